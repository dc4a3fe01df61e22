"""The quickstart's embedded grains over many draws of the noise: do the intervals of what
indentation sees cover the truth? With --data, the file of its moduli is made anew.

The correction is the quickstart's. The moduli without noise are simulated once with the finer
elements that its data were made with. For each draw Step 2 is done twice, with the correction and
with the theory of the half-space alone. What indentation sees of a cubic crystal are two
combinations of the constants: here the moduli of the half-space along [100] and [111]. Results are
kept as they come; run again to go on.
"""

import argparse
import json
from pathlib import Path

import f90nml
import numpy as np

import bayesindent as bi
from bayesindent.common.progress import progress_bar, show_progress
from bayesindent.crystal.elasticity import halfspace_modulus, stiffness_rows
from bayesindent.fe.indentation import Indentation
from bayesindent.settings.problem import Problem
from support.learner import build
from support.measured_tables import read_measurements

QUICKSTART = Path(__file__).parents[2] / "inputs" / "quickstart.nml"
TRUTH = [168.4, 121.4, 75.4]
#: Of the indentation direction in crystal axes.
DIRECTIONS = {"[100]": (0.0, 0.0, 0.0), "[111]": (0.0, 54.7356103, 45.0)}
SD_GPA = 2.0


def main(argv=None) -> int:
    """Simulate, sample, tabulate."""
    parser = argparse.ArgumentParser(
        prog="bench quickstart",
        description=__doc__,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    parser.add_argument("--draws", type=int, default=200, help="draws of the noise (200)")
    parser.add_argument("--workers", type=int, default=0, help="threads (0: all cores)")
    parser.add_argument("--output", type=Path, default=Path("runs/bench_quickstart"))
    parser.add_argument("--data", type=Path, help="write the quickstart's moduli, and end")
    arguments = parser.parse_args(argv)
    arguments.output.mkdir(parents=True, exist_ok=True)
    show_progress(True)
    if arguments.data:
        write_data(arguments)
        return 0
    surrogate = bi.Surrogate.load(build(Problem(QUICKSTART, "build"), arguments.output)["file"])
    angles, modulus = without_noise(arguments)
    truth = halfspace_modulus(
        stiffness_rows("cubic", len(DIRECTIONS) * [TRUTH]), list(DIRECTIONS.values())
    )
    kept = arguments.output / "draws.json"
    rows = json.loads(kept.read_text()) if kept.exists() else []
    with progress_bar("draws", arguments.draws) as advance:
        advance(len(rows))
        for seed in range(len(rows), arguments.draws):
            noisy = modulus + np.random.default_rng(seed).normal(0, SD_GPA, len(modulus))
            rows.append(
                {
                    name: seen(angles, noisy, model, seed, arguments)
                    for name, model in (("correction", surrogate), ("theory", "halfspace"))
                }
            )
            kept.write_text(json.dumps(rows))
            advance(1)
    print(f"{len(rows)} draws\n| | " + " | ".join(DIRECTIONS) + " |\n|---|---|---|")
    for name in ("correction", "theory"):
        # Bounds, mean and sd of each constant in each draw.
        low, high, mean, sd = np.moveaxis(np.array([row[name] for row in rows]), -1, 0)
        covered = np.mean((low <= truth) & (truth <= high), axis=0)
        print(
            f"| {name}: in the 90 % interval | "
            + " | ".join(f"{100 * share:.1f} %" for share in covered)
            + " |"
        )
        print(
            f"| {name}: mean bias, sds | "
            + " | ".join(f"{value:+.2f}" for value in np.mean((mean - truth) / sd, axis=0))
            + " |"
        )
        pairs = zip(sd.mean(axis=0), mean.std(axis=0), strict=True)
        print(
            f"| {name}: mean sd, and spread of the means, GPa | "
            + " | ".join(f"{a:.2f}, {b:.2f}" for a, b in pairs)
            + " |"
        )
    return 0


def without_noise(arguments) -> tuple[np.ndarray, np.ndarray]:
    """Angles (n, 3) of the quickstart's grains, and their moduli (n,) in GPa."""
    namelist = f90nml.read(QUICKSTART)
    angles = read_measurements(
        QUICKSTART.parent / namelist["measurements"].pop("file"),
        "cubic",
        **namelist["measurements"],
    ).euler_deg
    file = arguments.output / "without_noise.txt"
    if not file.exists():
        grain = Indentation(**namelist["specimen"], refine=1.5, extrapolate=True)
        results = grain.run_many(
            stiffness_rows("cubic", len(angles) * [TRUTH]), angles, workers=arguments.workers
        )
        np.savetxt(file, [result.indentation_modulus_gpa for result in results])
    return angles, np.loadtxt(file)


def write_data(arguments) -> None:
    """Write the moduli of the quickstart, with one draw of the noise."""
    angles, modulus = without_noise(arguments)
    noisy = modulus + np.random.default_rng(11).normal(0, SD_GPA, len(modulus))
    rows = np.column_stack([angles, noisy, np.full(len(noisy), SD_GPA)])
    header = (
        f"# synthetic: copper, {TRUTH} GPa, as the &specimen of quickstart.nml by finite elements "
        f"(refine = 1.5, extrapolate = .true.) plus N(0, {SD_GPA} GPa) noise; made by "
        "./bayesindent dev bench quickstart --data FILE\n"
        "phi1_deg,Phi_deg,phi2_deg,indentation_modulus_gpa,sd_gpa"
    )
    formats = ["%.4f", "%.4f", "%.4f", "%.3f", "%.2f"]
    np.savetxt(arguments.data, rows, formats, ",", header=header, comments="")


def seen(angles, modulus, surrogate, seed: int, arguments) -> list[list[float]]:
    """Of each direction the 5th and the 95th percentile, mean and sd of the modulus, GPa."""
    known = f90nml.read(QUICKSTART)["knowledge"]
    table = {"euler_deg": angles, "modulus_gpa": modulus, "sd_gpa": np.full(len(modulus), SD_GPA)}
    posterior = bi.extract(
        table,
        symmetry="cubic",
        modulus_kind="indentation_modulus",
        surrogate=surrogate,
        seed=seed,
        samples=1500,
        chains=2,
        knowledge={known["quantity"]: (known["mean"], known["sd"])},
        workers=arguments.workers,
    ).posterior
    draws = np.column_stack([posterior[name].values.ravel() for name in ("C11", "C12", "C44")])[::5]
    matrices = stiffness_rows("cubic", draws)
    moduli = [
        halfspace_modulus(matrices, len(draws) * [direction]) for direction in DIRECTIONS.values()
    ]
    return [
        [*np.quantile(values, [0.05, 0.95]).tolist(), float(values.mean()), float(values.std())]
        for values in moduli
    ]
