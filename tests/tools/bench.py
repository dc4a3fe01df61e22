"""Benchmarks against peers (simulate, build, extract), rates (theory), and studies of accuracy
(learning, paper, studies).
"""

import argparse
import importlib
import sys
from pathlib import Path

FOLDER = Path(__file__).parents[1] / "benchmarks"


def main(argv=None) -> int:
    """Run tests/benchmarks/bench_NAME.py: its `main(arguments)` returns an exit status or
    nothing.
    """
    known = sorted(path.stem.removeprefix("bench_") for path in FOLDER.glob("bench_*.py"))
    parser = argparse.ArgumentParser(prog="bayesindent dev bench", description=__doc__)
    parser.add_argument(
        "name",
        metavar="NAME",
        choices=known,
        help=f"one of {', '.join(known)}; NAME --help says more",
    )
    parser.add_argument("arguments", nargs=argparse.REMAINDER, help="what the benchmark takes")
    arguments = parser.parse_args(argv)
    return int(
        importlib.import_module(f"benchmarks.bench_{arguments.name}").main(arguments.arguments) or 0
    )


if __name__ == "__main__":
    sys.exit(main())
