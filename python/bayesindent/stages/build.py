"""Step 1 in Python: a surrogate from simulations by a function of the user, and simulations that
are performed elsewhere.
"""

import json
import time
from collections.abc import Callable
from functools import partial
from os import PathLike
from pathlib import Path
from typing import Any

import numpy as np

from ..core import BayesindentError, InputError, MachineError
from ..settings.keywords import warn_of
from ..settings.problem import Points, Problem
from ..surrogate.surrogate import Surrogate, places
from .stage import Job, Stage, run_stage


def build_surrogate(
    problem: Problem | str | PathLike, output: str | PathLike, *, simulate: Callable | None = None
) -> Surrogate:
    """Step 1: build the surrogate of `problem`, a namelist file or a `Problem`. The folder `output`
    stores the simulations; a second call resumes.

    `simulate(stiffness, euler_deg)` replaces the program's own simulations: for a stiffness (6, 6)
    in GPa in crystal axes and Bunge-Euler angles (3,) in degrees it returns an indentation modulus
    in GPa, or raises `BayesindentError` if it fails. It needs &simulation simulator = 'import',
    under which its results are stored. &execution workers threads call it at once (0: one for each
    core).

    Examples
    --------
    >>> def simulate(stiffness, euler_deg):
    ...     return 1.01 * float(bi.halfspace_modulus(stiffness, euler_deg))
    >>> surrogate = bi.build("build.nml", "runs/build", simulate=simulate)
    >>> mean, sd = surrogate.predict(bi.stiffness("cubic", 168.4, 121.4, 75.4), [0, 0, 0])
    >>> abs(float(mean) / (1.01 * 134.0) - 1) < 0.01
    True
    """
    if not isinstance(problem, Problem):
        problem = Problem(problem, "build")
    if (simulate is not None) != (problem.settings.simulation.simulator == "import"):
        raise InputError(
            "simulate(stiffness, euler_deg) is given where it is 'import', and only there",
            str(problem.path),
            "simulation",
            "simulator",
        )
    warn_of(
        run_stage(problem, "build", output, simulate=simulate and partial(outcome_of, simulate))
    )
    return Surrogate.load(Path(output) / problem.settings.surrogate.file)


def outcome_of(function: Callable, job: Job) -> dict:
    """The outcome of a job, see `run_stage`, whose modulus a function of the user computes."""
    start, outcome = time.perf_counter(), dict[str, Any]()
    try:
        modulus = float(function(job.stiffness, job.euler_deg))
        if np.isfinite(modulus) and modulus > 0:
            outcome["modulus_gpa"] = modulus
        else:
            outcome["message"] = f"the modulus is {modulus}"
    except (InputError, MachineError):
        raise
    except BayesindentError as error:
        outcome["message"] = str(error)
    return outcome | {"seconds": time.perf_counter() - start}


def ask(problem: Problem, output: str | PathLike, count: int) -> dict:
    """The next `count` crystals of the design, chosen before any of their moduli is known: the
    document of `build --ask`, whose points are rows by the names of columns.
    """
    found = Stage(problem, "build", Path(output))._call("look_ahead", count=count)
    points = [
        dict(zip([*found["constants"], "phi1_deg", "Phi_deg", "phi2_deg"], row))
        for row in found["values"].tolist()
    ]
    return {"points": points, "warnings": [*problem.warnings, *json.loads(found["warnings"])]}


def tell(problem: Problem, output: str | PathLike, points: Points, name: str = "the table") -> dict:
    """Import results that were computed elsewhere, a table with modulus_gpa. Messages call it
    `name`.
    """
    found = points.problem._call("import", problem=problem.handle, name=name, **places(output, ""))
    return json.loads(found["text"]) | {"warnings": problem.warnings}
