"""Leave out the rows of a table that are no measurements, and make its cells plain numbers."""

import re
from collections.abc import Sequence

import numpy as np
import pandas as pd

from ..core import InputError
from .cells import (
    CELL,
    NUMBER,
    is_missing,
    is_number,
    is_plain_number,
    missing,
    number_of,
    plain_numbers,
    value_of,
)
from .columns import (
    ANGLES,
    BY_NAME,
    DEGREES,
    DIRECTIONS,
    LENGTHS,
    MODULI,
    NAME_COLUMNS,
    RADIANS,
    UNIT_WORDS,
    abridged,
    split_name,
)
from .table import LaboratoryTable

#: Names of rows of statistics: of a mean ("Mittelwert"), a spread ("Std. Dev.") or an extent
#: ("Overall (n = 12)").
STATISTICS = re.compile(
    r"(?:(mean|average|avg|median|mittel\w*|moyenne|media|(?:over)?all)"
    r"|(std|st\.? ?dev|stand\w*|stabw|[eé]cart|sd|sem|(?:% ?)?cov|cv|coefficient|vari\w+)"
    r"|(min(?:imum)?|max(?:imum)?|count|number|range|sum|total|n))\b[^0-9]*(?:\(n ?= ?\d+\))?$",
    re.I,
)
#: Columns that a table without a map does without.
OPTIONAL = ("time_s", "x_um", "y_um")
#: Indices of a direction or a plane in one cell, such as "[1 0 -2]" or "(0001)".
INDICES = re.compile(r"([\[({<])\s*(-?\d[-\d\s,.;\u0304\u0305]*)[\])}>]$")
#: Headers of sds in per cent of the value, such as "CoV (%)"; they count where no column has the sd
#: in GPa.
RELATIVE = re.compile(
    r"(%|co?v|rsd|rel\w*[ ._]+(sd|std|error|uncertainty)|(sd|std|error)[ _]percent)\b.*|% ?co?v",
    re.I,
)
#: A sign of per cent, such as "Er sd (%)"; the one of "95 %" is a confidence level and no share.
SHARE = re.compile(r"(?<![\d ])(?<!\d )%|percent|(?<=[^\d] )%", re.I)


def clean(table: LaboratoryTable, radians: bool) -> None:
    """Leave out rows that are no measurements, turn cells into plain numbers, lengths into um, and
    give each grain one name. Angles may be in `radians`.
    """
    factors = factors_of_units(table, radians)
    if not table.oriented():
        split_indices(table)
    leave_out_statistics(table)
    remarks = (
        line
        for line, *row in table.cells.itertuples()
        if row.count("") == len(row) - 1 and not is_number("".join(row))
    )
    table.leave_out(remarks, "a remark")
    if line := next((line for line in table.cells.index if line in table.short), 0):
        raise InputError(
            f"line {line}: {table.short[line]} cells where the header has {len(table.names)}"
        )
    split_sds(table)
    refuse_words(table)
    for j, factor in factors.items():
        table.cells[j] = [
            cell if is_missing(cell) else repr(value_of(cell) * factor) for cell in table.cells[j]
        ]
    if (grain := table.column("grain")) >= 0:
        one_spelling(table, grain)


def factors_of_units(table: LaboratoryTable, radians: bool) -> dict[int, float]:
    """The factors to um of columns of lengths. Refuse units that a column cannot have, in its
    header or in the row of units.
    """
    factors = {}
    for j, (name, meaning) in enumerate(zip(table.names, table.meanings)):
        if meaning not in BY_NAME:
            continue
        units, under = BY_NAME[meaning].units, table.units[j]
        for unit in filter(None, (split_name(name)[1], under)):
            if unit in RADIANS and meaning in ANGLES and not radians:
                raise InputError(
                    f"column {name} is in radians; degrees are needed, or angles = 'radians'"
                )
            if unit in units or (unit == "%" and meaning == "sd_gpa"):
                if units is LENGTHS and LENGTHS[unit] != 1.0:
                    factors[j] = LENGTHS[unit]
                continue
            # In a header that the user names, and of names, other words are no unit.
            if unit not in UNIT_WORDS and (not units or (name in table.stated and unit != under)):
                continue
            if meaning in OPTIONAL:
                table.meanings[j] = ""
                table.note(f"the column {name} is not read: its unit is {unit}")
                continue
            allowed = f"allowed {' '.join(units)}" if units else "this column has none"
            raise InputError(f"column {name}: the unit {unit} is not read; {allowed}")
    return factors


def unit_of(table: LaboratoryTable, j: int) -> str:
    """The unit in the header of a column or below it; '' if there is none."""
    return split_name(table.names[j])[1] or table.units[j]


def leave_out_incomplete(table: LaboratoryTable) -> None:
    """Leave out the rows without a name of the grain, an angle, a modulus or its sd. A column that
    is empty throughout is not needed.
    """
    incomplete: set[int] = set()
    for j, meaning in enumerate(table.meanings):
        if meaning in ("grain", *MODULI, "sd_gpa", *ANGLES, *DIRECTIONS):
            cells = table.cells[j]
            empty = cells == "" if meaning == "grain" else missing(cells)
            if not empty.all():
                incomplete |= {*cells.index[empty]}
    table.leave_out(incomplete, "a value is missing")


def leave_out_statistics(table: LaboratoryTable) -> None:
    """Leave out the rows of statistics: their name is one of a statistic, and they have no angles
    or positions, or their modulus is a statistic of the others, or a blank row is above them. Other
    rows of such a name are grains.
    """
    first = table.cells.where(table.cells != "").bfill(axis=1)[0].fillna("")
    named = first.map(STATISTICS.match).dropna()
    if named.empty:
        return
    names = (*ANGLES, *DIRECTIONS, "x_um", "y_um")
    places = [j for j, meaning in enumerate(table.meanings) if meaning in names]
    modulus = table.column(*MODULI)
    others = table.cells.drop(index=named.index)
    values = statistics_of(others[modulus].map(number_of).dropna() if modulus >= 0 else [])
    statistics = []
    for line, match in named.items():
        row = table.cells.loc[line]
        last = max((other for other in others.index if other < line), default=table.header_line)
        if (
            row[places].map(is_missing).any()
            or any(last < blank < line for blank in table.blank)
            or modulus < 0
            or is_missing(row[modulus])
            or is_rounded(row[modulus], values[match.lastindex - 1])
        ):
            statistics.append(line)
        else:
            table.note(
                f"line {line}: {first[line]} is taken for a grain, not for a statistic: its "
                "modulus is no statistic of the other rows"
            )
    table.leave_out(statistics, "statistics of the table")


def statistics_of(values: Sequence[float]) -> tuple[list, list, list]:
    """The statistics that tables have of a column: means, spreads and extents."""
    n = len(values)
    if not n:
        return [], [], []
    mean, deviations = np.mean(values), [np.std(values, ddof=k) for k in (0, 1) if n > k]
    spreads = [*deviations, *(100 * sd / mean for sd in deviations), deviations[-1] / np.sqrt(n)]
    extents = [np.min(values), np.max(values), np.ptp(values), n, np.sum(values)]
    return [mean, np.median(values)], spreads, extents


def is_rounded(cell: str, values: list[float]) -> bool:
    """Whether a cell is one of the values, rounded or cut."""
    number, decimals = number_of(cell), re.search(r"\.(\d*)", cell)
    last_place = 10.0 ** -len(decimals[1]) if decimals else 1.0
    return any(abs(number - value) <= 1.001 * last_place for value in values)


def dressed_columns(table: LaboratoryTable) -> list[int]:
    """Columns of numbers that are read and have cells that are not plain numbers, such as
    '112.3 GPa' or 'n/a'.
    """
    return [
        j
        for j, meaning in enumerate(table.meanings)
        if meaning and meaning not in NAME_COLUMNS and not plain_numbers(table.cells[j].tolist())
    ]


def split_sds(table: LaboratoryTable) -> None:
    """Split `109.7 ± 3.0` into two cells, reduce `46.3°` and `112.3 GPa` to numbers, and convert
    an sd of `5 %` of the modulus to GPa.
    """
    modulus, sd = table.column(*MODULI), table.column("sd_gpa")
    moduli = table.cells[modulus].map(number_of) if modulus >= 0 else float("nan")

    def are_shares(j: int) -> bool:
        """Whether the header of a column, or the row of units, says so."""
        return bool(SHARE.search(table.names[j]) or table.units[j] == "%")

    def in_gpa(percents: pd.Series) -> pd.Series:
        return (percents.map(number_of, "ignore") / 100 * moduli).map(repr, "ignore")

    for j in dressed_columns(table):
        found = table.cells[j].str.extract(CELL)
        numbers, own_sd, is_share = found[0], found[1], found[2] == "%"
        refuse_other_units(table, j, found[2].mask(is_share).dropna())
        if j == modulus and sd < 0 and own_sd.notna().any():
            table.add_column("sd_gpa", own_sd.mask(is_share, in_gpa(own_sd)).fillna("").tolist())
            table.note(f"column {table.names[j]}: what follows ± is its sd")
        else:
            shares = in_gpa(numbers) if j == sd and modulus >= 0 else float("nan")
            shares = numbers if j == sd and are_shares(j) else shares
            numbers = numbers.mask(is_share, shares).mask(own_sd.notna())
        table.cells[j] = numbers.fillna(table.cells[j])
    sd = table.column("sd_gpa")
    if sd < 0:
        relative = (
            j
            for j, name in enumerate(table.names)
            if RELATIVE.fullmatch(name) and SHARE.search(name)
        )
        sd = next(relative, -1)
    if sd < 0 or modulus < 0 or not are_shares(sd):
        return
    cells = table.cells[sd].mask(missing(table.cells[sd]))
    if cells.dropna().str.fullmatch(rf"{NUMBER}\s*%?").all():
        table.cells[sd] = in_gpa(cells).fillna("")
        table.note(f"column {table.names[sd]}: per cent of the modulus")
        table.meanings[sd] = "sd_gpa"


def refuse_other_units(table: LaboratoryTable, j: int, units: pd.Series) -> None:
    """Refuse a unit of a cell that is not the one of its column."""
    stated, meaning = unit_of(table, j), table.meanings[j]
    usual = split_name(meaning)[1] or "".join(BY_NAME[meaning].units if meaning in BY_NAME else "")
    unit = stated if stated in UNIT_WORDS else usual
    for line, other in units.str.lower().items():
        same_length = other in LENGTHS and LENGTHS[other] == LENGTHS.get(unit)
        if not (other == unit or same_length or {other, unit} <= {*DEGREES}):
            raise InputError(
                f"line {line}, column {table.names[j]}: the unit {other}, where the column has "
                f"{unit or 'none'}"
            )


def split_indices(table: LaboratoryTable) -> None:
    """Replace a column of `[1 0 2]` or `(0001)` by columns of indices."""
    for j, name in enumerate(table.names):
        cells = [
            cell for cell in table.cells[j] if not is_missing(cell) and not STATISTICS.match(cell)
        ]
        if not cells or not all(map(INDICES.match, cells)):
            continue
        if re.search("euler|bunge", name, re.I):
            raise InputError(
                f"column {name}: three angles in one cell, {cells[0]}; a column "
                "for each is needed: phi1, Phi, phi2"
            )
        are_directions = {cell[0] in "[<" for cell in cells}
        indices = [indices_of(cell) for cell in table.cells[j]]
        counts = {len(value) for value in indices if value}
        if len(are_directions) > 1 or counts not in ({3}, {4}):
            raise InputError(
                f"column {name}: directions [..] or planes (..) of three indices, "
                f"or all of four, are read; not {', '.join(cells[:3])}"
            )
        kind, three, four = (
            ("direction", "u v w", "u v t w")
            if are_directions == {True}
            else ("plane", "h k l", "h k i l")
        )
        for k, label in enumerate((three if counts == {3} else four).split()):
            table.add_column(label, [value[k] if value else "" for value in indices])
        table.note(f"column {name}: indices of the {kind} along the indenter")
        return


def indices_of(cell: str) -> list[str]:
    """The indices of `[1 0 -2]`, `(0001)` or `[11-20]`; a negative one has a bar over its digit or
    a minus before it.
    """
    found = INDICES.match(cell)
    if not found:
        return []
    inside = re.sub(r"(\d)[\u0304\u0305]", r"-\1", found[2]).strip()
    return re.findall(r"-?\d+" if re.search(r"[\s,;.]", inside) else r"-?\d", inside)


def refuse_words(table: LaboratoryTable) -> None:
    """Refuse cells that are not numbers where numbers are needed; one message names them all. A
    number that can be read in two ways is none.
    """
    for (line, j), cell in table.doubtful.items():
        meaning = [*table.meanings, *[""] * (j + 1)][j]
        if line in table.cells.index and meaning and meaning not in NAME_COLUMNS:
            raise InputError(
                f"line {line}, column {table.names[j]}: {cell} can be read in two ways, since most "
                f"numbers have {'points' if ',' in cell else 'commas'}; leave out the marks of "
                "thousands"
            )
    found = sorted(
        (line, j, cell)
        for j in dressed_columns(table)
        for line, cell in table.cells[j].items()
        if not is_missing(cell) and not is_plain_number(cell)
    )
    wrong = [f"line {line}, column {table.names[j]}: {cell[:30]!r}" for line, j, cell in found]
    if len(wrong) == 1:
        commas = "; decimal commas are read where semicolons or tabs separate the cells"
        hint = commas if is_plain_number(found[0][2].replace(",", ".")) else ""
        raise InputError(f"{wrong[0]} is not a number{hint}")
    if wrong:
        raise InputError(f"{len(wrong)} cells are no numbers: {abridged(wrong, 12, '; ')}")


def key_of(name: str) -> str:
    """What spellings of a name have in common: 'g1' of 'G 01' and 'Grain-1'. A separator between
    two digits stays: 1-1 and 11 are different grains.
    """
    key = re.sub(r"^(grain|korn)(?=[\s_.#-]*\d)", "g", name.strip().casefold())
    key = re.sub(r"(?<!\d)[\s_.#-]+|[\s_.#-]+(?!\d)", "", key)
    return re.sub(r"(?<!\d)0+(?=\d)", "", key)


def one_spelling(table: LaboratoryTable, grain: int) -> None:
    """Give `G1`, `g1` and `G 1`, which are one grain, the spelling of the first row."""
    names = table.cells[grain]
    keys = {name: key_of(name) for name in names.unique()}
    spelled = names.groupby(names.map(keys)).transform("first")
    others = dict.fromkeys(zip(names[names != spelled], spelled[names != spelled]))
    if others:
        pairs = ", ".join(f"{other} and {name}" for other, name in others)
        table.note(f"column {table.names[grain]}: taken for one grain: {pairs}")
        table.cells[grain] = spelled
