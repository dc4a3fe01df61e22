"""Rules of the sources that no compiler checks."""

import ast
import dataclasses
import inspect
import re

import pytest

import bayesindent
from support.tree import SOURCE
from tools import arguments, lines, prose, tokens, where

FORTRAN = sorted((SOURCE / "fortran").rglob("*.f90"))
LIBRARY = [path for path in FORTRAN if path.parent.name != "program"]
PYTHON = sorted((SOURCE / "python").rglob("*.py"))

#: Each folder may use those before it; Python's sub-packages bear the same names.
LAYERS = (
    "common",
    "engines",
    "crystal",
    "lab",
    "settings",
    "observables",
    "tables",
    "problem",
    "theory",
    "curves",
    "fe",
    "simulation",
    "surrogate",
    "inference",
    "rivals",
    "campaign",
    "analysis",
    "training",
    "documents",
    "stages",
    "report",
    "facade",
    "program",
)


def relative(path):
    return str(path.relative_to(SOURCE))


def statements(path):
    """Statements of Fortran without comments and texts."""
    return [statement for _, _, statement in lines.statements(path.read_text())]


@pytest.mark.parametrize("path", LIBRARY, ids=relative)
def test_the_library_neither_stops_nor_prints(path):
    # One `error stop` would end the Python process.
    for statement in statements(path):
        assert not re.match(r"(.*\)\s*)?(error\s+)?stop\b", statement), statement
        assert not re.match(r"(.*\)\s*)?print\b", statement), statement
        assert not re.match(r"(.*\)\s*)?write\s*\(\s*\*", statement), statement
        # Lines of progress are asked for by `show_progress`.
        allowed = path.stem in ("running_command", "progress")
        assert allowed or "print_line" not in statement, statement


@pytest.mark.parametrize(
    "path", [path for path in LIBRARY if path.parent.name != "facade"], ids=relative
)
def test_a_file_is_the_module_of_its_name(path):
    found = statements(path)
    assert [line for line in found if re.match(r"module (?!procedure)\w", line)] == [
        f"module {path.stem}"
    ]
    assert "implicit none" in found
    assert "private" in found


def test_only_long_work_gives_up_the_lock():
    # gfortran keeps lengths of deferred-length texts in static memory, so two threads must not make
    # such texts at once.
    text = (SOURCE / "fortran" / "facade" / "core.f90").read_text()
    procedures = re.findall(r"^subroutine (\w+)(.*?)^end subroutine", text, flags=re.M | re.S)
    assert [name for name, body in procedures if "!f2py threadsafe" in body] == ["core_do_long"]
    makes_texts = {"stage", "campaign", "problem", "settings", "file", "basis"}
    # A fit is work on numbers.
    assert not {
        operation
        for operation in bayesindent.core.LONG - {"basis.fit"}
        if operation.split(".")[0] in makes_texts
    }


def test_fortran_folders_depend_one_way():
    folder = {path.stem: path.parent.name for path in FORTRAN} | {"settings_schema": "settings"}
    for path in FORTRAN:
        for statement in statements(path):
            used = re.match(r"use\b(?:\s*,[^:]*)?(?:\s*::)?\s*(\w+)", statement)
            if used and used[1] in folder:
                assert LAYERS.index(folder[used[1]]) <= LAYERS.index(path.parent.name), (
                    f"{relative(path)}: {statement}"
                )
                assert folder[used[1]] != "facade" or path.parent.name == "facade", (
                    f"{relative(path)}: {statement}"
                )
                assert (path.parent.name, folder[used[1]]) != ("settings", "crystal"), (
                    f"{relative(path)}: {statement}"
                )


def test_python_folders_depend_one_way():
    package = SOURCE / "python" / "bayesindent"
    for path in sorted(package.rglob("*/*.py")):
        parts = path.relative_to(package).parts
        for node in ast.walk(ast.parse(path.read_text())):
            if isinstance(node, ast.ImportFrom) and node.level == len(parts) and node.module:
                used = node.module.split(".")[0]
                if used in LAYERS:
                    assert LAYERS.index(used) <= LAYERS.index(parts[0]), (
                        f"{relative(path)}:{node.lineno} imports {node.module}"
                    )


CLASS_TABLE = SOURCE / "fortran" / "crystal" / "crystal_class.f90"
#: The Laue class of each space group.
GROUP_TABLE = SOURCE / "fortran" / "crystal" / "space_groups.f90"
NOT_TABLE = [path for path in lines.files(SOURCE) if path not in (CLASS_TABLE, GROUP_TABLE)]


def class_names():
    """Names and synonyms in the table of crystal classes."""
    rows = re.findall(r"row_type\('([^']*)', *'([^']*)'", CLASS_TABLE.read_text())
    names = {name.strip() for row in rows for text in row for name in text.split(",")} - {""}
    assert {"cubic", "6/mmm", "-1"} <= names
    return names


def texts(path):
    """Number of line and content of every text in a source, without docstrings and comments."""
    if path.suffix == ".py":
        tree = ast.parse(path.read_text())
        documentation = {id(node.value) for node in ast.walk(tree) if isinstance(node, ast.Expr)}
        for node in ast.walk(tree):
            if (
                isinstance(node, ast.Constant)
                and isinstance(node.value, str)
                and id(node) not in documentation
            ):
                yield node.lineno, node.value
    else:
        quoted = (
            r"'((?:[^']|'')*)'|\"([^\"]*)\""
            if path.suffix == ".f90"
            else r"\"((?:[^\"\\]|\\.)*)\"()"
        )
        comment = "!" if path.suffix == ".f90" else "//"
        for number, line in enumerate(path.read_text().splitlines(), 1):
            for found in re.finditer(f"({comment}.*)|{quoted}", line):
                if not found[1]:
                    yield number, found[2] or found[3] or ""


def test_nothing_but_the_table_names_a_crystal_class():
    names = class_names()
    found = []
    for path in NOT_TABLE:
        for number, text in texts(path):
            if {item.strip().lower() for item in text.split(",")} & names:
                found.append(f"{relative(path)}:{number}: '{text}'")
    assert not found, "\n".join(found)


def test_nothing_but_the_table_compares_a_symmetry_or_counts_constants():
    compared = r"\s*(==|/=|!=|<=|>=|<|>|\.eq\.|\.ne\.|\bin\b|\bnot in\b|\bis\b)\s*"
    forbidden = [
        r"\bsymmetry_(?!names)\w*("
        + "|".join(sorted(name for name in class_names() if name.isalpha()))
        + r")",
        rf"\bn_constants{compared}[1-9(\[]",
        rf"[\d)\]]{compared}(\w+%)*n_constants\b",
        rf"\b(size|len)\([^()]*(constants|stiffness)[^()]*\){compared}[1-9(\[]",
        rf"\b(constants|bounds)(\.shape\[-?\d\]|\.size){compared}[1-9(\[]",
        r"select\s*case\s*\(.*(symmetry|n_constants|class%name)",
        r"\bmatch\b.*(symmetry|n_constants)",
        rf"\b(symmetry|class%name){compared}['\"]\w",
    ]
    found = []
    for path in NOT_TABLE:
        comment = {".py": "#", ".f90": "!"}.get(path.suffix, "//")
        for number, line in enumerate(path.read_text().splitlines(), 1):
            code = line.split(comment)[0]
            if any(re.search(pattern, code, re.IGNORECASE) for pattern in forbidden):
                found.append(f"{relative(path)}:{number}: {line.strip()}")
    assert not found, "\n".join(found)


#: Lines and arguments that a part may have; the tables of cases in tests are longer.
LARGEST = {"file": 600, "class": 280, "procedure": 125}
LARGEST_OF_TESTS = {"file": 900, "class": 400, "procedure": 125}
MOST_ARGUMENTS = 10


def too_large(parts, largest=LARGEST):
    """Parts beyond these limits."""
    return [
        part for part in parts if part.lines > largest[part.kind] or part.arguments > MOST_ARGUMENTS
    ]


def test_nothing_is_too_large():
    assert not too_large(lines.parts(SOURCE, "fortran", "cpp", "python"))
    assert not too_large(lines.parts(SOURCE, "tests"), LARGEST_OF_TESTS)


def test_finds_what_is_too_large(tmp_path):
    (tmp_path / "python").mkdir()
    head, body = "def long(a, b):\n", "    a += b\n"
    arguments = ", ".join(f"a{number}" for number in range(MOST_ARGUMENTS + 1))
    (tmp_path / "python" / "p.py").write_text(
        head
        + 124 * body
        + head.replace("long", "longer")
        + 125 * body
        + f"def many({arguments}):\n{body}"
    )
    assert [part.name for part in too_large(list(lines.parts(tmp_path, "python")))] == [
        "longer",
        "many",
    ]


def test_counts_the_parts_of_each_language(tmp_path):
    """What counts as a class, a procedure and an argument."""
    for folder in ("fortran/a", "cpp", "python"):
        (tmp_path / folder).mkdir(parents=True)
    (tmp_path / "fortran/a/m.f90").write_text(
        "module m\n!> comment\n\n   type, abstract :: t_type\n   contains\n      procedure(f), "
        "deferred :: f\n   end type\n"
        "   interface\n      subroutine dgemm(a, b, c)\n      end subroutine dgemm\n   end "
        "interface\ncontains\n"
        "   pure real(wp) function f(x, & ! first\n      & y) result(r)\n      r = x('end "
        "function', y)\n   end function f\nend module m\n"
    )
    (tmp_path / "cpp/c.cpp").write_text(
        "// comment\nclass box {\npublic:\n  box(int a, int b) : n{a} { n += b; }\n};\nint "
        "f(const int *x,\n      int y) {\n  if (y) { return 1; }\n  return g(1, 2, 3);\n}\n"
    )
    (tmp_path / "python/p.py").write_text(
        '"""Text."""\n\n# comment\nclass C:\n    @staticmethod\n    def f(self, a, *, b=1):\n'
        "        return a\n"
    )
    found = {
        (part.kind, part.name, part.lines, part.arguments)
        for part in lines.parts(tmp_path)
        if part.kind != "file"
    }
    assert found == {
        ("class", "t_type", 4, 0),
        ("procedure", "f", 4, 2),
        ("class", "box", 4, 0),
        ("procedure", "box", 1, 2),
        ("procedure", "f", 5, 2),
        ("class", "C", 4, 0),
        ("procedure", "f", 3, 2),
    }


FORTRAN_SAMPLE = """
module m ! a comment counts nothing
   if (x == 'a ! in a text') & ! hidden
      & y = 1
   if (x == 1 .and. &
      & y == 2) then
   end if
"""
CPP_SAMPLE = """// comment
/* another
   comment */
f("text // of more than sixty characters, which therefore counts as two tokens");
"""
PYTHON_SAMPLE = """'Docstring.'

def f(a):
    'Docstring.'
    return [[f"{b}" for b in c] for c in a]
"""
LONG_STATEMENT = "   y = " + " &\n      & ".join(["+ a_long_name"] * 20) + "\n"


def test_counts_tokens_and_packed_code(tmp_path):
    """The count of `bayesindent dev lines` on a source tree of one file for each language."""
    for name, text in {
        "fortran/a/m.f90": FORTRAN_SAMPLE + LONG_STATEMENT,
        "cpp/c.cpp": CPP_SAMPLE,
        "python/p.py": PYTHON_SAMPLE + "#" + 100 * "x" + "\n",
        "python/t.html.j2": "<p>{{ two }}</p>\n",
        "python/p.txt": "left out\n",
    }.items():
        (tmp_path / name).parent.mkdir(parents=True, exist_ok=True)
        (tmp_path / name).write_text(text)
    found = tokens.count(tmp_path, *tokens.SOURCES)
    fortran = 33 + 80
    assert found.kinds == {".f90": fortran, ".cpp": 6, ".py": 20, ".j2": 12}
    assert found.folders == {
        "fortran/a": fortran,
        "cpp/c.cpp": 6,
        "python/p.py": 20,
        "python/t.html.j2": 12,
    }
    assert (found.wide, found.hidden_ifs, found.long_statements, found.nested) == (1, 1, 1, 1)


def test_tests_have_few_nested_comprehensions():
    assert tokens.count(SOURCE, "tests").nested <= 10


def test_the_build_runs_and_reads_nothing_that_the_count_leaves_out():
    """Of files beside fortran/, cpp/ and python/ the build reads the pages of variables and of
    diagnostics alone.
    """
    builds = [
        path for top in tokens.SOURCES for path in sorted((SOURCE / top).rglob("meson.build"))
    ]
    outside = set()
    for path in builds:
        text = path.read_text()
        assert "source_root()" not in text
        for name in re.findall(r"'(\.\./[^']*)'", text):
            outside.add(relative((path.parent / name).resolve()))
    assert {name for name in outside if not name.startswith(tokens.SOURCES)} == {
        "docs/diagnostics.md",
        "docs/namelists.md",
    }


def test_every_module_has_its_tests():
    """By its name, or by a row of tests/where.md; `PYTHONPATH=tests python -m tools.where` writes
    that page.
    """
    rows = where.written_rows(SOURCE / "tests" / "where.md")
    lacking = [module for module in where.nameless(SOURCE) if not rows.get(module)]
    assert not lacking, lacking
    named = {*rows, *(test for tests in rows.values() for test in tests)}
    assert not [name for name in named if not (SOURCE / name).exists()]


def glossary():
    """Arguments that mean the same everywhere, by their shape: a table of docs/fortran.md."""
    text = (
        (SOURCE / "docs" / "fortran.md")
        .read_text()
        .split("| argument | shape | is |")[1]
        .split("\n\n")[0]
    )
    rows = [row.split("|") for row in text.strip().splitlines()[1:]]
    return {
        name: row[2].strip().replace(" ", "")
        for row in rows
        for name in re.findall(r"`(\w+)`", row[1])
    }


@pytest.mark.parametrize("path", LIBRARY, ids=relative)
def test_every_argument_is_explained(path):
    found = list(arguments.unexplained(path, glossary()))
    assert not found, "\n".join(found)


def test_finds_what_is_not_explained(tmp_path):
    (tmp_path / "m.f90").write_text(
        "module m\n   private\n   public :: f\ncontains\n"
        "   !> Doubles x.\n   subroutine f(x, y, z, c, w, error)\n      real(wp), intent(in) :: "
        "x(:), w(3)\n      !> GPa.\n"
        "      real(wp), intent(in) :: y(2), z\n      real(wp), intent(in) :: c(6, 6)\n      "
        "type(error_type), intent(out) :: error\n"
        "   end subroutine f\n   subroutine g(hidden)\n      integer :: hidden\n   end "
        "subroutine g\nend module m\n"
    )
    assert list(arguments.unexplained(tmp_path / "m.f90", glossary())) == ["f: w(3)"]
    assert list(arguments.unexplained(tmp_path / "m.f90", {})) == ["f: c(6, 6)", "f: w(3)"]


def test_every_public_python_parameter_is_explained():
    taken = {name: getattr(bayesindent, name) for name in bayesindent.__all__}
    found = [
        f"{name}: {parameter}"
        for name, item in taken.items()
        # Of a dataclass each field is explained where it stands.
        if callable(item)
        and not dataclasses.is_dataclass(item)
        and not (isinstance(item, type) and issubclass(item, Exception))
        for parameter in inspect.signature(item).parameters
        if not re.search(
            rf"\b{parameter}\b",
            item.__doc__ + (item.__init__.__doc__ or "" if isinstance(item, type) else ""),
        )
    ]
    assert not found, "\n".join(found)


def test_the_prose_keeps_its_rules():
    assert prose.complaints(SOURCE) == []


def test_finds_pages_of_users_that_are_too_long():
    words = {number: "Word" + " word" * (number - 1) + ". " for number in (17, 18, 30, 31)}
    assert not prose.of_pages({"a.md": words[17] * 9 + words[30], "b.md": "| cell |\n" * 600})
    found = prose.of_pages({"a.md": words[18] * 8 + words[31] * 2, "b.md": "| cell |\n" * 8000})
    assert [line.partition(";")[0] for line in found] == [
        "pages of users: 24206 words",
        "pages of users: the median sentence has 18 words",
        "a.md: 2 sentences of more than 30 words",
        "b.md: 24000 words",
    ]


def test_sentences_are_those_of_the_prose():
    page = """# A heading. Of two\n
One `bayesindent run FILE.nml` [is a word](a.md). **Two words.**
- first item
  over two lines
1. second item\n
    code of a block. It is code\n
```
code. More code
```
| a cell. And | another |
term of a list
: its meaning follows
"""
    expected = [
        "One `x` is a word.",
        "Two words.",
        "first item over two lines",
        "second item",
        "its meaning follows",
    ]
    assert prose.sentences(page) == expected


def test_finds_prose_that_breaks_them():
    long = "One two three. " * 150 + "Word" + " word" * 30 + ".\n\n```\n" + "code " * 40 + "\n```\n"
    found = prose.of_readme(f"# Title\n\n{long}")
    assert [words.partition(";")[0] for words in found] == ["a sentence of 31 words"]
    assert prose.of_readme("# Title\n\nA short one. " * 20)[0] == "100 words; allowed 500 to 700"
    assert prose.of_phrases(
        "What the\nspecimen adds is learnt from rows; the prior has a say."
    ) == [
        ("has a say", "the result depends on the prior"),
        ("What the specimen adds", "the specimen correction"),
        ("learnt from", "is trained on"),
    ]
    assert not prose.of_phrases("The user knows the prior and learns a lot.")
