"""A command: its help, its action, and how its document is shown."""

import argparse
import logging
import os
import shlex
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

from ..core import InputError, call
from ..settings.problem import Problem, schema, stages
from ..stages.stage import run_stage
from ..surrogate.surrogate import places
from ..version import __version__
from .from_table import is_table

log = logging.getLogger("bayesindent")

#: Seconds that a short command waits for another process to leave a folder.
PATIENCE_S = 60


def perform_stage(arguments: argparse.Namespace) -> dict:
    """Perform the stage of a command in its output folder."""
    return perform(arguments.command, *prepare(arguments))


@dataclass(frozen=True)
class Command:
    """One command: `action(arguments)` returns its JSON document, and `show` prints it. A tool of a
    source tree has no `show`, and its action does not return.

    By default a command performs the core's stage of its name, or `stage`(problem, output) ->
    document; its help explains `groups`. `arguments` adds options to the parser.
    `resumes` is true if a second call continues from the output folder. `then(arguments, document)`
    names the next step.
    """

    name: str
    groups: tuple[str, ...] = ()
    stage: Callable[..., dict] | None = None
    action: Callable[[argparse.Namespace], dict] = perform_stage
    arguments: Callable[[argparse.ArgumentParser], object] | None = None
    show: Callable[[dict], object] | None = None
    resumes: bool = False
    then: Callable[[argparse.Namespace, dict], str] | None = None


def namelist_command(name: str, **more: Any) -> Command:
    """The command of a stage, or `run`; the core lists the groups that its help explains."""
    groups = next(row.groups for row in stages() if row.name == name)
    if name == "run":
        groups = tuple(dict.fromkeys(variable.group for variable in schema()))
    return Command(name, groups=groups, **more)


def prepare(arguments: argparse.Namespace, patience_s: int | None = 0) -> tuple[Problem, Path]:
    """The problem of a command's namelist, some of whose variables options replace, and its output
    folder, see `output_folder`. The resolved input and the log are written to a folder that the
    command locks.
    """
    options = {
        "&sampler samples": getattr(arguments, "samples", None),
        "&problem seed": arguments.seed,
        **getattr(arguments, "stated", {}),
    }
    changes = "\n".join(
        f"{name} = {value} /" for name, value in options.items() if value is not None
    )
    if address := getattr(arguments, "scheduler", None):
        # Dask reads its configuration when it is imported.
        os.environ["DASK_SCHEDULER_ADDRESS"] = address
        changes += "\n&execution engine = 'dask', scheduler = 'address' /"
    if is_table(arguments.file):
        raise InputError(
            f"{arguments.file}: is a table, no namelist; bayesindent extract "
            f"{quoted(arguments.file)} --symmetry CLASS"
        )
    problem = Problem(arguments.file, arguments.command.name, changes)
    output = output_folder(arguments, arguments.file, patience_s)
    if patience_s is None:
        return problem, output
    arguments.results = output
    # The log must be no link and no pipe, which would wait for a reader.
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
    """The next step after a stage whose figures remain to be drawn."""
    return f"bayesindent report {quoted(arguments.results)}"


def quoted(path: Path) -> str:
    """A path as a word of a shell."""
    return shlex.quote(str(path))


def output_folder(
    arguments: argparse.Namespace, source: Path, patience_s: int | None = PATIENCE_S
) -> Path:
    """The folder for the results of a file. It is made and locked until the command ends, which is
    refused if another process holds it for longer than `patience_s`; None takes no lock.
    """
    output = arguments.output or Path("runs") / source.stem
    if patience_s is not None:
        resumes = arguments.command.resumes
        call("file.take_folder", folder=output, patience=patience_s, resumes=resumes)
    return output


def perform(command: Command, problem: Problem, output: Path) -> dict:
    """Perform a command's stage; the output folder stores its document for reports."""
    log.info("%s begins", command.name)
    stage = command.stage or partial(run_stage, name=command.name)
    document = stage(problem, output=output)
    log.info("%s ends", command.name)
    return document


def show_table(title: str, header: Iterable[str], rows: Iterable[Iterable]) -> None:
    """Print a table under its title, numbers on the right, as wide as it needs."""
    cells = [list(header), *(list(map(as_text, row)) for row in rows)]
    widths = [max(map(len, column)) for column in zip(*cells)]
    print(f"{title}:")
    for first, *others in cells:
        print(
            f"{first:<{widths[0]}}",
            *(f"{cell:>{width}}" for cell, width in zip(others, widths[1:])),
            sep="  ",
        )


def as_text(value: object) -> str:
    """The text of a cell: real numbers have two decimals."""
    return "" if value is None else f"{value:.2f}" if isinstance(value, float) else str(value)
