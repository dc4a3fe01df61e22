"""Learning curves of Step 1 with real simulations: error on unseen crystals against the number of simulations.

Random crystals of the paper's domain are simulated once and kept in campaign.sqlite (run again to go on). For each seed half of them
are unseen, and the design chooses among the others, by the variance of M. Compared are the four combinations of coordinates and prior,
and the baselines: theory alone, and theory times one ratio that the same number of random simulations fits.
"""

import argparse
import csv
import json
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import numpy as np

from bayesindent.build import FIRST_SD, physics_identity, simulator_of
from bayesindent.campaign import Campaign
from bayesindent.core import BayesindentError
from bayesindent.crystal import halfspace_modulus
from bayesindent.domain import Domain
from bayesindent.problem import Problem
from bayesindent.progress import Progress
from bayesindent.surrogate import Basis, new_design, sd_factor, stiffness_rows

#: Bases: degree and bandlimit of total truncation; a flat prior needs one that grows with the data.
MODELS = {
    ("dimensionless", "theory"): [(4, 8)],
    ("dimensionless", "zero"): [(1, 4), (2, 4), (3, 4), (3, 6), (4, 8)],
    ("box", "theory"): [(4, 8)],
    ("box", "zero"): [(1, 4), (2, 4), (3, 4), (3, 6), (4, 8)],
}
COLORS = {"dimensionless": "tab:blue", "box": "tab:orange"}


def main(argv=None) -> int:
    """Simulate, learn, tabulate, draw."""
    parser = argparse.ArgumentParser(prog="bench learning", description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--symmetry", choices=("cubic", "hexagonal"), default="cubic")
    parser.add_argument("--mesh", choices=("paper", "halfspace"), default="paper")
    parser.add_argument("--simulator", choices=("fe", "theory"), default="fe", help="theory: no simulation, only to try the command")
    parser.add_argument("--points", type=int, default=1000, help="random crystals (1000): half unseen, half to choose from")
    parser.add_argument("--seeds", type=int, default=5, help="partitions over which errors are averaged (5)")
    parser.add_argument("--sizes", default="0,5,10,15,20,30,40,60,80,100,150,200", help="numbers of simulations")
    parser.add_argument("--workers", type=int, default=0, help="simulations at a time (0: all cores)")
    parser.add_argument("--output", type=Path, default=None, help="folder (default: runs/learning_SYMMETRY_MESH)")
    arguments = parser.parse_args(argv)
    output = arguments.output or Path("runs") / f"learning_{arguments.symmetry}_{arguments.mesh}"
    output.mkdir(parents=True, exist_ok=True)
    domain = Domain.default(arguments.symmetry)
    constants, angles, modulus, failed = simulated(arguments, domain, output)
    theory = halfspace_modulus(stiffness_rows(arguments.symmetry, constants), angles)
    ratio = modulus / theory
    print(f"{len(modulus)} simulations, {failed} failed; simulation over theory {ratio.mean():.4f}, sd {ratio.std():.4f}, "
          f"{ratio.min():.4f} .. {ratio.max():.4f}")  # fmt: skip
    sizes = sorted({int(word) for word in arguments.sizes.split(",")})
    rows = []
    for seed in range(1, arguments.seeds + 1):
        order = np.random.default_rng(seed).permutation(len(modulus))
        unseen, pool = order[: len(order) // 2], order[len(order) // 2 :]
        rows += baselines(theory, modulus, unseen, pool, sizes, seed)
        for model in MODELS:
            rows += curve(domain, model, constants, angles, modulus, unseen, pool, sizes, seed)
    columns = ["model", "simulations", "seed", "degree", "bandlimit", "error_gpa", "within_1_sd", "within_2_sd", "z_99"]
    with open(output / "learning.csv", "w", newline="") as stream:
        writer = csv.DictWriter(stream, columns)
        writer.writeheader()
        writer.writerows(rows)
    print_table(rows, sizes)
    draw(rows, sizes, arguments, output)
    print(f"{output / 'learning.csv'}, {output / 'learning.svg'}")
    return 0


def simulated(arguments, domain: Domain, output: Path):
    """The moduli of the random crystals, from the campaign or simulated now."""
    namelist = output / "learning.nml"
    namelist.write_text(
        f"&problem symmetry = '{domain.symmetry}' /\n&simulation simulator = '{arguments.simulator}', mesh = '{arguments.mesh}' /\n&design /\n"
    )
    problem = Problem(namelist, "build")
    # A larger number later adds to the crystals of a smaller one.
    constants, angles = (part[: arguments.points] for part in domain.crystals(max(2000, arguments.points), seed=1000))
    stiffness = stiffness_rows(domain.symmetry, constants)
    with Campaign(output / "campaign.sqlite", physics_identity(problem)) as campaign:
        missing = [i for i in range(len(constants)) if campaign.find(domain.symmetry, constants[i], angles[i]) is None]
        if missing:
            simulate = simulator_of(problem)

            def run(i):
                try:
                    return simulate(stiffness[i], angles[i])
                except BayesindentError as error:
                    return {"message": str(error)}

            with ThreadPoolExecutor(arguments.workers or None) as threads, Progress(True).bar("simulations", len(missing)) as advance:
                for i, result in zip(missing, threads.map(run, missing), strict=True):
                    campaign.add(domain.symmetry, constants[i], angles[i], position=i, **result)
                    advance(1)
        rows = [campaign.find(domain.symmetry, c, e) for c, e in zip(constants, angles, strict=True)]
    done = np.array([row.status == "done" for row in rows])
    return constants[done], angles[done], np.array([row.modulus_gpa for row in rows if row.status == "done"]), int((~done).sum())


def baselines(theory, modulus, unseen, pool, sizes, seed: int) -> list[dict]:
    """Theory alone, and times the geometric mean ratio of the first points of the pool."""
    rows = []
    for n in sizes:
        ratio = np.exp(np.mean(np.log(modulus[pool[:n]] / theory[pool[:n]]))) if n else 1.0
        for model, factor in (("theory", 1.0), ("theory x ratio", ratio)):
            error = np.mean(np.abs(factor * theory[unseen] - modulus[unseen]))
            rows.append({"model": model, "simulations": n, "seed": seed, "error_gpa": error})
    return rows


def curve(domain, model, constants, angles, modulus, unseen, pool, sizes, seed: int) -> list[dict]:
    """Errors of one combination of coordinates and prior, the design chosen by variance."""
    coordinates, prior = model
    rows = []
    for n in sizes:
        if n == 1 or n > len(pool) or (n == 0 and prior == "zero"):
            continue
        # The largest basis with an informative prior; under a flat one the largest that has no more terms than points.
        bases = [Basis(domain.symmetry, coordinates, "total", *size, *domain.ranges(coordinates)) for size in MODELS[model]]
        bases = [basis for basis in bases if prior == "theory" or basis.n_terms <= n]
        if not bases:
            continue
        basis = bases[-1]
        terms, scale = basis.terms(constants, angles)
        y = basis.to_y(modulus, scale)
        design = new_design(basis, domain, prior)
        design.set_candidates(terms[:, pool])
        design.fit(*(sd**-2 for sd in FIRST_SD[prior, coordinates]))
        if n == 0:
            error = np.mean(np.abs(basis.to_modulus(design.mean() @ terms[:, unseen], scale[unseen]) - modulus[unseen]))
            rows.append({"model": f"{coordinates}, {prior}", "simulations": 0, "seed": seed, "error_gpa": error})
            continue
        used = 0
        while used < n:
            count = min(8, n) if used == 0 else 1
            importance = basis.to_modulus(design.mean() @ terms[:, pool], scale[pool]) if coordinates == "dimensionless" else None
            chosen = pool[design.choose(count, importance)[0]]
            design.add(terms[:, chosen], y[chosen])
            used += count
            if basis.n_terms <= 100 or used % 10 == 0 or used == n:
                _, beta, _ = design.fit()
            else:
                design.settle()
        residual, sd = design.leave_out(np.arange(n))
        inflation = sd_factor(basis, domain, prior, design, residual / sd)
        mean = design.mean() @ terms[:, unseen]
        variance = np.einsum("in,in->n", terms[:, unseen], design.covariance() @ terms[:, unseen]) + 1 / beta
        z = np.abs(mean - y[unseen]) / (inflation * np.sqrt(variance))
        error = np.mean(np.abs(basis.to_modulus(mean, scale[unseen]) - modulus[unseen]))
        rows.append({"model": f"{coordinates}, {prior}", "simulations": n, "seed": seed, "degree": basis.degree,
                     "bandlimit": basis.bandlimit, "error_gpa": error, "within_1_sd": np.mean(z <= 1), "within_2_sd": np.mean(z <= 2),
                     "z_99": np.quantile(z, 0.99)})  # fmt: skip
    return rows


def summary(rows, name: str) -> dict:
    """Mean over seeds of a column: {model: {size: value}}."""
    groups = {}
    for row in rows:
        if row.get(name) is not None:
            groups.setdefault(row["model"], {}).setdefault(row["simulations"], []).append(row[name])
    return {model: {n: float(np.mean(values)) for n, values in sizes.items()} for model, sizes in groups.items()}


def print_table(rows, sizes) -> None:
    """Mean errors in GPa, and the coverage of our model."""
    errors = summary(rows, "error_gpa")
    print(f"{'mean absolute error, GPa':26}" + "".join(f"{n:>8}" for n in sizes))
    for model, values in errors.items():
        print(f"{model:26}" + "".join(f"{values[n]:8.3f}" if n in values else f"{'':8}" for n in sizes))
    for name in ("within_1_sd", "within_2_sd", "z_99"):
        values = summary(rows, name)["dimensionless, theory"]
        print(f"{'ours: ' + name:26}" + "".join(f"{values[n]:8.2f}" if n in values else f"{'':8}" for n in sizes))


def draw(rows, sizes, arguments, output: Path) -> None:
    """The learning curves."""
    import matplotlib

    matplotlib.use("Agg")
    import matplotlib.pyplot as plt

    figure, axes = plt.subplots(figsize=(6.4, 4.4), layout="constrained")
    for model, values in summary(rows, "error_gpa").items():
        n = [size for size in sizes if size in values]
        if model.startswith("theory"):
            axes.plot(n, [values[size] for size in n], color="0.4", ls="--" if model == "theory" else ":", label=model)
        else:
            coordinates, prior = model.split(", ")
            axes.plot(n, [values[size] for size in n], marker="o", ms=4, color=COLORS[coordinates], mfc=None if prior == "theory" else "w",
                      ls="-" if prior == "theory" else "-.", label=f"{coordinates} coordinates, prior {prior}")  # fmt: skip
    axes.set(xlabel="simulations", ylabel="mean absolute error on unseen crystals, GPa", yscale="log",
             title=f"{arguments.symmetry}, {arguments.mesh} mesh, {arguments.seeds} partitions")  # fmt: skip
    axes.set_xscale("symlog", linthresh=10, linscale=0.5)
    axes.set_xlim(-0.3, max(sizes))
    axes.set_xticks([n for n in sizes if n != 15], [str(n) for n in sizes if n != 15])
    axes.minorticks_off()
    axes.legend(fontsize=8)
    axes.grid(alpha=0.3)
    figure.savefig(output / "learning.svg", metadata={"Date": None, "Creator": None})
    plt.close(figure)
    (output / "summary.json").write_text(
        json.dumps({name: summary(rows, name) for name in ("error_gpa", "within_1_sd", "within_2_sd", "z_99")}, indent=1)
    )


if __name__ == "__main__":
    raise SystemExit(main())
