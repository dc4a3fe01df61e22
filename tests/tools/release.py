"""Everything that a release consists of, in dist/: the source distribution, a wheel made from it,
the documentation, a recipe for conda, the citation of this version, and checksums.

`--check` then looks into each file, follows the links of the documentation, and tries the wheel on
a bare Debian (as root, with debootstrap). Nothing is uploaded.
"""

import argparse
import datetime
import hashlib
import re
import subprocess
import sys
import tarfile
import tempfile
import zipfile
from html.parser import HTMLParser
from pathlib import Path
from urllib.parse import unquote, urlsplit

from tools import bare_system, docs, wheel

ROOT = Path(__file__).parents[2]
DIST = ROOT / "dist"
#: What a source distribution must have, and what it must not.
NEEDED = ("LICENSE", "README.md", "meson.build", "pyproject.toml", "docs/namelists.md")
UNWANTED = (".git/", ".venv/", "build/", "runs/", "dist/")


def main(argv: list[str] | None = None) -> int:
    """Make the files, check them if that is asked for, and print their names and faults."""
    parser = argparse.ArgumentParser(
        prog="bayesindent dev release",
        description=__doc__,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    parser.add_argument("--check", action="store_true", help="check what was made")
    parser.add_argument("--no-gallery", action="store_true", help="run no script of the gallery")
    parser.add_argument(
        "--system",
        metavar="DIR",
        type=Path,
        help="a Debian that debootstrap made before, of which a copy is used",
    )
    arguments = parser.parse_args(argv)
    found = faults_of_sources()
    files = make(not arguments.no_gallery)
    print(*(file.relative_to(ROOT) for file in files), sep="\n", flush=True)
    if arguments.check:
        found += faults_of_archive(files[0]) + faults_of_wheel(files[1])
        found += faults_of_site(docs.SITE)
        if not found:
            bare_system.try_wheel(files[1], arguments.system)
    print(*(f"fault: {fault}" for fault in found), sep="\n")
    print("release: faults" if found else "release: no fault found", flush=True)
    return 1 if found else 0


def version() -> str:
    """The version, whose only place is meson.build."""
    return re.findall(r"version: '([\d.]+)'", (ROOT / "meson.build").read_text())[0]


def faults_of_sources() -> list[str]:
    """What is missing before a release can be made."""
    found = []
    if f"\n## {version()}\n" not in (ROOT / "CHANGELOG.md").read_text(encoding="utf-8"):
        found.append(f"CHANGELOG.md: there is no heading of {version()}")
    changed = wheel.output("git", "-C", ROOT, "status", "--porcelain")
    if changed:
        found.append(f"files that are not committed: {changed}")
    return found


def make(gallery: bool) -> list[Path]:
    """Make the files of a release: sources, wheel, documentation, recipe, citation, checksums."""
    DIST.mkdir(exist_ok=True)
    command: list[str | Path] = [
        *(sys.executable, "-m", "build", "--sdist", "--outdir"),
        *(DIST, ROOT),
    ]
    subprocess.run(command, check=True, stdout=subprocess.DEVNULL)
    sources = DIST / f"bayesindent-{version()}.tar.gz"
    with tempfile.TemporaryDirectory() as folder:
        subprocess.run(["tar", "--extract", "--file", sources, "--directory", folder], check=True)
        made = wheel.make(sys.executable, Path(folder, "wheel"), next(Path(folder).iterdir()))
    if docs.build(docs.SITE, gallery).returncode:
        sys.exit("the documentation cannot be built")
    site = DIST / f"bayesindent-{version()}-docs.tar.gz"
    with tarfile.open(site, "w:gz") as archive:
        archive.add(docs.SITE, f"bayesindent-{version()}-docs")
    others = {"meta.yaml": recipe(sources), "CITATION.cff": citation(datetime.date.today())}
    files = [sources, made, site]
    for name, text in others.items():
        (DIST / name).write_text(text, encoding="utf-8")
        files.append(DIST / name)
    sums = DIST / "SHA256SUMS"
    sums.write_text("".join(f"{digest(file)}  {file.name}\n" for file in files))
    return [*files, sums]


def digest(file: Path) -> str:
    """The SHA-256 of a file."""
    return hashlib.sha256(file.read_bytes()).hexdigest()


def recipe(sources: Path) -> str:
    """The recipe of conda with the released sources in place of this folder. Its address is where
    the archive is published.
    """
    text = (ROOT / "conda" / "meta.yaml").read_text(encoding="utf-8")
    text = re.sub(r"\{% set version = .*? %\}", f'{{% set version = "{version()}" %}}', text)
    released = f"source:\n  url: {sources.name}\n  sha256: {digest(sources)}\n"
    return text.replace("source:\n  path: ..\n", released)


def citation(day: datetime.date) -> str:
    """CITATION.cff with the version and the day of its release."""
    text = (ROOT / "CITATION.cff").read_text(encoding="utf-8")
    return text.replace(
        "type: software\n", f"type: software\nversion: {version()}\ndate-released: {day}\n"
    )


def faults_of_archive(file: Path) -> list[str]:
    """What a source distribution lacks or should not have."""
    with tarfile.open(file) as archive:
        names = [name.partition("/")[2] for name in archive.getnames()]
    found = [f"{file.name}: {name} is missing" for name in NEEDED if name not in names]
    return found + [f"{file.name}: has {name}" for name in names if name.startswith(UNWANTED)]


def faults_of_wheel(file: Path) -> list[str]:
    """Licences, versions and the bill of materials of a wheel."""
    with zipfile.ZipFile(file) as archive:
        texts = {name: archive.read(name) for name in archive.namelist() if ".dist-info/" in name}
        libraries = [name for name in archive.namelist() if ".libs/" in name]
    metadata = next(text for name, text in texts.items() if name.endswith("/METADATA")).decode()
    expected = {
        f"Version: {version()}": metadata,
        "License-Expression: GPL-3.0-or-later": metadata,
        "Description-Content-Type: text/markdown": metadata,
        "/licenses/LICENSE": "\n".join(texts),
        "/sboms/libraries.cdx.json": "\n".join(texts),
        "libopenblas": "\n".join(libraries),
    }
    return [f"{file.name}: lacks {part}" for part, text in expected.items() if part not in text]


class Links(HTMLParser):
    """The targets of a page's links and pictures, and the places that links can name."""

    def __init__(self) -> None:
        super().__init__()
        self.targets: list[str] = []
        self.places: set[str] = set()

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        """Note where a tag points to, and its own name."""
        for name, value in attrs:
            if name in ("href", "src") and value:
                self.targets.append(value)
            elif name == "id" and value:
                self.places.add(value)


def faults_of_site(site: Path) -> list[str]:
    """Links within the site that lead nowhere."""
    pages: dict[Path, Links] = {}
    for page in site.rglob("*.html"):
        pages[page.resolve()] = links = Links()
        links.feed(page.read_text(encoding="utf-8"))
    found = []
    for page, links in pages.items():
        for target in links.targets:
            parts = urlsplit(target)
            if parts.scheme or parts.netloc:
                continue
            file = (page.parent / unquote(parts.path)).resolve() if parts.path else page
            place = unquote(parts.fragment)
            lost = place and file in pages and place not in pages[file].places
            if not file.exists() or lost:
                found.append(f"{page.relative_to(site.resolve())}: {target} leads nowhere")
    return sorted(set(found))


if __name__ == "__main__":
    sys.exit(main())
