"""A stage of a problem: the core says what is to be simulated and keeps what became of it, an
engine simulates; see docs/architecture.md.
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
from ..core import MachineError, NativeObject
from ..settings.problem import Problem
from ..surrogate.surrogate import places

#: What became of a simulation: the machine could not make it, or it is done, or failed.
WAITING, DONE, FAILED = 0, 1, 2
#: What is left out of what became of a simulation; its `status` follows from whether there is a
#: modulus.
LEFT_OUT = {
    "modulus_gpa": 0.0,
    "seconds": 0.0,
    "elements": 0,
    "depth_um": [],
    "force_mn": [],
    "message": "",
}


class Job(NamedTuple):
    """A simulation to be made: a crystal (6, 6) in GPa, and angles (3,) in degrees."""

    stiffness: np.ndarray
    euler_deg: np.ndarray


class Simulator(NativeObject):
    """What the groups &specimen, &indenter and &simulation of a namelist's text ask for. Threads
    may share it.
    """

    kind = "simulator"

    def __init__(self, origin: str, physics: str):
        # The messages begin with the origin.
        self._hold(Problem.parse(origin, physics)._call("simulator")["handle"])


class Simulations:
    """Simulations by one simulator, made for the first job; each process makes its own."""

    def __init__(self, origin: str, physics: str):
        self.origin, self.physics, self._lock = origin, physics, Lock()
        self._simulator: Simulator | None = None

    def __reduce__(self) -> tuple:
        return Simulations, (self.origin, self.physics)

    def __call__(self, job: Job) -> dict:
        """What became of a job: status, modulus_gpa, seconds, elements, depth_um, force_mn, and the
        message why it failed.
        """
        with self._lock:
            if self._simulator is None:
                self._simulator = Simulator(self.origin, self.physics)
        return self._simulator._call("run", stiffness=job.stiffness, euler_deg=job.euler_deg)


def attempt(simulate: Callable[[Job], dict], job: Job) -> dict:
    """What became of a job, for `run_stage`; what the machine could not do is no result."""
    try:
        return simulate(job)
    except MachineError as error:
        return {"status": WAITING, "message": str(error)}


class Stage(NativeObject):
    """A stage by its name, in a folder of results; see fortran/pipeline/abstract_stage.f90."""

    kind = "stage"

    def __init__(self, problem: Problem, name: str, output: str | PathLike):
        Path(output).mkdir(parents=True, exist_ok=True)
        self.problem = problem
        opened = problem._call("stage", name=name, **places(output, problem.folder))
        #: Simulations that are still to be made, as far as is known.
        self.expected = opened["expected"]
        #: Groups of a namelist, from which an engine makes the simulator.
        self.physics = opened["physics"]
        self._hold(opened["handle"])

    def wanted(self) -> tuple[list[int], list[Job]]:
        """The simulations to be made now, by their numbers; none: all is done."""
        found = self._call("want")
        crystals = zip(found["stiffness"], found["euler_deg"], strict=True)
        return found["number"].tolist(), [Job(*crystal) for crystal in crystals]

    def close(self) -> dict:
        """Write the results; the document."""
        return json.loads(self._call("close")["text"])


def run_stage(
    problem: Problem,
    name: str,
    output: str | PathLike,
    simulate: Callable[[Job], dict] | None = None,
) -> dict:
    """A stage from its beginning to its document. Simulations are made by `simulate`, or as the
    problem asks, on the engine of &execution.
    """
    # Not above: it takes time to import.
    from ..engines import ENGINES

    stage, execution, engine = Stage(problem, name, output), problem.settings.execution, None
    with progress_bar("simulations", stage.expected) as advance, ExitStack() as opened:
        opened.callback(stage._call, "leave")
        while (wanted := stage.wanted())[0]:
            numbers, jobs = wanted
            engine = engine or opened.enter_context(
                ENGINES[execution.engine](execution.workers, execution.scheduler)
            )
            simulate = simulate or Simulations(str(problem.path), stage.physics)

            def take(k: int, made: dict, numbers: list[int] = numbers) -> None:
                made = {"status": DONE if "modulus_gpa" in made else FAILED} | LEFT_OUT | made
                stage._call("take", number=numbers[k], **made)
                advance(int(made["status"] == DONE))

            engine.map(partial(attempt, simulate), jobs, take)
    return stage.close()
