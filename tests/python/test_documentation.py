"""Links of the documentation resolve, the commands and files that pages name exist, and the site is made without a warning."""

import importlib.util
import re
import subprocess
import sys

import pytest

from conftest import SOURCE

DOCS = SOURCE / "docs"
PAGES = [SOURCE / "README.md", SOURCE / "CONTRIBUTING.md", SOURCE / "CHANGELOG.md", *sorted(DOCS.rglob("*.md"))]


def relative(path):
    return str(path.relative_to(SOURCE))


def prose(path):
    """A page without its blocks of code."""
    return re.sub(r"^```.*?^```", "", path.read_text(), flags=re.M | re.S)


def anchors(path):
    """What a link may name in a page: its headings as GitHub and MyST spell them."""
    headings = re.findall(r"^#+ (.*)$", prose(path), flags=re.M)
    return {re.sub(r"[^\w\- ]", "", heading.lower()).replace(" ", "-") for heading in headings}


@pytest.mark.parametrize("page", PAGES, ids=relative)
def test_links_resolve(page):
    wrong = []
    for target in re.findall(r"\]\(([^)\s]+)\)", re.sub(r"`[^`]*`", "", prose(page))):
        if re.match(r"[a-z]+:", target):
            continue
        name, _, anchor = target.partition("#")
        file = page.parent / name if name else page
        # The map is drawn where the site is made.
        drawn = name == "figures/house.svg"
        if not (file.exists() or drawn) or (anchor and anchor not in anchors(file)):
            wrong.append(target)
    assert not wrong


def test_commands_that_pages_name_exist():
    known = {path.stem.removeprefix("bench_") for path in (SOURCE / "tests" / "benchmarks").glob("bench_*.py")}
    for page in PAGES:
        assert set(re.findall(r"`(?:\./bayesindent )?bench (\w+)", page.read_text())) <= known | {"NAME"}, page
        for file in re.findall(r"`((?:tests|inputs|python|fortran|cpp|docs|conda)/[\w./]+\w)`", page.read_text()):
            assert re.search("NAME|_X", file) or (SOURCE / file).exists(), f"{relative(page)}: {file}"


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
