"""The site is made without a warning, and the map of the house has all of it."""

import re

import pytest

from support.tree import SOURCE
from tools import docs, house, release


def test_the_site_builds_without_a_warning(tmp_path):
    for needed in ("sphinx", "myst_parser", "furo", "sphinx_gallery"):
        pytest.importorskip(needed)
    done = docs.build(tmp_path, False, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    assert (tmp_path / "searchindex.js").exists()
    assert release.faults_of_site(tmp_path) == []
    # Each script of the gallery has a page with the script and a notebook.
    for script in (SOURCE / "docs" / "gallery").glob("*.py"):
        assert (tmp_path / "examples" / f"{script.stem}.html").exists()
        for suffix in (".py", ".ipynb"):
            assert list((tmp_path / "_downloads").rglob(script.stem + suffix))


def test_the_map_has_every_folder_and_points_down(tmp_path):
    file = tmp_path / "house.svg"
    house.draw(SOURCE, file)
    svg = file.read_text()
    for folder in (SOURCE / "fortran").iterdir():
        if folder.is_dir():
            assert f">{folder.name} ({len(list(folder.glob('*.f90')))})<" in svg
    for start, end in re.findall(r'd="M\S+ (\S+) C.*? (\S+)" fill', svg):
        assert float(start) < float(end)
