"""How busy unequal workers are kept, and what is lost if many simulations are chosen at a time.

Eight simulated workers, the slowest half as fast as the fastest, make simulations of 0.5 to 1.5 s
(a wait, and theory): the share of their time in which they simulate, from the first choice to the
last result, by engine and `batch` of &design. Then corrections of the paper's block are built with
each `batch` to equal budgets, from other candidates for each seed, and compared with unseen
crystals as in `bench learning`; those are kept in campaign.sqlite (run again to go on; --output may
be the folder of `bench learning`).
"""

import argparse
import csv
import threading
import time
from itertools import product
from pathlib import Path

import distributed
import numpy as np

from bayesindent.common.progress import show_progress
from bayesindent.crystal.elasticity import halfspace_modulus
from bayesindent.engines import ENGINES
from bayesindent.settings.problem import Problem
from bayesindent.stages.stage import Job, Stage
from bayesindent.surrogate.surrogate import Surrogate
from benchmarks.bench_learning import kinds, simulated, unseen_crystals
from support.learner import build

WORKERS = 8
#: Seconds of a simulation by the fastest worker, and by how much simulations differ.
SECONDS, SPREAD = 0.625, 0.2


def main(argv=None) -> int:
    """Measure, tabulate."""
    parser = argparse.ArgumentParser(
        prog="bench workers",
        description=__doc__,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    parser.add_argument(
        "--batches", default="1,4,16,64", help="simulations chosen at a time (1,4,16,64)"
    )
    parser.add_argument(
        "--budget", type=int, default=256, help="simulations of the simulated workers (256)"
    )
    parser.add_argument(
        "--sizes",
        default="20,40,60",
        help="budgets of the corrections; none: workers alone (20,40,60)",
    )
    parser.add_argument(
        "--seeds", type=int, default=3, help="corrections of each batch, two or more (3)"
    )
    parser.add_argument(
        "--unseen", type=int, default=320, help="unseen crystals of each kind (320)"
    )
    parser.add_argument(
        "--unseen-seed", type=int, default=12345, help="other unseen crystals (12345)"
    )
    parser.add_argument(
        "--workers", type=int, default=0, help="real simulations at a time (0: all cores)"
    )
    parser.add_argument(
        "--output", type=Path, default=Path("runs/workers"), help="folder (runs/workers)"
    )
    arguments = parser.parse_args(argv)
    show_progress(True)
    arguments.specimen = "block"
    batches = [int(batch) for batch in arguments.batches.split(",")]
    print(
        f"{WORKERS} workers, {arguments.budget} simulations\n\n| batch | local | dask |\n"
        "|---|---|---|"
    )
    for batch in batches:
        shares = [utilisation(arguments, name, batch) for name in ("local", "dask")]
        print(
            f"| {batch} | " + " | ".join(f"{100 * share:.0f} %" for share in shares) + " |",
            flush=True,
        )
    if arguments.sizes:
        rows = losses(arguments, batches, [int(size) for size in arguments.sizes.split(",")])
        with open(arguments.output / "batches.csv", "w", newline="") as stream:
            writer = csv.DictWriter(stream, list(rows[0]))
            writer.writeheader()
            writer.writerows(rows)
        print_losses(rows)
    return 0


class UnequalWorkers:
    """A simulation that takes as long as the worker needs who makes it; its modulus is near that of
    theory.
    """

    def __call__(self, job: Job) -> dict:
        """What a simulator gives, with the seconds that it took."""
        theory = float(halfspace_modulus(job.stiffness, job.euler_deg))
        seconds = (
            SECONDS * (1 + worker_number() / (WORKERS - 1)) * (1 + SPREAD * np.sin(1000 * theory))
        )
        time.sleep(seconds)
        return {"modulus_gpa": theory * (1.1 + 0.05 * np.sin(theory / 50)), "seconds": seconds}


def worker_number() -> int:
    """The number of this process of Dask, or else of this thread of its pool."""
    try:
        return int(distributed.get_worker().name)
    except ValueError:
        return int(threading.current_thread().name.rpartition("_")[2])


def utilisation(arguments, engine_name: str, batch: int) -> float:
    """The share of their time that the workers simulate, from the first choice to the last
    result.
    """
    folder = arguments.output / f"{engine_name}_{batch}"
    folder.mkdir(parents=True, exist_ok=True)
    path = folder / "build.nml"
    path.write_text(
        "&problem /\n"
        "&specimen geometry = 'block' /\n"
        f"&design budget = {arguments.budget}, batch = {batch} /\n"
    )
    (folder / "campaign.sqlite").unlink(missing_ok=True)
    stage, seconds = Stage(Problem(path, "build"), "build", folder), []
    with ENGINES[engine_name](WORKERS, "local") as engine:
        start = time.perf_counter()
        while (wanted := stage.wanted())[0]:

            def take(k: int, result: dict, numbers=wanted[0]) -> None:
                seconds.append(result["seconds"])
                stage.take(numbers[k], result)

            engine.map(UnequalWorkers(), wanted[1], take)
        return sum(seconds) / (WORKERS * (time.perf_counter() - start))


def losses(arguments, batches: list[int], sizes: list[int]) -> list[dict]:
    """Mean absolute errors on unseen crystals, by batch, budget and seed."""
    unseen = {
        name: simulated(arguments, name, points)
        for name, points in unseen_crystals(arguments).items()
    }
    rows = []
    for batch, seed, size in product(batches, range(1, arguments.seeds + 1), sizes):
        folder = arguments.output / f"batch_{batch}_seed_{seed}"
        folder.mkdir(exist_ok=True)
        path = folder / f"build_{size}.nml"
        path.write_text(
            f"&problem title = 'Batches', seed = {seed} /\n"
            "&specimen geometry = 'block' /\n"
            f"&design budget = {size}, batch = {batch} /\n"
            f"&execution workers = {arguments.workers} /\n"
        )
        surrogate = Surrogate.load(build(Problem(path, "build"), folder)["file"])
        for name, (matrices, angles, modulus) in unseen.items():
            error = float(np.mean(np.abs(surrogate.predict(matrices, angles)[0] - modulus)))
            rows.append(
                {"batch": batch, "seed": seed, "simulations": size, "set": name, "error_gpa": error}
            )
    return rows


def print_losses(rows: list[dict]) -> None:
    """A table for each budget: the mean error over the seeds, and its standard error."""
    for size in sorted({row["simulations"] for row in rows}):
        print(
            f"\n| {size} simulations, GPa | "
            + " | ".join(kinds(rows))
            + " |\n|"
            + "---|" * (len(kinds(rows)) + 1)
        )
        for batch in sorted({row["batch"] for row in rows}):
            cells = []
            for name in kinds(rows):
                errors = [
                    row["error_gpa"]
                    for row in rows
                    if (row["batch"], row["simulations"], row["set"]) == (batch, size, name)
                ]
                cells.append(
                    f"{np.mean(errors):.3f} ± {np.std(errors, ddof=1) / np.sqrt(len(errors)):.3f}"
                )
            print(f"| batch {batch} | " + " | ".join(cells) + " |")
