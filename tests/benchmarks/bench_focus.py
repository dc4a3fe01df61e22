"""Whether the loop closes: embedded grains of metals for which the first fifteen simulations are
wrong, and simulations at the posterior.

    ./bayesindent dev bench focus [--metals iridium,lead] [--grain 2.5,163,0.223] [--seeds 5]
    [--many 200] [--output DIR]

Synthetic moduli of eleven grains, by finer simulations than those of the loop, with a noise of 2
GPa or 1.5 % and the bulk modulus known to 2 %. Each is inferred by `run` with its defaults. Then
the draws are weighted by what a surrogate of `--many` simulations at the posterior makes of their
density (0: not): chains of that surrogate may stay where its polynomial has crystals of its own,
beyond all simulations.
"""

import argparse
import contextlib
import io
import json
import re
import tempfile
from pathlib import Path

import numpy as np

import bayesindent as bi
from bayesindent.crystal.elasticity import stiffness_rows
from bayesindent.program.cli import main as bayesindent
from bayesindent.stages.results_folder import read_posterior
from support.densities import Posterior

#: GPa, in the order of their class.
METALS = {
    "iridium": ("cubic", (596.0, 252.0, 270.0)),
    "lead": ("cubic", (49.5, 42.3, 14.9)),
    "beta-brass": ("cubic", (129.1, 109.7, 82.4)),
    "zinc": ("hexagonal", (161.1, 34.2, 38.3, 61.1, 50.3)),
    "graphite": ("hexagonal", (1060.0, 180.0, 4.5, 36.5, 15.0)),
}
#: On which nothing of the loop was chosen.
OTHERS = {
    "chromium": ("cubic", (350.0, 67.8, 100.8)),
    "silver": ("cubic", (124.0, 93.4, 46.1)),
    "cobalt": ("hexagonal", (307.0, 165.0, 75.5, 358.1, 103.0)),
    "magnesium": ("hexagonal", (59.7, 26.2, 16.4, 61.7, 21.7)),
}
GRAIN = {"geometry": "grain", "matrix": "isotropic", "estimator": "curve"}
GRAINS = 11
CASE = """\
&problem symmetry = '{symmetry}', synthetic = .true., seed = {seed} /
&specimen geometry = 'grain', matrix = 'isotropic', estimator = 'curve', {grain} /
&design {design} /
&measurements file = '{data}', modulus_kind = 'indentation_modulus' /
&knowledge quantity = 'bulk_modulus', mean = {bulk}, sd = {bulk_sd} /
&sampler samples = {samples}, chains = {chains} /
"""
#: Samples and chains of the loop, and of what is compared.
LOOP, COMPARED = {"samples": 5000, "chains": 4}, {"samples": 10000, "chains": 12}
#: Every so many draws are weighted.
STRIDE = 12
WIDE = (
    "&domain log_anisotropy_max = {}, poisson_min = -0.9, poisson_max = 0.49, stiffness_min_gpa "
    "= 5, stiffness_max_gpa = 2000 /\n"
)


def truth_of(metal, folder, grain):
    """Moduli of the grains, kept from call to call."""
    symmetry, constants = (METALS | OTHERS)[metal]
    rng = np.random.default_rng(7)
    euler = np.column_stack(
        [
            rng.uniform(0, 360, GRAINS),
            np.degrees(np.arccos(rng.uniform(-1, 1, GRAINS))),
            rng.uniform(0, 360, GRAINS),
        ]
    )
    file = folder / f"{metal}.txt"
    if not file.exists():
        indentation = bi.Indentation(**GRAIN, **grain, refine=1.5, extrapolate=True)
        outcomes = indentation.run_many(stiffness_rows(symmetry, [constants] * GRAINS), euler)
        np.savetxt(file, [outcome.indentation_modulus_gpa for outcome in outcomes])
    return euler, np.loadtxt(file)


def run(name, text, folder, output, command="run"):
    """A command with its standard streams aside."""
    file = folder / f"{name}.nml"
    file.write_text(text)
    with (
        contextlib.redirect_stdout(io.StringIO()),
        contextlib.redirect_stderr(io.StringIO()) as said,
    ):
        status = bayesindent([command, str(file), "--output", str(output)])
    if status not in (0, 3):
        raise RuntimeError(said.getvalue())


def draws_of(output):
    """The constants of a posterior, GPa, (draw, constant)."""
    found = read_posterior(output)
    draws = np.concatenate(found["draws"])
    return draws[:, : len(bi.constants(found["symmetry"]))]


def candidates(names, posteriors, euler, file, count=600):
    """Crystals of some posteriors of the same metal in the directions of the grains, as a table."""
    some = []
    for draws in posteriors:
        far = np.argsort(np.abs((draws - draws.mean(axis=0)) / draws.std(axis=0)).max(axis=1))
        # Half of them from the outermost twentieth, where few draws are and much of the variance
        # comes from.
        for one in (draws, draws[far[-len(draws) // 20 :]]):
            some += list(one[:: max(1, len(one) * 2 * len(posteriors) // count)])
    with file.open("w") as page:
        print(*names, "phi1_deg", "Phi_deg", "phi2_deg", sep=",", file=page)
        for i, row in enumerate(some):
            print(
                *(f"{value:.6f}" for value in row),
                *(f"{angle:.4f}" for angle in euler[i % len(euler)]),
                sep=",",
                file=page,
            )


def widths(draws, weight):
    """Of each constant the sd and the widths of the central intervals of 95 and 68 %, which a long
    tail moves less; (constant, 3).
    """
    rows = []
    for x in draws.T:
        order = np.argsort(x)
        ends = np.interp([0.025, 0.975, 0.16, 0.84], np.cumsum(weight[order]), x[order])
        rows.append([np.sqrt(weight @ (x - weight @ x) ** 2), *np.diff(ends)[::2]])
    return np.array(rows)


def main(argv=None) -> None:
    parser = argparse.ArgumentParser(
        prog="bayesindent dev bench focus", description=__doc__.splitlines()[0]
    )
    parser.add_argument("--metals", default=",".join(METALS), help=f"also {', '.join(OTHERS)}")
    parser.add_argument(
        "--grain",
        default="2.5,163,0.223",
        help="its radius in um; Young's modulus in GPa and Poisson's ratio of the matrix",
    )
    parser.add_argument("--seeds", type=int, default=5)
    parser.add_argument("--many", type=int, default=200)
    parser.add_argument("--design", default="")
    parser.add_argument("--output", type=Path)
    options = parser.parse_args(argv)
    # What is kept there belongs to one grain.
    folder = (options.output or Path(tempfile.mkdtemp())) / options.grain.replace(",", "_")
    folder.mkdir(parents=True, exist_ok=True)
    grain = dict(
        zip(
            ("grain_radius_um", "matrix_young_gpa", "matrix_nu"),
            map(float, options.grain.split(",")),
            strict=True,
        )
    )
    for metal in options.metals.split(","):
        symmetry, constants = (METALS | OTHERS)[metal]
        euler, moduli = truth_of(metal, folder, grain)
        bulk = bi.quantities(symmetry, constants, names=["bulk_modulus"])["bulk_modulus"]
        cases, posteriors = {}, {}
        for seed in range(1, options.seeds + 1):
            rng = np.random.default_rng(seed)
            sd = np.maximum(2.0, 0.015 * moduli)
            data = folder / f"{metal}_{seed}.csv"
            rows = np.column_stack([euler, moduli + sd * rng.normal(size=GRAINS), sd])
            header = "phi1_deg,Phi_deg,phi2_deg,modulus_gpa,sd_gpa"
            np.savetxt(
                data, rows, delimiter=",", header=header, comments="# synthetic\n", fmt="%.6f"
            )
            cases[seed] = {
                "symmetry": symmetry,
                "grain": ", ".join(f"{name} = {value}" for name, value in grain.items()),
                "seed": seed,
                "data": data,
                "bulk": bulk * (1 + 0.02 * rng.normal()),
                "bulk_sd": 0.02 * bulk,
            }
            output = folder / f"{metal}_{seed}"
            run(
                f"{metal}_{seed}",
                CASE.format(design=options.design, **LOOP, **cases[seed]),
                folder,
                output,
            )
            build, found = (
                json.loads((output / document).read_text())
                for document in ("build.json", "summary.json")
            )
            posteriors[seed] = draws_of(output)
            z = [
                (one["mean"] - true) / one["sd"]
                for one, true in zip(found["parameters"].values(), constants, strict=True)
            ]
            share = max(one["surrogate"] or 0.0 for one in found["error_budget"].values())
            line = (
                f"{metal:10} {seed}: {build['simulations']} simulations, {build['failed']} "
                f"failed; surrogate's share {share:.2f}; z"
            )
            line += "".join(f" {value:.1f}" for value in z) + (
                "" if found["usable"] else f"; unusable: {found['reasons'][0]}"
            )
            print(line, flush=True)
        if not options.many:
            continue
        table = folder / f"{metal}_candidates.csv"
        if not table.exists():
            candidates(bi.constants(symmetry), list(posteriors.values()), euler, table)
        surrogates = ((folder / f"{metal}_{seed}" / "surrogate.txt").read_text() for seed in cases)
        farthest = max(
            float(re.search(r"^log_anisotropy_max (\S+)", text, flags=re.M)[1])
            for text in surrogates
        )
        design = f"budget = {options.many}, focus = 'domain', candidates = '{table}'"
        many = CASE.format(design=design, **LOOP, **cases[1]) + WIDE.format(farthest)
        run(f"{metal}_many", many, folder, folder / f"{metal}_many", "build")
        for seed, values in cases.items():
            own = folder / f"{metal}_{seed}"
            run(
                f"{metal}_own_{seed}",
                CASE.format(design=options.design, **COMPARED, **values),
                folder,
                own,
                "extract",
            )
            draws, table_of = (
                draws_of(own)[::STRIDE],
                np.genfromtxt(values["data"], delimiter=",", skip_header=2),
            )
            asked = {
                "modulus_kind": "indentation_modulus",
                "knowledge": {"bulk_modulus": (values["bulk"], values["bulk_sd"])},
            }
            density, other = (
                Posterior.of(
                    table_of,
                    surrogate=bi.Surrogate.load(place / "surrogate.txt"),
                    symmetry=symmetry,
                    **asked,
                ).evaluate(draws)[0]
                for place in (own, folder / f"{metal}_many")
            )
            weight = np.exp(other - density - (other - density).max())
            weight /= weight.sum()
            ratios = widths(draws, np.full(len(draws), 1 / len(draws))) / widths(draws, weight)
            words = "; ".join(" ".join(map("{:.2f}".format, row)) for row in ratios)
            print(
                f"{metal:10} {seed}: sd, widths of 95 and 68 % over those of {options.many} "
                f"simulations: {words}",
                end="",
            )
            print(f"; {1 / (weight @ weight):.0f} of {len(draws)} draws effective", flush=True)


if __name__ == "__main__":
    main()
