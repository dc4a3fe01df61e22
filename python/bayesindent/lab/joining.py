"""Join a table of moduli and a list of orientations by the names of the grains."""

import re
from pathlib import Path

from ..core import InputError
from .cleaning import clean
from .columns import ANGLES, DIRECTIONS, WAYS, abridged
from .header import table_of_rows
from .reading import rows_of_file
from .table import LaboratoryTable


def key_of(name: str) -> str:
    """What spellings of a name have in common: 'g1' of 'G 01' and 'Grain-1'."""
    key = re.sub(r"^(grain|korn)(?=[\s_.#-]*\d)", "g", name.strip().casefold())
    key = re.sub(r"(?<!\d)[\s_.#-]+|[\s_.#-]+(?!\d)", "", key)
    return re.sub(r"(?<!\d)0+(?=\d)", "", key)


def orientations_of_file(path: Path) -> LaboratoryTable:
    """The table of a list of orientations."""
    found = rows_of_file(path, "", [])
    if found is None or not found.rows:
        raise InputError("is no table of orientations")
    table = table_of_rows(found, [])
    clean(table)
    if not any(set(way) <= set(table.meanings) for way in (ANGLES, *WAYS)):
        raise InputError(
            f"the columns are {', '.join(table.names)}; the angles phi1, Phi, phi2 are needed, or "
            "indices"
        )
    return table


def add_orientations_of_file(table: LaboratoryTable, path: Path, by: str) -> None:
    """Add the orientations of a file to the rows of a table of moduli: those of the same grain, or,
    `by` 'order', those of the same row. Rows without an orientation are left out.
    """
    given = [name for name in table.meanings if name in ANGLES or name in DIRECTIONS]
    if given:
        raise InputError(f"the table of moduli has orientations too: the column {given[0]}")
    other = orientations_of_file(path)
    columns = [name for name in other.meanings if name in ANGLES or name in DIRECTIONS]
    cells = other.cells[[other.column(name) for name in columns]]
    rows = {line: list(row) for line, *row in cells.itertuples()}
    if by == "order":
        if len(rows) != len(table.cells):
            raise InputError(f"{len(rows)} orientations for {len(table.cells)} rows of moduli")
        found = dict(zip(table.cells.index, rows.values()))
    else:
        found = joined_by_name(table, other, rows)
    table.leave_out(set(table.cells.index) - found.keys(), f"no orientation in {path.name}")
    for j, name in enumerate(columns):
        table.add_column(name, [found[line][j] for line in table.cells.index])


def joined_by_name(
    table: LaboratoryTable, other: LaboratoryTable, rows: dict[int, list[str]]
) -> dict[int, list[str]]:
    """The cells of the orientation of each line of moduli whose grain is in both tables."""
    for each, what in ((table, "moduli"), (other, "orientations")):
        if each.column("grain") < 0:
            raise InputError(
                f"the {what} have no column of the grains' names (grain); name it, or state "
                "orientations_by = 'order' if both tables have the same order"
            )
    own = table.cells[table.column("grain")]
    theirs: dict[str, list[str]] = {}
    spelled: dict[str, str] = {}
    for line, name in other.cells[other.column("grain")].items():
        key = key_of(name)
        if theirs.setdefault(key, rows[line]) != rows[line]:
            raise InputError(f"line {line}: the grain {name} has two orientations")
        spelled[key] = name
    found = {line: theirs[key_of(name)] for line, name in own.items() if key_of(name) in theirs}
    if not found:
        raise InputError(
            f"no grain is in both tables: {abridged(own, 3)} have moduli, "
            f"{abridged(spelled.values(), 3)} orientations"
        )
    alone = [name for key, name in spelled.items() if key not in {*map(key_of, own)}]
    if alone:
        table.note(f"no modulus of the grains {abridged(alone)}")
    return found
