"""Rules of the Fortran sources that no compiler checks."""

import re

import pytest

from conftest import SOURCE

LIBRARY = [path for path in sorted((SOURCE / "fortran").rglob("*.f90")) if path.parent.name != "program"]


def statements(path):
    """Lines without comments and texts."""
    for line in path.read_text().splitlines():
        yield re.sub(r"!.*", "", re.sub(r"'[^']*'|\"[^\"]*\"", "''", line)).strip().lower()


@pytest.mark.parametrize("path", LIBRARY, ids=lambda path: path.stem)
def test_the_library_neither_stops_nor_prints(path):
    # One `error stop` would end the Python process.
    for statement in statements(path):
        assert not re.match(r"(.*\)\s*)?(error\s+)?stop\b", statement), statement
        assert not re.match(r"(.*\)\s*)?print\b", statement), statement
        assert not re.match(r"(.*\)\s*)?write\s*\(\s*\*", statement), statement


@pytest.mark.parametrize("path", [path for path in LIBRARY if path.parent.name != "facade"], ids=lambda path: path.stem)
def test_a_file_is_the_module_of_its_name(path):
    lines = list(statements(path))
    assert [line for line in lines if re.match(r"module (?!procedure)\w", line)] == [f"module {path.stem}"]
    assert "implicit none" in lines
    assert "private" in lines


@pytest.mark.parametrize("path", sorted((SOURCE / "fortran" / "facade").glob("*.f90")), ids=lambda path: path.stem)
def test_the_facade_gives_up_the_lock(path):
    text = path.read_text()
    procedures = re.findall(r"^subroutine \w+.*?^end subroutine", text, flags=re.M | re.S)
    assert procedures
    for procedure in procedures:
        assert "!f2py threadsafe" in procedure, procedure.splitlines()[0]
