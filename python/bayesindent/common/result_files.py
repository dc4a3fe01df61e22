"""Write files of results (CSV, JSON, netCDF). Each file is written beside its final name and
renamed once it is complete.

Documents (JSON) end with a checksum; the core writes and reads them.
"""

import csv
import io
import json
import math
import os
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np

from ..core import call


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
            group.dimensions = {
                axis: size
                for axes, values, *_ in variables.values()
                for axis, size in zip(axes, values.shape)
            }
            for label, (axes, values, *attributes) in variables.items():
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
