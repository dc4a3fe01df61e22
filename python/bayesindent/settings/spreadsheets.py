"""Spreadsheets as the text of a table, which the core reads like any other; and what reads files that only other packages read."""

import csv
import sys
from contextlib import closing
from importlib import import_module
from io import StringIO
from pathlib import Path
from types import ModuleType

from ..core import InputError

__all__ = ["page_of", "reader_of"]


def reader_of(place: str, path: Path, kind: str, module: str, otherwise: str = "") -> ModuleType:
    """The `module` of another package that reads a file of this `kind`, which is there. `place` begins the message of a refusal; `otherwise`:
    what else can be done than to install the package."""
    package = module.partition(".")[0]
    try:
        import_module(package)
        found = import_module(module)
    except ImportError:
        raise InputError(
            f"{place}reading {kind} needs {package}, which is not installed: {sys.executable} -m pip install {package}{otherwise}"
        ) from None
    if not path.is_file():
        raise InputError(f"{place}the file does not exist")
    return found


def page_of(place: str, path: Path, sheet: str) -> str:
    """A sheet of an .xlsx file, the first one where `sheet` is empty: a line for each row, cells between tabs, numbers in full, formulas by
    the values that were last computed. `place` begins the message of a refusal."""
    openpyxl = reader_of(place, path, "a spreadsheet", "openpyxl", ", or save the sheet as CSV")
    try:
        with closing(openpyxl.load_workbook(path, read_only=True, data_only=True)) as book:
            if sheet and sheet not in book.sheetnames:
                raise InputError(f"{place}there is no sheet {sheet!r}; the sheets are {', '.join(book.sheetnames)}")
            page = StringIO()
            writer = csv.writer(page, delimiter="\t", lineterminator="\n")
            for row in book[sheet or book.sheetnames[0]].iter_rows(values_only=True):
                cells = ["" if value is None else " ".join(str(value).split()) for value in row]
                writer.writerow(cells if any(cells) else [])
    except InputError:
        raise
    except Exception as error:  # whatever a damaged file makes its reader raise
        raise InputError(f"{place}is no spreadsheet that can be read ({' '.join(f'{type(error).__name__}: {error}'.split())})") from None
    return page.getvalue()
