"""Is the stated sd honest? Surrogates as `build` makes them, several with different candidates, on random unseen simulations.

The random crystals are those of `bench learning` (same folder: nothing is simulated twice); each design is a `build` of its own with the
namelist's defaults. Printed for each budget: mean absolute error, theory times the one ratio that the design's simulations fit, and the
shares of unseen moduli within 1 and 2 sd and the 99 % quantile of |z|, with the factor on the sd and without it.
"""

import argparse
from pathlib import Path

import numpy as np
from bench_learning import simulated
from paper_domains import DOMAINS

from bayesindent.common.progress import Progress
from bayesindent.crystal.elasticity import halfspace_modulus, stiffness_rows
from bayesindent.pipeline.build import build
from bayesindent.settings.problem import Problem
from bayesindent.surrogate.surrogate import Surrogate


def main(argv=None) -> int:
    """Simulate, build, tabulate."""
    parser = argparse.ArgumentParser(prog="bench coverage", description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--symmetry", choices=("cubic", "hexagonal"), default="cubic")
    parser.add_argument("--mesh", choices=("paper", "halfspace"), default="paper")
    parser.add_argument("--simulator", choices=("fe", "theory"), default="fe", help="theory: no simulation, only to try the command")
    parser.add_argument("--points", type=int, default=500, help="random unseen crystals (500)")
    parser.add_argument("--designs", type=int, default=10, help="surrogates, each with other candidates (10)")
    parser.add_argument("--budgets", default="", help="numbers of simulations (cubic: 20,40; hexagonal: 40,80)")
    parser.add_argument("--workers", type=int, default=0, help="simulations at a time (0: all cores)")
    parser.add_argument("--output", type=Path, default=None, help="folder (default: runs/learning_SYMMETRY_MESH)")
    arguments = parser.parse_args(argv)
    output = arguments.output or Path("runs") / f"learning_{arguments.symmetry}_{arguments.mesh}"
    output.mkdir(parents=True, exist_ok=True)
    constants, angles, modulus, failed = simulated(arguments, DOMAINS[arguments.symmetry], output)
    stiffness = stiffness_rows(arguments.symmetry, constants)
    theory = halfspace_modulus(stiffness, angles)
    budgets = [int(word) for word in (arguments.budgets or {"cubic": "20,40", "hexagonal": "40,80"}[arguments.symmetry]).split(",")]
    print(f"{len(modulus)} unseen, {failed} failed, {arguments.designs} designs")
    header = ["simulations", "error, GPa", "theory x ratio", "factor", "within 1 sd", "within 2 sd", "99 % of |z|", "without:", "", ""]
    print("".join(f"{name:>15}" for name in header))
    for budget in budgets:
        rows = []
        for seed in range(1, arguments.designs + 1):
            document, surrogate = built(arguments, budget, seed, output / f"design_{seed}")
            mean, sd = surrogate.predict(stiffness, angles)
            z = np.abs(mean - modulus) / sd
            error = [np.mean(np.abs(value - modulus)) for value in (mean, document["baselines"]["ratio"] * theory)]
            rows.append([*error, surrogate.sd_inflation, *shares(z), *shares(z * surrogate.sd_inflation)])
        print(f"{budget:15d}" + "".join(f"{value:15.2f}" for value in np.mean(rows, axis=0)))
    return 0


def shares(z) -> list[float]:
    """Shares within 1 and 2, and the 99 % quantile."""
    return [np.mean(z <= 1), np.mean(z <= 2), np.quantile(z, 0.99)]


def built(arguments, budget: int, seed: int, folder: Path) -> tuple[dict, Surrogate]:
    """The document and the surrogate of a build with the defaults."""
    folder.mkdir(parents=True, exist_ok=True)
    path = folder / f"build_{budget}.nml"
    domain = DOMAINS[arguments.symmetry]
    path.write_text(
        f"&problem symmetry = '{arguments.symmetry}', seed = {seed} /\n"
        f"&simulation simulator = '{arguments.simulator}', mesh = '{arguments.mesh}' /\n"
        f"&domain c_min = {', '.join(map(str, domain.c_min))}, c_max = {', '.join(map(str, domain.c_max))}, "
        f"anisotropy_cap = {domain.anisotropy_cap} /\n"
        f"&design budget = {budget} /\n&execution workers = {arguments.workers} /\n"
    )
    document = build(Problem(path, "build"), folder, Progress(True))
    return document, Surrogate.load(folder / "surrogate.txt")


if __name__ == "__main__":
    raise SystemExit(main())
