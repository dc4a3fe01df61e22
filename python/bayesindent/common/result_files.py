"""Write files of results (CSV, JSON, netCDF). Each file is written beside its final name and
renamed once it is complete.

Documents (JSON) end with a checksum; the core writes and reads them. Their forms (names, kinds and
shapes) are in documents.json. A form is a kind (see `KINDS`), '=' and a value, or the name of
another form; a list of the form of the items and perhaps their number; or an object of the forms of
entries. An entry whose name ends in '?' may be absent, '*' stands for all others, and '|' for
several forms of which one is right. Entries without a form are not checked. A name beside a list,
or after '*', is that of an axis: lists of an axis have the same length, and objects the same names.
"""

import csv
import io
import json
import math
import os
import sys
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np

from ..core import call

#: Forms of documents by the names of their files, and those that they share.
FORMS = json.loads(Path(__file__).with_name("documents.json").read_text(encoding="utf-8"))


def is_number(value: Any, largest: float = 1e30) -> bool:
    """Whether a value is a finite number, and no absurd one."""
    return type(value) in (int, float) and abs(value) <= largest


KINDS = {
    "text": lambda value: isinstance(value, str),
    "logical": lambda value: isinstance(value, bool),
    "real": lambda value: is_number(value, sys.float_info.max),
    "number": is_number,
    "number?": lambda value: value is None or is_number(value),
    "positive": lambda value: is_number(value) and value > 0,
    "count": lambda value: is_number(value) and value >= 0 and value == int(value),
}


@contextmanager
def whole_file(path: Path) -> Iterator[Path]:
    """Yield a path beside `path` to write to. The file is renamed to `path` at the end, and removed
    after an exception.
    """
    path = Path(path)
    path.parent.mkdir(parents=True, exist_ok=True)
    beside = path.with_name(f".part-{os.getpid()}-{path.name}")
    beside.unlink(missing_ok=True)
    try:
        # A link of that name must not redirect the writing.
        os.close(os.open(beside, os.O_CREAT | os.O_EXCL | os.O_NOFOLLOW, 0o666))
        yield beside
        with open(beside, "rb") as stream:
            os.fsync(stream.fileno())
        beside.replace(path)
    except OSError as error:
        raise OSError(error.errno, error.strerror, str(path)) from error
    finally:
        beside.unlink(missing_ok=True)


def write_text(path: Path, text: str) -> None:
    """Write a text."""
    with whole_file(path) as beside:
        beside.write_text(text, encoding="utf-8", newline="")


def write_json(path: Path, document: dict) -> None:
    """Write a document, which must not be empty, with its checksum."""
    path.parent.mkdir(parents=True, exist_ok=True)
    call(
        "file.write_document",
        path=path,
        document=json.dumps(plain(document), indent=1, allow_nan=False) + "\n",
    )


def read_json(path: Path) -> dict:
    """The document of a file, whose checksum the core verifies; an empty one if there is no
    file.
    """
    return json.loads(call("file.read_document", path=path)["text"]) if path.exists() else {}


def write_csv(
    path: Path, header: Iterable[str], rows: Iterable[Iterable], comment: str = ""
) -> None:
    """Write a table under a line of comment."""
    write_text(path, (f"# {comment}\n" if comment else "") + as_csv(header, rows))


def write_groups(path: Path, groups: dict[str, tuple[dict, dict]]) -> None:
    """Write groups of variables (axes, values, perhaps attributes) and facts as netCDF. This does
    without xarray, whose import takes half a second.
    """
    call("file.check_memory", bytes=1e8, what=path.name)
    import h5netcdf

    # The file is made in memory, since HDF5 does not recover from a full disk.
    content = io.BytesIO()
    with h5netcdf.File(content, "w") as file:
        for name, (variables, facts) in groups.items():
            group = file.create_group(name)
            group.attrs.update(facts)
            for label, (axes, values, *attributes) in variables.items():
                group.dimensions.update(
                    {
                        axis: size
                        for axis, size in zip(axes, values.shape)
                        if axis not in group.dimensions
                    }
                )
                group.create_variable(label, axes, data=values).attrs.update(*attributes)
    with whole_file(path) as beside:
        beside.write_bytes(content.getvalue())


def as_csv(header: Iterable[str], rows: Iterable[Iterable]) -> str:
    """A table as text; floats are written with all their bits."""
    text = io.StringIO()
    csv.writer(text, lineterminator="\n").writerows([header, *rows])
    return text.getvalue()


def plain(value: Any) -> Any:
    """The value with types that JSON has: numbers of NumPy become Python's, and numbers that are
    not finite become null.
    """
    if isinstance(value, dict):
        return {str(key): plain(item) for key, item in value.items()}
    if isinstance(value, list | tuple):
        return [plain(item) for item in value]
    if isinstance(value, np.ndarray | np.generic):
        return plain(value.tolist())
    if isinstance(value, Path):
        return str(value)
    if isinstance(value, float) and not math.isfinite(value):
        return None
    return value


def misfits(value: Any, form: Any, axes: dict, place: str = "") -> Iterator[str]:
    """The places in a document, or a part of it, that have not their form; `axes` are those that
    were met, with their sizes or names.
    """
    if isinstance(form, str) and form in FORMS:
        form = FORMS[form]
    if isinstance(form, str):
        if not (KINDS[form](value) if form in KINDS else form == f"={text_of(value)}"):
            yield place
    elif isinstance(form, list):
        inner, *axis = form
        size = len(value) if isinstance(value, list) else -1
        if size < 0 or any(axes.setdefault(name, size) != size for name in axis):
            yield place
        for number, item in enumerate(value if size > 0 else []):
            yield from misfits(item, inner, dict(axes), f"{place}[{number}]")
    elif not isinstance(value, dict):
        yield place
    elif "|" in form:
        found = [next(misfits(value, each, dict(axes), place), "") for each in form["|"]]
        if all(found):
            yield max(found, key=len)
    else:
        for key, inner in form.items():
            names = [key.rstrip("?")]
            if key.startswith("*"):
                names = [name for name in value if name not in form]
                if key != "*" and axes.setdefault(key, set(names)) != set(names):
                    yield place
            for name in names:
                if name in value:
                    yield from misfits(value[name], inner, axes, f"{place}.{name}")
                elif not key.endswith("?"):
                    yield f"{place}.{name}"


def text_of(value: Any) -> str:
    """A value as it is written after '='."""
    return value if isinstance(value, str) else json.dumps(value)
