"""The batch program: arguments, exit status, and the same verdict on a file as the Python program."""

import os
import subprocess
from pathlib import Path

import pytest

from conftest import SOURCE

PROGRAM = Path(os.environ.get("BAYESINDENT_BUILD", SOURCE / "build")) / "fortran" / "bayesindent-batch"
BAD = [path for path in sorted((SOURCE / "inputs" / "bad").glob("*.nml")) if "\n! command: " not in path.read_text()]


@pytest.fixture
def batch(tmp_path):
    """`batch(*arguments)` in an empty folder gives the finished process."""

    def run(*arguments) -> subprocess.CompletedProcess:
        return subprocess.run([PROGRAM, *map(str, arguments)], cwd=tmp_path, capture_output=True, text=True, stdin=subprocess.DEVNULL)

    return run


def test_help_and_version(batch):
    done = batch("--help")
    assert (done.returncode, done.stderr) == (0, "")
    assert done.stdout.startswith("usage: bayesindent-batch FILE.nml")
    done = batch("--version")
    assert done.returncode == 0
    assert done.stdout.startswith("bayesindent-batch 0.")


@pytest.mark.parametrize("arguments", [(), ("--unknown",), ("a.nml", "b.nml"), ("a.nml", "--output")])
def test_wrong_usage_exits_2(batch, arguments):
    done = batch(*arguments)
    assert done.returncode == 2
    assert done.stdout == ""
    assert "usage:" in done.stderr


@pytest.mark.parametrize("path", BAD, ids=lambda path: path.stem)
def test_bad_input_exits_2_with_one_line(batch, path):
    expected = path.read_text().splitlines()[0].removeprefix("! expect: ")
    done = batch(path)
    assert (done.returncode, done.stdout) == (2, "")
    assert done.stderr.startswith(f"{path}: {expected}")
    assert done.stderr.count("\n") == 1


@pytest.mark.parametrize("name", ["unstable", "nan", "unknown_variable", "missing_slash", "missing_file"])
def test_both_programs_say_the_same(batch, bayesindent, name):
    pytest.importorskip("bayesindent.stages")
    path = next(path for path in BAD if path.stem.endswith(name))
    done = bayesindent("run", path)
    assert (done.returncode, done.stdout) == (2, "")
    assert done.stderr == batch(path).stderr


def test_check_writes_nothing(batch, tmp_path):
    (tmp_path / "a.nml").write_text("&problem symmetry = 'cubic' /\n&design /\n")
    done = batch("a.nml", "--check")
    assert (done.returncode, done.stdout, done.stderr) == (0, "a.nml is right; it asks for: build\n", "")
    assert [path.name for path in tmp_path.iterdir()] == ["a.nml"]


def test_documentation_is_current(batch):
    page = SOURCE / "docs" / "namelists.md"
    assert page.read_text() == batch("--schema").stdout, "write it anew: bayesindent-batch --schema > docs/namelists.md"
