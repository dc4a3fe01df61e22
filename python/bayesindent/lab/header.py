"""Find the header of a table: its names, its row of units, and a header of two rows."""

import re
from collections.abc import Iterable
from itertools import pairwise

import pandas as pd

from ..core import InputError
from .cells import is_number
from .columns import HARDNESS, meaning_of
from .reading import Rows, header_row
from .table import LaboratoryTable

#: A cell of a row of units, such as "[GPa]", of those that are read and of others.
UNIT = re.compile(
    r"[\[(]?(deg|degrees?|°|rad|radians|[GMk]?Pa|um|µm|μm|nm|mm|m?N|%|-"
    r"|[kM]?(bar|psi)|px|pixels?|Å|min|h)[\])]?",
    re.I,
)


def table_of_rows(found: Rows, stated: Iterable[str]) -> LaboratoryTable:
    """The table of rows, with the names of its columns and their meanings."""
    rows = found.rows
    header, _, meanings = header_row(rows, stated)
    line, names = rows[header]
    meanings = meanings or [""] * len(names)
    begin, notes = header + 1, list(found.notes)
    # The row above or below may belong to the header.
    for upper, lower in pairwise(range(max(header - 1, 0), min(header + 2, len(rows)))):
        above, (last, under) = rows[upper], rows[lower]
        few_numbers = sum(map(is_number, under)) <= len(names) // 2
        if few_numbers and (joined := joined_header(above[1], under, meanings)):
            (names, meanings), begin = joined, lower + 1
            notes.append(f"lines {above[0]} and {last} together are the header")
            break
    else:
        if header:
            lines = f"{header} line{'s' * (header > 1)}"
            notes.append(f"the header is on line {line}; {lines} above it left out")
    below = rows[begin:]
    width = max((j + 1 for j, name in enumerate(names) if name), default=0)
    names = names[:width]
    units = [""] * width
    under = below[0][1] if below else []
    # Several cells are units, and none is a number.
    if sum(map(bool, map(UNIT.fullmatch, under))) > 1 and not any(map(is_number, under)):
        units = [
            cell.strip("[]()- ").lower() if UNIT.fullmatch(cell) else ""
            for cell in [*under, *units][:width]
        ]
        below = below[1:]
    check_widths(below, names, line)
    cells = [[*row, *[""] * width][:width] for _, row in below]
    table = LaboratoryTable(
        names,
        [meaning.replace("stated", "") for meaning in meanings[:width]],
        pd.DataFrame(cells, [number for number, _ in below], range(width), dtype=object),
        units,
        line,
        found.sheet,
        found.blank,
        notes=notes,
        doubtful=found.doubtful,
    )
    if not found.sheet:
        table.short = {number: len(row) for number, row in below if len(row) < width}
    again = (number for number, row in below if row == rows[header][1])
    table.leave_out(again, "the header once more")
    return table


def check_widths(below: list, names: list[str], header_line: int) -> None:
    """Refuse a row with cells beyond the header."""
    for number, cells in below:
        if any(cells[len(names) :]):
            title = f"; if line {header_line} is a title, put # before it" * (len(names) == 1)
            commas = "; if commas are decimal, separate the cells by semicolons"
            raise InputError(
                f"line {number}: {len(cells)} cells where the header has {len(names)}"
                f"{title or commas}"
            )


def joined_header(
    above: list[str], below: list[str], meanings: list[str]
) -> tuple[list[str], list[str]] | None:
    """Names and meanings of a header of two rows; None if joining them gives no further meaning.

    A cell of the upper row stands over several columns, and the lower row completes it.
    """
    upper, last = [], ""
    for cell in [*above, *[""] * len(below)][: len(below)]:
        last = cell or last
        upper.append(last)
    names, found = [], []
    for up, low in zip(upper, below):
        # Prefer both rows together, then the lower one alone; what stands below a hardness, such
        # as its sd, belongs to the hardness.
        choices = [f"{up} {low}".strip(), low, up if not low else ""]
        specific = (name for name in choices if meaning_of(name) not in ("", "modulus_gpa"))
        best = choices[0] if HARDNESS.fullmatch(up) else next(specific, low)
        names.append(best)
        found.append(meaning_of(best))
    return (names, found) if len(set(found) - {""}) > len(set(meanings) - {""}) else None
