"""Tables (CSV) with lines of comments as rows, and the numbers of rows and columns."""

import csv
from collections.abc import Iterable, Mapping
from pathlib import Path

import numpy as np

__all__ = ["ANGLES", "column", "columns", "named_numbers", "numbers", "read_rows", "row_named"]

ANGLES = ("phi1_deg", "Phi_deg", "phi2_deg")


def read_rows(path: Path) -> list[dict[str, str]]:
    """The rows of a table without its comments."""
    with path.open(encoding="utf-8", newline="") as file:
        lines = [line for line in file if not line.startswith("#")]
    return list(csv.DictReader(lines))


def row_named(path: Path, name: str) -> dict[str, str]:
    """The first row whose cell below `name` is this."""
    return next(row for row in read_rows(path) if row["name"] == name)


def column(rows: Iterable[Mapping], name: str) -> list:
    """The cells of a column."""
    return [row[name] for row in rows]


def columns(rows: list[dict]) -> dict[str, list]:
    """The cells of each column, by its name."""
    return {name: column(rows, name) for name in rows[0]}


def named_numbers(row: Mapping, names: Iterable[str]) -> dict[str, float]:
    """The numbers of a row in these columns; an empty cell is zero."""
    return {name: float(row[name] or 0) for name in names}


def numbers(rows: Iterable[Mapping], names: Iterable[str]) -> np.ndarray:
    """The numbers of these columns, a row of them for each row of the table."""
    names = list(names)
    return np.array([list(named_numbers(row, names).values()) for row in rows])
