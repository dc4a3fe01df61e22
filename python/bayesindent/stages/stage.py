"""A stage of a problem: the core chooses the simulations and stores their outcomes, and an engine
performs them; see docs/architecture.md.
"""

import json
from collections.abc import Callable
from contextlib import ExitStack
from functools import partial
from os import PathLike
from pathlib import Path
from threading import Lock
from typing import NamedTuple

import numpy as np

from ..common.progress import progress_bar
from ..core import MachineError, NativeObject, located
from ..settings.problem import Problem
from ..surrogate.surrogate import places

#: Status of a simulation: it waits, since the machine could not perform it, or is done, or failed.
WAITING, DONE, FAILED = 0, 1, 2
#: Values of an outcome that a simulation does not state. Its `status` follows from whether there is
#: a modulus.
OUTCOME_DEFAULTS = {
    "modulus_gpa": 0.0,
    "seconds": 0.0,
    "elements": 0,
    "depth_um": [],
    "force_mn": [],
    "modulus_by_stiffness": [],
    "message": "",
}


class Job(NamedTuple):
    """A simulation to perform: the stiffness of a crystal (6, 6) in GPa, and angles (3,) in
    degrees.
    """

    stiffness: np.ndarray
    euler_deg: np.ndarray


class Simulator(NativeObject):
    """The simulator of the groups &specimen, &indenter and &simulation of a namelist's text.
    Threads may share it.
    """

    kind = "simulator"

    def __init__(self, origin: str, physics: str):
        # The messages begin with the origin.
        self._hold(Problem.parse(origin, physics)._call("simulator")["handle"])


class Simulations:
    """Simulations by one simulator, which each process makes for its first job."""

    def __init__(self, origin: str, physics: str):
        self.origin, self.physics, self._lock = origin, physics, Lock()
        self._simulator: Simulator | None = None

    def __reduce__(self) -> tuple:
        return Simulations, (self.origin, self.physics)

    def __call__(self, job: Job) -> dict:
        """The outcome of a job: status, modulus_gpa, seconds, elements, depth_um, force_mn, and the
        reason of a failure as message.
        """
        with self._lock:
            if self._simulator is None:
                self._simulator = Simulator(self.origin, self.physics)
        return self._simulator._call("run", stiffness=job.stiffness, euler_deg=job.euler_deg)


def attempt(simulate: Callable[[Job], dict], job: Job) -> dict:
    """The outcome of a job, for `run_stage`; an error of the machine leaves the job waiting."""
    try:
        return simulate(job)
    except MachineError as error:
        return {"status": WAITING, "message": str(error)}


class Stage(NativeObject):
    """A stage by its name, in a folder of results; see fortran/stages/abstract_stage.f90."""

    kind = "stage"

    def __init__(self, problem: Problem, name: str, output: str | PathLike):
        Path(output).mkdir(parents=True, exist_ok=True)
        self.problem = problem
        opened = problem._call("stage", name=name, **places(output, problem.folder))
        #: The number of simulations that remain, as far as it is known.
        self.expected = opened["expected"]
        #: Groups of a namelist, from which an engine makes the simulator.
        self.physics = opened["physics"]
        self._hold(opened["handle"])

    def wanted(self) -> tuple[list[int], list[Job]]:
        """The numbers and the jobs of the simulations to perform now; none when all are done."""
        found = self._call("want")
        crystals = zip(found["stiffness"], found["euler_deg"])
        return found["number"].tolist(), [Job(*crystal) for crystal in crystals]

    def close(self) -> dict:
        """Write the results and return the document."""
        return json.loads(self._call("close")["text"])


def run_stage(
    problem: Problem,
    name: str,
    output: str | PathLike,
    simulate: Callable[[Job], dict] | None = None,
) -> dict:
    """Perform a stage and return its document. `simulate`, or else the simulator of the problem,
    performs the simulations on the engine of &execution.
    """
    # Importing the engines takes time, which other commands save.
    from ..engines import engine_of

    stage, execution, engine = Stage(problem, name, output), problem.settings.execution, None
    with progress_bar("simulations", stage.expected) as advance, ExitStack() as opened:
        opened.callback(stage._call, "leave")
        while (wanted := stage.wanted())[0]:
            numbers, jobs = wanted
            with located(problem.path):
                engine = engine or opened.enter_context(engine_of(execution))
            simulate = simulate or Simulations(str(problem.path), stage.physics)

            def store(k: int, outcome: dict, numbers: list[int] = numbers) -> None:
                default = OUTCOME_DEFAULTS | {
                    "status": DONE if "modulus_gpa" in outcome else FAILED
                }
                found = default | outcome
                stage._call("take", number=numbers[k], **found)
                advance(int(found["status"] == DONE))

            engine.map(partial(attempt, simulate), jobs, store)
    return stage.close()
