"""The documents of the commands in words, for people at a terminal."""

import sys
from collections.abc import Callable, Iterable, Sequence
from pathlib import Path

from rich.console import Console
from rich.table import Table

__all__ = ["show"]


def show(command: str, document: dict) -> None:
    """Print the document of a command on standard output."""
    if command == "run" and "stages" not in document:
        for stage in ("simulate", "theory", "build", "extract", "next", "report"):
            if stage in document:
                show(stage, document[stage])
    else:
        WORDS[command](document)


def show_check(document: dict) -> None:
    """`run --check`."""
    print(f"{document['file']}: right; it asks for {', '.join(document['stages'])}")


def show_moduli(document: dict) -> None:
    """`simulate` and `theory`."""
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


def show_build(document: dict) -> None:
    """`build`, and `build --tell`."""
    if "imported" in document:
        print(f"Campaign: {document['imported']} results imported, {document['simulations']} simulations in all")
        return
    print(
        f"Surrogate: {document['simulations']} simulations ({document['new_simulations']} new, {document['failed']} failed), "
        f"{document['terms']} terms, leave-one-out error {document['loocv_gpa']:.3g} GPa"
    )


def show_extract(document: dict) -> None:
    """`extract`."""
    rows = []
    for name, item in document["parameters"].items():
        low, high = item["hdi_95"]
        interval = f"{low:.1f} .. {high:.1f}"
        quality = [f"{item['r_hat']:.3f}", f"{item['ess_bulk']:.0f}", f"{item['ess_tail']:.0f}"]
        rows.append([name, f"{item['mean']:.1f}", f"{item['sd']:.1f}", f"{item['map']:.1f}", interval, *quality])
    header = ["constant", "mean", "sd", "most probable", "95 %", "R-hat", "ESS bulk", "ESS tail"]
    show_table("Elastic constants (GPa)", header, rows)


def show_next(document: dict) -> None:
    """`next`."""
    rows = [[*(f"{angle:.1f}" for angle in item["euler_deg"]), f"{item['gain']:.3g}"] for item in document["suggestions"]]
    show_table("Orientations worth measuring next (degrees)", ["phi1", "Phi", "phi2", "expected gain"], rows)


def show_predictions(document: dict) -> None:
    """`predict`: CSV, for pipes."""
    sys.stdout.write(Path(document["file"]).read_text())


def show_report(document: dict) -> None:
    """`report`."""
    print(f"Report: {document['file']}")


def show_table(title: str, header: Sequence[str], rows: Iterable[Sequence[str]]) -> None:
    """A table under its title, numbers to the right; as wide as it needs where standard output is no terminal."""
    table = Table(box=None, pad_edge=False)
    for number, name in enumerate(header):
        table.add_column(name, justify="left" if number == 0 else "right", no_wrap=True)
    for row in rows:
        table.add_row(*row)
    console = Console(width=None if sys.stdout.isatty() else 160, highlight=False)
    console.print(f"{title}:")
    console.print(table)


WORDS: dict[str, Callable[[dict], None]] = {
    "run": show_check,
    "simulate": show_moduli,
    "theory": show_moduli,
    "build": show_build,
    "extract": show_extract,
    "next": show_next,
    "predict": show_predictions,
    "report": show_report,
}
