"""Small problems of Step 1 with the theory in place of simulations, and the values by which two
builds are compared.
"""

import sqlite3
from pathlib import Path

from bayesindent.settings.problem import Problem
from bayesindent.surrogate.surrogate import Surrogate

__all__ = ["CORRECTION", "PAPER", "make_problem", "numbers_of", "posterior_of", "stored"]

#: The paper's model (Eq. 6) of cubic crystals, 16 terms; a correction of all crystals with 29.
PAPER = {
    "problem": {"symmetry": "'cubic'"},
    "domain": {"c_min": "50, 40, 15", "c_max": "250, 150, 120", "anisotropy_cap": "7.2"},
    "surrogate": {"model": "'paper'", "degree": 1, "bandlimit": 4, "prior_sd": "'equal'"},
}
CORRECTION = {
    "problem": {"title": "'all crystals'"},
    "domain": {"log_anisotropy_max": "1.2"},
    "surrogate": {"degree": 2},
}


def make_problem(folder: Path, *, model=PAPER, **groups) -> Problem:
    groups = model | {
        "simulation": {"simulator": "'theory'"},
        "design": {"n_candidates": 200, "budget": 16},
        "execution": {"workers": 1},
        **groups,
    }
    lines = []
    for group, values in groups.items():
        lines += [
            f"&{group}\n",
            *(f"  {name} = {value}\n" for name, value in values.items()),
            "/\n",
        ]
    folder.mkdir(parents=True, exist_ok=True)
    path = folder / "problem.nml"
    path.write_text("".join(lines))
    return Problem(path, "build")


def stored(output: Path) -> list:
    return (
        sqlite3.connect(output / "campaign.sqlite")
        .execute(
            "SELECT position, constants, euler_deg, indentation_modulus_gpa FROM simulation "
            "ORDER BY position"
        )
        .fetchall()
    )


def numbers_of(document: dict) -> dict:
    """The document of a build without the values that depend on its folder and on interruptions."""
    return {
        name: value
        for name, value in document.items()
        if name not in ("file", "new_simulations", "inputs")
    }


def posterior_of(folder: Path) -> list:
    surrogate = Surrogate.load(folder / "surrogate.txt")
    return [
        surrogate.coefficients.tolist(),
        surrogate.covariance.tolist(),
        surrogate.alpha,
        surrogate.beta,
        surrogate.fall,
    ]
