"""`run`: all that a namelist asks for."""

import argparse

from ...common.progress import Progress
from ..command import Command, output_folder, perform, prepare, with_warnings

__all__ = ["COMMAND"]


def run(arguments: argparse.Namespace) -> dict:
    """The stages of the file in order, then a report; with --check only what would be done."""
    from ...settings.problem import Problem
    from ..commands import COMMANDS, report

    if arguments.check:
        return check(Problem(arguments.file, "run"), arguments)
    problem, output = prepare(arguments)
    known = {command.name: command for command in COMMANDS}
    documents = {name: perform(known[name], problem, output, Progress(True)) for name in asked(problem)}
    documents["report"] = report.make(output, output)
    warnings = [line for document in documents.values() for line in document["warnings"]]
    return with_warnings(problem, documents | {"warnings": warnings})


def asked(problem) -> list[str]:
    """What `run` does with a file, in order: the theory goes with every simulation of crystals."""
    return [stage for name in problem.stages for stage in ((name, "theory") if name == "simulate" else (name,))]


def check(problem, arguments: argparse.Namespace) -> dict:
    """Look at what the reader cannot see: the surrogate, if no stage before builds it, and whether it knows the crystals of the prior."""
    from ...inference.extract import check_stage

    stages = asked(problem)
    if "build" not in stages and {"extract", "next"} & set(stages):
        check_stage(problem, output_folder(arguments, arguments.file))
    return {"file": str(arguments.file), "stages": stages, "warnings": problem.warnings}


def show(document: dict) -> None:
    """The stages, one after another."""
    from ..commands import COMMANDS

    if "stages" in document:
        print(f"{document['file']}: right; it asks for {', '.join(document['stages'])}")
    for command in COMMANDS:
        if command.name in document:
            command.show(document[command.name])


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Options."""
    parser.add_argument("--check", action="store_true", help="only validate the file and what it names")


COMMAND = Command(
    "run",
    "all that the groups of a namelist ask for, in order, resuming what is done",
    """&crystals asks for simulate and theory, &design for build, &measurements for extract, &next for next; a report ends it. Nothing
    that is already in the output folder is simulated again.""",
    groups=("problem", "crystals", "simulation", "domain", "surrogate", "design", "measurements", "prior", "sampler", "next", "execution"),
    action=run,
    arguments=add_arguments,
    show=show,
)
