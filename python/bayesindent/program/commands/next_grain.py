"""`next`: the grains worth measuring next."""

from pathlib import Path

from ...common.progress import Progress
from ..command import namelist_command
from ..console import show_table

__all__ = ["COMMAND"]


def next_grain(problem, output: Path, progress: Progress) -> dict:
    """The orientations, ranked."""
    from ...inference.next_grain import next_stage

    return next_stage(problem, output, progress)


def show(document: dict) -> None:
    """The orientations."""
    rows = [[*(f"{angle:.1f}" for angle in item["euler_deg"]), f"{item['gain']:.3g}"] for item in document["suggestions"]]
    show_table("Orientations worth measuring next (degrees)", ["phi1", "Phi", "phi2", "expected gain"], rows)


COMMAND = namelist_command(
    "next",
    stage=next_grain,
    show=show,
)
