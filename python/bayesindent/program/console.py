"""Tables at a terminal."""

import sys
from collections.abc import Iterable, Sequence

__all__ = ["show_moduli", "show_table"]


def show_moduli(document: dict) -> None:
    """Moduli of crystals, simulated or of the theory."""
    simulated = any(row.get("elements") for row in document["results"])
    header = ["constants (GPa)", "phi1", "Phi", "phi2", "M (GPa)", *["elements", "seconds"] * simulated]
    rows = []
    for row in document["results"]:
        modulus = row["indentation_modulus_gpa"]
        constants = ", ".join(f"{name} {value:g}" for name, value in row["constants"].items())
        cells = [constants, *(f"{angle:g}" for angle in row["euler_deg"]), "failed" if modulus is None else f"{modulus:.3f}"]
        if simulated:
            cells += [str(row["elements"]), f"{row['seconds']:.2f}"] if row["elements"] else ["–", "–"]
        rows.append(cells)
    show_table("Finite elements" if simulated else "Half-space theory", header, rows)


def show_table(title: str, header: Sequence[str], rows: Iterable[Sequence[str]]) -> None:
    """A table under its title, numbers to the right; as wide as it needs where standard output is no terminal."""
    from rich.console import Console
    from rich.table import Table

    table = Table(box=None, pad_edge=False)
    for number, name in enumerate(header):
        table.add_column(name, justify="left" if number == 0 else "right", no_wrap=True)
    for row in rows:
        table.add_row(*row)
    console = Console(width=None if sys.stdout.isatty() else 160, highlight=False)
    console.print(f"{title}:")
    console.print(table)
