"""Simulations that are made elsewhere: the next crystals out, and their moduli in."""

from pathlib import Path

import numpy as np

from ..core import InputError
from ..pipeline.build import Build
from ..pipeline.campaign import Campaign

__all__ = ["ask", "tell"]


def ask(problem, output, count: int) -> dict:
    """The next `count` crystals: the document of `build --ask`, whose points are rows by the names of columns."""
    steps = Build(problem, output)
    return {"points": steps.ask(count), "warnings": steps.warnings()}


def tell(problem, output, points, name: str = "the table") -> dict:
    """Import results that were computed elsewhere: a table (`Points`) with modulus_gpa, which errors call `name`."""
    if points.modulus_gpa is None or not np.isfinite(points.modulus_gpa).all():
        raise InputError(f"{name}: there must be a column modulus_gpa (GPa) with a value in every row")
    symmetry, classes = problem.settings.problem.symmetry, sorted(set(points.symmetry))
    if symmetry is not None and classes != [symmetry] and problem.settings.domain.c_min is not None:
        raise InputError(f"{name}: there are crystals that are not {symmetry}, which is the symmetry of {problem.path}")
    new = 0
    with Campaign(Path(output) / "campaign.sqlite", problem.physics) as campaign:
        for own in classes:
            rows = [i for i, other in enumerate(points.symmetry) if other == own]
            constants = [list(points.constants[i].values()) for i in rows]
            try:
                new += campaign.import_rows(own, constants, points.euler_deg[rows], points.modulus_gpa[rows])
            except InputError as error:
                raise InputError(f"{name}: {error}") from None
        simulations = sum(row.modulus_gpa is not None for own in classes for row in campaign.rows(own))
    return {"imported": new, "simulations": simulations, "warnings": []}
