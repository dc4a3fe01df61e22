"""Learning curves of Step 1 with real simulations: error on unseen crystals against the number of simulations.

Random crystals of the paper's domain are simulated once and kept in campaign.sqlite (run again to go on). For each seed some of them
are unseen, and the design chooses among the others. Compared are the four combinations of coordinates and prior; other ways to choose,
and the baselines: theory alone, and theory times one ratio that the same number of
random simulations fits.
"""

import argparse
import csv
import json
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from paper_domains import DOMAINS

from bayesindent.common.progress import Progress
from bayesindent.crystal.elasticity import halfspace_modulus, stiffness_rows
from bayesindent.pipeline.campaign import Campaign
from bayesindent.pipeline.engines import LocalEngine
from bayesindent.pipeline.simulator import Simulator, physics_identity, simulate_into
from bayesindent.settings.problem import Problem
from bayesindent.surrogate.basis import Basis
from bayesindent.surrogate.domain import Domain
from bayesindent.surrogate.learner import Learner
from bayesindent.surrogate.learning import FIRST_SD


@dataclass(frozen=True)
class Model:
    """A way to learn: coordinates, prior, what decides the next simulation."""

    coordinates: str
    prior: str
    choice: str = "modulus"

    @property
    def label(self) -> str:
        return f"{self.coordinates}, {self.prior}{'' if self.choice == 'modulus' else f', {self.choice}'}"

    def bases(self, domain: Domain) -> list[Basis]:
        """Total truncations (degree, bandlimit); a flat prior needs one that grows with the data."""
        sizes = [(4, 8)] if self.prior == "theory" else [(1, 4), (2, 4), (3, 4), (3, 6), (4, 8)]
        return [Basis(domain, self.coordinates, "total", *size) for size in sizes]


OURS = Model("dimensionless", "theory")
COMBINATIONS = (OURS, Model("dimensionless", "zero"), Model("box", "theory"), Model("box", "zero"))
VARIANTS = tuple(Model("dimensionless", "theory", choice) for choice in ("log_modulus", "random"))
COLORS = {"dimensionless": "tab:blue", "box": "tab:orange"}


def main(argv=None) -> int:
    """Simulate, learn, tabulate, draw."""
    parser = argparse.ArgumentParser(prog="bench learning", description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--symmetry", choices=("cubic", "hexagonal"), default="cubic")
    parser.add_argument("--mesh", choices=("paper", "halfspace"), default="paper")
    parser.add_argument("--simulator", choices=("fe", "theory"), default="fe", help="theory: no simulation, only to try the command")
    parser.add_argument("--points", type=int, default=700, help="random crystals (700)")
    parser.add_argument("--unseen", type=int, default=500, help="of them unseen (500, at most half of a smaller number)")
    parser.add_argument("--seeds", type=int, default=10, help="partitions over which all is averaged (10)")
    parser.add_argument("--sizes", default="0,8,12,16,20,30,40,60,80,100,150,200", help="numbers of simulations")
    parser.add_argument("--workers", type=int, default=0, help="simulations at a time (0: all cores)")
    parser.add_argument("--output", type=Path, default=None, help="folder (default: runs/learning_SYMMETRY_MESH)")
    arguments = parser.parse_args(argv)
    output = arguments.output or Path("runs") / f"learning_{arguments.symmetry}_{arguments.mesh}"
    output.mkdir(parents=True, exist_ok=True)
    domain = DOMAINS[arguments.symmetry]
    constants, angles, modulus, failed = simulated(arguments, domain, output)
    theory = halfspace_modulus(stiffness_rows(arguments.symmetry, constants), angles)
    ratio = modulus / theory
    n_unseen = arguments.unseen if len(modulus) > arguments.unseen + 20 else len(modulus) // 2
    print(f"{len(modulus)} simulations, {failed} failed, {n_unseen} unseen; simulation over theory {ratio.mean():.4f}, "
          f"sd {ratio.std():.4f}, {ratio.min():.4f} .. {ratio.max():.4f}")  # fmt: skip
    sizes = sorted({int(word) for word in arguments.sizes.split(",") if int(word) <= len(modulus) - n_unseen})
    rows = []
    with Progress(True).bar("learning", arguments.seeds * len(COMBINATIONS + VARIANTS)) as advance:
        for seed in range(1, arguments.seeds + 1):
            order = np.random.default_rng(seed).permutation(len(modulus))
            unseen, pool = order[:n_unseen], order[n_unseen:]
            rows += baselines(theory, modulus, unseen, pool, sizes, seed)
            for model in COMBINATIONS + VARIANTS:
                rows += curve(domain, model, constants, angles, modulus, unseen, pool, sizes, seed)
                advance(1)
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
    problem = Problem.from_keywords("learning", simulation={"simulator": arguments.simulator, "mesh": arguments.mesh})
    # A larger number later adds to the crystals of a smaller one.
    constants, angles = (part[: arguments.points] for part in domain.crystals(max(2000, arguments.points), seed=1000))
    with Campaign(output / "campaign.sqlite", physics_identity(problem)) as campaign:
        points = [(domain.symmetry, tuple(c), tuple(e)) for c, e in zip(constants.tolist(), angles.tolist(), strict=True)]
        missing = [point for point in points if campaign.find(*point) is None]
        if missing:
            with Progress(True).bar("simulations", len(missing)) as advance:
                simulate_into(campaign, Simulator(problem), missing, LocalEngine(arguments.workers), lambda success: advance(1))
        rows = [campaign.find(*point) for point in points]
    done = np.array([row.modulus_gpa is not None for row in rows])
    return constants[done], angles[done], np.array([row.modulus_gpa for row in rows if row.modulus_gpa is not None]), int((~done).sum())


def baselines(theory, modulus, unseen, pool, sizes, seed: int) -> list[dict]:
    """Theory alone, and times the geometric mean ratio of the first points of the pool."""
    rows = []
    for n in sizes:
        ratio = np.exp(np.mean(np.log(modulus[pool[:n]] / theory[pool[:n]]))) if n else 1.0
        for model, factor in (("theory", 1.0), ("theory x ratio", ratio)):
            error = np.mean(np.abs(factor * theory[unseen] - modulus[unseen]))
            rows.append({"model": model, "simulations": n, "seed": seed, "error_gpa": error})
    return rows


def curve(domain, model: Model, constants, angles, modulus, unseen, pool, sizes, seed: int) -> list[dict]:
    """Errors of a model on the unseen points, learning from those of the pool that it chooses."""
    bases = model.bases(domain)
    rows, stages = [], {}
    for n in sizes:
        # The largest basis with an informative prior; under a flat one the largest that has no more terms than points.
        fit = [basis for basis in bases if model.prior == "theory" or basis.n_terms <= n]
        if fit and n != 1:
            stages.setdefault(fit[-1], []).append(n)
    stiffness = stiffness_rows(domain.symmetry, constants)
    for basis, stops in stages.items():
        learner, data = Learner(basis, model.prior), 0
        learner.set_candidates(constants[pool], angles[pool], "modulus" if model.choice == "random" else model.choice)
        learner.fit(*(sd**-2 for sd in FIRST_SD[model.prior, model.coordinates]))
        for stop in stops:
            while data < stop:
                count = min(8, stop) if data == 0 else 1
                random = model.choice == "random"
                chosen = pool[np.arange(data, data + count) if random else learner.choose(count)[0]]
                learner.add(constants[chosen], angles[chosen], modulus[chosen], chosen=not random)
                data += count
                if basis.n_terms <= 100 or data % 10 == 0 or data == stop:
                    learner.fit()
                else:
                    learner.update()
            error = np.abs(learner.predict(constants[unseen], angles[unseen]) - modulus[unseen])
            row = {"model": model.label, "simulations": stop, "seed": seed, "degree": basis.degree, "bandlimit": basis.bandlimit,
                   "error_gpa": error.mean()}  # fmt: skip
            if stop > 1:
                z = error / learner.surrogate().predict(stiffness[unseen], angles[unseen])[1]
                row |= {"within_1_sd": np.mean(z <= 1), "within_2_sd": np.mean(z <= 2), "z_99": np.quantile(z, 0.99)}
            rows.append(row)
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
    print(f"{'mean absolute error, GPa':42}" + "".join(f"{n:>8}" for n in sizes))
    for model, values in errors.items():
        print(f"{model:42}" + "".join(f"{values[n]:8.3f}" if n in values else f"{'':8}" for n in sizes))
    for name in ("within_1_sd", "within_2_sd", "z_99"):
        values = summary(rows, name)[OURS.label]
        print(f"{'ours: ' + name:42}" + "".join(f"{values[n]:8.2f}" if n in values else f"{'':8}" for n in sizes))


def draw(rows, sizes, arguments, output: Path) -> None:
    """The learning curves."""
    import matplotlib

    matplotlib.use("Agg")
    import matplotlib.pyplot as plt

    figure, axes = plt.subplots(figsize=(8.4, 4.2), layout="constrained")
    errors = summary(rows, "error_gpa")
    for model in COMBINATIONS:
        values = errors[model.label]
        n, flat = [size for size in sizes if size in values], model.prior == "zero"
        axes.plot(n, [values[size] for size in n], marker="o", ms=4, color=COLORS[model.coordinates], mfc="w" if flat else None,
                  ls="-." if flat else "-", label=f"{model.coordinates} coordinates, {'flat' if flat else model.prior} prior")  # fmt: skip
    for label, dashes in (("theory", "--"), ("theory x ratio", ":")):
        axes.plot(sizes, [errors[label][size] for size in sizes], color="0.4", ls=dashes, label=label)
    axes.set(xlabel="simulations", ylabel="mean absolute error on unseen crystals, GPa", yscale="log",
             title=f"{arguments.symmetry}, {arguments.mesh} mesh, {arguments.seeds} partitions")  # fmt: skip
    axes.set_xscale("symlog", linthresh=10, linscale=0.5)
    axes.set_xlim(-0.3, max(sizes))
    axes.set_xticks([n for n in sizes if n != 15], [str(n) for n in sizes if n != 15])
    axes.minorticks_off()
    figure.legend(loc="outside right upper", fontsize=8)
    axes.grid(alpha=0.3)
    figure.savefig(output / "learning.svg", metadata={"Date": None, "Creator": None})
    plt.close(figure)
    (output / "summary.json").write_text(
        json.dumps({name: summary(rows, name) for name in ("error_gpa", "within_1_sd", "within_2_sd", "z_99")}, indent=1)
    )


if __name__ == "__main__":
    raise SystemExit(main())
