"""tests/where.md: which test files exercise which source module.

PYTHONPATH=tests python -m tools.where     writes the page anew.

A module whose name is that of a test (`campaign.f90`, `test_campaign.f90`) needs no row. For all
others the sources are read: a test leads to the files that it uses, imports or names, to the stages
and commands that it runs, and these lead to further ones. Of the tests that lead to a module, a row
has those that name its file (`Modules:` in a docstring), that share a word with its name or folder,
and from which the fewest steps lead to it, at most two of each.
"""

import ast
import re
import sys
from collections.abc import Iterator
from functools import cache
from pathlib import Path

from tools.lines import statements

ROOT = Path(__file__).parents[2]
PAGE = ROOT / "tests" / "where.md"
HEAD = """# Where the tests of a module are

`PYTHONPATH=tests python -m tools.where` writes this table from the sources (`tests/tools/where.py`
explains how). A module that is missing here has a test of its own name. A test file may name
modules that it tests at the end of its docstring: `Modules: core.py, core.f90.`

| module | tests |
|---|---|
"""
#: The most test files of each sort in a row, and the most steps that still count as near.
EACH, NEAR = 2, 2
#: It reads all sources and tests none.
LEFT_OUT = "tests/python/test_sources.py"
PACKAGE = "python/bayesindent"
COMMANDS = f"{PACKAGE}/program/commands"


def main() -> int:
    """Write the page; name the modules to which no test leads."""
    rows = table(ROOT)
    lines = [f"| `{module}` | {quoted(tests)} |\n" for module, tests in rows.items()]
    PAGE.write_text(HEAD + "".join(lines), encoding="utf-8")
    lacking = [module for module, tests in rows.items() if not tests]
    print(
        f"{PAGE.relative_to(ROOT)}: {len(rows)} modules;",
        f"without a test: {', '.join(lacking) or 'none'}",
    )
    return 1 if lacking else 0


def quoted(names: list[str]) -> str:
    """Names as code of a page."""
    return ", ".join(f"`{name}`" for name in names)


@cache
def modules(root: Path) -> list[str]:
    """The source modules of the tree, without packages' `__init__.py`, relative to its root."""
    paths = [path for top in ("fortran", "cpp", "python") for path in (root / top).rglob("*")]
    kinds = (".f90", ".cpp", ".py")
    return sorted(
        name_of(root, path) for path in paths if path.suffix in kinds and path.name != "__init__.py"
    )


@cache
def test_files(root: Path) -> list[str]:
    """The files with tests, relative to the root."""
    paths = [path for path in (root / "tests").glob("*/test_*.*") if path.suffix in (".py", ".f90")]
    return sorted({name_of(root, path) for path in paths} - {LEFT_OUT})


def nameless(root: Path) -> list[str]:
    """Modules of whose name no test is."""
    names = {Path(test).stem.removeprefix("test_") for test in test_files(root)}
    return [module for module in modules(root) if Path(module).stem not in names]


def table(root: Path) -> dict[str, list[str]]:
    """The rows of the page."""
    steps = {test: steps_from(root, test) for test in test_files(root)}
    return {module: row(root, module, steps) for module in nameless(root)}


def row(root: Path, module: str, steps: dict[str, dict[str, int]]) -> list[str]:
    """The tests of a module, of all tests that lead to it."""
    reached = {test: found[module] for test, found in steps.items() if module in found}
    # Tests that use few files come first: they look at each of them more closely.
    order = sorted(reached, key=lambda test: (len(leads_to(root, test)), test))
    naming = [test for test in order if Path(module).name in (root / test).read_text()]
    likenesses = {test: likeness(test, module) for test in order}
    most = max(likenesses.values(), default=0)
    alike = [test for test in order if most and likenesses[test] == most]
    nearest = [test for test in order if reached[test] == min(reached.values())]
    chosen = naming[:EACH] + alike[:EACH]
    if not chosen or min(reached.values()) <= NEAR:
        chosen += nearest[:EACH]
    return list(dict.fromkeys(chosen))


def written_rows(page: Path) -> dict[str, list[str]]:
    """The rows of the page as it is written."""
    rows = {}
    for line in page.read_text(encoding="utf-8").splitlines():
        module, *tests = re.findall(r"`([^`]+)`", line) or [""]
        if line.startswith("| `"):
            rows[module] = tests
    return rows


def name_of(root: Path, path: Path) -> str:
    """A path relative to the root."""
    return path.relative_to(root).as_posix()


def likeness(test: str, module: str) -> int:
    """How much the name of a test has in common with that of a module (two a word) and of its
    folder (one a word).
    """
    words = words_of(Path(test).stem)
    return 2 * len(words & words_of(Path(module).stem)) + len(
        words & words_of(Path(module).parent.name)
    )


def words_of(name: str) -> set[str]:
    """The words of a name in the singular."""
    found = set()
    for word in name.removeprefix("test_").split("_"):
        found.add(re.sub("ies$", "y", word) if word.endswith("ies") else word.removesuffix("s"))
    return found


def steps_from(root: Path, test: str) -> dict[str, int]:
    """The number of steps to each file to which a test leads."""
    found, front = {test: 0}, [test]
    while front:
        following = []
        for name in front:
            for reached in sorted(leads_to(root, name)):
                if reached not in found:
                    found[reached] = found[name] + 1
                    following.append(reached)
        front = following
    return found


@cache
def leads_to(root: Path, name: str) -> frozenset[str]:
    """The files that one file uses, imports or names."""
    reader = {".f90": fortran_leads, ".py": python_leads, ".cpp": cpp_leads}[Path(name).suffix]
    return frozenset(reader(root, name)) - {name}


@cache
def homes(root: Path) -> dict[str, str]:
    """The file of each Fortran module, and of each procedure of C++ that Fortran calls."""
    found = {}
    for name in modules(root):
        if name.endswith(".f90"):
            found[Path(name).stem] = name
        elif name.endswith(".cpp"):
            found.update(
                dict.fromkeys(re.findall(r"\b(bayesindent_\w+)\(", (root / name).read_text()), name)
            )
    return found | {"settings_schema": "fortran/settings/settings_schema.py"}


def fortran_leads(root: Path, name: str) -> Iterator[str]:
    """Modules that Fortran uses, and procedures of C++ that it binds."""
    text = (root / name).read_text()
    used = [
        re.match(r"use\b(?:\s*,[^:]*)?(?:\s*::)?\s*(\w+)", line) for _, _, line in statements(text)
    ]
    names = [found[1] for found in used if found] + re.findall(r"name='(bayesindent_\w+)'", text)
    yield from (homes(root)[used] for used in names if used in homes(root))


def cpp_leads(root: Path, name: str) -> Iterator[str]:
    """Files of C++ that declare a class or procedure of the same header as this one."""
    headers = set(re.findall(r'#include "(\w+\.h)"', (root / name).read_text()))
    for path in (root / "cpp").glob("*.cpp"):
        if headers & set(re.findall(r'#include "(\w+\.h)"', path.read_text())):
            yield name_of(root, path)


def python_leads(root: Path, name: str) -> Iterator[str]:
    """Modules that Python imports, operations of the core, and stages and commands that a test
    names.
    """
    text = (root / name).read_text()
    tree = ast.parse(text)
    yield from imports(root, name, tree)
    yield from named_files(root, text)
    words = {
        node.value
        for node in ast.walk(tree)
        if isinstance(node, ast.Constant) and isinstance(node.value, str)
    }
    if name.startswith("tests/"):
        yield from named_by_tests(root, words)
        yield from attributes_of_package(root, tree)
    else:
        kinds = set(re.findall(r'^    kind = "(\w+)"', text, flags=re.MULTILINE))
        kinds |= {
            word.partition(".")[0] for word in words if re.fullmatch(r"[a-z]+\.[a-z_]+", word)
        }
        for path in (root / "fortran" / "facade").glob("*_operations.f90"):
            if (
                any(f"'{kind}'" in path.read_text() for kind in kinds)
                or path.stem.partition("_")[0] in kinds
            ):
                yield name_of(root, path)
        if kinds:
            yield "fortran/facade/operations.f90"


def named_files(root: Path, text: str) -> Iterator[str]:
    """Modules whose files a text names, and those of C++ whose procedures it names."""
    of_file = {Path(module).name: module for module in modules(root)}
    names = re.findall(r"\b\w+\.(?:f90|cpp|py)\b", text)
    yield from (of_file[name] for name in names if name in of_file)
    procedures = re.findall(r"\bbayesindent_\w+", text)
    yield from (homes(root)[name] for name in procedures if name in homes(root))


def imports(root: Path, name: str, tree: ast.Module) -> Iterator[str]:
    """Files of the package and of tests/ that Python imports."""
    for node in ast.walk(tree):
        if isinstance(node, ast.ImportFrom):
            level = node.level
            base = Path(name).parents[level - 1] if level else Path()
            yield from file_of(root, base, node.module or "", [alias.name for alias in node.names])
        elif isinstance(node, ast.Import):
            for alias in node.names:
                yield from file_of(root, Path(), alias.name, [])


def file_of(root: Path, base: Path, module: str, names: list[str]) -> Iterator[str]:
    """The file of a module, or of these names in a package."""
    path = Path(*module.split(".")) if module else Path()
    bases = [base] if base != Path() else [Path("python"), Path("tests")]
    for start in bases:
        candidates = [(start / path).with_suffix(".py") if module else start / "none.py"]
        candidates += [start / path / f"{name}.py" for name in [*names, "__init__"]]
        yield from (each.as_posix() for each in candidates if (root / each).is_file())


def named_by_tests(root: Path, words: set[str]) -> Iterator[str]:
    """Stages and commands whose names a test has as texts."""
    for word in words & stages(root):
        yield f"fortran/stages/{word}_stage.f90"
    for word in words & set(commands(root)):
        yield f"{COMMANDS}/{commands(root)[word]}.py"
    if any("bayesindent-batch" in word for word in words):
        yield "fortran/program/batch.f90"


@cache
def stages(root: Path) -> frozenset[str]:
    """Names of the stages."""
    return frozenset(
        path.stem.removesuffix("_stage")
        for path in (root / "fortran" / "stages").glob("*_stage.f90")
    )


@cache
def commands(root: Path) -> dict[str, str]:
    """Commands, and the modules that have them."""
    text = (root / PACKAGE / "program" / "help.txt").read_text()
    return dict(re.findall(r"^== ([a-z-]+) (\w+):", text, flags=re.MULTILINE))


def attributes_of_package(root: Path, tree: ast.Module) -> Iterator[str]:
    """Modules whose names a test takes from the package, as in `bi.extract`."""
    offered = ast.parse((root / PACKAGE / "interface.py").read_text())
    taken = {node.attr for node in ast.walk(tree) if isinstance(node, ast.Attribute)}
    for node in offered.body:
        if not isinstance(node, ast.ImportFrom) or not node.module:
            continue
        names = {alias.asname or alias.name for alias in node.names}
        if taken & names:
            yield from file_of(root, Path(PACKAGE), node.module, sorted(names))


if __name__ == "__main__":
    sys.exit(main())
