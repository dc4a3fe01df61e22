"""Nothing that a command did not make is replaced: names of output files stay in the output folder,
and simulations stay.
"""

import os
import shutil
import subprocess
import sys

import pytest

from support.campaigns import count_rows

NAMELIST = """\
&problem symmetry = 'cubic' /
&simulation simulator = 'theory' /
&domain c_min = 50, 40, 15, c_max = 250, 150, 120, anisotropy_cap = 7.2 /
&surrogate degree = 2, bandlimit = 4, file = '{}' /
&design n_candidates = 50, budget = 9 /
"""


@pytest.fixture(scope="module")
def first(tmp_path_factory):
    """A campaign of nine simulations in out/, and a copy of it in a folder beside."""
    folder = tmp_path_factory.mktemp("first")
    (folder / "a.nml").write_text(NAMELIST.format("mine.txt"))
    subprocess.run(
        [sys.executable, "-m", "bayesindent", "build", "a.nml", "--output", "out"],
        cwd=folder,
        env=os.environ,
        check=True,
    )
    (folder / "other").mkdir()
    shutil.copy(folder / "out" / "campaign.sqlite", folder / "other" / "file")
    return folder


@pytest.fixture
def built(first, tmp_path):
    """The same anew."""
    shutil.copytree(first, tmp_path, dirs_exist_ok=True)
    return tmp_path


NAMES = [
    "campaign.sqlite",
    "../other/file",
    "../other/new.txt",
    "{folder}/other/file",
    "resolved.nml",
    "inputs.json",
    "../out/campaign.sqlite",
]


@pytest.mark.parametrize("name", NAMES)
def test_a_surrogate_replaces_nothing_else(bayesindent, built, name):
    before = {
        path: path.read_bytes()
        for path in built.rglob("*")
        if path.name not in ("a.nml", "run.log") and path.is_file()
    }
    (built / "a.nml").write_text(NAMELIST.format(name.format(folder=built)))
    for command in (["run", "--check"], ["build"]):
        done = bayesindent(*command, "a.nml", "--output", "out")
        assert done.returncode == 2
        (line,) = done.stderr.splitlines()
        assert line.startswith("a.nml: &surrogate file: ")
        assert (
            count_rows(built / "out" / "campaign.sqlite")
            == count_rows(built / "other" / "file")
            == 9
        )
        kept = {
            path: path.read_bytes()
            for path in built.rglob("*")
            if path.name not in ("a.nml", "run.log") and path.is_file()
        }
        assert {
            path for path in before.keys() | kept.keys() if before.get(path) != kept.get(path)
        } <= {built / "out" / name for name in ("resolved.nml", "inputs.json")}


def test_a_file_that_is_no_surrogate_is_not_replaced(bayesindent, built):
    (built / "out" / "notes.txt").write_text("mine")
    (built / "a.nml").write_text(NAMELIST.format("notes.txt"))
    done = bayesindent("build", "a.nml", "--output", "out")
    assert done.returncode == 2
    assert "notes.txt" in done.stderr
    assert (built / "out" / "notes.txt").read_text() == "mine"


def test_its_own_surrogate_is_replaced(bayesindent, built):
    (built / "a.nml").write_text(NAMELIST.format("mine.txt").replace("budget = 9", "budget = 11"))
    done = bayesindent("build", "a.nml", "--output", "out")
    assert done.returncode == 0, done.stderr
    assert count_rows(built / "out" / "campaign.sqlite") == 11
