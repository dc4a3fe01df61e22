"""`extract`: Step 2."""

import argparse
from pathlib import Path

from ...common.progress import Progress
from ...common.result_files import write_groups
from ...inference.extract import groups_of
from ...pipeline.results_folder import read_posterior
from ...pipeline.stage import run_stage
from ...report.formatting import best_first, number
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
    """The constants, the best known first, and the prior that was in effect."""
    rows = []
    for name, item, contraction in best_first(document):
        low, high = item["hdi_95"]
        values = [number(item["mean"]), number(item["sd"]), number(item["map"]), f"{low:.1f} .. {high:.1f}", number(contraction, 3)]
        rows.append([name, *values, number(item["r_hat"], 3), number(item["ess_bulk"], 0), number(item["ess_tail"], 0)])
    header = ["constant", "mean", "sd", "most probable", "95 %", "contraction", "R-hat", "ESS bulk", "ESS tail"]
    show_table("Elastic constants (GPa), the best known first", header, rows)
    if beside := document.get("theory_alone"):
        said = ", ".join(f"{name} {number(item['mean'])} ± {number(item['sd'])}" for name, item in beside.items())
        print(f"Theory of the half-space alone would have said: {said}")
    print("The prior that was in effect:", *document["prior"]["words"], sep="\n  ")


def then(arguments: argparse.Namespace, document: dict) -> str:
    """What to do next."""
    return f"bayesindent report {arguments.results}, and bayesindent next {arguments.file} for the grain to measure next"


COMMAND = namelist_command("extract", stage=extract, show=show, resumes=True, then=then)
