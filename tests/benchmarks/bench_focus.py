"""Whether the loop closes: films of metals for which the quickstart's first fifteen simulations are wrong, and simulations at the posterior.

    ./bayesindent bench focus [--metals iridium,lead] [--seeds 5] [--many 200] [--output DIR]

Synthetic moduli of eleven grains, by finer simulations than those of the loop, with a noise of 2 GPa or 1.5 % and the bulk modulus known to
2 %. Each is inferred by `run` with its defaults, and once more with a surrogate of `--many` simulations at the posterior (0: not).
"""

import argparse
import contextlib
import io
import json
import tempfile
from pathlib import Path

import numpy as np

import bayesindent as bi
from bayesindent.crystal.elasticity import stiffness_rows
from bayesindent.program.cli import main as bayesindent

#: GPa, in the order of their class.
METALS = {
    "iridium": ("cubic", (596.0, 252.0, 270.0)),
    "lead": ("cubic", (49.5, 42.3, 14.9)),
    "beta-brass": ("cubic", (129.1, 109.7, 82.4)),
    "zinc": ("hexagonal", (161.1, 34.2, 38.3, 61.1, 50.3)),
    "graphite": ("hexagonal", (1060.0, 180.0, 4.5, 36.5, 15.0)),
}
FILM = {"geometry": "film", "thickness_um": 1.0, "substrate_young_gpa": 163, "substrate_nu": 0.223}
GRAINS = 11
CASE = """\
&problem symmetry = '{symmetry}', synthetic = .true., seed = {seed} /
&specimen geometry = 'film', thickness_um = 1.0, substrate_young_gpa = 163, substrate_nu = 0.223 /
&design {design} /
&measurements file = '{data}', modulus_kind = 'indentation_modulus' /
&knowledge quantity = 'bulk_modulus', mean = {bulk}, sd = {bulk_sd} /
&sampler samples = 5000 /
"""


def truth_of(metal, folder):
    """Moduli of the grains, kept from call to call."""
    symmetry, constants = METALS[metal]
    rng = np.random.default_rng(7)
    euler = np.column_stack([rng.uniform(0, 360, GRAINS), np.degrees(np.arccos(rng.uniform(-1, 1, GRAINS))), rng.uniform(0, 360, GRAINS)])
    file = folder / f"{metal}.txt"
    if not file.exists():
        indentation = bi.Indentation(**FILM, refine=1.5, extrapolate=True)
        outcomes = indentation.run_many(stiffness_rows(symmetry, [constants] * GRAINS), euler)
        np.savetxt(file, [outcome.indentation_modulus_gpa for outcome in outcomes])
    return euler, np.loadtxt(file)


def run(name, text, folder, output):
    """The documents of a run."""
    file = folder / f"{name}.nml"
    file.write_text(text)
    with contextlib.redirect_stdout(io.StringIO()), contextlib.redirect_stderr(io.StringIO()) as said:
        status = bayesindent(["run", str(file), "--output", str(output)])
    if status not in (0, 3):
        raise RuntimeError(said.getvalue())
    return tuple(json.loads((output / document).read_text()) for document in ("build.json", "summary.json"))


def candidates(output, euler, file, count=600):
    """Crystals of a posterior in the directions of the grains, as a table."""
    rows = np.genfromtxt(output / "posterior.csv", delimiter=",", names=True)
    names = [name for name in rows.dtype.names if name.startswith("C")]
    some = rows[:: max(1, len(rows) // count)]
    with file.open("w") as page:
        print(*names, "phi1_deg", "Phi_deg", "phi2_deg", sep=",", file=page)
        for i, row in enumerate(some):
            print(*(f"{row[name]:.6f}" for name in names), *(f"{angle:.4f}" for angle in euler[i % len(euler)]), sep=",", file=page)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--metals", default=",".join(METALS))
    parser.add_argument("--seeds", type=int, default=5)
    parser.add_argument("--many", type=int, default=200)
    parser.add_argument("--design", default="")
    parser.add_argument("--output", type=Path)
    options = parser.parse_args()
    folder = options.output or Path(tempfile.mkdtemp())
    folder.mkdir(parents=True, exist_ok=True)
    for metal in options.metals.split(","):
        symmetry, constants = METALS[metal]
        euler, moduli = truth_of(metal, folder)
        bulk = bi.quantities(symmetry, constants, names=["bulk_modulus"])["bulk_modulus"]
        for seed in range(1, options.seeds + 1):
            rng = np.random.default_rng(seed)
            sd = np.maximum(2.0, 0.015 * moduli)
            data = folder / f"{metal}_{seed}.csv"
            rows = np.column_stack([euler, moduli + sd * rng.normal(size=GRAINS), sd])
            np.savetxt(
                data, rows, delimiter=",", header="phi1_deg,Phi_deg,phi2_deg,modulus_gpa,sd_gpa", comments="# synthetic\n", fmt="%.6f"
            )
            values = {"symmetry": symmetry, "seed": seed, "data": data, "bulk": bulk * (1 + 0.02 * rng.normal()), "bulk_sd": 0.02 * bulk}
            output = folder / f"{metal}_{seed}"
            build, found = run(f"{metal}_{seed}", CASE.format(design=options.design, **values), folder, output)
            sds = {name: one["sd"] for name, one in found["parameters"].items()}
            z = {name: (one["mean"] - true) / one["sd"] for (name, one), true in zip(found["parameters"].items(), constants, strict=True)}
            share = max(one["surrogate"] or 0.0 for one in found["error_budget"].values())
            line = f"{metal:10} {seed}: {build['simulations']} simulations, {build['failed']} failed; surrogate's share {share:.2f}; z"
            line += "".join(f" {value:.1f}" for value in z.values())
            if options.many:
                table = folder / f"{metal}_candidates.csv"
                if not table.exists():
                    candidates(output, euler, table)
                design = f"budget = {options.many}, focus = 'domain', candidates = '{table}'"
                domain = "&domain log_anisotropy_max = 5, poisson_min = -0.9, poisson_max = 0.49, stiffness_min_gpa = 5, stiffness_max_gpa = 2000 /"
                _, many = run(
                    f"{metal}_many_{seed}", CASE.format(design=design, **values) + domain + "\n", folder, folder / f"{metal}_many"
                )
                line += "; sd over that of many" + "".join(f" {sds[name] / one['sd']:.2f}" for name, one in many["parameters"].items())
            print(line + ("" if found["usable"] else f"; unusable: {found['reasons'][0]}"), flush=True)


if __name__ == "__main__":
    main()
