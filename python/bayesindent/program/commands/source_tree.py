"""Commands that only a source tree has: each runs the module tests/tools/NAME.py."""

import argparse
import os
import sys
from pathlib import Path
from typing import NoReturn

from ...core import BayesindentError
from ..command import Command


def take_all(parser: argparse.ArgumentParser) -> None:
    """Leave all arguments, options included, to the tool."""
    parser.prefix_chars = "\0"
    parser.add_argument("arguments", nargs="*", help="--help says more")


def run(arguments: argparse.Namespace) -> NoReturn:
    """Run a tool in place of this process, with tests/ on the path of Python.

    The launcher names the source tree. Otherwise the current folder must be one.
    """
    tests = Path(os.environ.get("BAYESINDENT_SOURCE", ".")).resolve() / "tests"
    if not (tests / "tools").is_dir():
        raise BayesindentError(
            f"{tests.parent} is no source tree of bayesindent; use ./bayesindent in one"
        )
    paths = filter(None, [str(tests), os.environ.get("PYTHONPATH")])
    environment = os.environ | {"PYTHONPATH": os.pathsep.join(paths)}
    command = [sys.executable, "-m", f"tools.{arguments.command.name}", *arguments.arguments]
    os.execve(sys.executable, command, environment)


NAMES = ("reproduce", "test", "dev")
COMMANDS = tuple(Command(name, action=run, arguments=take_all) for name in NAMES)
