"""The paper's two surrogates, whole, for several seeds, and the correction that comes with the
package on the same unseen simulations.

Runs inputs/case_studies/SYMMETRY_paper.nml once for each seed, as `build` does: every simulation is
kept, and running again goes on.

With --figures: those of the first seed, for docs/verification.

With --step 2: both steps of inputs/case_studies/iron_paper.nml or titanium_paper.nml, and the exact
posterior beside the paper's method.
"""

import argparse
import time
from pathlib import Path

import f90nml
import numpy as np

from bayesindent.common.progress import show_progress
from bayesindent.crystal.elasticity import halfspace_modulus, stiffness_rows
from bayesindent.report.figures.learning import truncations, validation
from bayesindent.report.figures.style import house_style, panels
from bayesindent.report.results import Results
from bayesindent.settings.problem import Problem
from bayesindent.stages.stage import run_stage
from bayesindent.surrogate.surrogate import Surrogate
from benchmarks.paper_step_2 import FIGURES, Study

INPUTS = Path(__file__).parents[2] / "inputs" / "case_studies"


def main(argv=None) -> int:
    """Build, compare, print the tables."""
    parser = argparse.ArgumentParser(
        prog="bench paper",
        description=__doc__,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    parser.add_argument(
        "--step",
        type=int,
        choices=(1, 2),
        default=1,
        help="1: the surrogates, 2: the constants (1)",
    )
    parser.add_argument("--symmetry", choices=("cubic", "hexagonal"), default="cubic")
    parser.add_argument("--seeds", default="1", help="seeds, for example 1,2,3,4,5 (1)")
    parser.add_argument(
        "--cap", type=float, default=0.0, help="cap on the anisotropy index (default: the file's)"
    )
    parser.add_argument(
        "--simulator",
        choices=("fe", "theory"),
        default=None,
        help=(
            "finite elements on the paper's block, or the half-space theory in their place "
            "(default: the file's)"
        ),
    )
    parser.add_argument(
        "--workers", type=int, default=0, help="simulations at a time (0: all cores)"
    )
    parser.add_argument(
        "--output", type=Path, default=None, help="folder (default: runs/paper_SYMMETRY)"
    )
    parser.add_argument(
        "--figures", action="store_true", help="write the figures of docs/verification"
    )
    arguments = parser.parse_args(argv)
    output = arguments.output or Path("runs") / f"paper_{arguments.symmetry}"
    show_progress(True)
    if arguments.step == 2:
        study = Study(arguments.symmetry, output / "step_2", arguments.simulator, arguments.workers)
        study.run()
        study.tables()
        study.precision_table()
        if arguments.figures:
            study.figures()
        return 0
    rows, ours, scans = [], [], []
    for seed in map(int, arguments.seeds.split(",")):
        folder = output / f"seed_{seed}"
        problem = variant(arguments, seed, folder)
        start = time.perf_counter()
        document = run_stage(problem, "build", folder)
        seconds = time.perf_counter() - start
        (folder / "resolved.nml").write_text(problem.resolved)
        validation = document["validation"]
        rows.append(
            [
                seed,
                document["loocv_gpa"],
                document["leave_crystal_out_gpa"],
                validation["mean_absolute_gpa"],
                validation["within_1_sd"],
                validation["within_2_sd"],
                document["failed"],
                document["new_simulations"],
                seconds,
            ]
        )
        ours.append(on_same_unseen(arguments.symmetry, validation))
        scans.append(document["scan"])
        if arguments.figures and len(rows) == 1:
            write_figures(Results(folder), arguments.symmetry)
    unseen = f"{validation['points']} unseen"
    print_rows(
        [
            "seed",
            "leave-one-out",
            "one-crystal-out",
            unseen,
            "within 1 sd",
            "within 2 sd",
            "failed",
            "new",
            "seconds",
        ],
        rows,
    )
    print(f"\nother truncations, seed {seed}")
    for entry in document.get("scan", []):
        print(
            f"degree {entry['degree']}, bandlimit {entry['bandlimit']}: leave-one-out "
            f"{entry['loocv_gpa']:.2f} GPa, "
            f"log evidence {entry['log_evidence']:.0f}, {entry['terms']} terms"
        )
    print(
        "\nof these the leave-one-out error, GPa, by the number of simulations, mean of the seeds"
    )
    for entries in zip(*scans, strict=True):
        values = np.mean([entry["curve"]["loocv_gpa"] for entry in entries], axis=0)
        of_numbers = [
            f"{number:.0f}: {value:.1f}"
            for number, value in zip(entries[0]["curve"]["simulations"], values, strict=True)
        ]
        print(
            f"degree {entries[0]['degree']}, bandlimit {entries[0]['bandlimit']}: "
            f"{', '.join(of_numbers)}"
        )
    error, ratio, *within = np.mean(ours, axis=0)
    print(
        f"\nthe correction 'block' on the same {unseen}: mean absolute error {error:.3f} GPa, "
        f"theory x ratio {ratio:.3f}; within 1 and 2 sd "
        f"{within[0]:.2f}, {within[1]:.2f}, 99 % quantile of |z| {within[2]:.1f}"
    )
    return 0


def variant(arguments, seed: int, folder: Path) -> Problem:
    """The problem of the case study with another seed, cap or simulator."""
    namelist = f90nml.read(INPUTS / f"{arguments.symmetry}_paper.nml")
    namelist["problem"]["seed"] = seed
    if arguments.simulator:
        namelist["simulation"] = {"simulator": arguments.simulator}
        namelist["specimen"] = {"geometry": "block" if arguments.simulator == "fe" else "halfspace"}
    namelist["execution"] = {"workers": arguments.workers}
    if arguments.cap > 0:
        namelist["domain"]["anisotropy_cap"] = arguments.cap
    folder.mkdir(parents=True, exist_ok=True)
    path = folder / f"{arguments.symmetry}_paper.nml"
    namelist.write(path, force=True)
    return Problem(path, "build")


def write_figures(results: Results, symmetry: str) -> None:
    """Figs. 1 to 3 of the paper, or 6 to 8: truncations, norm and angle of the coefficients, unseen
    simulations.
    """
    history = results.documents["build"]["history"][1:]
    with house_style():
        figure, places = panels(3.0, 1, 2)
        labels = {
            "norm": "norm of the coefficients (GPa)",
            "angle_deg": "angle to those before (degrees)",
        }
        for axes, (name, label) in zip(places, labels.items(), strict=True):
            axes.plot(
                [entry["simulations"] for entry in history],
                [entry[name] for entry in history],
                ".-",
            )
            axes.set(xlabel="simulations", ylabel=label)
        figures = {
            "truncations.svg": truncations(results).figure,
            "coefficients.svg": figure,
            "validation.png": validation(results).figure,
        }
        for name, drawn in figures.items():
            drawn.savefig(
                FIGURES / f"{symmetry}_paper_{name}",
                metadata={"Date": None} if name.endswith("svg") else None,
                dpi=130,
            )


def on_same_unseen(symmetry: str, validation: dict) -> list[float]:
    """Mean absolute errors of the correction and of theory times one ratio, shares within 1 and 2
    sd, and the 99 % quantile of |z|.
    """
    matrices, angles = (
        stiffness_rows(symmetry, np.array(validation["constants"])),
        np.array(validation["euler_deg"]),
    )
    modulus, theory = (
        np.array(validation["simulated"]),
        halfspace_modulus(matrices, validation["euler_deg"]),
    )
    mean, sd = Surrogate.load("block").predict(matrices, angles)
    z, ratio = np.abs(mean - modulus) / sd, np.exp(np.mean(np.log(modulus / theory)))
    errors = [np.mean(np.abs(value - modulus)) for value in (mean, ratio * theory)]
    return [*errors, np.mean(z <= 1), np.mean(z <= 2), np.quantile(z, 0.99)]


def print_rows(header, rows) -> None:
    """A table, and the means of its columns."""
    print("".join(f"{name:>16}" for name in header))
    mean = ["mean", *np.mean(np.array(rows)[:, 1:], axis=0)]
    for row in [*rows, mean] if len(rows) > 1 else rows:
        print(
            f"{row[0]:>16}"
            + "".join(f"{value:16.2f}" for value in row[1:6])
            + "".join(f"{value:16.0f}" for value in row[6:])
        )


if __name__ == "__main__":
    raise SystemExit(main())
