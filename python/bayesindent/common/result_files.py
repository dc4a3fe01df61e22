"""Files of results: each is written beside its name and takes it when it is whole; numbers as CSV, JSON and netCDF hold them."""

import csv
import io
import json
import math
import os
from collections.abc import Iterable, Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path

import numpy as np

__all__ = ["as_csv", "cell", "plain", "read_json", "whole_file", "write_csv", "write_groups", "write_json", "write_text"]


@contextmanager
def whole_file(path: Path) -> Iterator[Path]:
    """Yield a path beside `path` to write to; what is there at the end takes the name, or nothing does after an exception."""
    path = Path(path)
    path.parent.mkdir(parents=True, exist_ok=True)
    beside = path.with_name(f".{path.stem}.{os.getpid()}{path.suffix}")
    try:
        yield beside
        with open(beside, "rb") as stream:
            os.fsync(stream.fileno())
        beside.replace(path)
    finally:
        beside.unlink(missing_ok=True)


def write_text(path: Path, text: str) -> None:
    """Write a text."""
    with whole_file(path) as beside:
        beside.write_text(text, encoding="utf-8", newline="")


def write_json(path: Path, document: dict) -> None:
    """Write a document."""
    write_text(path, json.dumps(plain(document), indent=1, allow_nan=False) + "\n")


def read_json(path: Path) -> dict:
    """The document of a file; an empty one where there is none."""
    return json.loads(path.read_text(encoding="utf-8")) if path.exists() else {}


def write_csv(path: Path, header: Sequence[str], rows: Iterable[Sequence], comment: str = "") -> None:
    """Write a table, under a line of comment."""
    write_text(path, (f"# {comment}\n" if comment else "") + as_csv(header, rows))


def write_groups(path: Path, groups: dict[str, tuple[dict, dict]]) -> None:
    """Write groups of variables (axes, values) and facts as netCDF, without xarray: importing that takes half a second."""
    import h5netcdf

    with whole_file(path) as beside, h5netcdf.File(beside, "w") as file:
        for name, (variables, facts) in groups.items():
            group = file.create_group(name)
            group.attrs.update(facts)
            for label, (axes, values) in variables.items():
                group.dimensions.update({axis: size for axis, size in zip(axes, values.shape) if axis not in group.dimensions})
                group.create_variable(label, axes, data=values)


def as_csv(header: Sequence[str], rows: Iterable[Sequence]) -> str:
    """A table as text; a float that is not given as text keeps its last bit."""
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow(header)
    writer.writerows([repr(float(value)) if isinstance(value, float) else value for value in row] for row in rows)
    return text.getvalue()


def cell(value) -> str:
    """A value for people: ten digits, nothing where it is not finite."""
    if isinstance(value, float):
        return f"{value:.10g}" if math.isfinite(value) else ""
    return str(value)


def plain(value):
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
