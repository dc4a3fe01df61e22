"""The loop of Step 1: the core chooses and learns, an engine simulates; see docs/surrogate.md.

All results go through campaign.sqlite, so that an interrupted build goes on where it was, and a larger budget continues it.
"""

import time
from collections.abc import Callable
from contextlib import ExitStack
from pathlib import Path

import numpy as np

from ..common.progress import Progress
from ..core import BayesindentError, InputError, MachineError, NativeObject, call, warn_of
from ..crystal.elasticity import constant_names
from ..pipeline.inputs_identity import keep_document, write_resolved
from ..pipeline.simulator import Simulator, engine_of, simulate_all
from ..settings.problem import Problem
from ..surrogate.basis import Basis
from ..surrogate.lookup import check_replaceable
from ..surrogate.surrogate import Surrogate

__all__ = ["Build", "build", "build_surrogate"]


def build_surrogate(problem, output, *, simulate: Callable | None = None) -> Surrogate:
    """Step 1: the surrogate that `problem`, a namelist file or a `Problem`, asks for. Simulations are kept in the folder `output`; call it again to go on.

    `simulate(stiffness, euler_deg)`, stiffness (6, 6) in GPa in crystal axes and Bunge-Euler angles (3,) in degrees, gives an indentation
    modulus in GPa in place of the program's own simulations; it may raise `BayesindentError` where it fails. &simulation simulator must be 'import',
    under which its results are kept. As many are called at once, from threads, as &execution says (0: as there are cores).
    """
    if not isinstance(problem, Problem):
        problem = Problem(problem, "build")
    if (simulate is not None) != (problem.settings.simulation.simulator == "import"):
        raise InputError(
            f"{problem.path}: &simulation simulator: simulate(stiffness, euler_deg) is given where it is 'import', and only there"
        )
    output = Path(output)
    document = build(problem, output, simulate=None if simulate is None else Given(simulate))
    write_resolved(output, problem.resolved)
    keep_document(problem, "build", output, document)
    warn_of(document)
    return Surrogate.load(output / problem.settings.surrogate.file)


class Given:
    """A function of the user's as a `Simulator`."""

    def __init__(self, function: Callable):
        self.function = function

    def __call__(self, stiffness, euler_deg) -> dict:
        """What `Campaign.add` stores."""
        begun = time.perf_counter()
        try:
            modulus = float(self.function(stiffness, euler_deg))
        except (InputError, MachineError):
            raise
        except BayesindentError as error:
            return {"seconds": time.perf_counter() - begun, "message": str(error)}
        if not (np.isfinite(modulus) and modulus > 0):
            return {"seconds": time.perf_counter() - begun, "message": f"the modulus is {modulus}"}
        return {"modulus_gpa": modulus, "seconds": time.perf_counter() - begun}


def build(problem, output, progress: Progress | None = None, simulate: Callable | None = None) -> dict:
    """Step 1 of a problem: the surrogate in the output folder, and the document of `build`."""
    progress = progress or Progress()
    design, engine = problem.settings.design, None
    steps = Build(problem, output)
    wanted, learnt, _ = steps.advance()
    with progress.bar("simulations", max(0, design.budget + design.validation - learnt)) as advance, ExitStack() as opened:
        while wanted:
            if engine is None:
                simulate, engine = simulate or Simulator(problem), opened.enter_context(engine_of(problem))
            steps.perform(simulate, engine, advance, wanted)
            wanted = steps.advance()[0]
    return steps.conclude()


class Build(NativeObject):
    """One build in an output folder: what is simulated next, and what was learnt."""

    kind = "build"

    def __init__(self, problem, output):
        check_replaceable(problem, output)
        self.problem, self.output = problem, str(output)
        Path(output).mkdir(parents=True, exist_ok=True)
        self._hold(call("build_new", problem.handle, self.output))

    def advance(self) -> tuple[int, int, bool]:
        """Learn what was stored and choose: how many simulations are wanted, how many were learnt, whether this is for validation."""
        wanted, learnt, validating = call("build_advance", self.handle)
        return int(wanted), int(learnt), bool(validating)

    def wanted(self, n: int) -> tuple[np.ndarray, np.ndarray]:
        """The n crystals (n, 6, 6) in GPa that are wanted and their angles (n, 3) in degrees."""
        stiffness, euler_deg = call("build_wanted", self.handle, n)
        return np.moveaxis(stiffness, -1, 0), euler_deg.T

    def store(self, number: int, result: dict) -> None:
        """Keep what `Simulator` gives of simulation `number`, from 0."""
        points = len(result.get("depth_um", ()))
        # The core takes no empty arrays.
        curve = np.column_stack([result["depth_um"], result["force_mn"]]) if points else np.zeros((1, 2))
        numbers = [result.get(name, 0.0) for name in ("modulus_gpa", "seconds", "elements")]
        call("build_store", self.handle, number, [*numbers, points], curve, result.get("message", ""))

    def perform(self, simulate: Callable, engine, advance: Callable[[int], None], n: int) -> None:
        """Have the n simulations that are wanted made by an engine; each is stored as soon as it is done."""

        def store(k: int, result: dict) -> None:
            self.store(k, result)
            advance(int("modulus_gpa" in result))

        simulate_all(simulate, list(zip(*self.wanted(n), strict=True)), engine, store)

    def ask(self, count: int) -> list[dict]:
        """The next crystals before the moduli of the first are known: rows by the names of columns."""
        symmetry = Basis(self.problem).symmetry
        constants, euler_deg = call("build_ask", self.handle, len(constant_names(symmetry)), count)
        header = [*constant_names(symmetry), "phi1_deg", "Phi_deg", "phi2_deg"]
        return [dict(zip(header, row, strict=True)) for row in np.vstack([constants, euler_deg]).T.tolist()]

    def warnings(self) -> list[str]:
        """What is to be said of the build so far."""
        return self._document()["warnings"]

    def conclude(self) -> dict:
        """Write the surrogate, and say how good it is: the document of `build`."""
        call("build_conclude", self.handle, self.output)
        return self._document()
