"""Tables of measurements as laboratories have them, text or spreadsheet, made into the plain table
that the core reads.

A plain table stays as it is. Of others the header is found below other lines, rows of statistics
and incomplete rows are left out, cells such as `46.3°`, `109.7 ± 3.0`, `5 %` and `[1 0 2]` become
numbers, and repeated tests without sds means with standard errors. Each change is said in a note.
Lines keep their numbers, so that messages of the core name those of the file.
"""

import re
from collections.abc import Iterable, Sequence
from contextlib import closing
from pathlib import Path

from ..core import InputError, call
from .other_files import decoded, reader_of, reading, refuse_formulas
from .table_cells import is_number, rows_of, tabbed, tidy, usual
from .table_cleaning import HARDNESS, MODULI, LaboratoryTable, clean

#: Longer files are plain tables.
MOST_LINES = 200_000


def laboratory_table(
    place: str, path: Path, sheet: str = "", stated: Iterable[str] = ()
) -> LaboratoryTable | None:
    """The table of a file; None if it is none that needs changes, or none at all, which is the
    core's to say. `place` begins the message of a refusal; `sheet`: of a spreadsheet; `stated`:
    headers that the user gave a meaning.
    """
    if path.suffix.lower() in (".xlsx", ".xlsm"):
        return understood(place, *sheet_of(place, path, sheet, stated), stated, is_plain=False)
    try:
        # A pipe can be read but once.
        content = path.read_bytes() if path.is_file() else b""
    except OSError:
        return None
    # Of so many lines the core says soon whether they are too many.
    text, encoding = decoded(content) if content.count(b"\n") <= MOST_LINES else ("", "")
    if not text:
        return None
    with reading(place, "is no table that can be read"):
        # The core finds a stated header as it is written.
        own = tabbed(usual(text) if all(usual(header) == header for header in stated) else text)
        if header_of(rows := rows_of(own), stated)[1] < 2:
            own = tabbed(re.sub("(?m)^#+[ \t]*", "", own))
            rows = rows_of(own)
    if header_of(rows, stated)[1] < 2:
        return None
    table = understood(
        place, rows, "", stated, is_plain=own == text and "\n" in text and "|" not in text
    )
    if encoding:
        table.note(f"read as {encoding}")
    return table


def sheet_of(place: str, path: Path, sheet: str, stated: Iterable[str]) -> tuple[list, str]:
    """The rows of a sheet of a spreadsheet with their numbers, and its name: the one that is asked
    for, or the first that has a table of moduli.
    """
    openpyxl = reader_of(place, path, "a spreadsheet", "openpyxl", ", or save the sheet as CSV")
    with reading(place, "is no spreadsheet that can be read"):
        with closing(openpyxl.load_workbook(path, read_only=True, data_only=True)) as book:
            if sheet and sheet not in book.sheetnames:
                raise InputError(
                    f"{place}there is no sheet {sheet!r}; the sheets are "
                    f"{', '.join(book.sheetnames)}"
                )
            pages = {
                name: list(book[name].iter_rows(values_only=True))
                for name in ([sheet] if sheet else book.sheetnames)
            }
        rows = {}
        for name, page in pages.items():
            numbered = enumerate(([usual(tidy(value)) for value in row] for row in page), 1)
            rows[name] = [(number, cells) for number, cells in numbered if any(cells)]
        fit = [name for name, page in rows.items() if set(MODULI) & set(header_of(page, stated)[2])]
        if len(fit) > 1 and next(iter(rows)) not in fit:
            raise InputError(
                f"{place}the sheets {', '.join(fit)} have moduli; "
                f"state sheet = '{fit[0]}' or another"
            )
        name = next(iter(rows)) if next(iter(rows)) in fit or not fit else fit[0]
        refuse_formulas(place, openpyxl, path, name, pages[name])
    return rows[name], name


def meanings_of(names: Sequence[str], stated: Iterable[str] = ()) -> list[str]:
    """What the core takes headers for; those that the user gave a meaning are 'stated'."""
    found = [call("file.column_name", header=without_mean(name))["text"] for name in names]
    own = {header.lower() for header in stated}
    return [
        "stated" if name.lower() in own else meaning
        for name, meaning in zip(names, found, strict=True)
    ]


def without_mean(name: str) -> str:
    """'Er (GPa)' of 'Mean Er (GPa)'."""
    return re.sub(r"\b[ _]*(mean|average|avg)[ _]*\b", " ", name, flags=re.I).strip() or name


def header_of(
    rows: list[tuple[int, list[str]]], stated: Iterable[str]
) -> tuple[int, int, list[str]]:
    """The place of the header among the first rows, how many of its names are known, and what they
    mean.
    """
    best: tuple[int, int, list[str]] = (0, 0, [])
    for i, (_, cells) in enumerate(rows[:60]):
        found = meanings_of(cells, stated) if sum(map(is_number, cells)) <= len(cells) // 2 else []
        if (known := len(set(found) - {""})) > best[1]:
            best = (i, known, found)
    return best


def understood(
    place: str,
    rows: list[tuple[int, list[str]]],
    sheet: str,
    stated: Iterable[str],
    is_plain: bool = True,
) -> LaboratoryTable:
    """The table of rows of cells with their numbers."""
    at, _, meanings = header_of(rows, stated)
    if not rows:
        return LaboratoryTable(place, [], [], [], [], sheet=sheet, is_plain=is_plain)
    line, names = rows[at]
    below = rows[at + 1 :]
    table = LaboratoryTable(
        place,
        list(names),
        meanings or [""] * len(names),
        [],
        [],
        header_line=line,
        sheet=sheet,
        is_plain=is_plain,
    )
    if at and (joined := joined_header(rows[at - 1][1], names, meanings, stated)):
        together = rows[at - 1][0], line
    elif (
        below
        and sum(map(is_number, below[0][1])) <= len(names) // 2
        and (joined := joined_header(names, below[0][1], meanings, stated))
    ):
        together, below = (line, below[0][0]), below[1:]
    else:
        joined = None
    if joined:
        table.names, table.meanings = joined
        table.note("lines {} and {} together are the header".format(*together))
    elif at:
        table.note(f"the header is on line {line}; {at} line{'s' * (at > 1)} above it left out")
    short = [
        without_mean(name) if meaning else name
        for name, meaning in zip(table.names, table.meanings)
    ]
    table.names, table.is_plain = short, table.is_plain and short == table.names
    width = max((j + 1 for j, name in enumerate(table.names) if name), default=0)
    table.names, table.meanings = table.names[:width], table.meanings[:width]
    table.rows = [
        cells if any(cells[width:]) else [*cells, *[""] * width][:width] for _, cells in below
    ]
    table.lines = [number for number, _ in below]
    table.leave_out(
        (i for i, (_, cells) in enumerate(below) if cells == names), "the header once more"
    )
    # Of a cell too many the core says the line.
    if all(len(row) == width for row in table.rows):
        clean(
            table,
            {} if sheet else {number: len(cells) for number, cells in below if len(cells) < width},
        )
    return table


def joined_header(
    above: list[str], below: list[str], meanings: list[str], stated: Iterable[str]
) -> tuple[list[str], list[str]] | None:
    """Names and meanings of two rows of headers, where the lower one completes the upper one, which
    stands over several columns; or None.
    """
    upper, last = [], ""
    for cell in [*above, *[""] * len(below)][: len(below)]:
        last = cell or last
        upper.append(last)
    choices = [
        [low, f"{up} {low}".strip(), up if not low else ""]
        for up, low in zip(upper, below, strict=True)
    ]
    found = [meanings_of(names, stated) for names in zip(*choices, strict=True)]
    best = [
        next((k for k in (1, 0, 2) if found[k][j] not in ("", "modulus_gpa")), 0)
        for j in range(len(below))
    ]
    # What stands below a hardness is its own.
    best = [1 if HARDNESS.fullmatch(up) else k for k, up in zip(best, upper, strict=True)]
    result = [found[k][j] for j, k in enumerate(best)]
    if len(set(result) - {""}) <= len(set(meanings) - {""}):
        return None
    return [choices[j][k] for j, k in enumerate(best)], result
