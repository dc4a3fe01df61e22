"""The command line: what it says, where, and its exit status.

Modules: __main__.py, command.py.
"""

import os
import re
import subprocess

import pytest

from bayesindent.program.commands import HELP, TOPICS
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
    "test",
    "dev",
)


def test_help_names_every_command(process):
    done = process("--help")
    assert done.returncode == 0
    for command in COMMANDS:
        assert re.search(rf"\n  {command}\s", done.stdout)


def test_help_fits_a_screen(process):
    """A terminal of 80 columns and 24 lines, with the prompt below."""
    lines = process("--help").stdout.splitlines()
    assert len(lines) <= 23
    assert max(map(len, lines)) <= 80


@pytest.mark.parametrize("topic", TOPICS)
def test_help_explains_topics(process, topic):
    assert topic in process("--help").stdout
    done = process("help", topic)
    assert (done.returncode, done.stdout.strip("\n")) == (0, HELP[topic])


@pytest.mark.parametrize(
    ("typed", "completed"),
    [
        ("bayesindent cur", ["curves"]),
        ("./bayesindent dev", ["dev"]),
        ("bayesindent help un", ["units"]),
        ("bayesindent extract --orient", ["--orientations"]),
        ("bayesindent extract ", []),
    ],
)
def test_completes_words_in_bash(process, typed, completed):
    words = " ".join(f"'{word}'" for word in typed.split(" "))
    script = process("completion").stdout + (
        f"\nCOMP_WORDS=({words}); COMP_CWORD={typed.count(' ')}; _bayesindent\n"
        'printf "%s\\n" "${COMPREPLY[@]}"'
    )
    done = subprocess.run(["bash", "-c", script], capture_output=True, text=True)
    assert (done.stdout.split(), done.stderr) == (completed, "")


def test_version(process):
    done = process("--version")
    assert done.returncode == 0
    assert done.stdout.startswith("bayesindent 1.")


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
    done = process("dev", "bench", "unknown", env=tree)
    assert (done.returncode, done.stdout) == (2, "")
    assert "invalid choice: 'unknown'" in done.stderr
    assert "--fix" in process("dev", "lint", "--help", env=tree).stdout
    for wrong in ("lint", "bench"):
        assert process(wrong, env=tree).returncode == 2
    done = process("dev", "lines", env=os.environ | {"BAYESINDENT_SOURCE": "."})
    assert done.returncode == 1
    assert "is no source tree of bayesindent; use ./bayesindent in one" in done.stderr
