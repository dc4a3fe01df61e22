"""Counting the cases of the tests, of both kinds of report."""

import sys

import pytest

from conftest import SOURCE

sys.path.insert(0, str(SOURCE / "tests" / "tools"))
from cases import count_cases

JUNIT = '<testsuites><testsuite name="pytest" errors="{errors}" failures="{failures}" skipped="{skipped}" tests="{tests}"/></testsuites>'


def counted(entry, logs, **report):
    if report:
        (logs / "python.junit.xml").write_text(JUNIT.format(**report))
    count = count_cases(entry, logs)
    return count["passed"], count["failed"], count["skipped"]


@pytest.mark.parametrize(
    ("stdout", "result", "expected"),
    [
        ("ok 1 - a\nok 2 - b\n1..2\n", "OK", (2, 0, 0)),
        ("ok 1 - a\nnot ok 2 - b\n# because\nok 3 - c # SKIP no ccx\n1..3\n", "FAIL", (1, 1, 1)),
        ("ok 1 - a\n", "ERROR", (1, 1, 0)),  # crashed before the plan
        ("", "TIMEOUT", (0, 1, 0)),
        ("okay, a line that is no case\n", "OK", (1, 0, 0)),  # no TAP: the program is the case
        ("", "SKIP", (0, 0, 1)),
    ],
)
def test_tap(tmp_path, stdout, result, expected):
    assert counted({"name": "unit - bayesindent:crystal", "stdout": stdout, "result": result}, tmp_path) == expected


def test_pytest(tmp_path):
    entry = {"name": "python - bayesindent:python", "stdout": "....", "result": "OK"}
    assert counted(entry, tmp_path, errors=0, failures=0, skipped=2, tests=36) == (34, 0, 2)
    entry["result"] = "FAIL"
    assert counted(entry, tmp_path, errors=1, failures=3, skipped=0, tests=36) == (32, 4, 0)
    assert counted(entry, tmp_path, errors=0, failures=0, skipped=0, tests=36) == (36, 1, 0)
