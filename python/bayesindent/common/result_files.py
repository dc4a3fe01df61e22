"""Files of results: each is written beside its name and takes it when it is whole; numbers as CSV,
JSON and netCDF hold them.

Documents (JSON) have a checksum as their last entry: the core writes and reads them.
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
    """Yield a path beside `path` to write to; what is there at the end takes the name, or nothing
    does after an exception.
    """
    path = Path(path)
    path.parent.mkdir(parents=True, exist_ok=True)
    beside = path.with_name(f".part-{os.getpid()}-{path.name}")
    beside.unlink(missing_ok=True)
    try:
        # Never through a link that somebody left there.
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
    """Write a document, which is not empty, and with it its checksum."""
    path.parent.mkdir(parents=True, exist_ok=True)
    call(
        "file.write_document",
        path=path,
        document=json.dumps(plain(document), indent=1, allow_nan=False) + "\n",
    )


def read_json(path: Path) -> dict:
    """The document of a file without its checksum, which the core verifies; an empty one where
    there is none.
    """
    return json.loads(call("file.read_document", path=path)["text"]) if path.exists() else {}


def write_csv(
    path: Path, header: Iterable[str], rows: Iterable[Iterable], comment: str = ""
) -> None:
    """Write a table, under a line of comment."""
    write_text(path, (f"# {comment}\n" if comment else "") + as_csv(header, rows))


def write_groups(path: Path, groups: dict[str, tuple[dict, dict]]) -> None:
    """Write groups of variables (axes, values, perhaps attributes) and facts as netCDF, without
    xarray: importing that takes half a second.
    """
    call("file.check_memory", bytes=1e8, what=path.name)
    import h5netcdf

    # In memory: HDF5 does not recover from a disk that is full.
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
    """A table as text; a float that is not given as text keeps its last bit."""
    text = io.StringIO()
    csv.writer(text, lineterminator="\n").writerows([header, *rows])
    return text.getvalue()


def plain(value: Any) -> Any:
    """What JSON can hold: numbers of numpy become Python's, what is not finite becomes null."""
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
