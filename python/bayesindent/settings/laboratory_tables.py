"""Read tables of measurements as laboratories have them, text or spreadsheet, and make the plain
table that the core reads.

A plain table stays as it is. In other tables the header may stand below other lines. Rows of
statistics and incomplete rows are left out. Cells such as `46.3°`, `109.7 ± 3.0`, `5 %` and
`[1 0 2]` become numbers. Repeated tests without sds get standard errors. A note describes each
change. Rows keep their line numbers, so that messages of the core name the lines of the file.
"""

import re
from collections.abc import Iterable, Sequence
from contextlib import closing
from pathlib import Path

from ..core import InputError, call
from .other_files import decoded, reader_of, reading, refuse_formulas
from .table_cells import is_number, rows_of, tabbed, tidy, usual
from .table_cleaning import HARDNESS, MODULI, LaboratoryTable, clean

#: Longer files are passed on unread: the core checks the limit of rows itself.
MOST_LINES = 200_000


def laboratory_table(
    place: str, path: Path, sheet: str = "", stated: Iterable[str] = ()
) -> LaboratoryTable | None:
    """The table of a file; None if the core shall read the file itself, or refuse it.

    `place` begins the message of a refusal, `sheet` names a sheet of a spreadsheet, and `stated`
    are the headers whose meaning the user stated.
    """
    if path.suffix.lower() in (".xlsx", ".xlsm"):
        return understood(place, *sheet_of(place, path, sheet, stated), stated, is_plain=False)
    try:
        # A pipe can be read only once, and the core reads it.
        content = path.read_bytes() if path.is_file() else b""
    except OSError:
        return None
    text, encoding = decoded(content) if content.count(b"\n") <= MOST_LINES else ("", "")
    if not text:
        return None
    with reading(place, "is no table that can be read"):
        # The core looks for a stated header as it is written.
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
    """The rows of a sheet with their numbers, and its name. Without a stated `sheet` it is the
    first one, or, if that has no moduli, the only one with moduli.
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
        rows: dict[str, list] = {}
        for name, page in pages.items():
            rows[name] = []
            for number, values in enumerate(page, 1):
                cells = [usual(tidy(value)) for value in values]
                rows[name] += [(number, cells)] if any(cells) else []
        fit = [name for name, page in rows.items() if set(MODULI) & set(header_of(page, stated)[2])]
        name = next(iter(rows))
        if len(fit) > 1 and name not in fit:
            raise InputError(
                f"{place}the sheets {', '.join(fit)} have moduli; "
                f"state sheet = '{fit[0]}' or another"
            )
        name = name if name in fit or not fit else fit[0]
        refuse_formulas(place, openpyxl, path, name, pages[name])
    return rows[name], name


def meanings_of(names: Sequence[str], stated: Iterable[str] = ()) -> list[str]:
    """The canonical names that the core gives to headers, '' for none; 'stated' for headers whose
    meaning the user stated.
    """
    found = [call("file.column_name", header=without_mean(name))["text"] for name in names]
    own = {header.lower() for header in stated}
    return [
        "stated" if name.lower() in own else meaning
        for name, meaning in zip(names, found, strict=True)
    ]


def without_mean(name: str) -> str:
    """A header without a word for the mean: 'Er (GPa)' of 'Mean Er (GPa)'."""
    return re.sub(r"\b[ _]*(mean|average|avg)[ _]*\b", " ", name, flags=re.I).strip() or name


def header_of(
    rows: list[tuple[int, list[str]]], stated: Iterable[str]
) -> tuple[int, int, list[str]]:
    """The index of the header among the first 60 rows, the number of its names that are known, and
    their meanings. The header is the row with the most known names.
    """
    best: tuple[int, int, list[str]] = (0, 0, [])
    for i, (_, cells) in enumerate(rows[:60]):
        if sum(map(is_number, cells)) <= len(cells) // 2:
            meanings = meanings_of(cells, stated)
            known = len(set(meanings) - {""})
            best = (i, known, meanings) if known > best[1] else best
    return best


def understood(
    place: str,
    rows: list[tuple[int, list[str]]],
    sheet: str,
    stated: Iterable[str],
    is_plain: bool = True,
) -> LaboratoryTable:
    """The table of numbered rows of cells: its header is found and its rows are cleaned."""
    header, _, meanings = header_of(rows, stated)
    if not rows:
        return LaboratoryTable(place, [], [], [], [], sheet=sheet, is_plain=is_plain)
    line, names = rows[header]
    below = rows[header + 1 :]
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
    if header and (joined := joined_header(rows[header - 1][1], names, meanings, stated)):
        together = rows[header - 1][0], line
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
    elif header:
        lines = f"{header} line{'s' * (header > 1)}"
        table.note(f"the header is on line {line}; {lines} above it left out")
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
    # The core refuses a line with too many cells.
    if all(len(row) == width for row in table.rows):
        lengths = {} if sheet else {number: len(cells) for number, cells in below}
        clean(table, {number: length for number, length in lengths.items() if length < width})
    return table


def joined_header(
    above: list[str], below: list[str], meanings: list[str], stated: Iterable[str]
) -> tuple[list[str], list[str]] | None:
    """Names and meanings of a header of two rows; None if joining them gives no further meaning.

    A cell of the upper row stands over several columns, and the lower row completes it.
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
    joined_names, joined_meanings = [], []
    for j, up in enumerate(upper):
        # Prefer both rows together, then the lower one alone; what stands below a hardness, such
        # as its sd, belongs to the hardness.
        specific = [k for k in (1, 0, 2) if found[k][j] not in ("", "modulus_gpa")]
        best = 1 if HARDNESS.fullmatch(up) else next(iter(specific), 0)
        joined_names.append(choices[j][best])
        joined_meanings.append(found[best][j])
    if len(set(joined_meanings) - {""}) <= len(set(meanings) - {""}):
        return None
    return joined_names, joined_meanings
