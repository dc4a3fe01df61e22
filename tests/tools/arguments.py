"""Dummy arguments of the public Fortran procedures that nothing explains; docs/development.md
states the rule.
"""

import re
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path

from tools.lines import FORTRAN_PROCEDURE, statements

#: One entity of a declaration: its name, its shape.
ENTITY = re.compile(r"(\w+)\s*((?:\((?:[^()]|\([^()]*\))*\))?)\s*(?:=[^,]*)?(?:,|$)")


@dataclass
class Procedure:
    """A procedure with its comment; for each argument its type with attributes, its shape and its
    comment.
    """

    name: str
    comment: str
    arguments: dict[str, tuple[str, str, str]] = field(default_factory=dict)


def unexplained(path: Path, glossary: dict[str, str]) -> Iterator[str]:
    """'procedure: argument' of each argument that neither a comment nor the glossary (name to
    shape) explains.
    """
    text = path.read_text()
    public = public_names(text.lower())
    of_module = (
        set(re.findall(r"`(\w+)`", text.split("\nmodule ")[0])) if "\nmodule " in text else set()
    )
    for procedure in procedures(path):
        if public and procedure.name not in public:
            continue
        for name, (kind, shape, comment) in procedure.arguments.items():
            named = re.search(
                rf"\b{name}\b" if name != "a" else "`a`", procedure.comment, re.IGNORECASE
            )
            explained = comment or kind.startswith(("type(", "class(")) or named
            if (
                not explained
                and name not in of_module
                and glossary.get(name) != shape.replace(" ", "")
            ):
                yield f"{procedure.name}: {name}{shape}"


def public_names(text: str) -> set[str]:
    """Names that a module makes public, its abstract interfaces, and the procedures that its types
    are bound to; none of a file without a module. A type that extends another has the arguments of
    its parent.
    """
    joined = re.sub(r"&[^\n]*\n\s*&?", "", text)
    names = set(
        re.findall(r"\w+", " ".join(re.findall(r"^\s*public\s*::(.*)$", joined, re.MULTILINE)))
    )
    for block in re.findall(
        r"^\s*abstract interface\b.*?^\s*end interface", joined, re.MULTILINE | re.DOTALL
    ):
        names |= set(re.findall(r"^\s*end (?:subroutine|function) (\w+)", block, re.MULTILINE))
    children = r"^\s*type\s*,[^\n]*extends\(.*?^\s*end type"
    bound = re.findall(
        r"^\s*procedure(?:\s*,[^:]*)?\s*::\s*(.*)$",
        re.sub(children, "", joined, flags=re.M | re.S),
        re.MULTILINE,
    )
    return names | {name.split("=>")[-1].strip() for names in bound for name in names.split(",")}


def procedures(path: Path) -> Iterator[Procedure]:
    """Every procedure of a file that has a body, or that an abstract interface declares."""
    text = path.read_text()
    starts = {first: (last, statement) for first, last, statement in statements(text)}
    comment: list[str] = []
    opened: list[Procedure] = []
    interfaces: list[bool] = []
    number, raw = 1, text.splitlines()
    while number <= len(raw):
        line = raw[number - 1].strip()
        last, statement = starts.get(number, (number, ""))
        if line.startswith("!>"):
            comment.append(line[2:])
        elif statement:
            if re.match(r"(abstract\s+)?interface\b", statement):
                interfaces.append(not statement.startswith("abstract"))
            elif re.match(r"end\s*interface", statement):
                interfaces.pop()
            elif re.match(r"end\s*(subroutine|function)\b", statement):
                procedure = opened.pop()
                if not any(interfaces):
                    yield procedure
            elif not statement.startswith("end") and (found := FORTRAN_PROCEDURE.match(statement)):
                names = [
                    name.strip() for name in (found["arguments"] or "").split(",") if name.strip()
                ]
                opened.append(
                    Procedure(found["name"], " ".join(comment), dict.fromkeys(names, ("", "", "")))
                )
            elif opened and "::" in statement:
                kind, entities = statement.split("::", 1)
                for name, shape in ENTITY.findall(entities):
                    if name in opened[-1].arguments:
                        opened[-1].arguments[name] = (kind.strip(), shape, " ".join(comment))
            comment = []
        number = last + 1
