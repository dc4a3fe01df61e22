"""Read the rows of a table, text or spreadsheet, or of a table of Python, as lists of texts."""

import csv
import re
from collections.abc import Iterable, Mapping
from contextlib import closing
from dataclasses import dataclass, field
from io import StringIO
from pathlib import Path
from typing import Any
from zipfile import ZipFile

from ..common.result_files import as_csv
from ..core import InputError
from .cells import is_number, rows_of, tabbed, tidy, usual
from .columns import MODULI, NAME_COLUMNS, meaning_of
from .other_files import decoded, reader_of, reading, refuse_formulas

#: More rows and more bytes are refused: ten tests of each of the grains that the core takes.
MOST_ROWS, MOST_BYTES = 200_000, 100_000_000
#: Bytes of the parts of a spreadsheet when unpacked.
MOST_UNPACKED = 1_000_000_000
#: The first bytes of spreadsheets of Excel before 2007.
OLD_EXCEL = bytes.fromhex("d0cf11e0")
#: The sheet of NanoSuite that has the Poisson's ratio.
INPUTS = "Required Inputs"
#: A header is looked for among so many rows.
FIRST_ROWS = 60


@dataclass
class Rows:
    """Rows of texts with the numbers of their lines, the lines that are blank, the name of a sheet,
    the text of the file, notes on how it was read, Poisson's ratios in other sheets, and numbers
    that can be read in two ways by line and place.
    """

    rows: list[tuple[int, list[str]]]
    blank: set[int]
    sheet: str = ""
    text: str = ""
    notes: tuple[str, ...] = ()
    ratios: list[str] = field(default_factory=list)
    doubtful: dict[tuple[int, int], str] = field(default_factory=dict)


def rows_of_file(path: Path, sheet: str, stated: Iterable[str]) -> Rows | None:
    """The rows of a file; None if it is no table, which the core then refuses.

    `sheet` names a sheet of a spreadsheet, and `stated` are headers that the user named.
    """
    if path.suffix.lower() in (".xlsx", ".xlsm"):
        return rows_of_sheet(path, sheet)
    if not path.is_file():
        return None
    try:
        with path.open("rb") as file:
            content = file.read(MOST_BYTES + 1)
    except OSError:
        return None
    lines = content.count(b"\n")
    if len(content) > MOST_BYTES or lines > 2 * MOST_ROWS:
        raise InputError(f"{lines} rows; allowed up to {MOST_ROWS}")
    if content.startswith(OLD_EXCEL):
        raise InputError("is an old Excel file; save it as .xlsx")
    text, encoding = decoded(content)
    if not text:
        return None
    with reading("is no table that can be read"):
        # A stated header is looked for as it is written.
        own = tabbed(usual(text) if all(usual(header) == header for header in stated) else text)
        refuse_open_quote(own)
        rows, blank, doubtful = rows_of(own)
        if header_row(rows, stated)[1] < 2:
            own = tabbed(re.sub("(?m)^#+[ \t]*", "", own))
            rows, blank, doubtful = rows_of(own)
        first = rows[0][1] if rows else []
        if header_row(rows, stated)[1] < 2 and sum(map(is_number, first)) >= len(first) / 2:
            return None
    notes = (f"read as {encoding}",) if encoding else ()
    return Rows(rows, blank, text=text, notes=notes, doubtful=doubtful)


def text_with_commas(path: Path) -> str | None:
    """The text of a table whose header has semicolons or tabs but no comma, with commas between the
    cells and decimal points; each row keeps its line. None for other files.
    """
    if not path.is_file() or path.stat().st_size > MOST_BYTES:
        return None
    try:
        text = decoded(path.read_bytes())[0]
    except OSError:
        return None
    header = next((line for line in text.splitlines() if line.strip() and line[0] != "#"), "")
    if "," in header or not re.search("[;\t]", header):
        return None
    rows = dict(rows_of(text)[0])
    first, *others = [rows.get(number, []) for number in range(1, max(rows) + 1)]
    return as_csv(first, others)


def refuse_open_quote(text: str) -> None:
    """Refuse a text in which a double quote that begins a cell is not closed."""
    if '"' not in text:
        return
    begin = 1
    reader = csv.reader(StringIO(text, newline=""), skipinitialspace=True, strict=True)
    try:
        for _ in reader:
            begin = reader.line_num + 1
    except csv.Error as error:
        if "end of data" in str(error):
            raise InputError(f"line {begin}: a double quote is not closed") from None


def rows_of_sheet(path: Path, sheet: str) -> Rows:
    """The rows of a sheet. Without a stated `sheet` it is the first one, or, if that has no moduli,
    the only one with moduli.
    """
    openpyxl = reader_of(path, "a spreadsheet", "openpyxl", ", or save the sheet as CSV")
    with reading("is no spreadsheet that can be read"):
        with ZipFile(path) as archive:
            size = sum(item.file_size for item in archive.infolist())
        if size > MOST_UNPACKED:
            raise InputError(f"{size} bytes when unpacked; allowed up to {MOST_UNPACKED}")
        with closing(openpyxl.load_workbook(path, read_only=True, data_only=True)) as book:
            if sheet and sheet not in book.sheetnames:
                raise InputError(
                    f"there is no sheet {sheet!r}; the sheets are {', '.join(book.sheetnames)}"
                )
            names = [name for name in book.sheetnames if sheet in ("", name) or name == INPUTS]
            rows = {name: filled_rows(book[name]) for name in names}
        fit = [name for name, page in rows.items() if set(MODULI) & set(header_row(page)[2])]
        name = sheet or next(iter(rows))
        if len(fit) > 1 and name not in fit:
            raise InputError(
                f"the sheets {', '.join(fit)} have moduli; state sheet = '{fit[0]}' or another"
            )
        name = name if name in fit or not fit else fit[0]
        filled = {line: len(cells) for line, cells in rows[name]}
        refuse_formulas(openpyxl, path, name, rows[name])
    blank = set(range(1, max(filled, default=0))) - {*filled}
    ratios = [ratio for other, page in rows.items() if other != name for ratio in ratios_of(page)]
    return Rows(rows[name], blank, name, ratios=ratios)


def ratios_of(rows: list[tuple[int, list[str]]]) -> list[str]:
    """The Poisson's ratios in a column of a sheet."""
    header, _, meanings = header_row(rows)
    if "sample_nu" not in meanings:
        return []
    j = meanings.index("sample_nu")
    return [cell for _, cells in rows[header + 1 :] for cell in cells[j : j + 1] if is_number(cell)]


def filled_rows(sheet: Any) -> list[tuple[int, list[str]]]:
    """The rows of a sheet that are not empty, up to their last filled cell. A sheet may claim to
    have a million rows.
    """
    sheet.reset_dimensions()
    rows: list[tuple[int, list[str]]] = []
    for line, row in enumerate(sheet.iter_rows(), 1):
        cells = [cell_text(shown_value(cell)) for cell in row]
        while cells and not cells[-1]:
            cells.pop()
        if cells:
            rows.append((line, cells))
        if len(rows) > MOST_ROWS:
            raise InputError(f"more than {MOST_ROWS} rows; allowed up to {MOST_ROWS}")
    return rows


def shown_value(cell: Any) -> object:
    """The value of a cell of a spreadsheet; one that is shown in per cent with its sign. A sign in
    quotes or after a backslash scales nothing.
    """
    is_number = isinstance(cell.value, float)
    if is_number and "%" in re.sub(r'"[^"]*"|[\\_].', "", cell.number_format):
        return f"{100 * cell.value:.12g} %"
    return cell.value


def rows_of_columns(table: Mapping[str, Iterable]) -> Rows:
    """The rows of a table of Python; the first one below the header is line 1."""
    columns = []
    for name, values in table.items():
        are_numbers = meaning_of(str(name)) not in NAME_COLUMNS
        columns.append([cell_text(value, are_numbers) for value in values])
    rows = enumerate(map(list, zip(*columns, strict=True)), 1)
    return Rows([(0, list(map(str, table))), *rows], set())


def cell_text(value: object, decimal_commas: bool = True) -> str:
    """The text of a value of a spreadsheet or of Python; NaN and None are empty."""
    return usual(tidy("" if value is None or value != value else value, decimal_commas))


def header_row(
    rows: list[tuple[int, list[str]]], stated: Iterable[str] = ()
) -> tuple[int, int, list[str]]:
    """The index of the header among the first rows, the number of its names that are known, and
    their meanings, 'stated' for headers that the user named. The header is the row with the most
    known names.
    """
    own = {header.lower() for header in stated}
    best: tuple[int, int, list[str]] = (0, 0, [])
    for i, (_, cells) in enumerate(rows[:FIRST_ROWS]):
        if sum(map(is_number, cells)) <= len(cells) // 2:
            meanings = ["stated" if name.lower() in own else meaning_of(name) for name in cells]
            known = len(set(meanings) - {""})
            best = (i, known, meanings) if known > best[1] else best
    return best
