"""`report`: one page of what a folder holds."""

import argparse
from pathlib import Path

from ...core import InputError
from ..command import Command

__all__ = ["COMMAND", "make"]


def make(folder: Path, output: Path, kind_of_files: str = "") -> dict:
    """The report of what a folder holds."""
    from ...report.report import write_report

    if not folder.is_dir():
        raise InputError(f"{folder}: there is no such folder of results")
    return {"file": str(write_report(folder, output, kind_of_files)), "warnings": []}


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Options."""
    parser.add_argument("folder", metavar="DIR", type=Path, help="the output folder of other commands")
    parser.add_argument("--figures", choices=("png", "pdf", "svg"), default="", help="every figure as a file in DIR/figures, too")


COMMAND = Command(
    "report",
    "report.html from what a folder holds",
    action=lambda arguments: make(arguments.folder, arguments.output or arguments.folder, arguments.figures),
    arguments=add_arguments,
    show=lambda document: print(f"Report: {document['file']}"),
)
