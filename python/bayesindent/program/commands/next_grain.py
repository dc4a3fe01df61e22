"""`next`: the grains worth measuring next."""

from ...pipeline.step_2 import next_stage
from ..command import namelist_command
from ..console import show_table

__all__ = ["COMMAND"]


def show(document: dict) -> None:
    """The orientations."""
    rows = [[*(f"{angle:.1f}" for angle in item["euler_deg"]), f"{item['gain']:.3g}"] for item in document["suggestions"]]
    show_table("Orientations worth measuring next (degrees)", ["phi1", "Phi", "phi2", "expected gain"], rows)


COMMAND = namelist_command("next", stage=next_stage, show=show, resumes=True)
