"""The site is made without a warning, and the map of the house has all of it."""

import importlib.util
import re
import subprocess
import sys

import pytest

from conftest import SOURCE

DOCS = SOURCE / "docs"


def test_the_site_builds_without_a_warning(tmp_path):
    for needed in ("sphinx", "myst_parser", "furo"):
        pytest.importorskip(needed)
    command = [sys.executable, "-m", "sphinx", "--fail-on-warning", "--quiet", str(DOCS), str(tmp_path)]
    done = subprocess.run(command, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    assert (tmp_path / "searchindex.js").exists()


def test_the_map_has_every_folder_and_points_down(tmp_path, monkeypatch):
    monkeypatch.syspath_prepend(str(SOURCE / "tests" / "tools"))
    specification = importlib.util.spec_from_file_location("house", SOURCE / "tests" / "tools" / "house.py")
    house = importlib.util.module_from_spec(specification)
    specification.loader.exec_module(house)
    file = tmp_path / "house.svg"
    house.draw(SOURCE, file)
    svg = file.read_text()
    for folder in (SOURCE / "fortran").iterdir():
        if folder.is_dir():
            assert f">{folder.name} ({len(list(folder.glob('*.f90')))})<" in svg
    for start, end in re.findall(r'd="M\S+ (\S+) C.*? (\S+)" fill', svg):
        assert float(start) < float(end)
