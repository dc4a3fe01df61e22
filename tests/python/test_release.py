"""The tool that makes a release: what it writes, and what it finds."""

import datetime
import json
import tarfile
import zipfile

import pytest

from tools import release

yaml = pytest.importorskip("yaml")


def test_a_citation_has_the_version_and_the_day():
    cited = yaml.safe_load(release.citation(datetime.date(2026, 12, 1)))
    assert cited["version"] == release.version()
    assert str(cited["date-released"]) == "2026-12-01"


def test_the_recipe_of_conda_names_the_released_sources(tmp_path):
    sources = tmp_path / f"bayesindent-{release.version()}.tar.gz"
    sources.write_bytes(b"sources")
    text = release.recipe(sources)
    assert f'set version = "{release.version()}"' in text
    assert f"url: {sources.name}\n  sha256: {release.digest(sources)}\n" in text
    assert "path: .." not in text and "load_file" not in text


def test_finds_links_that_lead_nowhere(tmp_path):
    (tmp_path / "b.html").write_text('<h1 id="here">B</h1>')
    (tmp_path / "a.html").write_text(
        '<a href="b.html#here">good</a> <a href="b.html#there">lost</a> <a href="c.html">lost</a>'
        '<a href="https://example.org/x">elsewhere</a> <img src="none.png"> <a href="#top">lost</a>'
    )
    found = release.faults_of_site(tmp_path)
    assert [line.split()[1] for line in found] == ["#top", "b.html#there", "c.html", "none.png"]


def test_finds_what_archives_lack(tmp_path):
    wheel = tmp_path / "x.whl"
    with zipfile.ZipFile(wheel, "w") as archive:
        archive.writestr("x.dist-info/METADATA", f"Version: {release.version()}\n")
        archive.writestr("x.dist-info/sboms/libraries.cdx.json", json.dumps({}))
    lacks = [line.partition(" lacks ")[2] for line in release.faults_of_wheel(wheel)]
    assert lacks == [
        "License-Expression: GPL-3.0-or-later",
        "Description-Content-Type: text/markdown",
        "/licenses/LICENSE",
        "libopenblas",
    ]
    sources = tmp_path / "x.tar.gz"
    (tmp_path / "LICENSE").write_text("")
    with tarfile.open(sources, "w:gz") as archive:
        archive.add(tmp_path / "LICENSE", "x-1/LICENSE")
        archive.add(tmp_path / "LICENSE", "x-1/build/a.o")
    found = release.faults_of_archive(sources)
    assert "x.tar.gz: has build/a.o" in found and "x.tar.gz: README.md is missing" in found
    assert not any("LICENSE is" in line for line in found)
