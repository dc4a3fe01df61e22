"""What a command is: its words for help, what it does, and how its document is shown."""

import argparse
import logging
import os
import shlex
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

from ..core import call
from ..pipeline.stage import run_stage
from ..settings.problem import Problem, schema, stages
from ..surrogate.surrogate import places
from ..version import __version__

log = logging.getLogger("bayesindent")

#: How long a command that is soon done waits for another process to leave a folder, s.
PATIENCE_S = 60


@dataclass(frozen=True)
class Command:
    """One command; `action(arguments)` gives its JSON document, or an exit status, and `show`
    prints the document.

    A command that reads a namelist does the core's stage of its name, or `stage`(problem, output)
    -> document; its help explains `groups`. `arguments` adds options to the parser. `resumes`: it
    goes on from what it kept in the output folder. `then(arguments, document)` says what to do
    next. Without `show` it gives an exit status.
    """

    name: str
    groups: tuple[str, ...] = ()
    stage: Callable[..., dict] | None = None
    action: Callable[[argparse.Namespace], dict | int] | None = None
    arguments: Callable[[argparse.ArgumentParser], object] | None = None
    show: Callable[[dict], object] | None = None
    resumes: bool = False
    then: Callable[[argparse.Namespace, dict], str] | None = None

    def run(self, arguments: argparse.Namespace) -> dict | int:
        """Do it."""
        return (
            self.action(arguments)
            if self.action is not None
            else perform(self, *prepare(arguments))
        )


def namelist_command(name: str, **more: Any) -> Command:
    """The command of a stage, or `run`: the groups that its help explains are the core's."""
    row = next(row for row in stages() if row.name == name)
    groups = (
        row.groups
        if name != "run"
        else tuple(dict.fromkeys(variable.group for variable in schema()))
    )
    return Command(name, groups=groups, **more)


def prepare(arguments: argparse.Namespace, patience_s: int | None = 0) -> tuple[Problem, Path]:
    """The problem of a command's namelist, with the options that take the place of its variables,
    and its output folder, see `output_folder`; in one that is the command's own are the resolved
    input and the log.
    """
    options = {
        "&sampler samples": getattr(arguments, "samples", None),
        "&problem seed": arguments.seed,
    }
    changes = "\n".join(
        f"{name} = {value} /" for name, value in options.items() if value is not None
    )
    problem = Problem(arguments.file, arguments.command.name, changes)
    output = output_folder(arguments, arguments.file, patience_s)
    if patience_s is None:
        return problem, output
    arguments.results = output
    # Not what a link leads to, and no pipe, which would wait for a reader.
    os.close(
        os.open(output / "run.log", os.O_WRONLY | os.O_CREAT | os.O_NOFOLLOW | os.O_NONBLOCK, 0o666)
    )
    handler = logging.FileHandler(output / "run.log", encoding="utf-8")
    handler.setFormatter(logging.Formatter("%(asctime)s %(levelname)s %(message)s"))
    log.addHandler(handler)
    log.setLevel(logging.INFO)
    log.info("bayesindent %s: %s %s", __version__, arguments.command.name, arguments.file)
    log.info("kernels of BLAS: %s", os.environ.get("OPENBLAS_CORETYPE", "its own choice"))
    problem._call(
        "begin_results", groups=" ".join(arguments.command.groups), **places(output, problem.folder)
    )
    return problem, output


def report_of(arguments: argparse.Namespace, document: dict) -> str:
    """What to do after a stage that leaves only figures to be drawn."""
    return f"bayesindent report {quoted(arguments.results)}"


def quoted(path: Path) -> str:
    """As a shell takes it."""
    return shlex.quote(str(path))


def output_folder(
    arguments: argparse.Namespace, source: Path, patience_s: int | None = PATIENCE_S
) -> Path:
    """Where the results of a file go. The folder is made and the command's own to its end, which is
    refused if another process has it for longer than `patience_s`; None: it may be another's.
    """
    output = arguments.output or Path("runs") / source.stem
    if patience_s is not None:
        call(
            "file.take_folder",
            folder=output,
            patience=patience_s,
            resumes=arguments.command.resumes,
        )
    return output


def perform(command: Command, problem: Problem, output: Path) -> dict:
    """Perform a command's stage; its document is kept in the output folder for reports."""
    log.info("%s begins", command.name)
    stage = command.stage or partial(run_stage, name=command.name)
    document = stage(problem, output=output)
    log.info("%s ends", command.name)
    return document


def show_table(title: str, header: Iterable[str], rows: Iterable[Iterable]) -> None:
    """Print a table under its title, numbers on the right, as wide as it needs."""
    cells = [list(header), *(list(map(as_text, row)) for row in rows)]
    widths = [max(map(len, column)) for column in zip(*cells, strict=True)]
    print(f"{title}:")
    for first, *others in cells:
        print(
            f"{first:<{widths[0]}}",
            *(f"{cell:>{width}}" for cell, width in zip(others, widths[1:], strict=True)),
            sep="  ",
        )


def as_text(value: object) -> str:
    """The text of a cell: real numbers have two decimals."""
    return f"{value:.2f}" if isinstance(value, float) else str(value)
