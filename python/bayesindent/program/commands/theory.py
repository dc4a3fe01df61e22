"""`theory`: the exact half-space theory of the crystals of a namelist."""

from pathlib import Path

from ...common.progress import Progress
from ...crystal.elasticity import halfspace_modulus
from ...pipeline.moduli import identified, write_moduli
from ..command import namelist_command, report_of
from ..console import show_moduli

__all__ = ["COMMAND"]


def theory(problem, output: Path, progress: Progress) -> dict:
    """Theory.csv and the document."""
    points = problem.crystals
    moduli = halfspace_modulus(points.stiffness, points.euler_deg)
    write_moduli(output / "theory.csv", problem, points, moduli)
    return {"results": [identified(points, i) | {"indentation_modulus_gpa": modulus} for i, modulus in enumerate(moduli)]}


COMMAND = namelist_command("theory", stage=theory, show=show_moduli, then=report_of)
