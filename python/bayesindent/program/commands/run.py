"""`run`: all that a namelist asks for."""

import argparse
import sys

from ...surrogate.surrogate import places
from ..command import namelist_command, output_folder, perform, prepare, problem_of
from . import report
from .stages import COMMANDS

__all__ = ["COMMAND"]


def run(arguments: argparse.Namespace) -> dict:
    """The stages of the file in order, then a report; with --check only what would be done. A result that cannot be used suggests no grain."""
    if arguments.check:
        problem, output = problem_of(arguments), output_folder(arguments, arguments.file, None)
    else:
        problem, output = prepare(arguments)
    # What the reader cannot see: the surrogate, if no stage before builds it, and whether it is valid for the prior's crystals.
    problem._call("check_stages", **places(output, problem.folder))
    if arguments.check:
        return {"file": str(arguments.file), "stages": problem.stages, "warnings": problem.warnings}
    if problem.table and not arguments.quiet:
        print(*problem.table.words(len(problem.measurements)), sep="\n", file=sys.stderr)
    known = {command.name: command for command in COMMANDS}
    documents: dict[str, dict] = {}
    for name in problem.stages:
        if name != "next" or documents.get("extract", {}).get("usable", True):
            documents[name] = perform(known[name], problem, output)
    documents["report"] = report.make(output, output)
    return documents | {"warnings": [*problem.warnings, *(line for document in documents.values() for line in document["warnings"])]}


def show(document: dict) -> None:
    if "stages" in document:
        print(f"{document['file']}: right; it asks for {', '.join(document['stages'])}")
    # The constants last: a terminal shows the end.
    for command in sorted((*COMMANDS, report.COMMAND), key=lambda command: command.name == "extract"):
        if command.show is not None and command.name in document:
            command.show(document[command.name])


def then(arguments: argparse.Namespace, document: dict) -> str:
    if arguments.check:
        return f"bayesindent run {arguments.file}"
    more = f"; bayesindent report {arguments.results} --paper for a paper" if "extract" in document else ""
    return f"open {document['report']['file']} in a browser{more}"


def add_arguments(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("--check", action="store_true", help="only validate the file and what it names")


COMMAND = namelist_command("run", action=run, arguments=add_arguments, show=show, resumes=True, then=then)
