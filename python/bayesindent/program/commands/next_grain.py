"""`next`: the grains worth measuring next."""

import argparse

from ...pipeline.step_2 import next_stage
from ..command import namelist_command
from ..console import show_table

__all__ = ["COMMAND"]


def show(document: dict) -> None:
    """The orientations."""
    rows = [[*(f"{angle:.1f}" for angle in item["euler_deg"]), f"{item['gain']:.3g}"] for item in document["suggestions"]]
    show_table("Orientations worth measuring next (degrees)", ["phi1", "Phi", "phi2", "expected gain"], rows)


def then(arguments: argparse.Namespace, document: dict) -> str:
    """What to do next."""
    return f"measure such grains, add them to the measurements of {arguments.file}, and bayesindent run it again"


COMMAND = namelist_command("next", stage=next_stage, show=show, resumes=True, then=then)
