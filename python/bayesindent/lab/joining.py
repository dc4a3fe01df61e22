"""Join a table of moduli and a list of orientations by the names of the grains."""

from pathlib import Path

import pandas as pd

from ..core import InputError
from .cleaning import clean, key_of
from .columns import ANGLES, WAYS, abridged
from .header import table_of_rows
from .reading import rows_of_file
from .table import LaboratoryTable

#: What a list of orientations may have beside the angles and the names.
BESIDE = ("orientation_sd_deg", "grain_radius_um")


def orientations_of_file(path: Path, radians: bool) -> LaboratoryTable:
    """The table of a list of orientations."""
    found = rows_of_file(path, "", [])
    if found is None or not found.rows:
        raise InputError("is no table of orientations")
    table = table_of_rows(found, [])
    kept = {"grain", *BESIDE, *table.oriented()}
    table.meanings = [meaning if meaning in kept else "" for meaning in table.meanings]
    clean(table, radians)
    if not any(set(way) <= set(table.meanings) for way in (ANGLES, *WAYS)):
        raise InputError(
            f"the columns are {', '.join(table.names)}; the angles phi1, Phi, phi2 are needed, or "
            "indices"
        )
    return table


def add_orientations_of_file(table: LaboratoryTable, path: Path, by: str, radians: bool) -> None:
    """Add the orientations of a file, their sds and the sizes of the grains to the rows of a table
    of moduli: those of the same grain, or, `by` 'order', those of the same row. Rows without an
    orientation are left out.
    """
    table.refuse_orientations()
    other = orientations_of_file(path, radians)
    names = other.oriented()
    names += [name for name in BESIDE if name in {*other.meanings} - {*table.meanings}]
    if twice := {name for name in names if names.count(name) > 1}:
        raise InputError(f"{min(twice)} has several columns; one of them is allowed")
    cells = other.cells[[other.column(name) for name in names]]
    if by == "order":
        if len(cells) != len(table.cells):
            raise InputError(f"{len(cells)} orientations for {len(table.cells)} rows of moduli")
        cells = cells.set_axis(table.cells.index)
    else:
        cells = joined_by_name(table, other, cells)
    table.leave_out({*table.cells.index} - {*cells.index}, f"no orientation in {path.name}")
    for name, column in zip(names, cells):
        table.add_column(name, cells[column].tolist())


def joined_by_name(
    table: LaboratoryTable, other: LaboratoryTable, cells: pd.DataFrame
) -> pd.DataFrame:
    """The cells of the orientation of each line of moduli whose grain is in both tables."""
    for each, what in ((table, "moduli"), (other, "orientations")):
        if each.column("grain") < 0:
            raise InputError(
                f"the {what} have no column of the grains' names (grain); name it, or state "
                "orientations_by = 'order' if both tables have the same order"
            )
    own, theirs = (each.cells[each.column("grain")] for each in (table, other))
    keys, their_keys = own.map(key_of), theirs.map(key_of)
    distinct = cells.assign(key=their_keys).drop_duplicates()
    for line in distinct.index[distinct["key"].duplicated()]:
        raise InputError(f"line {line}: the grain {theirs[line]} has two orientations")
    found = keys[keys.isin(their_keys)]
    if not len(found):
        raise InputError(
            f"no grain is in both tables: {abridged(own, 3)} have moduli, "
            f"{abridged(theirs, 3)} orientations"
        )
    if alone := [*theirs[distinct.index][~distinct["key"].isin(keys)]]:
        table.note(f"no modulus of the grains {abridged(alone)}")
    return distinct.set_index("key").loc[found].set_axis(found.index)
