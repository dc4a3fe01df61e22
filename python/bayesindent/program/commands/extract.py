"""`extract`: Step 2."""

import argparse
from pathlib import Path

from ...common.progress import Progress
from ...common.result_files import write_groups
from ...inference.extract import groups_of
from ...pipeline.results_folder import read_posterior
from ...pipeline.stage import run_stage
from ...report.formatting import SHARES, number, numbers, share_cells
from ...settings.problem import Problem
from ..command import namelist_command
from ..console import show_table

__all__ = ["COMMAND"]


def extract(problem: Problem, output: Path, progress: Progress) -> dict:
    """The stage, and its numbers in ArviZ' schema: posterior.nc."""
    document = run_stage(problem, "extract", output, progress)
    write_groups(output / "posterior.nc", groups_of(read_posterior(output)))
    return document


def show(document: dict) -> None:
    """The constants, and what they follow from."""
    rows = [
        [name, *numbers(item, mean=1, sd=1), " .. ".join(map(number, item["hdi_95"])), *share_cells(item)]
        for name, item in document["parameters"].items()
    ]
    print("Measurements, prior and surrogate:", *document["prior"]["words"], sep="\n  ")
    if beside := document.get("theory_alone"):
        constants = ", ".join(f"{name} {' ± '.join(numbers(item, mean=1, sd=1))}" for name, item in beside.items())
        print(f"Theory of the half-space without the specimen: {constants}")
    header = ["constant", "mean", "sd", "95 %", *SHARES.values(), "verdict"]
    show_table("Elastic constants (GPa), and shares of their variance (%)", header, rows)


def then(arguments: argparse.Namespace, document: dict) -> str:
    more = f", and bayesindent next {arguments.file} for the grain to measure next" if document["usable"] else ""
    return f"bayesindent report {arguments.results}{more}"


COMMAND = namelist_command("extract", stage=extract, show=show, resumes=True, then=then)
