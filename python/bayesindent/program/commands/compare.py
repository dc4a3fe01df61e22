"""`compare`: posteriors of several runs side by side."""

import argparse
from pathlib import Path

from ...report.comparison import compare_runs, read_runs
from ...report.formatting import number
from ..command import Command, output_folder, show_table

__all__ = ["COMMANDS"]


def compare(arguments: argparse.Namespace) -> dict:
    """Tables and figures of the runs in the output folder, and the document."""
    runs = read_runs(arguments.runs)
    arguments.results = output_folder(arguments, Path("compare"))
    return compare_runs(runs, arguments.results, arguments.figures)


def show(document: dict) -> None:
    """The constants of all runs, and how well each model predicts the measurements."""
    runs = document["runs"]
    differences = {
        (item["run"], item["constant"]): item["difference_sd"] for item in document["differences"]
    }
    header, rows = ["constant", runs[0]["run"]], []
    for run in runs[1:]:
        header += [run["run"], "differs by (sd)"]
    for name in dict.fromkeys(name for run in runs for name in run["parameters"]):
        rows.append([name])
        for run in runs:
            item = run["parameters"].get(name, {})
            rows[-1] += [with_sd(item.get("mean"), item.get("sd"), 1)]
            rows[-1] += [number(differences.get((run["run"], name)), 2)] * (run is not runs[0])
    show_table(
        "Elastic constants (GPa), and by how many sds of the difference they are from the first",
        header,
        rows,
    )
    if document["same_data"]:
        print(
            "The runs share their measurements, and with them the errors of these: differences "
            "come from the models and the priors."
        )
    if models := document["models"]:
        columns = ("elpd_difference", "log_z", "log_z_difference")
        rows = [
            [
                row["run"],
                number(row["elpd"], 2),
                *(with_sd(row[name], row[f"{name}_sd"], 2) for name in columns),
            ]
            for row in models
        ]
        header = ["run", "leave-one-out", "less the first's", "log evidence", "less the first's"]
        show_table("Which model predicts these measurements best: larger is better", header, rows)
        print(
            "A difference of less than two of its sds says nothing. The evidence depends on the "
            "bounds of each prior; leave-one-out hardly."
        )


def with_sd(value: float | None, sd: float | None, digits: int) -> str:
    return "–" if value is None else f"{number(value, digits)} ± {number(sd, digits)}"


def add_arguments(parser: argparse.ArgumentParser) -> None:
    parser.add_argument(
        "runs",
        metavar="RUN",
        nargs="+",
        type=Path,
        help="output folders of extract or run, two or more",
    )
    parser.add_argument(
        "--figures",
        choices=("png", "pdf", "svg"),
        default="png",
        help="kind of the figures (default: png)",
    )


def after(arguments: argparse.Namespace, document: dict) -> str:
    return (
        f"look at {' and '.join(document['figures'])}; bayesindent report RUN has every figure "
        "of one run"
    )


COMMANDS = (Command("compare", action=compare, arguments=add_arguments, show=show, then=after),)
