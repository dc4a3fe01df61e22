"""Cells of tables as laboratories write them: how a text becomes rows of cells, and which cells are
numbers.
"""

import csv
import re
from collections import Counter
from io import StringIO
from typing import Any
from unicodedata import normalize

import numpy as np

#: Cells that say that there is no value; the last is what some instruments write.
MISSING = {
    ".",
    "n/a",
    "na",
    "nan",
    "none",
    "null",
    "nil",
    "missing",
    "#n/a",
    "#div/0!",
    "#value!",
    "#ref!",
    "#num!",
    "1.797e308",
    "1.797e+308",
    "1.797693e+308",
}
NUMBER = r"[+-]?(?:\d+[.,]?\d*|[.,]\d+)(?:[eEdD][+-]?\d+)?"
is_plain_number = re.compile(NUMBER).fullmatch
PLUS_MINUS = re.compile(rf"\(?({NUMBER})\s*(?:GPa)?\s*(?:±|\+/-|\+-)\s*({NUMBER})\)?\s*(GPa|%|)$")
WITH_UNIT = re.compile(rf"({NUMBER})\s*(°|deg|GPa|nm|um|µm|μm|mN|s|%)$")
#: Signs that programs write for others, and those that nobody sees.
SIGNS = str.maketrans({"−": "-", "–": "-", "º": "°", "\u200b": None, "\ufeff": None})


def is_missing(cell: str) -> bool:
    """Whether a cell has no value; dashes too are none."""
    return not cell.strip("-—=:") or cell.lower() in MISSING


def is_number(cell: str) -> bool:
    """Whether a cell is a number, perhaps with a unit or an sd."""
    return bool(is_plain_number(cell) or WITH_UNIT.match(cell) or PLUS_MINUS.match(cell))


def plain_numbers(cells: list[str]) -> bool:
    """Whether all cells are numbers and nothing else; of many rows soon."""
    try:
        return bool((np.abs(np.array(cells, float)) < 1e300).all())
    except ValueError:
        return all(map(is_plain_number, cells))


def value_of(number: str) -> float:
    """The value of a number as tables have it: 3,5 or 1d5 too."""
    return float(number.lower().replace(",", ".").replace("d", "e"))


def tidy(value: Any, decimal_commas: bool = True) -> str:
    """A cell in one line, a number with a decimal point."""
    cell = "" if value is None else " ".join(str(value).split())
    return (
        re.sub(r"(?<=\d),(?=\d)", ".", cell)
        if decimal_commas and "," in cell and is_number(cell)
        else cell
    )


def usual(text: str) -> str:
    """A text with the usual signs: narrow and fixed blanks, minus signs, raised and lowered
    letters.
    """
    # Sign by sign: letters of names that are written as two signs stay so.
    own: dict[int, str | None] = {
        ord(sign): normalize("NFKC", sign).replace("μ", "µ")
        for sign in set(text)
        if not sign.isascii()
    }
    return text.translate(own | SIGNS)


def tabbed(text: str) -> str:
    """The text of a table with tabs between its cells, where these are separated by blanks alone:
    by two, if some cells have one inside.
    """
    if re.search(r"[;\t|]|,(?!\d)|(?<!\d),", text):
        return text
    lines = [line.strip() for line in text.splitlines()]
    gap = (
        " +"
        if len({len(line.split()) for line in lines if line and line[0] != "#"}) == 1
        else "  +"
    )
    return "\n".join(re.sub(gap, "\t", line) for line in lines)


def rows_of(text: str) -> list[tuple[int, list[str]]]:
    """Cells with the number of their line, of what separates most lines into as many: tabs,
    semicolons, bars or commas.
    """
    lines = text.splitlines()[:1000]
    alike = {
        mark: max(Counter(line.count(mark) for line in lines if mark in line).values(), default=0)
        for mark in "\t;|,"
    }
    # As many lines may have decimal commas.
    delimiter = max("\t;|,", key=lambda mark: alike[mark] - 0.5 * (mark == ","))
    reader = csv.reader(StringIO(text, newline=""), delimiter=delimiter, skipinitialspace=True)
    rows, before = [], 0
    for cells in reader:
        whole = "".join(cells)
        if whole.strip() and not cells[0].startswith("#"):
            is_tidy = whole.split() == [whole] and "," not in whole
            rows.append(
                (before + 1, cells if is_tidy else [tidy(cell, delimiter != ",") for cell in cells])
            )
        before = reader.line_num
    return rows
