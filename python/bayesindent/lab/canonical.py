"""The canonical table of measurements: exact names, GPa, degrees, a row a grain or a test."""

import csv
import math
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import pandas as pd

from ..common.result_files import as_csv
from ..core import InputError, call, located
from .cells import is_missing, is_number, missing, value_of
from .cleaning import clean, leave_out_incomplete, unit_of
from .columns import (
    ANGLES,
    DIRECTIONS,
    HARDNESS,
    KINDS,
    LENGTHS,
    MODULI,
    NAME_COLUMNS,
    SHARED,
    WAYS,
    abridged,
    hint_of,
    listed,
    meaning_of,
    nearest_to,
    split_deviation,
    stated_columns,
)
from .header import table_of_rows
from .joining import add_orientations_of_file
from .means import standard_errors
from .reading import MOST_ROWS, Rows, rows_of_columns, rows_of_file
from .table import LaboratoryTable

if TYPE_CHECKING:
    from .orientation_maps import IndentedMap

#: Order of the columns; `row` is the line of the file.
ORDER = (
    *("row", "grain", "test", *ANGLES, *sorted(DIRECTIONS), *MODULI, "sd_gpa", "sample_nu"),
    *("orientation_sd_deg", "depth_um", "contact_radius_um", "grain_radius_um", "zero_sd_nm"),
    *("group", "reference", "session", "time_s", "x_um", "y_um"),
)
#: The first line of a file that this program wrote begins so.
MARK = "# Canonical table of bayesindent"


@dataclass
class Canonical:
    """A canonical table: the `table` that was read, the `page` that is written, and the map that
    gave the orientations, or None.
    """

    table: LaboratoryTable
    page: str
    map: "IndentedMap | None" = None


def canonical_table(
    source: Path | Mapping[str, Iterable], facts: Mapping[str, Any], origin: Path
) -> Canonical | None:
    """The canonical table of a file or of columns; None if the file is no table, which the core
    then refuses.

    `facts` are the resolved variables of the namelist, such as 'measurements.sheet', and its
    'folder'; `origin` is its file.
    """

    def stated(name: str) -> Any:
        return facts.get(f"measurements.{name}")

    columns = stated("columns") or []
    headers = [words.partition("=")[2].strip() for words in columns]
    found = (
        rows_of_file(source, stated("sheet"), headers)
        if isinstance(source, Path)
        else rows_of_columns(source)
    )
    if found is None or not found.rows:
        return None
    table = table_of_rows(found, headers)
    if len(table.cells) > MOST_ROWS:
        raise InputError(f"{len(table.cells)} rows; allowed up to {MOST_ROWS}")
    if not len(table.cells):
        raise InputError("the table is empty: no row follows the header")
    resolve(table, stated_columns(columns, table.names), stated("modulus_kind"))
    drop_texts(table)
    radians = stated("angles") == "radians" and not found.text.startswith(MARK)
    clean(table, radians)
    lines = table.cells.index
    if path := stated("orientations_file"):
        with located(origin, "measurements", "orientations_file"), located(path):
            add_orientations_of_file(
                table, Path(facts["folder"]) / path, stated("orientations_by"), radians
            )
    leave_out_incomplete(table)
    indented = None
    if not stated("ebsd"):
        check_orientations(table, facts)
    check_modulus(table, stated("modulus_kind"))
    add_ratio(table, found.ratios)
    if stated("ebsd"):
        indented = add_orientations(table, facts, origin)
    standard_errors(table)
    if table.column("sd_gpa") < 0 and stated("scale") != "inferred":
        raise InputError(
            f"the column sd_gpa is missing; it may be absent only with scale = "
            f"'inferred'; the columns are {listed(table.names)}"
            f"{nearest_to(['sd_gpa'], table.names)}. If another column is it, state columns = "
            "'sd_gpa = its header'"
        )
    if path := stated("shared_errors"):
        add_shared_errors(table, Path(facts["folder"]) / path, lines)
    for name in table.names:
        if hint := hint_of(name):
            table.note(f"the column {name} is not read{hint}")
    if not (table.notes or indented or radians) and has_plain_text(table, found):
        return Canonical(table, found.text)
    if radians:
        convert_radians(table)
    return Canonical(table, page_of(table, source, stated("modulus_kind")), indented)


def resolve(table: LaboratoryTable, given: Mapping[str, str], kind: str | None) -> None:
    """Let each meaning have one column: the one that the user names, the one of the exact name, or
    the only one. An sd is that of the modulus which its header names, or else of the column before
    it.
    """
    names, meanings = table.names, table.meanings
    table.stated = {*given}
    for j, name in enumerate(names):
        meanings[j] = given.get(name, meanings[j])
    for meaning in {*meanings} - {"", "sd_gpa"}:
        choose_column(table, meaning)
    if "other_probability" in names:
        raise InputError(
            "the column other_probability is not allowed; leave out the rows with "
            "other_probability above 0.05, and the columns other_*"
        )
    kinds = [meaning_of(name) for name in names]
    choose_modulus(table, kind)
    modulus = table.column(*MODULI)
    others = {*kinds} - {"", kinds[modulus]}
    for j, name in enumerate(names):
        if meanings[j] == "sd_gpa" and split_deviation(name)[1] in others and name not in given:
            meanings[j] = ""
    choose_column(table, "sd_gpa", modulus + 1)
    sd = table.column("sd_gpa")
    is_stated = sd < 1 or names[sd].lower() == "sd_gpa" or names[sd] in given
    if is_stated or split_deviation(names[sd])[1] or sd - 1 == modulus:
        return
    unit, is_other = unit_of(table, sd - 1), kinds[sd - 1] in MODULI and not meanings[sd - 1]
    if unit in {*LENGTHS, "mn", "un"} and kinds[sd - 1] not in ("x_um", "y_um"):
        is_other |= unit_of(table, sd) in ("", unit)
    if HARDNESS.fullmatch(names[sd - 1]) or is_other:
        raise InputError(
            f"line {table.header_line}: the column {names[sd]} follows {names[sd - 1]} and may be "
            "of that; name it sd_gpa if it is the sd of the modulus"
        )


def choose_column(table: LaboratoryTable, meaning: str, preferred: int = -1) -> None:
    """Let one column have a meaning; of several with the same header the `preferred` one."""
    names, ranks = table.names, {}
    for j, own in enumerate(table.meanings):
        if own == meaning:
            is_name = names[j] == meaning, names[j].lower() == meaning.lower()
            ranks[j] = (names[j] in table.stated, *is_name)
    chosen = [j for j, rank in ranks.items() if rank == max(ranks.values())]
    if len({names[j] for j in chosen}) > 1:
        raise InputError(
            f"the columns {names[chosen[0]]} and {names[chosen[1]]} are both {meaning}; "
            f"one of them is allowed, or one that is named {meaning}"
        )
    if preferred in chosen:
        chosen = [preferred]
    if len(chosen) > 1:
        raise InputError(f"line {table.header_line}: the column {names[chosen[0]]} is there twice")
    for j in ranks.keys() - chosen:
        table.meanings[j] = ""


def drop_texts(table: LaboratoryTable) -> None:
    """Do not read a column of times or rows whose cells are texts, such as 12:30."""
    for name in ("row", "time_s"):
        j = table.column(name)
        if j >= 0 and not all(is_missing(cell) or is_number(cell) for cell in table.cells[j]):
            table.meanings[j] = ""


def choose_modulus(table: LaboratoryTable, kind: str | None) -> None:
    """Let the modulus be the column that the user names, the one of the kind that `&measurements
    modulus_kind` states, or the one that does not say its kind. Otherwise the core takes the only
    one.
    """
    columns = {name: table.column(name) for name in MODULI if name in table.meanings}
    stated = [name for name, j in columns.items() if table.names[j] in table.stated]
    of_kind = [name for name in (f"{kind}_gpa", "modulus_gpa") if kind and name in columns]
    chosen = stated or of_kind[:1] or [*columns]
    for name in columns.keys() - chosen:
        table.meanings[columns[name]] = ""


def check_modulus(table: LaboratoryTable, kind: str | None) -> None:
    """Refuse a table without a modulus, and moduli whose kind is not stated or is contradicted."""
    columns = {table.names[j]: name for j, name in enumerate(table.meanings) if name in MODULI}
    headers, kinds = " and ".join(columns), f"""'{"', '".join(KINDS)}'"""
    if not columns:
        raise InputError(
            f"no column is a modulus; allowed {', '.join(MODULI[:-1])}, or "
            f"modulus_gpa with modulus_kind; the columns are {listed(table.names)}"
            f"{nearest_to(MODULI, table.names)}. If another one is, find out which modulus the "
            "instrument reports, and state columns = 'KIND_gpa = its header'"
        )
    if kind and not {f"{kind}_gpa", "modulus_gpa"} & {*columns.values()}:
        raise InputError(
            f"modulus_kind = '{kind}', but the moduli are those of the column "
            f"{headers}; leave modulus_kind out, or name the column modulus_gpa"
        )
    if not kind and len(columns) > 1:
        raise InputError(
            f"the columns {headers} are moduli; state modulus_kind to take one: {kinds}"
        )
    # The core refuses a canonical table of this name, after its numbers.
    if not kind and "modulus_gpa" in columns.values() and headers != "modulus_gpa":
        raise InputError(
            f"the column {headers} does not say which modulus was measured, nor does "
            f"modulus_kind; allowed {kinds} (effective_modulus: reduced modulus, Er; "
            "sample_modulus: EIT, Young's modulus)"
        )


def add_ratio(table: LaboratoryTable, ratios: list[str]) -> None:
    """Note the Poisson's ratio with which the instrument made the moduli: that of a column, or else
    of another sheet, which becomes a column. The core uses it.
    """
    if table.column("sample_nu") < 0 and ratios:
        n = len(table.cells)
        table.add_column("sample_nu", (ratios * n)[:n])
    j = table.column("sample_nu")
    if j >= 0 and (ratios or table.names[j] != "sample_nu"):
        table.note(f"sample_nu = {abridged(dict.fromkeys(table.cells[j]))}")


def check_orientations(table: LaboratoryTable, facts: Mapping[str, Any]) -> None:
    """Refuse a table without orientations, unless they are unknown."""
    has_way = any(set(way) <= set(table.meanings) for way in WAYS)
    missing = [name for name in ANGLES if name not in table.meanings]
    if facts.get("measurements.orientations") == "unknown" or has_way or not missing:
        return
    instead = (
        "; instead of angles q0, q1, q2, q3, or u, v, w, or h, k, l; if no orientation is known "
        "state orientations = 'unknown'"
    )
    raise missing_column(table, missing[0], instead if len(missing) == 3 else "")


def missing_column(table: LaboratoryTable, name: str, remedy: str = "") -> InputError:
    """The refusal of a table without a column."""
    return InputError(
        f"the column {name} is missing; the columns are {listed(table.names)}"
        f"{nearest_to([name], table.names)}{remedy}"
    )


def add_orientations(
    table: LaboratoryTable, facts: Mapping[str, Any], origin: Path
) -> "IndentedMap":
    """Add the orientations of a map; indents whose grain is uncertain are left out."""
    # The packages that read maps take time to import.
    from .orientation_maps import indented_map, registered

    for name in ("x_um", "y_um"):
        if name not in table.meanings:
            raise missing_column(table, name)
    stage = table.cells[[table.column("x_um"), table.column("y_um")]]
    for line in stage.index[stage.map(is_missing).any(axis=1)]:
        raise InputError(f"line {line}: x_um or y_um is empty; numbers are needed")
    contact = np.zeros(len(table.cells))
    if (j := table.column("contact_radius_um")) >= 0:
        contact = table.cells[j].map(lambda cell: 0.0 if is_missing(cell) else value_of(cell))
    folder = Path(facts["folder"])
    ebsd, points = facts["measurements.ebsd"], facts.get("measurements.ebsd_points")
    warnings: list[tuple] = []
    at, sd = stage.map(value_of).to_numpy(float), np.zeros(len(stage))
    if points:
        with located(origin, "measurements", "ebsd_points"), located(points):
            at, sd, warnings = registered(folder / points, at)
    with located(origin, "measurements", "ebsd"), located(ebsd):
        table.refuse_orientations()
        found = indented_map(
            folder / ebsd,
            at,
            sd,
            np.asarray(contact),
            np.array(stage.index),
            table.meanings,
            facts.get("problem.symmetry"),
            facts.get("measurements.crystal_axes"),
        )
    found.warnings[:0] = warnings
    table.cells = table.cells.iloc[found.rows].copy()
    for name, values in found.columns.items():
        table.add_column(name, list(map(str, values)))
    return found


def add_shared_errors(table: LaboratoryTable, path: Path, lines: pd.Index) -> None:
    """Replace the shared errors of a table by those of a file with a row for each of its `lines`,
    before any was left out.
    """
    table.meanings = ["" if SHARED.fullmatch(name) else name for name in table.meanings]
    values = call("file.shared_errors", path=path, rows=len(lines))["values"]
    for j, cells in enumerate(values[lines.isin(table.cells.index)].T, 1):
        table.add_column(f"shared_{j}", list(map(repr, cells.tolist())))


def convert_radians(table: LaboratoryTable) -> None:
    """Convert the angles to degrees; half a turn may be rounded up."""
    for j, meaning in enumerate(table.meanings):
        if meaning in ANGLES:
            degrees = table.cells[j].map(value_of) / (math.pi / 180)
            degrees[degrees.between(180, 180.01)] = 180.0
            table.cells[j] = list(map(repr, degrees.tolist()))


def has_plain_text(table: LaboratoryTable, found: Rows) -> bool:
    """Whether the text of the file is the canonical table as it is."""
    if table.names != table.meanings or any(table.units):
        return False
    lines = [line for line in found.text.splitlines() if line.strip() and line[0] != "#"]
    rows = [list(map(str.strip, row)) for row in csv.reader(lines)]
    return rows == [table.names, *table.cells.to_numpy().tolist()]


def page_of(table: LaboratoryTable, source: Path | Mapping, kind: str | None) -> str:
    """The text of the canonical table, whose first lines say how it was made."""
    if kind and (j := table.column("modulus_gpa")) >= 0:
        table.meanings[j] = f"{kind}_gpa"
    name = source.name if isinstance(source, Path) else "a table of Python"
    sheet = f", sheet {table.sheet}" if table.sheet else ""
    comments = [f"{MARK}, made of {name}{sheet}: GPa, degrees, um; row: the line there"]
    comments += [f"# {line.strip()}" for line in table.words(0)[1:2]]
    comments += [f"# {' '.join(note.split())}" for note in table.notes]
    columns = {"row": table.cells.index}
    for meaning in (*ORDER, *filter(SHARED.fullmatch, table.meanings)):
        if (j := table.column(meaning)) >= 0:
            cells = table.cells[j]
            are_names = meaning in NAME_COLUMNS
            columns[meaning] = cells if are_names else cells.mask(missing(cells), "")
    return "\n".join(comments) + "\n" + as_csv(columns, zip(*columns.values()))
