"""Code lines (without blanks and comments) by folder, and the largest file, class, procedure and list of arguments.

Counted are fortran/, cpp/ and python/. Docstrings count as code; sizes of files, classes and procedures count every line; `self` and `cls`
are no arguments; procedures that interfaces declare are not counted.
"""

import argparse
import ast
import re
import sys
from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

ROOT = Path(__file__).parents[2]
COMMENT = {".f90": "!", ".cpp": "//", ".h": "//", ".py": "#"}

FORTRAN_NAME = r"(?:[\w()=, *:]*\s)?(?:subroutine|function)\s+(?P<name>\w+)\s*(?:\((?P<arguments>[^)]*)\))?"
FORTRAN_PROCEDURE = re.compile(rf"^{FORTRAN_NAME}", re.IGNORECASE)
FORTRAN_TYPE = re.compile(r"^type\s*(?:,[^:]*)?(?:::)?\s*(?P<name>\w+)$", re.IGNORECASE)

CPP_IGNORED = re.compile(r"//[^\n]*|/\*.*?\*/|\"(?:[^\"\\]|\\.)*\"|'(?:[^'\\]|\\.)*'|^#[^\n]*", re.DOTALL | re.MULTILINE)
CPP_PART = re.compile(
    r"\b(?P<kind>class|struct)\s+(?P<name>\w+)[^;{()]*\{"
    r"|(?P<function>~?\w+)\s*\((?P<arguments>[^;{}]*?)\)\s*(?:const|noexcept|override|\s)*(?::[^;]*?)?\{"
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
    """Print the table of one source tree, or of several side by side."""
    parser = argparse.ArgumentParser(prog="bayesindent lines", description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("roots", nargs="*", type=Path, metavar="ROOT", help="source trees (this one)")
    roots = parser.parse_args(argv).roots or [ROOT]
    counts = [count_lines(root) for root in roots]
    for folder in sorted(set().union(*counts)):
        print(f"{folder:<28}" + "".join(f"{count[folder] or '':>8}" for count in counts))
    print(f"{'all':<28}" + "".join(f"{sum(count.values()):>8}" for count in counts))
    for root in roots:
        found = list(parts(root))
        for kind in ("file", "class", "procedure"):
            largest = max((part for part in found if part.kind == kind), key=lambda part: part.lines)
            print(f"largest {kind}: {largest.lines} lines, {largest.name} ({largest.file})")
        longest = max(found, key=lambda part: part.arguments)
        print(f"most arguments: {longest.arguments}, {longest.name} ({longest.file})")
    return 0


def files(root: Path, *folders: str) -> list[Path]:
    """The source files in these folders (fortran, cpp, python)."""
    return sorted(
        path for folder in folders or ("fortran", "cpp", "python") for path in (root / folder).rglob("*") if path.suffix in COMMENT
    )


def count_lines(root: Path) -> Counter:
    """Code lines of each folder."""
    count: Counter = Counter()
    for path in files(root):
        lines = [line.strip() for line in path.read_text().splitlines()]
        count[str(path.relative_to(root).parent)] += sum(bool(line) and not line.startswith(COMMENT[path.suffix]) for line in lines)
    return count


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
            lines = (node.end_lineno or node.lineno) - min([node.lineno, *(mark.lineno for mark in node.decorator_list)]) + 1
            if isinstance(node, ast.ClassDef):
                yield Part("class", node.name, file, lines)
            else:
                taken = node.args
                names = [argument.arg for argument in (*taken.posonlyargs, *taken.args, *taken.kwonlyargs)]
                yield Part("procedure", node.name, file, lines, sum(name not in ("self", "cls") for name in names))


def statements(text: str) -> Iterator[tuple[int, int, str]]:
    """First line, last line and text of each statement of Fortran, without comments, texts and continuations, in lower case."""
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
            arguments = len([name for name in (found["arguments"] or "").split(",") if name.strip()])
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
