"""All computations of the reproduction, in parts whose results the folder keeps: a run that is
killed loses the part that it was in, and of simulations not even that.
"""

import os
import sys
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from bayesindent.common.result_files import write_text
from bayesindent.surrogate.surrogate import Surrogate
from reproduction import arms, block
from reproduction.published import STUDIES
from reproduction.step_2 import Study
from reproduction.studies import Pool, build, by_theory, namelist_of

__all__ = ["QUICK", "TINY", "WHOLE", "Plan", "Results", "perform"]


@dataclass(frozen=True)
class Plan:
    """How much is computed. `design`: changes of the cubic case's &design; `scan`: truncations by
    class; `simulated`: the classes whose Step 1 is by finite elements, the others are by theory;
    `judges`: independent crystals that are simulated; seeds of the arms by class, and of degree 3.
    """

    name: str
    design: dict = field(default_factory=dict)
    scan: dict = field(default_factory=dict)
    simulated: tuple = ("cubic", "hexagonal")
    judges: int = 200
    seeds: dict = field(default_factory=lambda: {"cubic": 10, "hexagonal": 10})
    degree_3_seeds: int = 3
    step_2: tuple = ("cubic", "hexagonal")
    is_quick: bool = False


WHOLE = Plan("whole")
#: 180 simulations in place of 5,286, and fewer seeds; the hexagonal case by theory.
QUICK = Plan(
    "quick",
    design={"n_candidates": 270, "initial": 60, "budget": 140, "validation": 20},
    scan={"cubic": "1, 2 x 8, 10", "hexagonal": "1, 2 x 2, 4"},
    simulated=("cubic",),
    judges=20,
    seeds={"cubic": 3, "hexagonal": 0},
    degree_3_seeds=1,
    is_quick=True,
)
#: For tests.
TINY = Plan(
    "tiny",
    design={"n_candidates": 270, "initial": 60, "budget": 140, "validation": 60},
    scan={"cubic": "1 x 8", "hexagonal": "1 x 2"},
    simulated=(),
    judges=2,
    seeds={"cubic": 1, "hexagonal": 0},
    degree_3_seeds=1,
    step_2=("cubic",),
    is_quick=True,
)

#: Truncations in which degree 3 is compared with what the paper chose.
TRUNCATIONS = {
    "cubic": [(2, 10), (3, 8), (3, 10), (3, 12)],
    "hexagonal": [(2, 4), (3, 4)],
}


@dataclass
class Results:
    """What the parts leave, by class where there are two."""

    plan: Plan
    folder: Path
    documents: dict[str, dict] = field(default_factory=dict)
    pools: dict[str, Pool] = field(default_factory=dict)
    zinc: dict[str, Any] = field(default_factory=dict)
    meshes: dict[str, dict] = field(default_factory=dict)
    #: By class, a list over seeds.
    arms: dict[str, list] = field(default_factory=dict)
    arms_fe: dict[str, Any] = field(default_factory=dict)
    #: By class, those that are by finite elements.
    derivatives: dict[str, dict] = field(default_factory=dict)
    judges: Pool | None = None
    degree_3: dict[str, list] = field(default_factory=dict)
    studies: dict[str, Study] = field(default_factory=dict)
    precisions: dict[str, list] = field(default_factory=dict)
    #: CPU seconds of all runs in this folder; number of simulations.
    cpu_s: float = 0.0

    def surrogate(self, symmetry: str) -> Surrogate:
        """That of Step 1."""
        return Surrogate.load(self.folder / symmetry / "surrogate.txt")

    @property
    def simulations(self) -> int:
        """Number of finite element simulations of the two case studies and of the judges."""
        studies = [name for name in self.pools if self.by_simulation(name)]
        judges = 0 if self.judges is None else len(self.judges.modulus)
        return judges + sum(len(self.pools[name].modulus) for name in studies)

    def by_simulation(self, symmetry: str) -> bool:
        """Whether Step 1 of a class is by finite elements."""
        return symmetry in self.plan.simulated


@contextmanager
def counted_cpu(folder: Path) -> Iterator[None]:
    """Keep the CPU time of this process in the folder, every two seconds: a killed run counts."""
    file = folder / "cpu" / f"{os.getpid()}-{time.time_ns()}"
    stop = threading.Event()

    def write() -> None:
        write_text(file, f"{time.process_time():.1f}")

    def keep() -> None:
        while not stop.wait(2.0):
            write()

    thread = threading.Thread(target=keep, daemon=True)
    write()
    thread.start()
    try:
        yield
    finally:
        stop.set()
        thread.join()
        write()


def cpu_seconds(folder: Path) -> float:
    """CPU seconds of all runs in a folder."""
    return sum(float(file.read_text()) for file in (folder / "cpu").iterdir())


def study_namelist(symmetry: str, plan: Plan, workers: int):
    """The case study's Step 1 as the plan wants it."""
    groups: dict[str, dict] = {} if symmetry in plan.simulated else by_theory()
    if symmetry == "cubic":
        groups["design"] = plan.design
    if symmetry in plan.scan:
        groups["surrogate"] = {"scan": plan.scan[symmetry]}
    return namelist_of(symmetry, workers, **groups)


def perform(folder: Path, plan: Plan, workers: int, quiet: bool = False) -> Results:
    """Compute what is not kept in the folder; return all of it."""
    results = Results(plan, folder)
    many = 5 + len(plan.step_2)
    number = iter(range(1, many + 1))

    def say(what: str) -> None:
        if not quiet:
            print(f"reproduce {next(number)}/{many}: {what}", file=sys.stderr, flush=True)

    with counted_cpu(folder):
        say("zinc and other crystals on the paper's block (Fig. 5)")
        results.zinc = block.zinc(folder / "block", plan.is_quick)
        results.meshes = block.meshes(folder / "block", plan.is_quick)
        for symmetry in ("cubic", "hexagonal"):
            how = "finite elements" if results.by_simulation(symmetry) else "theory"
            say(f"the {symmetry} surrogate, Step 1, by {how}")
            namelist = study_namelist(symmetry, plan, workers)
            document = results.documents[symmetry] = build(namelist, folder / symmetry)
            initial = namelist["design"]["initial"]
            results.pools[symmetry] = Pool.of_build(symmetry, folder / symmetry, document, initial)
        say("independent crystals on the paper's block")
        results.judges = block.judges_by_simulation(
            "cubic", folder / "judges", plan.judges, workers
        )
        say("arms: how the simulations are chosen; degree 3")
        compute_arms(results)
        for symmetry in plan.step_2:
            study = results.studies[symmetry] = Study(
                symmetry, folder / f"step_2_{symmetry}", workers
            )
            say(f"the constants of {study.metal}, Step 2")
            trained = folder / "cubic" / "surrogate.txt"
            has_block = symmetry == "cubic" and results.by_simulation("cubic")
            study.run(trained if has_block else None)
            results.precisions[symmetry] = [] if plan.is_quick else study.precisions()
    results.cpu_s = cpu_seconds(folder)
    return results


def compute_arms(results: Results) -> None:
    """Arms by theory and by finite elements, and the truncations of degree 3."""
    plan, folder = results.plan, results.folder / "arms"
    for symmetry, seeds in plan.seeds.items():
        results.arms[symmetry] = [
            arms.arms_by_theory(symmetry, seed, folder / f"{symmetry}_{seed}")
            for seed in range(1, seeds + 1)
        ]
        many = min(seeds, plan.degree_3_seeds if symmetry == "cubic" else 1)
        results.degree_3[symmetry] = [
            arms.degree_3(symmetry, seed, folder / f"{symmetry}_{seed}", TRUNCATIONS[symmetry])
            for seed in range(1, many + 1)
        ]
    budget = plan.design.get("budget", STUDIES["cubic"]["chosen"])
    sizes = [size for size in arms.SIZES["cubic"] if size < budget] + [budget]
    found = arms.arms_of(results.pools["cubic"], results.judges, 1, tuple(sizes))
    results.arms_fe = {"sizes": sizes, "errors": found}
    for symmetry in filter(results.by_simulation, results.pools):
        pool = results.pools[symmetry]
        judges = results.judges if symmetry == "cubic" else pool.last(pool.unseen)
        results.derivatives[symmetry] = arms.derivatives(pool, judges, folder / symmetry)
