"""`next`: the grains worth measuring next."""

import argparse

from ..command import namelist_command
from ..console import show_table

__all__ = ["COMMAND"]


def show(document: dict) -> None:
    """The orientations, or the grains, and their directions along the indenter."""
    rows, header = [], ["phi1", "Phi", "phi2", "along z", f"expected gain ({document['unit']})"]
    for item in document["suggestions"]:
        along = item.get("uvw") or " ".join(f"{component:.2f}" for component in item["direction"])
        name = [item["grain"]] if "grain" in item else []
        rows.append([*name, *(f"{angle:.1f}" for angle in item["euler_deg"]), along, f"{item['gain']:.3g}"])
    grains = any("grain" in item for item in document["suggestions"])
    show_table(f"{'Grains' if grains else 'Orientations'} worth measuring next (degrees)", ["grain", *header] if grains else header, rows)


def then(arguments: argparse.Namespace, document: dict) -> str:
    return f"measure such grains, add them to the measurements of {arguments.file}, and bayesindent run it again"


COMMAND = namelist_command("next", show=show, resumes=True, then=then)
