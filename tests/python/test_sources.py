"""Rules of the sources that no compiler checks."""

import re
import sys

import pytest

from conftest import SOURCE

sys.path.insert(0, str(SOURCE / "tests" / "tools"))
import lines

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


#: What is still above a limit: this list only shrinks.
ABOVE = {
    "Indentation.add", "__init__", "add", "basis_terms", "calibration_new", "calibration_sample", "choose_measurements",
    "coefficient_prior", "cpp/sparse_cholesky.cpp", "domain_ranges", "extract", "fortran/inference/constants_posterior.f90",
    "fortran/inference/samplers.f90", "fortran/settings/problem.f90", "indentation_mesh", "indentation_new", "indentation_run",
    "next_choice", "python/bayesindent/inference/extract.py",
    "surrogate_header", "surrogate_inflation",
    "surrogate_new", "tests/python/test_inference.py",
}  # fmt: skip


def test_nothing_is_too_large():
    lines_allowed = {"file": 500, "class": 250}
    for part in lines.parts(SOURCE, "fortran", "cpp", "python", "tests"):
        if part.name not in ABOVE:
            assert part.lines <= lines_allowed.get(part.kind, 500), part
            assert part.arguments <= 10, part


def test_counts_the_lines_and_parts_of_each_language(tmp_path):
    """The counter itself: what it takes for code, a class, a procedure and an argument."""
    for folder in ("fortran/a", "cpp", "python"):
        (tmp_path / folder).mkdir(parents=True)
    (tmp_path / "fortran/a/m.f90").write_text(
        "module m\n!> comment\n\n   type, abstract :: t_type\n   contains\n      procedure(f), deferred :: f\n   end type\n"
        "   interface\n      subroutine dgemm(a, b, c)\n      end subroutine dgemm\n   end interface\ncontains\n"
        "   pure real(wp) function f(x, & ! first\n      & y) result(r)\n      r = x('end function', y)\n   end function f\nend module m\n"
    )
    (tmp_path / "cpp/c.cpp").write_text(
        "// comment\nclass box {\npublic:\n  box(int a, int b) : n{a} { n += b; }\n};\nint f(const int *x,\n      int y) {\n  if (y) { return 1; }\n  return g(1, 2, 3);\n}\n"
    )
    (tmp_path / "python/p.py").write_text(
        '"""Text."""\n\n# comment\nclass C:\n    @staticmethod\n    def f(self, a, *, b=1):\n        return a\n'
    )
    assert lines.count_lines(tmp_path) == {"fortran/a": 15, "cpp": 9, "python": 5}
    found = {(part.kind, part.name, part.lines, part.arguments) for part in lines.parts(tmp_path) if part.kind != "file"}
    assert found == {
        ("class", "t_type", 4, 0),
        ("procedure", "f", 4, 2),
        ("class", "box", 4, 0),
        ("procedure", "box", 1, 2),
        ("procedure", "f", 5, 2),
        ("class", "C", 4, 0),
        ("procedure", "f", 3, 2),
    }
