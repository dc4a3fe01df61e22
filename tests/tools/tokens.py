"""How much there is to read in a source tree: lexer tokens, and code that is packed.

Counted are fortran/, cpp/ and python/, and apart from these tests/ without its reference values.
Comments and docstrings count nothing. A text is one token, and one more for each 60 characters.
Templates (.j2, .in) count by their words.
"""

import ast
import io
import re
import tokenize
from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path

#: The mark that begins a comment, by the ending of a file.
COMMENT = {".f90": "!", ".cpp": "//", ".h": "//", ".c": "//", ".py": "#"}
TEMPLATES = (".j2", ".in")
SOURCES = ("fortran", "cpp", "python")
TEXT_STEP, WIDTH, LONGEST_STATEMENT = 60, 100, 200

#: A text in single or double quotes, a name, a number, or one other sign, as in "call f(x, 'it''s',
#: 1.5_wp)".
SINGLE_QUOTED = r"'(?:[^']|'')*'"
DOUBLE_QUOTED = r"\"(?:[^\"\\]|\\.)*\""
WORD = re.compile(rf"{SINGLE_QUOTED}|{DOUBLE_QUOTED}|[A-Za-z_]\w*|\d[\w.]*|[^\s\w]")

COMPREHENSIONS = (ast.ListComp, ast.SetComp, ast.DictComp, ast.GeneratorExp)
DOCUMENTED = (ast.Module, ast.ClassDef, ast.FunctionDef, ast.AsyncFunctionDef)
LAYOUT = {
    tokenize.COMMENT,
    tokenize.NL,
    tokenize.NEWLINE,
    tokenize.INDENT,
    tokenize.DEDENT,
    tokenize.ENCODING,
    tokenize.ENDMARKER,
}
#: Python 3.12 and later split a text with places, f"..", into tokens between these two.
PLACES_START = getattr(tokenize, "FSTRING_START", None)
PLACES_END = getattr(tokenize, "FSTRING_END", None)


@dataclass
class Count:
    """Tokens by the ending of the file and by folder, and the packed places of some folders."""

    kinds: Counter = field(default_factory=Counter)
    folders: Counter = field(default_factory=Counter)
    lines: int = 0
    #: Lines beyond 100 columns.
    wide: int = 0
    #: Statements of Fortran beyond 200 characters, texts left out.
    long_statements: int = 0
    #: One-line ifs of Fortran that go over several lines.
    hidden_ifs: int = 0
    #: Comprehensions of Python inside of others.
    nested: int = 0

    @property
    def tokens(self) -> int:
        """The sum over all files."""
        return sum(self.kinds.values())


def count(root: Path, *tops: str) -> Count:
    """What the sources below these folders of a tree have."""
    found = Count()
    for path in files(root, *tops):
        name = path.relative_to(root)
        text = path.read_text(encoding="utf-8")
        number = tokens_of(text, path.suffix)
        found.kinds[path.suffix] += number
        found.folders[folder_of(name)] += number
        filled = [line for line in text.splitlines() if line.strip()]
        found.lines += len(filled)
        if path.suffix in COMMENT:
            found.wide += sum(len(line) > WIDTH for line in filled)
        if path.suffix == ".f90":
            code = without_comments(text, path.suffix)
            found.long_statements += long_statements(code)
            found.hidden_ifs += hidden_ifs(code)
        if path.suffix == ".py":
            found.nested += nested_comprehensions(text)
    return found


def files(root: Path, *tops: str) -> Iterator[Path]:
    """The counted files below these folders, in order of their names."""
    paths = [path for top in tops for path in (root / top).rglob("*")]
    for path in sorted(paths):
        if path.suffix in (*COMMENT, *TEMPLATES) and "reference" not in path.parts:
            yield path


def folder_of(name: Path) -> str:
    """The part of the tree whose tokens are summed: a folder, or a file that lies beside such
    folders.
    """
    depth = 3 if name.parts[0] == "python" else 2
    return "/".join(name.parts[:depth])


def tokens_of(text: str, kind: str) -> int:
    """Tokens of a file with this ending."""
    if kind == ".py":
        return python_tokens(text)
    if kind in TEMPLATES:
        return len(WORD.findall(text))
    if kind != ".f90":
        text = re.sub(r"/\*.*?\*/", "", text, flags=re.DOTALL)
    total = 0
    for line in without_comments(text, kind):
        for word in WORD.findall(line):
            total += weight(len(word)) if word[0] in "'\"" else 1
    return total


def weight(length: int) -> int:
    """Tokens that a text of so many characters counts for."""
    return 1 + length // TEXT_STEP


def without_comments(text: str, kind: str) -> list[str]:
    """Lines up to the mark of a comment, which is none within a text."""
    return [line[: comment_start(line, COMMENT[kind])] for line in text.splitlines()]


def comment_start(line: str, mark: str) -> int:
    """Where the comment of a line begins."""
    quote = ""
    for place, sign in enumerate(line):
        if quote:
            if sign == quote:
                quote = ""
        elif sign in "'\"":
            quote = sign
        elif line.startswith(mark, place):
            return place
    return len(line)


def python_tokens(text: str) -> int:
    """Tokens of Python without docstrings; a text with places counts like any other."""
    documentation = docstring_places(text)
    total, depth, start = 0, 0, (0, 0)
    for token in tokenize.generate_tokens(io.StringIO(text).readline):
        if token.type == PLACES_START:
            if depth == 0:
                start = token.start
            depth += 1
        elif token.type == PLACES_END:
            depth -= 1
            if depth == 0:
                total += weight(distance(text, start, token.end))
        elif depth or token.type in LAYOUT or token.start in documentation:
            continue
        elif token.type == tokenize.STRING:
            total += weight(len(token.string))
        else:
            total += 1
    return total


def docstring_places(text: str) -> set[tuple[int, int]]:
    """Line and column of each constant that is the first statement of a module, class or
    function.
    """
    places = set()
    for node in ast.walk(ast.parse(text)):
        if isinstance(node, DOCUMENTED) and node.body and isinstance(node.body[0], ast.Expr):
            first = node.body[0]
            if isinstance(first.value, ast.Constant):
                places.add((first.lineno, first.col_offset))
    return places


def distance(text: str, start: tuple[int, int], end: tuple[int, int]) -> int:
    """Characters between two places of a text, each a line (from 1) and a column."""
    lines = text.splitlines(keepends=True)
    between = sum(len(line) for line in lines[start[0] - 1 : end[0] - 1])
    return between + end[1] - start[1]


def long_statements(code: list[str]) -> int:
    """Statements of Fortran whose joined lines are beyond the limit; texts count as two signs."""
    joined = re.sub(r"&\s*\n\s*&?", " ", "\n".join(code))
    total = 0
    for statement in joined.splitlines():
        bare = " ".join(re.sub(r"'[^']*'", "''", statement).split())
        total += len(bare) > LONGEST_STATEMENT
    return total


def hidden_ifs(code: list[str]) -> int:
    """Statements `if (..) action` that are continued on further lines."""
    total, inside = 0, False
    for line in code:
        continued = line.rstrip().endswith("&")
        if not inside:
            inside = continued and re.match(r"\s*if \(", line) is not None
        elif not continued:
            inside = False
            total += re.search(r"\bthen\s*$", line) is None
    return total


def nested_comprehensions(text: str) -> int:
    """Pairs of comprehensions of which the second is a part of the first."""
    total = 0
    for outer in ast.walk(ast.parse(text)):
        if isinstance(outer, COMPREHENSIONS):
            inner = [node for node in ast.walk(outer) if isinstance(node, COMPREHENSIONS)]
            total += len(inner) - 1
    return total
