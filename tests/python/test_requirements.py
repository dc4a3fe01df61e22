"""The exact versions of requirements/ are those that pyproject.toml allows, each with hashes."""

import re

import pytest
from packaging.requirements import Requirement

from support.tree import SOURCE

tomllib = pytest.importorskip("tomllib")
FOLDER = SOURCE / "requirements"
SETTINGS = tomllib.loads((SOURCE / "pyproject.toml").read_text())
ASKED = {
    "build": SETTINGS["build-system"]["requires"],
    "run": SETTINGS["project"]["dependencies"],
    **SETTINGS["project"]["optional-dependencies"],
}


def plain(name: str) -> str:
    """The name of a package as indices have it."""
    return re.sub(r"[-_.]+", "-", name).lower()


def pinned(*names: str) -> dict[str, list[str]]:
    """Versions of each package in these files."""
    versions: dict[str, list[str]] = {}
    for name in names:
        lines = (FOLDER / f"{name}.txt").read_text()
        for package, version in re.findall(r"^([\w.-]+)==([\w.]+)", lines, re.MULTILINE):
            versions.setdefault(plain(package), []).append(version)
    return versions


@pytest.mark.parametrize("name", ASKED)
def test_what_is_asked_for_is_there_within_its_bounds(name):
    versions = pinned("run", name) if name != "build" else pinned("build")
    for text in ASKED[name]:
        wanted = Requirement(text)
        assert all(wanted.specifier.contains(version) for version in versions[plain(wanted.name)])


@pytest.mark.parametrize("name", ASKED)
def test_each_package_has_hashes(name):
    blocks = re.split(r"^(?=\w)", (FOLDER / f"{name}.txt").read_text(), flags=re.MULTILINE)[1:]
    assert len(blocks) >= len(pinned(name))
    assert all(
        re.search(r"^    --hash=sha256:[0-9a-f]{64}", block, re.MULTILINE) for block in blocks
    )


def test_files_agree():
    """A package of two files has the same versions in both: pip refuses others."""
    versions = [pinned(name) for name in ASKED]
    for first in versions:
        for second in versions:
            assert all(first[package] == second[package] for package in first.keys() & second)
