"""Cells of tables as laboratories write them: how a text becomes rows of cells, and which cells are
numbers.
"""

import csv
import re
from collections import Counter
from io import StringIO
from itertools import repeat
from typing import Any
from unicodedata import normalize

import numpy as np
import pandas as pd

#: Cells that mean that there is no value: words, errors of spreadsheets, and the largest double,
#: which some instruments write.
MISSING_TEXTS = (
    ". n/a na nan none null nil missing #n/a #div/0! #value! #ref! #num! "
    "1.797e308 1.797e+308 1.797693e+308"
)
MISSING = {*MISSING_TEXTS.split()}
#: A number with a decimal point and perhaps an exponent, such as "1.05d2".
NUMBER = r"[+-]?(?:\d+\.?\d*|\.\d+)(?:[eEdD][+-]?\d+)?"
is_plain_number = re.compile(NUMBER).fullmatch
#: A number, perhaps with its sd and a unit, such as "46.3°" or "(109.7 ± 3.0) GPa".
CELL = re.compile(
    rf"^\(?({NUMBER})\s*(?:GPa)?\s*(?:(?:±|\+/-|\+-)\s*({NUMBER})\)?)?\s*"
    r"(°|deg|GPa|nm|um|µm|μm|mN|s|%)?$"
)
#: A number with a point or a comma, and one whose mark may separate thousands.
MARKED = re.compile(r"[+-]?\d+([.,])\d+")
THOUSANDS = re.compile(r"[+-]?\d{1,3}[.,]\d{3}")
#: Signs that control a terminal.
CONTROLS = re.compile(r"[\x00-\x08\x0e-\x1f\x7f-\x9f]")
#: Signs that programs write in place of the usual ones, and invisible signs.
SIGNS = str.maketrans({"−": "-", "–": "-", "º": "°", "\u200b": None, "\ufeff": None})


def is_missing(cell: str) -> bool:
    """Whether a cell has no number: it is empty, one of `MISSING`, or made of dashes."""
    return not cell.strip("-—=:") or cell.lower() in MISSING


def is_number(cell: str) -> bool:
    """Whether a cell is a number, perhaps with a unit or an sd."""
    return bool(CELL.match(cell))


def plain_numbers(cells: list[str]) -> bool:
    """Whether all cells are numbers and nothing else; NumPy decides this fast for most columns."""
    try:
        return bool((np.abs(np.array(cells, float)) < 1e300).all())
    except ValueError:
        return all(map(is_plain_number, cells))


def missing(cells: pd.Series) -> pd.Series:
    """Which cells of a column have no number."""
    if plain_numbers(cells.tolist()):
        return pd.Series(False, cells.index)
    return cells.map(is_missing)


def value_of(number: str) -> float:
    """The value of a number, which may be written as 1d5."""
    return float(number.lower().replace("d", "e"))


def number_of(cell: str) -> float:
    """The number of a cell, without its unit or its sd; NaN if there is none."""
    found = CELL.match(cell)
    return value_of(found[1]) if found else float("nan")


def tidy(value: Any, decimal_commas: bool) -> str:
    """The text of a cell on one line; a decimal comma in a number becomes a point."""
    cell = "" if value is None else re.sub(r" *[\n\r\t\f\v]\s*", " ", str(value)).strip()
    with_points = cell.replace(",", ".")
    return with_points if decimal_commas and is_number(with_points) else cell


def usual(text: str) -> str:
    """The text with the usual signs in place of narrow blanks, other minus signs, and raised or
    lowered letters, and ? in place of those that control a terminal.
    """
    # Each sign is normalised alone, so that a letter with a combining accent stays two signs.
    own: dict[int, str | None] = {
        ord(sign): normalize("NFKC", sign).replace("μ", "µ")
        for sign in set(text)
        if not sign.isascii()
    }
    return CONTROLS.sub("?", text.translate(own | SIGNS))


def tabbed(text: str) -> str:
    """The text of a table with tabs between cells that only blanks separate. Where lines have
    different numbers of words, some cells contain a blank, and two blanks separate cells.
    """
    if re.search(r"[;\t|]|,(?!\d)|(?<!\d),", text):
        return text
    lines = [line.strip() for line in text.splitlines()]
    word_counts = {len(line.split()) for line in lines if line and line[0] != "#"}
    gap = " +" if len(word_counts) == 1 else "  +"
    return "\n".join(re.sub(gap, "\t", line) for line in lines)


def rows_of(text: str) -> tuple[list[tuple[int, list[str]]], set[int], dict[tuple[int, int], str]]:
    """The rows of a table as pairs of line number and cells, the blank lines, and the numbers that
    can be read in two ways.

    The delimiter is the one of tab, semicolon, bar and comma that splits most of the first 1000
    lines into the same number of cells.
    """
    lines = text.splitlines()[:1000]

    def lines_alike(mark: str) -> int:
        counts = Counter(line.count(mark) for line in lines)
        counts.pop(0, None)
        return max(counts.values(), default=0)

    # Commas come last and lose a tie, since they may be decimal commas.
    delimiter = max("\t;|,", key=lines_alike)
    reader = csv.reader(StringIO(text, newline=""), delimiter=delimiter, skipinitialspace=True)
    rows, blank, last_line = [], set(), 0
    for cells in reader:
        joined = "".join(cells)
        if not joined.strip():
            blank.add(last_line + 1)
        elif not cells[0].startswith("#"):
            rows.append((last_line + 1, cells))
        last_line = reader.line_num
    may_be_decimal = delimiter != ","
    may_have_two = may_be_decimal and "," in text and "." in text
    doubtful = marked_in_two_ways(rows) if may_have_two else {}
    for i, (line, cells) in enumerate(rows):
        # Most rows of long tables need nothing.
        if re.search(r"[\s,]", "".join(cells)):
            rows[i] = (line, list(map(tidy, cells, repeat(may_be_decimal))))
    return rows, blank, doubtful


def marked_in_two_ways(rows: list[tuple[int, list[str]]]) -> dict[tuple[int, int], str]:
    """The numbers that may be of thousands, since their mark is not that of most numbers, by line
    and place in it.
    """
    found = {
        (line, j): match
        for line, cells in rows
        for j, cell in enumerate(cells)
        if (match := MARKED.fullmatch(cell.strip()))
    }
    usual_mark = Counter(match[1] for match in found.values()).most_common(1)
    return {
        place: match[0]
        for place, match in found.items()
        if match[1] != usual_mark[0][0] and THOUSANDS.fullmatch(match[0])
    }
