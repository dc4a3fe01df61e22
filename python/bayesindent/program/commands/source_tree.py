"""`bench`, `test`, `lint`, `wheel`, `docs` and `lines`: what only a source tree can do, by its tests/tools/NAME.py."""

import argparse
import importlib.util
import os
import sys
from pathlib import Path

from ...core import BayesindentError
from ..command import Command

__all__ = ["COMMANDS"]

SUMMARIES = {
    "bench": "benchmarks against peers, and studies of accuracy, from a source tree",
    "test": "build and run the tests of a source tree",
    "lint": "formatters, linters and type checker of a source tree",
    "wheel": "portable wheels of a source tree, and a trial on a bare system",
    "docs": "the documentation of a source tree as a site",
    "lines": "code lines of a source tree by folder, and its largest parts",
}


def take_all(parser: argparse.ArgumentParser) -> None:
    """Whatever follows, options too, is the tool's."""
    parser.prefix_chars = "\0"
    parser.add_argument("arguments", nargs="*", help="--help says more")


def run(arguments: argparse.Namespace) -> int:
    """Run the `main(arguments)` of a tool. The launcher says where the source tree is; otherwise the current folder must be it."""
    root = Path(os.environ.get("BAYESINDENT_SOURCE", "."))
    file = root / "tests" / "tools" / f"{arguments.command.name}.py"
    specification = importlib.util.spec_from_file_location(f"tool_{file.stem}", file)
    if not file.exists() or specification is None or specification.loader is None:
        raise BayesindentError(f"{root.resolve()} is no source tree of bayesindent; use ./bayesindent in one")
    sys.path.insert(0, str(file.parent))
    module = importlib.util.module_from_spec(specification)
    specification.loader.exec_module(module)
    return module.main(arguments.arguments)


COMMANDS = tuple(Command(name, summary, action=run, arguments=take_all) for name, summary in SUMMARIES.items())
