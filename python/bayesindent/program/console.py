"""Tables at a terminal."""

from collections.abc import Iterable, Sequence

__all__ = ["show_moduli", "show_table"]


def show_moduli(document: dict) -> None:
    """Moduli of crystals, simulated or of the theory."""
    simulated = any(row.get("elements") for row in document["results"])
    header = ["constants (GPa)", "phi1", "Phi", "phi2", "M (GPa)", *["elements", "seconds"] * simulated]
    if waves := any("rayleigh_velocity_m_s" in row for row in document["results"]):
        header += ["along", "Rayleigh (m/s)"]
    rows = []
    for row in document["results"]:
        modulus = row["indentation_modulus_gpa"]
        constants = ", ".join(f"{name} {value:g}" for name, value in row["constants"].items())
        cells = [constants, *(f"{angle:g}" for angle in row["euler_deg"]), "failed" if modulus is None else f"{modulus:.3f}"]
        if simulated:
            cells += [str(row["elements"]), f"{row['seconds']:.2f}"] if row["elements"] else ["–", "–"]
        if waves:
            cells += [f"{row['propagation_deg']:g}", f"{row['rayleigh_velocity_m_s']:.1f}" + " weak" * (not row["rayleigh_detected"])]
        rows.append(cells)
    show_table("Finite elements" if simulated else "Half-space theory", header, rows)


def show_table(title: str, header: Sequence[str], rows: Iterable[Sequence[str]]) -> None:
    """A table under its title, numbers to the right, as wide as it needs: no number is cut."""
    cells = [list(header), *map(list, rows)]
    widths = [max(map(len, column)) for column in zip(*cells, strict=True)]
    print(f"{title}:")
    for first, *others in cells:
        print(f"{first:<{widths[0]}}", *(f"{cell:>{width}}" for cell, width in zip(others, widths[1:], strict=True)), sep="  ")
