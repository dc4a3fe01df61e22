"""Load the packages that read files of other programs, and refuse files that cannot be read."""

import warnings
from collections.abc import Iterator
from contextlib import closing, contextmanager, redirect_stdout
from importlib import import_module
from importlib.util import find_spec
from io import StringIO
from pathlib import Path
from types import ModuleType

from ..common.packages import installation
from ..core import InputError
from .columns import abridged


def reader_of(path: Path, kind: str, module: str, otherwise: str = "") -> ModuleType:
    """The `module` of another package that reads a file of this `kind`. `otherwise` names a remedy
    other than the installation.
    """
    package = module.partition(".")[0]
    if not find_spec(package):
        raise InputError(
            f"reading {kind} needs {package}, which is not installed: "
            f"{installation(package)}{otherwise}"
        )
    try:
        found = import_module(module)
    except Exception as error:
        raise InputError(
            f"reading {kind} needs {package}, which is installed but cannot be imported "
            f"({type(error).__name__}: {error})"
        ) from None
    if not path.is_file():
        raise InputError("the file does not exist")
    return found


@contextmanager
def reading(words: str) -> Iterator[None]:
    """Turn the exceptions of a reader of a damaged file into a refusal, `words`, and suppress the
    reader's own warnings and output.
    """
    try:
        with warnings.catch_warnings(), redirect_stdout(StringIO()):
            warnings.simplefilter("ignore")
            yield
    except InputError:
        raise
    except Exception as error:
        raise InputError(f"{words} ({type(error).__name__})") from None


def decoded(content: bytes) -> tuple[str, str]:
    """The text of a file and its encoding, '' for UTF-8; an empty text if it is not text."""
    if content[:2] in (b"\xff\xfe", b"\xfe\xff"):
        return content.decode("utf-16", "replace"), "UTF-16"
    if b"\0" in content:
        return "", ""
    try:
        return content.decode("utf-8-sig"), ""
    except UnicodeDecodeError:
        return content.decode("cp1252", "replace"), "Windows-1252"


def refuse_formulas(openpyxl: ModuleType, path: Path, sheet: str, rows: list) -> None:
    """Refuse formulas whose values were never computed; `rows` are the lines and values of rows
    that have values.
    """
    values = dict(rows)
    with closing(openpyxl.load_workbook(path, read_only=True)) as book:
        book[sheet].reset_dimensions()
        found = [
            cell.coordinate
            for line, row in enumerate(book[sheet].iter_rows(), 1)
            for column, cell in enumerate(row)
            if str(cell.value).startswith("=") and not "".join(values.get(line, [])[column:][:1])
        ]
    if found:
        raise InputError(
            f"the sheet {sheet} has formulas without a stored value "
            f"({abridged(found)}): "
            "open it in a spreadsheet program and save it, or write the values"
        )
