"""The command line: what it says, where, and its exit status.

Modules: __main__.py, command.py.
"""

import os
import re

import pytest

from support.tree import SOURCE

COMMANDS = (
    "init",
    "table",
    "map",
    "run",
    "simulate",
    "theory",
    "build",
    "plan",
    "curves",
    "predict",
    "extract",
    "next",
    "report",
    "compare",
    "bench",
    "test",
    "lint",
    "wheel",
    "docs",
    "lines",
)


def test_help_names_every_command(process):
    done = process("--help")
    assert done.returncode == 0
    for command in COMMANDS:
        assert re.search(rf"\n    {command}\s", done.stdout)
    assert "examples:" in done.stdout


def test_version(process):
    done = process("--version")
    assert done.returncode == 0
    assert done.stdout.startswith("bayesindent 0.")


@pytest.mark.parametrize(
    "arguments", [("--unknown",), ("unknown",), ("run",), ("predict", "--surrogate", "halfspace")]
)
def test_wrong_usage_exits_2(process, arguments):
    done = process(*arguments)
    assert done.returncode == 2
    assert done.stdout == ""
    assert "usage:" in done.stderr


def test_tools_of_the_source_tree_take_options_of_their_own(process):
    tree = os.environ | {"BAYESINDENT_SOURCE": str(SOURCE)}
    done = process("bench", "unknown", env=tree)
    assert (done.returncode, done.stdout) == (2, "")
    assert "invalid choice: 'unknown'" in done.stderr
    assert "--fix" in process("lint", "--help", env=tree).stdout
    done = process("lines", env=os.environ | {"BAYESINDENT_SOURCE": "."})
    assert done.returncode == 1
    assert "is no source tree of bayesindent; use ./bayesindent in one" in done.stderr
