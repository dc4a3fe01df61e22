"""Spreadsheets as the text of a table, which the core reads like any other."""

import csv
from contextlib import closing
from io import StringIO
from pathlib import Path
from zipfile import BadZipFile

from ..core import InputError
from .foreign_files import reader_of

__all__ = ["page_of"]


def page_of(place: str, path: Path, sheet: str) -> str:
    """A sheet of an .xlsx file, the first one where `sheet` is empty: a line for each row, cells between tabs, numbers in full, formulas by
    the values that were last computed. `place` begins the message of a refusal."""
    openpyxl = reader_of(place, path, "a spreadsheet", "openpyxl", ", or save the sheet as CSV")
    try:
        book = openpyxl.load_workbook(path, read_only=True, data_only=True)
    except (openpyxl.utils.exceptions.InvalidFileException, BadZipFile, KeyError, OSError, ValueError) as error:
        raise InputError(f"{place}is no spreadsheet that can be read ({error})") from None
    with closing(book):
        if sheet and sheet not in book.sheetnames:
            raise InputError(f"{place}there is no sheet {sheet!r}; the sheets are {', '.join(book.sheetnames)}")
        page = StringIO()
        writer = csv.writer(page, delimiter="\t", lineterminator="\n")
        for row in book[sheet or book.sheetnames[0]].iter_rows(values_only=True):
            cells = ["" if value is None else " ".join(str(value).split()) for value in row]
            writer.writerow(cells if any(cells) else [])
    return page.getvalue()
