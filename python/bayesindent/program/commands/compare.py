"""`compare`: posteriors of several runs side by side."""

import argparse
from pathlib import Path

from ...report.comparison import compare
from ..command import Command, output_folder, show_table


def action(arguments: argparse.Namespace) -> dict:
    """Compare the runs; tables and figure are in the output folder."""
    arguments.results = output_folder(arguments, Path("compare"))
    return compare(*arguments.runs, output=arguments.results)


def show(document: dict) -> None:
    """The constants of all runs, and how well each model predicts the measurements."""
    for title in ("constants", "models"):
        if rows := document[title]:
            show_table(title, rows[0], map(dict.values, rows))


COMMANDS = (
    Command(
        "compare",
        action=action,
        arguments=lambda parser: parser.add_argument(
            "runs", metavar="RUN", nargs="+", help="two or more folders of results"
        ),
        show=show,
    ),
)
