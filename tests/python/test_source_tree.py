"""The tool that runs the tests: what it counts, and what is left of a run that is killed."""

import json
import os
import signal
import subprocess
import sys
import time

import pytest

from support.programs import HANGS_S, with_tests
from support.tree import SOURCE
from tools import test as tool


def counted(cases) -> tuple[int, int, int]:
    outcomes = [case.outcome for case in cases]
    return tuple(outcomes.count(outcome) for outcome in ("passed", "failed", "skipped"))


@pytest.mark.parametrize(
    ("stdout", "result", "expected"),
    [
        ("ok 1 - a\nok 2 - b\n1..2\n", "OK", (2, 0, 0)),
        ("ok 1 - a\nnot ok 2 - b\n# because\nok 3 - c # SKIP no ccx\n1..3\n", "FAIL", (1, 1, 1)),
        ("ok 1 - a\n", "ERROR", (1, 1, 0)),  # crashed before the plan
        ("", "TIMEOUT", (0, 1, 0)),
        ("", "OK", (1, 0, 0)),  # no TAP: the program is the case
    ],
)
def test_counts_lines_of_tap(tmp_path, stdout, result, expected):
    entry = {
        "name": "unit - bayesindent:crystal",
        "stdout": stdout,
        "result": result,
        "duration": 1.5,
    }
    (tmp_path / "testlog.json").write_text(json.dumps(entry) + "\n")
    cases = list(tool.unit_cases(tmp_path / "testlog.json"))
    assert counted(cases) == expected
    assert sum(case.seconds for case in cases) == 1.5


def test_says_the_slowest_and_the_count_last(capsys, tmp_path, monkeypatch):
    monkeypatch.delenv("BAYESINDENT_STRICT", raising=False)
    file = tmp_path / "not-checked.txt"
    cases = [tool.Case("passed", float(number), f"case {number}") for number in range(12)] + [
        tool.Case("skipped", 0.5, "skipped", "there is no ccx")
    ]
    assert tool.conclude(cases, True, file) == 0
    lines = capsys.readouterr().out.splitlines()
    assert lines[1:11] == [f"{number:7.1f} s  case {number}" for number in range(11, 1, -1)]
    assert lines[-2:] == [
        "not checked: skipped: there is no ccx",
        "12 passed, 0 failed, 1 skipped",
    ]
    assert file.read_text() == "skipped: there is no ccx\n"
    assert tool.conclude([*cases, tool.Case("failed", 1.0, "bad")], True, file) == 1
    assert tool.conclude(cases, False, file) == 1
    assert capsys.readouterr().out.splitlines()[-1] == "12 passed, 1 failed, 1 skipped"
    assert tool.conclude([], True, file) == 1
    monkeypatch.setenv("BAYESINDENT_STRICT", "1")
    assert tool.conclude(cases, True, file) == 1
    assert tool.conclude(cases[:-1], True, file) == 0


EXAMPLE = """
import os, time
def test_good(): pass
def test_bad(): assert 0
def test_that_kills_its_worker(): os._exit(3)
def test_that_takes_for_ever(): time.sleep(3600)
"""


def test_a_run_that_is_killed_leaves_its_results(tmp_path):
    (tmp_path / "test_example.py").write_text(EXAMPLE)
    (tmp_path / "conftest.py").write_text((SOURCE / "tests" / "conftest.py").read_text())
    command = [
        sys.executable,
        "-m",
        "pytest",
        "-n",
        "1",
        "-p",
        "no:cacheprovider",
        "--cases=cases.txt",
        ".",
    ]
    environment = {
        name: value for name, value in with_tests().items() if not name.startswith("PYTEST")
    }
    process = subprocess.Popen(
        command, cwd=tmp_path, env=environment, stdout=subprocess.DEVNULL, start_new_session=True
    )
    file, deadline = tmp_path / "cases.txt", time.monotonic() + HANGS_S
    while not (file.exists() and file.read_text().count("\n") == 3) and time.monotonic() < deadline:
        time.sleep(0.05)
    os.killpg(process.pid, signal.SIGKILL)
    process.wait()
    cases = list(tool.pytest_cases(file))
    assert {case.name.rpartition("::")[-1]: case.outcome for case in cases} == {
        "test_good": "passed",
        "test_bad": "failed",
        "test_that_kills_its_worker": "failed",
    }
