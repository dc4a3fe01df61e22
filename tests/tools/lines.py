"""How much there is to read, by folder: lexer tokens, packed code, and the largest parts of
fortran/, cpp/ and python/.

Comments and docstrings count no tokens. A text is one token, and one more for each 60 characters.
Templates count by their words. Sizes of files, classes and procedures count every line; `self` and
`cls` are no arguments; procedures that interfaces declare are left out.
"""

import argparse
import ast
import re
import sys
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

from tools import tokens

ROOT = Path(__file__).parents[2]
#: Endings of the files whose parts are known.
READABLE = (".f90", ".cpp", ".h", ".py")

FORTRAN_NAME = (
    r"(?:[\w()=, *:]*\s)?(?:subroutine|function)\s+(?P<name>\w+)\s*(?:\((?P<arguments>[^)]*)\))?"
)
FORTRAN_PROCEDURE = re.compile(rf"^{FORTRAN_NAME}", re.IGNORECASE)
FORTRAN_TYPE = re.compile(r"^type\s*(?:,[^:]*)?(?:::)?\s*(?P<name>\w+)$", re.IGNORECASE)

CPP_IGNORED = re.compile(
    r"//[^\n]*|/\*.*?\*/|\"(?:[^\"\\]|\\.)*\"|'(?:[^'\\]|\\.)*'|^#[^\n]*", re.DOTALL | re.MULTILINE
)
CPP_PART = re.compile(
    r"\b(?P<kind>class|struct)\s+(?P<name>\w+)[^;{()]*\{"
    r"|(?P<function>~?\w+)\s*\((?P<arguments>[^;{}]*?)\)"
    r"\s*(?:const|noexcept|override|\s)*(?::[^;]*?)?\{"
)


@dataclass(frozen=True)
class Part:
    """A file, a class or a procedure of the sources."""

    kind: str
    name: str
    file: str
    lines: int
    arguments: int = 0


def main(argv=None) -> int:
    """Print the counts of one source tree, or of several side by side, and the largest parts of
    each.
    """
    layout = argparse.RawDescriptionHelpFormatter
    parser = argparse.ArgumentParser(
        prog="bayesindent dev lines", description=__doc__, formatter_class=layout
    )
    parser.add_argument(
        "roots", nargs="*", type=Path, metavar="ROOT", help="source trees (this one)"
    )
    roots = parser.parse_args(argv).roots or [ROOT]
    sources = [tokens.count(root, *tokens.SOURCES) for root in roots]
    tests = [tokens.count(root, "tests") for root in roots]
    for folder in sorted(set().union(*(count.folders for count in sources))):
        print_row(folder, [count.folders[folder] for count in sources])
    for kind in sorted(set().union(*(count.kinds for count in sources))):
        print_row(f"tokens of {kind}", [count.kinds[kind] for count in sources])
    print_packing("", sources)
    print_packing("tests: ", tests)
    for root in roots:
        print_largest(root)
    return 0


def print_row(name: str, numbers: list[int]) -> None:
    """Print a name and the numbers of each source tree."""
    print(f"{name:<40}" + "".join(f"{number:>8}" for number in numbers))


def print_packing(of: str, counts: list[tokens.Count]) -> None:
    """Print the sum of the tokens, and how many places of a source tree are packed."""
    print_row(f"{of}tokens", [count.tokens for count in counts])
    print_row(f"{of}lines", [count.lines for count in counts])
    print_row(f"{of}lines beyond 100 columns", [count.wide for count in counts])
    print_row(f"{of}statements beyond 200 characters", [count.long_statements for count in counts])
    print_row(f"{of}one-line ifs over several lines", [count.hidden_ifs for count in counts])
    print_row(f"{of}nested comprehensions", [count.nested for count in counts])


def print_largest(root: Path) -> None:
    """Print the largest file, class and procedure of a source tree, and the procedure with the most
    arguments.
    """
    found = list(parts(root))
    for kind in ("file", "class", "procedure"):
        largest = max((part for part in found if part.kind == kind), key=lambda part: part.lines)
        print(f"largest {kind}: {largest.lines} lines, {largest.name} ({largest.file})")
    longest = max(found, key=lambda part: part.arguments)
    print(f"most arguments: {longest.arguments}, {longest.name} ({longest.file})")


def files(root: Path, *folders: str) -> list[Path]:
    """The source files in these folders (fortran, cpp, python)."""
    folders = folders or tokens.SOURCES
    paths = [path for folder in folders for path in (root / folder).rglob("*")]
    return sorted(path for path in paths if path.suffix in READABLE)


def parts(root: Path, *folders: str) -> Iterator[Part]:
    """Every file, class and procedure."""
    reader = {".f90": fortran_parts, ".cpp": cpp_parts, ".h": cpp_parts, ".py": python_parts}
    for path in files(root, *folders):
        text = path.read_text()
        name = str(path.relative_to(root))
        yield Part("file", name, name, len(text.splitlines()))
        yield from reader[path.suffix](text, name)


def python_parts(text: str, file: str) -> Iterator[Part]:
    """Classes, functions and methods."""
    for node in ast.walk(ast.parse(text)):
        if isinstance(node, (ast.ClassDef, ast.FunctionDef, ast.AsyncFunctionDef)):
            lines = (
                (node.end_lineno or node.lineno)
                - min([node.lineno, *(mark.lineno for mark in node.decorator_list)])
                + 1
            )
            if isinstance(node, ast.ClassDef):
                yield Part("class", node.name, file, lines)
            else:
                taken = node.args
                names = [
                    argument.arg
                    for argument in (*taken.posonlyargs, *taken.args, *taken.kwonlyargs)
                ]
                yield Part(
                    "procedure",
                    node.name,
                    file,
                    lines,
                    sum(name not in ("self", "cls") for name in names),
                )


def statements(text: str) -> Iterator[tuple[int, int, str]]:
    """First line, last line and text of each statement of Fortran, without comments, texts and
    continuations, in lower case.
    """
    start, whole = 0, ""
    for number, line in enumerate(text.splitlines(), 1):
        code = re.sub(r"!.*", "", re.sub(r"'[^']*'|\"[^\"]*\"", "''", line)).strip().lower()
        if not code:
            continue
        start = start or number
        whole += code.removeprefix("&").removesuffix("&")
        if not code.endswith("&"):
            yield start, number, whole.strip()
            start, whole = 0, ""


def fortran_parts(text: str, file: str) -> Iterator[Part]:
    """Derived types and procedures, without those that interfaces declare."""
    opened: list[tuple[str, str, int, int]] = []
    for first, last, statement in statements(text):
        if re.match(r"(abstract\s+)?interface\b", statement):
            opened.append(("interface", "", first, 0))
        elif re.match(r"end\s*(interface|type|subroutine|function|procedure)\b", statement):
            kind, name, start, arguments = opened.pop()
            if kind != "interface" and not any(outer[0] == "interface" for outer in opened):
                yield Part(kind, name, file, last - start + 1, arguments)
        elif found := FORTRAN_TYPE.match(statement):
            opened.append(("class", found["name"], first, 0))
        elif not statement.startswith("end") and (found := FORTRAN_PROCEDURE.match(statement)):
            arguments = len(
                [name for name in (found["arguments"] or "").split(",") if name.strip()]
            )
            opened.append(("procedure", found["name"], first, arguments))


def cpp_parts(text: str, file: str) -> Iterator[Part]:
    """Classes, and functions that have a body."""
    # Comments, texts and directives become blanks; lines stay where they are.
    code = CPP_IGNORED.sub(lambda found: re.sub(r"[^\n]", " ", found[0]), text)
    for found in CPP_PART.finditer(code):
        if found["function"] in ("if", "for", "while", "switch", "catch"):
            continue
        depth, end = 1, found.end()
        while depth and end < len(code):
            depth += {"{": 1, "}": -1}.get(code[end], 0)
            end += 1
        lines = code.count("\n", found.start(), end) + 1
        if found["kind"]:
            yield Part("class", found["name"], file, lines)
        else:
            arguments = [name for name in found["arguments"].split(",") if name.strip()]
            yield Part("procedure", found["function"], file, lines, len(arguments))


if __name__ == "__main__":
    sys.exit(main())
