"""`bench`, `test`, `lint` and `lines`: what only a source tree can do."""

import argparse

from .. import source_tree
from ..command import Command

__all__ = ["COMMANDS"]


def bench_arguments(parser: argparse.ArgumentParser) -> None:
    """Options of `bench`."""
    parser.add_argument("name", metavar="NAME")
    parser.add_argument("arguments", nargs=argparse.REMAINDER, help="what the benchmark takes")


def test_arguments(parser: argparse.ArgumentParser) -> None:
    """Options of `test`."""
    parser.add_argument("names", nargs="*", metavar="NAME", help="a suite (unit, python, cli), a unit test, or part of a case's name")
    parser.add_argument("--sanitize", action="store_true", help="of a build that checks addresses, undefined behaviour and bounds")


def lint_arguments(parser: argparse.ArgumentParser) -> None:
    """Options of `lint`."""
    parser.add_argument("--fix", dest="arguments", action="store_const", const=["--fix"], default=[], help="format and mend first")


def lines_arguments(parser: argparse.ArgumentParser) -> None:
    """Options of `lines`."""
    parser.add_argument("arguments", nargs="*", metavar="ROOT", help="other source trees, beside it")


def tool(arguments: argparse.Namespace) -> int:
    """Run a tool."""
    return source_tree.run_tool(arguments.command.name, arguments.arguments)


COMMANDS = (
    Command(
        "bench",
        "benchmarks against peers, and studies of accuracy, from a source tree",
        """NAME is simulate, build or extract (against peers), or learning, coverage, paper, shipped or studies (accuracy); NAME --help
        says more.""",
        action=lambda arguments: source_tree.run_benchmark(arguments.name, arguments.arguments),
        arguments=bench_arguments,
    ),
    Command(
        "test",
        "build and run the tests of a source tree",
        "The last line counts the cases.",
        action=lambda arguments: source_tree.run_tests(arguments.names, arguments.sanitize),
        arguments=test_arguments,
    ),
    Command("lint", "formatters, linters and type checker of a source tree", action=tool, arguments=lint_arguments),
    Command("lines", "code lines of a source tree by folder, and its largest parts", action=tool, arguments=lines_arguments),
)
