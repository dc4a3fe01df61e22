"""Step 1 for the library: a surrogate by simulations of a user's own, and simulations that are made
elsewhere.
"""

import json
import time
from collections.abc import Callable
from functools import partial
from os import PathLike
from pathlib import Path

import numpy as np

from ..core import BayesindentError, InputError, MachineError
from ..settings.keywords import warn_of
from ..settings.problem import Points, Problem
from ..surrogate.surrogate import Surrogate, places
from .stage import Job, Stage, run_stage


def build_surrogate(
    problem: Problem | str | PathLike, output: str | PathLike, *, simulate: Callable | None = None
) -> Surrogate:
    """Step 1: the surrogate that `problem`, a namelist file or a `Problem`, asks for. Simulations
    are kept in the folder `output`; call it again to go on.

    `simulate(stiffness, euler_deg)`, stiffness (6, 6) in GPa in crystal axes and Bunge-Euler angles
    (3,) in degrees, gives an indentation modulus in GPa in place of the program's own simulations;
    it may raise `BayesindentError` where it fails. &simulation simulator must be 'import', under
    which its results are kept. As many are called at once, from threads, as &execution says (0: as
    there are cores).
    """
    if not isinstance(problem, Problem):
        problem = Problem(problem, "build")
    if (simulate is not None) != (problem.settings.simulation.simulator == "import"):
        raise InputError(
            f"{problem.path}: &simulation simulator: simulate(stiffness, euler_deg) is given "
            "where it is 'import', and only there"
        )
    warn_of(
        run_stage(problem, "build", output, simulate=simulate and partial(given, simulate)), str
    )
    return Surrogate.load(Path(output) / problem.settings.surrogate.file)


def given(function: Callable, job: Job) -> dict:
    """What became of a job by a function of the user's in place of simulations, see `run_stage`."""
    begun = time.perf_counter()
    try:
        modulus = float(function(job.stiffness, job.euler_deg))
        made = (
            {"modulus_gpa": modulus}
            if np.isfinite(modulus) and modulus > 0
            else {"message": f"the modulus is {modulus}"}
        )
    except (InputError, MachineError):
        raise
    except BayesindentError as error:
        made = {"message": str(error)}
    return made | {"seconds": time.perf_counter() - begun}


def ask(problem: Problem, output: str | PathLike, count: int) -> dict:
    """The next `count` crystals before the moduli of the first are known: the document of `build
    --ask`, whose points are rows by the names of columns.
    """
    found = Stage(problem, "build", Path(output))._call("look_ahead", count=count)
    points = [
        dict(zip([*found["constants"], "phi1_deg", "Phi_deg", "phi2_deg"], row, strict=True))
        for row in found["values"].tolist()
    ]
    return {"points": points, "warnings": [*problem.warnings, *found["warnings"]]}


def tell(problem: Problem, output: str | PathLike, points: Points, name: str = "the table") -> dict:
    """Import results that were computed elsewhere: a table with modulus_gpa, which errors call
    `name`.
    """
    found = points.problem._call("import", problem=problem.handle, name=name, **places(output, ""))
    return json.loads(found["text"]) | {"warnings": problem.warnings}
