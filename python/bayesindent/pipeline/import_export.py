"""Simulations that are made elsewhere: the next crystals out, and their moduli in."""

from pathlib import Path

import numpy as np

from ..core import InputError
from ..crystal.elasticity import constant_names
from ..pipeline.build import Loop
from ..pipeline.campaign import Campaign
from ..pipeline.simulator import physics_identity

__all__ = ["ask", "tell"]


def ask(problem, output, count: int) -> dict:
    """The next `count` crystals: the document of `build --ask`, whose points are rows by the names of columns."""
    with Loop(problem, Path(output)) as loop:
        loop.replay()
        if not 1 <= count <= len(loop.choice.left):
            raise InputError(f"--ask {count}: allowed are 1 .. {len(loop.choice.left)}, the candidates that are left")
        points = loop.choice.candidates.points(loop.choice.look_ahead(count))
        header = [*constant_names(loop.symmetry), "phi1_deg", "Phi_deg", "phi2_deg"]
        rows = [dict(zip(header, (*constants, *euler_deg), strict=True)) for constants, euler_deg in points]
        return {"points": rows, "warnings": loop.warnings}


def tell(problem, output, points, name: str = "the table") -> dict:
    """Import results that were computed elsewhere: a table (`Points`) with modulus_gpa, which errors call `name`."""
    if points.modulus_gpa is None or not np.isfinite(points.modulus_gpa).all():
        raise InputError(f"{name}: there must be a column modulus_gpa (GPa) with a value in every row")
    symmetry = problem.settings.problem.symmetry
    if any(other != symmetry for other in points.symmetry):
        raise InputError(f"{name}: there are crystals that are not {symmetry}, which is the symmetry of {problem.path}")
    with Campaign(Path(output) / "campaign.sqlite", physics_identity(problem)) as campaign:
        try:
            new = campaign.import_rows(symmetry, points.constants_array(), points.euler_deg, points.modulus_gpa)
        except InputError as error:
            raise InputError(f"{name}: {error}") from None
        simulations = sum(row.modulus_gpa is not None for row in campaign.rows(symmetry))
    return {"imported": new, "simulations": simulations, "warnings": []}
