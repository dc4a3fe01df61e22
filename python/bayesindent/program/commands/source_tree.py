"""`bench`, `test`, `lint`, `wheel`, `docs` and `lines`: what only a source tree can do, by its tests/tools/NAME.py."""

import argparse
import os
import sys
from importlib import import_module
from pathlib import Path

from ...core import BayesindentError
from ..command import Command


def take_all(parser: argparse.ArgumentParser) -> None:
    """Whatever follows, options too, is the tool's."""
    parser.prefix_chars = "\0"
    parser.add_argument("arguments", nargs="*", help="--help says more")


def run(arguments: argparse.Namespace) -> int:
    """Run the `main(arguments)` of a tool. The launcher says where the source tree is; otherwise the current folder must be it."""
    root = Path(os.environ.get("BAYESINDENT_SOURCE", "."))
    tools = root / "tests" / "tools"
    if not tools.is_dir():
        raise BayesindentError(f"{root.resolve()} is no source tree of bayesindent; use ./bayesindent in one")
    sys.path.insert(0, str(tools))
    return import_module(arguments.command.name).main(arguments.arguments)


COMMANDS = tuple(Command(name, action=run, arguments=take_all) for name in ("bench", "test", "lint", "wheel", "docs", "lines"))
