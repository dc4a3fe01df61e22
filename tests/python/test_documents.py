"""What the documents name is there: links, files, modules, benchmarks."""

import re

import pytest

from benchmarks import bench_simulate
from support.diagnostics import ROWS, filled
from support.tree import SOURCE

PAGES = [*sorted(SOURCE.glob("*.md")), *sorted((SOURCE / "docs").rglob("*.md"))]
#: Drawn where the site is made.
MAP = "figures/house.svg"
TOP = ("fortran", "cpp", "python", "tests", "inputs", "docs", ".ci")


def relative(path):
    return str(path.relative_to(SOURCE))


def anchors(page):
    """Headings as links name them."""
    headings = re.findall(r"^#+ (.*)$", page.read_text(), flags=re.M)
    return {re.sub(r"[^\w\- ]", "", heading.lower()).replace(" ", "-") for heading in headings}


@pytest.mark.parametrize("page", PAGES, ids=relative)
def test_links_lead_somewhere(page):
    prose = re.sub(r"`[^`]*`", "", re.sub(r"^```.*?^```", "", page.read_text(), flags=re.M | re.S))
    for target in re.findall(r"\]\(([^)\s]+)\)", prose):
        if re.match("[a-z]+:", target) or target == MAP:
            continue
        path, _, anchor = target.partition("#")
        linked = page.parent / path if path else page
        assert linked.exists(), target
        assert not anchor or anchor in anchors(linked), target


@pytest.mark.parametrize("page", PAGES, ids=relative)
def test_files_that_are_named_exist(page):
    # Capitals stand for what a reader chooses: `bench_NAME.py`.
    for name in re.findall(
        rf"(?:^|[\s`(])((?:{'|'.join(map(re.escape, TOP))})/[\w./-]*\w/?)",
        page.read_text(),
        flags=re.M,
    ):
        if not re.search(r"[A-Z]{2}|\bX\b|_X\.", name):
            assert (SOURCE / name).exists(), name


@pytest.mark.parametrize("page", PAGES, ids=relative)
def test_benchmarks_that_are_named_exist(page):
    for name, words in re.findall(r"bench ([a-z]+)((?: [a-z]+)*)", page.read_text()):
        file = SOURCE / "tests" / "benchmarks" / f"bench_{name}.py"
        # As tests/tools/bench.py calls it.
        assert file.exists() and "\ndef main(argv=None)" in file.read_text(), name
        if name == "simulate" and words:
            assert set(words.split()) <= {*bench_simulate.SECTIONS}, words


@pytest.mark.parametrize("page", [page for page in PAGES if page.stem != "equations"], ids=relative)
def test_a_table_of_numbers_says_where_they_come_from(page):
    """A command, test or file, in the section of the table or above the first one."""
    number = (
        r"\**[-+<>≤]?\d[\d.,]*(e[-+]?\d+)?( ?(\.\.|to|±) ?[\d.,]+)?( ?(%|GPa|s|ms|MB|kB|×|µs))?\**"
    )
    named = (
        r"bench [a-z]+|bayesindent(-batch)? "
        r"(--schema|dev wheel|reproduce|run|build|extract|test)|(tests|inputs)/[\w./]+|test_\w+"
    )
    opening, *sections = re.split(r"(?m)^(?=##)", page.read_text())
    for section in (opening, *sections):
        cells = [
            cell.strip()
            for row in section.splitlines()
            if row.startswith("|")
            for cell in row.split("|")
        ]
        if sum(bool(re.fullmatch(number, cell)) for cell in cells) > 3:
            assert re.search(named, opening + section), section.partition("\n")[0]


def test_modules_of_the_architecture_exist():
    text = (SOURCE / "docs" / "architecture.md").read_text().split("## Contracts")[0]
    package = SOURCE / "python" / "bayesindent"
    checked = 0
    for row in text.splitlines():
        if not row.startswith("|"):
            continue
        folders, *_, modules = (re.findall(r"`([\w./]+)`", cell) for cell in row.split("|")[1:-1])
        # The first table names folders of the tree, the second those of the package.
        places = [SOURCE / name if (SOURCE / name).is_dir() else package / name for name in folders]
        assert all(place.is_dir() for place in places), folders
        # The first row of the second table is of the package itself.
        places = places or [package]
        for module in modules:
            assert any(
                (place / module).exists() or [*place.glob(f"{module}.*")]
                for place in (*places, SOURCE)
            ), f"{folders}: {module}"
            checked += 1
    assert checked > 80


def test_every_folder_of_the_core_is_in_the_architecture():
    text = (SOURCE / "docs" / "architecture.md").read_text()
    for folder in sorted(path for path in (SOURCE / "fortran").iterdir() if path.is_dir()):
        assert f"| `fortran/{folder.name}/` |" in text, folder.name


def test_every_diagnostic_has_an_example(monkeypatch):
    """For the page on what can go wrong."""
    monkeypatch.syspath_prepend(SOURCE / "docs")
    from warning_examples import EXAMPLES

    assert {*EXAMPLES} == {*ROWS}
    for code, (done, subject, numbers) in EXAMPLES.items():
        names = [name for name in ROWS[code]["numbers"].split(", ") if name]
        text = filled(code, subject, dict(zip(names, numbers, strict=True)))["text"]
        assert done.endswith(".") and text
        assert bool(subject) == ("{subject" in ROWS[code]["sentence"] + ROWS[code]["remedy"]), code
