"""Formatters, linters, the type checker and the rules of prose over the whole source tree: `lint`
reports faults, `lint --fix` formats first.

All of them are Python wheels of the development extra `dev`; their settings are in pyproject.toml,
.clang-format and fortitude.toml.
"""

import argparse
import os
import subprocess
import sys
from pathlib import Path

from tools import prose

ROOT = Path(__file__).parents[2]
SHELL = ("bayesindent", ".ci/run")


def main(argv=None) -> int:
    """Run every tool, show the output of those that report faults, and return 1 if one does."""
    parser = argparse.ArgumentParser(
        prog="bayesindent dev lint",
        description=__doc__,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    parser.add_argument(
        "--fix",
        action="store_true",
        help="format, and correct what the linters can correct, before checking",
    )
    arguments = parser.parse_args(argv)
    if arguments.fix:
        for command in fixes():
            run(command)
    failed = [name for name, command, silent in checks() if not passes(name, command, silent)]
    if found := prose.complaints(ROOT):
        failed.append("prose")
        print("== prose", *found, sep="\n")
    print(
        f"lint: {', '.join(failed)} found something" if failed else "lint: nothing found",
        flush=True,
    )
    return 1 if failed else 0


def sources(folders: tuple[str, ...], *suffixes: str) -> list[str]:
    """Files of these kinds in these folders, relative to the root."""
    found = (
        path
        for folder in folders
        for suffix in suffixes
        for path in (ROOT / folder).rglob(f"*{suffix}")
    )
    return sorted(str(path.relative_to(ROOT)) for path in found)


def fprettify(*options: str) -> list[str]:
    """The formatter of Fortran on every source."""
    return [
        "fprettify",
        "-i",
        "3",
        "-l",
        "100",
        "--disable-whitespace",
        *options,
        *sources(("fortran", "tests/fortran"), ".f90"),
    ]


def fixes() -> list[list[str]]:
    """Commands that change files."""
    return [
        fprettify(),
        ["clang-format", "-i", *sources(("cpp",), ".cpp", ".h")],
        ["ruff", "check", "--fix", "--quiet", "."],
        ["ruff", "format", "--quiet", "."],
        ["shfmt", "-i", "2", "-w", *SHELL],
    ]


def checks() -> list[tuple[str, list[str], bool]]:
    """Name of each tool, its command, and whether any output means a fault (fprettify reports by a
    diff alone).
    """
    return [
        ("fprettify", fprettify("--diff"), True),
        ("fortitude", ["fortitude", "check", "--quiet", "fortran", "tests"], False),
        (
            "clang-format",
            ["clang-format", "--dry-run", "--Werror", *sources(("cpp",), ".cpp", ".h")],
            False,
        ),
        ("ruff check", ["ruff", "check", "--quiet", "."], False),
        ("ruff format", ["ruff", "format", "--diff", "--quiet", "."], False),
        ("mypy", ["mypy"], False),
        ("shfmt", ["shfmt", "-i", "2", "-d", *SHELL], False),
        ("shellcheck", ["shellcheck", *SHELL], False),
        ("codespell", ["codespell"], False),
    ]


def run(command: list[str]) -> subprocess.CompletedProcess:
    """Run a tool of the environment of this Python, at the root."""
    environment = os.environ | {"PATH": f"{Path(sys.executable).parent}:{os.environ['PATH']}"}
    try:
        return subprocess.run(
            command,
            cwd=ROOT,
            env=environment,
            stdin=subprocess.DEVNULL,
            capture_output=True,
            text=True,
        )
    except FileNotFoundError:
        sys.exit(
            f"lint: {command[0]} is missing; ./bayesindent dev lint installs it, as does pip "
            "install '.[dev]'"
        )


def passes(name: str, command: list[str], silent: bool) -> bool:
    """Whether this tool reports no fault; otherwise its output is shown."""
    done = run(command)
    said = (done.stdout + done.stderr).strip()
    good = done.returncode == 0 and not (silent and said)
    if not good:
        print(f"== {name}\n{said}")
    return good


if __name__ == "__main__":
    sys.exit(main())
