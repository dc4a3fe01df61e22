"""The table of a laboratory, whose header is known, and its conversion to the plain table of the
core.
"""

import csv
import re
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field
from io import StringIO

import numpy as np

from ..core import InputError
from .table_cells import (
    PLUS_MINUS,
    WITH_UNIT,
    is_missing,
    is_number,
    is_plain_number,
    plain_numbers,
    value_of,
)

#: Canonical names of moduli; the most specific comes first.
MODULI = ("indentation_modulus_gpa", "effective_modulus_gpa", "sample_modulus_gpa", "modulus_gpa")
ANGLES = ("phi1_deg", "Phi_deg", "phi2_deg")
#: Columns whose cells are names, not numbers: they identify the grain and the test of a row.
NAME_COLUMNS = ("grain", "group", "test", "reference", "session")
#: Names of rows of statistics begin with a name of a mean ("Mittelwert"), of a spread ("Std. Dev.")
#: or of an extent ("Overall (n = 12)").
MEAN_NAMES = r"mean|average|avg|median|mittel\w*|moyenne|media"
SPREAD_NAMES = r"std|st\.? ?dev|stand\w*|stabw|[eé]cart|sd|sem|(% ?)?cov|cv|coefficient|vari\w+"
EXTENT_NAMES = r"min(imum)?|max(imum)?|count|number|range|sum|total|(over)?all|n"
STATISTICS = re.compile(
    rf"({MEAN_NAMES}|{SPREAD_NAMES}|{EXTENT_NAMES})\b[^0-9]*(\(n ?= ?\d+\))?$", re.I
)
#: A cell of a row of units, such as "[GPa]".
UNIT = re.compile(r"[\[(]?(deg|degrees?|°|rad|radians|[GMk]?Pa|um|µm|μm|nm|mm|m?N|%|-)[\])]?", re.I)
#: Indices of a direction or a plane in one cell, such as "[1 0 -2]" or "(0001)".
INDICES = re.compile(r"([\[({<])\s*(-?\d[-\d\s,.;\u0304\u0305]*)[\])}>]$")
#: Headers of a number of tests, such as "No. of indents".
COUNT = re.compile(
    r"n|count|((n|#|number of|no\. of)[ _]?)?\(?(tests|indents|indentations|measurements)\)?", re.I
)
#: Headers of the standard deviation of single tests, such as "Std. dev."; the canonical `sd_gpa` is
#: the sd of the value itself.
DEVIATION = re.compile(
    r"(?!sd_gpa$|.*\berr).*\b(std|st[ ._]*dev|stddev|standard[ _]deviation|sd)\b", re.I
)
#: Headers of sds in per cent of the value, such as "CoV (%)"; they count where no column has the sd
#: in GPa.
RELATIVE = re.compile(
    r"(%|co?v|rsd|rel\w*[ ._]+(sd|std|error|uncertainty)|(sd|std|error)[ _]percent)\b.*|% ?co?v",
    re.I,
)
#: A sign of per cent, such as "Er sd (%)"; the one of "95 %" is a confidence level and no share.
SHARE = re.compile(r"(?<![\d ])(?<!\d )%|percent|(?<=[^\d] )%", re.I)
#: Headers of a hardness, such as "H (GPa)", and of an sd that may be that of the hardness to its
#: left, such as "Std (GPa)".
HARDNESS = re.compile(r"(h|h_?it|.*hardness)\s*([\[(/].*)?", re.I)
ANY_SD = re.compile(
    r"(sd|std|st\w*\.? ?(dev\w*|error)|err\w*|unc\w*|se|sem|sigma|±)\.?\s*([\[(/].*)?", re.I
)
#: Grains with fewer tests get the sd pooled over all grains: with 9 degrees of freedom an own sd is
#: known to a quarter.
FEW_TESTS = 10


@dataclass
class LaboratoryTable:
    """A table and how it is read.

    `names` are the headers of its columns, `meanings` the canonical names that the core gives them
    ('' for none). `rows` are lists of cells, and `lines` their line numbers in the file. `units`
    holds the line number and the cells of a row of units, if there is one. `notes` describe the
    changes, `left_out` gives a reason for each line left out, and `is_plain` is true while nothing
    is changed.
    """

    place: str
    names: list[str]
    meanings: list[str]
    rows: list[list[str]]
    lines: list[int]
    units: list[tuple[int, list[str]]] = field(default_factory=list)
    header_line: int = 1
    sheet: str = ""
    notes: list[str] = field(default_factory=list)
    left_out: dict[int, str] = field(default_factory=dict)
    is_plain: bool = True

    def note(self, words: str) -> None:
        """Describe a change."""
        self.notes.append(words)
        self.is_plain = False

    def column(self, *meanings: str) -> int:
        """The first column with one of the meanings, -1 if there is none."""
        return next(
            (self.meanings.index(meaning) for meaning in meanings if meaning in self.meanings), -1
        )

    def leave_out(self, rows: Iterable[int], reason: str) -> None:
        """Remove rows, which are numbered from 0, and note their lines and the reason."""
        rows = set(rows)
        if rows:
            self.left_out |= {self.lines[i]: reason for i in rows}
            self.note(
                f"{len(rows)} of {len(self.rows)} rows left out, {reason}: "
                f"{lines_in_words(self.lines[i] for i in sorted(rows))}"
            )
        self.rows = [row for i, row in enumerate(self.rows) if i not in rows]
        self.lines = [line for i, line in enumerate(self.lines) if i not in rows]

    def add_column(self, name: str, meaning: str, cells: Sequence[str]) -> None:
        """Append a column."""
        self.names.append(name)
        self.meanings.append(meaning)
        for row, cell in zip(self.rows, cells, strict=True):
            row.append(cell)

    def words(self, grains: int) -> list[str]:
        """Three lines that describe how the table is read."""
        pairs = list(zip(self.names, self.meanings, strict=True))
        read = [
            name if name == meaning else f"{name} as {meaning}"
            for name, meaning in pairs
            if meaning
        ]
        unread = [name for name, meaning in pairs if name and not meaning]
        reasons = [f"line {line} ({reason})" for line, reason in self.left_out.items()]
        left = "; ".join(reasons[:6]) or "no row"
        where = f"sheet {self.sheet}, " if self.sheet else ""
        return [
            f"{self.place.removesuffix(': ')}: {grains} grains in {len(self.rows)} rows, "
            f"{where}header on line {self.header_line}",
            f"  read: {', '.join(read)}" + (f"; not read: {', '.join(unread)}" if unread else ""),
            f"  left out: {left}" + (", .." if len(reasons) > 6 else ""),
        ]

    def page(self) -> str:
        """The plain table, its rows on the same lines as in the file; '' if the file itself is
        plain.
        """
        if self.is_plain:
            return ""
        text = StringIO()
        writer = csv.writer(text, delimiter="\t", lineterminator="\n")
        next_line = 1
        numbered = zip(self.lines, self.rows, strict=True)
        for line, cells in [(self.header_line, self.names), *self.units, *numbered]:
            text.write("\n" * (line - next_line))
            writer.writerow([*cells, *[""] * (len(self.names) - len(cells))])
            next_line = line + 1
        return text.getvalue()


def lines_in_words(lines: Iterable[int]) -> str:
    """Line numbers as 'lines 3, 5, 9'; at most the first ten."""
    lines = list(lines)
    more = ", .." if len(lines) > 10 else ""
    return f"line{'s' * (len(lines) > 1)} {', '.join(map(str, lines[:10]))}{more}"


def clean(table: LaboratoryTable, short: dict[int, int]) -> None:
    """Leave out rows that are no measurements, turn cells into plain numbers, give each grain one
    name, and add standard errors to repeated tests. `short` has the number of cells of the lines
    that have too few.
    """
    # The core reads a row of units itself.
    first_row = table.rows[0] if table.rows else []
    if sum(map(bool, map(UNIT.fullmatch, first_row))) > 1 and not any(map(is_number, first_row)):
        row = table.rows.pop(0)
        table.units = [(table.lines.pop(0), [cell if UNIT.fullmatch(cell) else "" for cell in row])]
        table.is_plain &= table.units[0][1] == row
    if not any(meaning in ANGLES or len(meaning) in (1, 2) for meaning in table.meanings):
        split_indices(table)
    first = [next(filter(None, row), "") for row in table.rows]
    # A single letter, such as n, is the name of a grain if no cell of its row is empty.
    of_statistics = (
        i
        for i, name in enumerate(first)
        if STATISTICS.match(name) and (len(name) > 1 or "" in table.rows[i])
    )
    table.leave_out(of_statistics, "statistics of the table")
    remarks = (
        i
        for i, row in enumerate(table.rows)
        if row.count("") == len(row) - 1 and not is_number("".join(row))
    )
    table.leave_out(remarks, "a remark")
    if line := next((line for line in table.lines if line in short), 0):
        raise InputError(
            f"{table.place}line {line}: {short[line]} cells where the header has {len(table.names)}"
        )
    split_sds(table)
    refuse_words(table)
    grain = table.column("grain")
    # A column that is empty throughout is left to the core.
    incomplete: set[int] = set()
    for j in {grain, *dressed_columns(table)} - {-1}:
        meaning = table.meanings[j]
        is_needed = meaning in ("grain", *MODULI, "sd_gpa", *ANGLES) or len(meaning) in (1, 2)
        missing = {i for i, row in enumerate(table.rows) if is_needed and is_missing(row[j])}
        if len(missing) < len(table.rows):
            incomplete |= missing
    table.leave_out(incomplete, "a value is missing")
    if grain >= 0:
        one_spelling(table, grain)
    standard_errors(table, grain)


def dressed_columns(table: LaboratoryTable) -> list[int]:
    """Columns of numbers that are read and have cells that are not plain numbers, such as
    '112.3 GPa' or 'n/a'.
    """
    dressed = []
    for j, meaning in enumerate(table.meanings):
        if meaning and meaning not in (*NAME_COLUMNS, "stated"):
            dressed += [] if plain_numbers([row[j] for row in table.rows]) else [j]
    return dressed


def split_sds(table: LaboratoryTable) -> None:
    """Split `109.7 ± 3.0` into two cells, reduce `46.3°` and `112.3 GPa` to numbers, and convert
    an sd of `5 %` of the modulus to GPa.
    """
    modulus, sd = table.column(*MODULI), table.column("sd_gpa")
    sds: dict[int, str] = {}
    if sd > 0 and ANY_SD.fullmatch(table.names[sd]) and HARDNESS.fullmatch(table.names[sd - 1]):
        raise InputError(
            f"{table.place}line {table.header_line}: the column "
            f"{table.names[sd]} follows {table.names[sd - 1]} and may be of "
            "that; name it sd_gpa if it is the sd of the modulus"
        )

    columns = dressed_columns(table)
    for i, row in enumerate(table.rows):
        for j in columns:
            if is_plain_number(row[j]):
                continue
            if (found := PLUS_MINUS.match(row[j])) and j == modulus and sd < 0:
                row[j] = found[1]
                sds[i] = share(found[2], row[j]) if found[3] == "%" else found[2]
            if (found := WITH_UNIT.match(row[j])) and (
                found[2] != "%" or (j == sd and modulus >= 0)
            ):
                row[j] = share(found[1], row[modulus]) if found[2] == "%" else found[1]
                table.is_plain = False
    if sds:
        table.add_column("sd_gpa", "sd_gpa", [sds.get(i, "") for i in range(len(table.rows))])
        table.note(f"column {table.names[modulus]}: what follows ± is its sd")
    if sd < 0 and not sds:
        shares = (RELATIVE.fullmatch(name) and SHARE.search(name) for name in table.names)
        sd = next((j for j, is_relative in enumerate(shares) if is_relative), -1)
    unit = table.units[0][1] if table.units else table.names
    is_share = sd >= 0 and (SHARE.search(table.names[sd]) or unit[sd].strip("[]()") == "%")
    if (
        is_share
        and modulus >= 0
        and all(is_plain_number(row[sd]) or is_missing(row[sd]) for row in table.rows)
    ):
        for row in table.rows:
            row[sd] = share(row[sd], row[modulus]) if is_plain_number(row[sd]) else ""
        table.note(f"column {table.names[sd]}: per cent of the modulus")
        unit[sd] = ""
        table.names[sd] = table.meanings[sd] = "sd_gpa"


def share(number: str, modulus: str) -> str:
    """A percentage of the modulus in GPa; the percentage itself if the modulus is no number."""
    return repr(value_of(number) / 100 * value_of(modulus)) if is_plain_number(modulus) else number


def split_indices(table: LaboratoryTable) -> None:
    """Replace a column of `[1 0 2]` or `(0001)` by columns of indices."""
    for j, name in enumerate(list(table.names)):
        cells = [
            row[j] for row in table.rows if not is_missing(row[j]) and not STATISTICS.match(row[j])
        ]
        if not cells or not all(map(INDICES.match, cells)):
            continue
        if re.search("euler|bunge", name, re.I):
            raise InputError(
                f"{table.place}column {name}: three angles in one cell, {cells[0]}; a column "
                "for each is needed: phi1, Phi, phi2"
            )
        kinds = {cell[0] in "[<" for cell in cells}
        indices = {row[j]: indices_of(row[j]) for row in table.rows}
        counts = {len(value) for value in indices.values() if value}
        if len(kinds) > 1 or counts not in ({3}, {4}):
            raise InputError(
                f"{table.place}column {name}: directions [..] or planes (..) of three indices, "
                f"or all of four, are read; not {', '.join(cells[:3])}"
            )
        labels = (
            ("u v w" if counts == {3} else "u v t w")
            if kinds == {True}
            else ("h k l" if counts == {3} else "h k i l")
        )
        for k, label in enumerate(labels.split()):
            own = {cell: value[k] if value else "" for cell, value in indices.items()}
            table.add_column(label, label, [own[row[j]] for row in table.rows])
        table.note(
            f"column {name}: indices of the {'direction' if kinds == {True} else 'plane'} along "
            "the indenter"
        )
        return


def indices_of(cell: str) -> list[str]:
    """The indices of `[1 0 -2]`, `(0001)` or `[11-20]`; a negative one has a bar over its digit or
    a minus before it.
    """
    found = INDICES.match(cell)
    if not found:
        return []
    inside = re.sub(r"(\d)[\u0304\u0305]", r"-\1", found[2]).strip()
    return (
        re.findall(r"-?\d+", inside)
        if re.search(r"[\s,;.]", inside)
        else re.findall(r"-?\d", inside)
    )


def refuse_words(table: LaboratoryTable) -> None:
    """Refuse cells that are not numbers where numbers are needed; one message names them all."""
    columns = dressed_columns(table)
    wrong = [
        f"line {line}, column {table.names[j]}: {row[j][:30]!r}"
        for line, row in zip(table.lines, table.rows, strict=True)
        for j in columns
        if not is_missing(row[j]) and not is_plain_number(row[j])
    ]
    if len(wrong) > 1:
        raise InputError(
            f"{table.place}{len(wrong)} cells are no numbers: "
            f"{'; '.join(wrong[:12])}{'; ..' if len(wrong) > 12 else ''}"
        )


def one_spelling(table: LaboratoryTable, grain: int) -> None:
    """Give `G1`, `g1` and `G 1`, which are one grain, the spelling of the first row."""
    first: dict[str, str] = {}
    others: dict[str, str] = {}
    for row in table.rows:
        # A separator between two digits stays: 1-1 and 11 are different grains.
        key = re.sub(r"(?<!\d)[\s_-]+|[\s_-]+(?!\d)", "", row[grain]).casefold()
        name = first.setdefault(key, row[grain])
        if row[grain] != name:
            others[row[grain]] = name
            row[grain] = name
    if others:
        pairs = ", ".join(f"{other} and {name}" for other, name in others.items())
        table.note(f"column {table.names[grain]}: taken for one grain: {pairs}")


@np.errstate(all="ignore")
def standard_errors(table: LaboratoryTable, grain: int) -> None:
    """Add the standard errors of means.

    A column of standard deviations is divided by the root of the column of numbers of tests. Tests
    without sds get the standard deviation of the tests of their grain, or the pooled one if these
    are few.
    """
    modulus, sd = table.column(*MODULI), table.column("sd_gpa")
    number = next((j for j, name in enumerate(table.names) if COUNT.fullmatch(name)), -1)
    counts = [row[number] for row in table.rows] if number >= 0 else []
    if len(counts) > 2 and counts == [str(1 + i) for i in range(len(counts))]:
        table.note(
            f"column {table.names[number]}: numbers the rows; not taken for numbers of tests"
        )
        number = -1
    if (
        sd >= 0
        and number >= 0
        and DEVIATION.search(table.names[sd])
        and plain_numbers([row[sd] for row in table.rows])
    ):
        whole = re.compile(r"0*[1-9]\d{0,8}(\.0*)?").fullmatch
        numbered = zip(table.lines, counts, strict=True)
        if wrong := [line for line, count in numbered if not whole(count)]:
            raise InputError(
                f"{table.place}column {table.names[number]}, {lines_in_words(wrong)}: a number "
                f"of tests is needed; if {table.names[sd]} is a standard error, name it sd_gpa"
            )
        for row in table.rows:
            row[sd] = repr(value_of(row[sd]) / float(np.sqrt(float(row[number]))))
        table.note(
            f"column {table.names[sd]}: divided by the root of {table.names[number]} tests: the "
            "standard error of the mean"
        )
        table.meanings[number] = "number of tests"
    if (
        sd >= 0
        or grain < 0
        or modulus < 0
        or not plain_numbers([row[modulus] for row in table.rows])
    ):
        return
    tests: dict[str, list[float]] = {}
    for row in table.rows:
        tests.setdefault(row[grain], []).append(value_of(row[modulus]))
    freedom = len(table.rows) - len(tests)
    squares = sum(len(values) * np.var(values) for values in tests.values())
    pooled = float(np.sqrt(squares / max(1, freedom)))
    if not pooled > 0:
        return
    # The core combines tests that have sds into means.
    sds = {
        name: float(np.std(values, ddof=1)) if len(values) >= FEW_TESTS else pooled
        for name, values in tests.items()
    }
    table.add_column("sd_gpa", "sd_gpa", [repr(sds[row[grain]]) for row in table.rows])
    table.note(
        f"{len(table.rows)} tests of {len(tests)} grains became means with standard errors; the "
        f"sd of a test is {pooled:.3g} GPa, pooled over grains with fewer than {FEW_TESTS} "
        f"tests ({freedom} degrees of freedom)"
    )
