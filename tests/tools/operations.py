"""The operations that the facade offers to another language, from the comments of its sources.

The comment after each case states the names of the values of the request and of the result:
`!> stiffness, euler_deg -> values`. `..` stands for names that depend on the object.
"""

import re
from functools import cache
from pathlib import Path
from typing import NamedTuple

#: A case, a declaration that has a name of its own, and a comment.
CASE = re.compile(r" {6}case \('([\w.]+)'(?:, '(\w+)')?\)")
NAMED = re.compile(r" +!> (\w+\.\w+): (.*)")
COMMENT = re.compile(r" +!>? (.*)")
PROCEDURE = re.compile(r" {3}.*\b(?:subroutine|function) (?:(?:use|perform)_)?(\w+)\(")


class Operation(NamedTuple):
    """Names of the values of the request and of the result, and what follows in the comment."""

    given: tuple[str, ...]
    result: tuple[str, ...]
    meaning: str


@cache
def operations(root: Path) -> dict[str, Operation]:
    """All operations, 'KIND.VERB'."""
    found: dict[str, Operation | None] = {}
    for path in sorted((root / "fortran" / "facade").glob("*operations.f90")):
        lines, kind = path.read_text().splitlines(), ""
        for number, line in enumerate(lines):
            begun = PROCEDURE.match(line)
            if begun and not line.startswith("   end"):
                kind = begun[1]
            if named := NAMED.match(line):
                found[named[1]] = declared([f"!> {named[2]}", *lines[number + 1 :]])
            elif case := CASE.match(line):
                for verb in filter(None, case.groups()):
                    name = verb if kind == "file" else f"{kind}.{verb}"
                    found[name] = declared(lines[number + 1 :])
    return {name: operation for name, operation in found.items() if operation}


def declared(lines: list[str]) -> Operation | None:
    """The operation whose comment these lines begin with; None for other cases."""
    values: list[str] = []
    meaning: list[str] = []
    for line in lines:
        comment = COMMENT.match(f" {line}")
        if not comment:
            break
        (values if "!> " in line else meaning).append(comment[1])
    given, arrow, result = " ".join(values).partition("->")
    if not arrow:
        return None
    return Operation(names_of(given), names_of(result), " ".join(meaning))


def names_of(text: str) -> tuple[str, ...]:
    """Names that are separated by commas."""
    return tuple(filter(None, (name.strip() for name in text.split(","))))
