"""`report`: one page on the results in a folder."""

import argparse
import gc
from pathlib import Path

from ...core import InputError, call
from ..command import PATIENCE_S, Command, output_folder


def make(folder: Path, output: Path, kind_of_files: str = "", paper: bool = False) -> dict:
    """Write the report on the results in a folder."""
    call("file.check_memory", bytes=2.5e8, what="the report")
    # Figures have many parts, so that garbage collection would take a fifth of the time.
    gc.disable()
    # Importing matplotlib is slow; other commands do without.
    from ...report.report import write_report

    try:
        results, page = write_report(folder, output, kind_of_files, paper)
    finally:
        gc.enable()
    document = {"file": str(page), "warnings": results.edited}
    return document | {"paper": str(folder / "paper")} if paper else document


def report(arguments: argparse.Namespace) -> dict:
    """Report on a folder to which no other process writes."""
    folder = arguments.folder
    if folder.is_dir() and not arguments.paper and not any(folder.glob("*.json")):
        raise InputError(f"{folder}: there are no results; bayesindent run FILE.nml makes them")
    arguments.output = arguments.output or folder
    output = output_folder(
        arguments, arguments.folder, PATIENCE_S if arguments.folder.is_dir() else None
    )
    return make(arguments.folder, output, arguments.figures, arguments.paper)


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """The folder, and further files."""
    parser.add_argument(
        "folder", metavar="DIR", type=Path, help="the output folder of other commands"
    )
    parser.add_argument(
        "--figures",
        choices=("png", "pdf", "svg"),
        default="",
        help="every figure as a file in DIR/figures, too",
    )
    parser.add_argument(
        "--paper",
        action="store_true",
        help="texts, tables, figures and stiffness cards for a paper in DIR/paper, too",
    )


def show(document: dict) -> None:
    """Print where the report and the files for a paper are."""
    print(f"Report: {document['file']}")
    if "paper" in document:
        print(f"For a paper: {document['paper']}, methods.tex first")


def after(arguments: argparse.Namespace, document: dict) -> str:
    """The next step."""
    more = "" if arguments.paper else "; --paper writes what a paper takes"
    return f"open {document['file']} in a browser{more}"


COMMANDS = (Command("report", action=report, arguments=add_arguments, show=show, then=after),)
