"""Tools for work on the program itself, in a source tree: each is a module of tests/tools with a
`main`.
"""

import argparse
import importlib
import sys

#: Names of the tools, and what they do.
TOOLS = {
    "bench": "benchmarks against peers, and studies of accuracy",
    "docs": "the documentation as a site in build-docs/",
    "lines": "tokens by folder, packed code, and the largest parts",
    "lint": "formatters, linters, type checker and the rules of prose",
    "release": "everything that a release consists of, made and checked",
    "wheel": "portable wheels, their trial on a bare system, and exact versions of packages",
}


def main(argv: list[str] | None = None) -> int:
    """Run the tool that is named with the words after its name; return its exit status."""
    parser = argparse.ArgumentParser(
        prog="bayesindent dev",
        description=__doc__,
        epilog="\n".join(f"  {name:<9}{line}" for name, line in TOOLS.items()),
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    parser.add_argument("tool", metavar="TOOL", choices=TOOLS, help="TOOL --help says more")
    parser.add_argument("arguments", nargs=argparse.REMAINDER, help="what the tool takes")
    arguments = parser.parse_args(argv)
    return importlib.import_module(f"tools.{arguments.tool}").main(arguments.arguments)


if __name__ == "__main__":
    sys.exit(main())
