"""Tables of measurements as laboratories have them, text or spreadsheet, made into the plain table
that the core reads.

A plain table stays as it is. Of others the header is found below other lines, rows of statistics
and incomplete rows are left out, cells such as `46.3°`, `109.7 ± 3.0`, `5 %` and `[1 0 2]` become
numbers, and repeated tests without sds means with standard errors. Each change is said in a note.
Lines keep their numbers, so that messages of the core name those of the file.
"""

import csv
import re
from collections import Counter
from collections.abc import Iterable, Sequence
from contextlib import closing
from dataclasses import dataclass, field
from io import StringIO
from pathlib import Path
from typing import Any
from unicodedata import normalize

import numpy as np

from ..core import InputError, call
from .other_files import decoded, reader_of, reading, refuse_formulas

#: Moduli, most specific first; an sd; what says which test of which grain a row is.
MODULI = ("indentation_modulus_gpa", "effective_modulus_gpa", "sample_modulus_gpa", "modulus_gpa")
ANGLES = ("phi1_deg", "Phi_deg", "phi2_deg")
WORDS = ("grain", "group", "test", "reference", "session")
#: Cells that say that there is no value; the last is what some instruments write.
MISSING = {
    ".",
    "n/a",
    "na",
    "nan",
    "none",
    "null",
    "nil",
    "missing",
    "#n/a",
    "#div/0!",
    "#value!",
    "#ref!",
    "#num!",
    "1.797e308",
    "1.797e+308",
    "1.797693e+308",
}
#: Names of rows of statistics begin with a name of a mean ("Mittelwert"), of a spread ("Std. Dev.")
#: or of an extent ("Overall (n = 12)").
MEAN_NAMES = r"mean|average|avg|median|mittel\w*|moyenne|media"
SPREAD_NAMES = r"std|st\.? ?dev|stand\w*|stabw|[eé]cart|sd|sem|(% ?)?cov|cv|coefficient|vari\w+"
EXTENT_NAMES = r"min(imum)?|max(imum)?|count|number|range|sum|total|(over)?all|n"
STATISTICS = re.compile(
    rf"({MEAN_NAMES}|{SPREAD_NAMES}|{EXTENT_NAMES})\b[^0-9]*(\(n ?= ?\d+\))?$", re.I
)
NUMBER = r"[+-]?(?:\d+[.,]?\d*|[.,]\d+)(?:[eEdD][+-]?\d+)?"
is_plain_number = re.compile(NUMBER).fullmatch
PLUS_MINUS = re.compile(rf"\(?({NUMBER})\s*(?:GPa)?\s*(?:±|\+/-|\+-)\s*({NUMBER})\)?\s*(GPa|%|)$")
WITH_UNIT = re.compile(rf"({NUMBER})\s*(°|deg|GPa|nm|um|µm|μm|mN|s|%)$")
#: A cell of a row of units.
UNIT = re.compile(r"[\[(]?(deg|degrees?|°|rad|radians|[GMk]?Pa|um|µm|μm|nm|mm|m?N|%|-)[\])]?", re.I)
INDICES = re.compile(r"([\[({<])\s*(-?\d[-\d\s,.;\u0304\u0305]*)[\])}>]$")
#: Names of numbers of tests, and of their standard deviation; `sd_gpa` is that of the value.
COUNT = re.compile(
    r"n|count|((n|#|number of|no\. of)[ _]?)?\(?(tests|indents|indentations|measurements)\)?", re.I
)
DEVIATION = re.compile(
    r"(?!sd_gpa$|.*\berr).*\b(std|st[ ._]*dev|stddev|standard[ _]deviation|sd)\b", re.I
)
#: Names of sds in per cent of the value, where no column is that in GPa; `95 %` is a confidence, no
#: share.
RELATIVE = re.compile(
    r"(%|co?v|rsd|rel\w*[ ._]+(sd|std|error|uncertainty)|(sd|std|error)[ _]percent)\b.*|% ?co?v",
    re.I,
)
SHARE = re.compile(r"(?<![\d ])(?<!\d )%|percent|(?<=[^\d] )%", re.I)
#: A hardness, and a name of an sd that may be its own.
HARDNESS = re.compile(r"(h|h_?it|.*hardness)\s*([\[(/].*)?", re.I)
ANY_SD = re.compile(
    r"(sd|std|st\w*\.? ?(dev\w*|error)|err\w*|unc\w*|se|sem|sigma|±)\.?\s*([\[(/].*)?", re.I
)
#: Signs that programs write for others, and those that nobody sees.
SIGNS = str.maketrans({"−": "-", "–": "-", "º": "°", "\u200b": None, "\ufeff": None})
#: Longer files are plain tables.
MOST_LINES = 200_000
#: Own sds of grains with fewer tests are those of all.
FEW_TESTS = 10


@dataclass
class LaboratoryTable:
    """A table and what was understood: `names` of its columns, what the core takes each for
    (`meanings`, '' for nothing), and `rows` of cells, each with its `lines` number; of a row of
    `units` both. `notes` say what was changed, `left_out` rows by number with their reason;
    `is_plain`: nothing was changed.
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
        """Say what was changed."""
        self.notes.append(words)
        self.is_plain = False

    def column(self, *meanings: str) -> int:
        """The first column with one of the meanings, -1 if there is none."""
        return next(
            (self.meanings.index(meaning) for meaning in meanings if meaning in self.meanings), -1
        )

    def leave_out(self, rows: Iterable[int], reason: str) -> None:
        """Rows by their number from 0 that are not read."""
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
        """A column at the right."""
        self.names.append(name)
        self.meanings.append(meaning)
        for row, cell in zip(self.rows, cells, strict=True):
            row.append(cell)

    def words(self, grains: int) -> list[str]:
        """What was understood, in three lines."""
        pairs = list(zip(self.names, self.meanings, strict=True))
        read = [
            name if name == meaning else f"{name} as {meaning}"
            for name, meaning in pairs
            if meaning
        ]
        unread = [name for name, meaning in pairs if name and not meaning]
        left = (
            "; ".join(f"line {line} ({reason})" for line, reason in list(self.left_out.items())[:6])
            or "no row"
        )
        where = f"sheet {self.sheet}, " if self.sheet else ""
        return [
            f"{self.place.removesuffix(': ')}: {grains} grains in {len(self.rows)} rows, "
            f"{where}header on line {self.header_line}",
            f"  read: {', '.join(read)}" + (f"; not read: {', '.join(unread)}" if unread else ""),
            f"  left out: {left}" + (", .." if len(self.left_out) > 6 else ""),
        ]

    def page(self) -> str:
        """The plain table, on the lines that its rows have in the file; '' if that is plain
        itself.
        """
        if self.is_plain:
            return ""
        text = StringIO()
        writer = csv.writer(text, delimiter="\t", lineterminator="\n")
        at = 1
        for line, cells in [
            (self.header_line, self.names),
            *self.units,
            *zip(self.lines, self.rows, strict=True),
        ]:
            text.write("\n" * (line - at))
            writer.writerow([*cells, *[""] * (len(self.names) - len(cells))])
            at = line + 1
        return text.getvalue()


def laboratory_table(
    place: str, path: Path, sheet: str = "", stated: Iterable[str] = ()
) -> LaboratoryTable | None:
    """The table of a file; None if it is none that needs changes, or none at all, which is the
    core's to say. `place` begins the message of a refusal; `sheet`: of a spreadsheet; `stated`:
    headers that the user gave a meaning.
    """
    if path.suffix.lower() in (".xlsx", ".xlsm"):
        return understood(place, *sheet_of(place, path, sheet, stated), stated, is_plain=False)
    try:
        # A pipe can be read but once.
        content = path.read_bytes() if path.is_file() else b""
    except OSError:
        return None
    # Of so many lines the core says soon whether they are too many.
    text, encoding = decoded(content) if content.count(b"\n") <= MOST_LINES else ("", "")
    if not text:
        return None
    with reading(place, "is no table that can be read"):
        # The core finds a stated header as it is written.
        own = tabbed(usual(text) if all(usual(header) == header for header in stated) else text)
        if header_of(rows := rows_of(own), stated)[1] < 2:
            own = tabbed(re.sub("(?m)^#+[ \t]*", "", own))
            rows = rows_of(own)
    if header_of(rows, stated)[1] < 2:
        return None
    table = understood(
        place, rows, "", stated, is_plain=own == text and "\n" in text and "|" not in text
    )
    if encoding:
        table.note(f"read as {encoding}")
    return table


def usual(text: str) -> str:
    """A text with the usual signs: narrow and fixed blanks, minus signs, raised and lowered
    letters.
    """
    # Sign by sign: letters of names that are written as two signs stay so.
    own: dict[int, str | None] = {
        ord(sign): normalize("NFKC", sign).replace("μ", "µ")
        for sign in set(text)
        if not sign.isascii()
    }
    return text.translate(own | SIGNS)


def tabbed(text: str) -> str:
    """The text of a table with tabs between its cells, where these are separated by blanks alone:
    by two, if some cells have one inside.
    """
    if re.search(r"[;\t|]|,(?!\d)|(?<!\d),", text):
        return text
    lines = [line.strip() for line in text.splitlines()]
    gap = (
        " +"
        if len({len(line.split()) for line in lines if line and line[0] != "#"}) == 1
        else "  +"
    )
    return "\n".join(re.sub(gap, "\t", line) for line in lines)


def rows_of(text: str) -> list[tuple[int, list[str]]]:
    """Cells with the number of their line, of what separates most lines into as many: tabs,
    semicolons, bars or commas.
    """
    lines = text.splitlines()[:1000]
    alike = {
        mark: max(Counter(line.count(mark) for line in lines if mark in line).values(), default=0)
        for mark in "\t;|,"
    }
    # As many lines may have decimal commas.
    delimiter = max("\t;|,", key=lambda mark: alike[mark] - 0.5 * (mark == ","))
    reader = csv.reader(StringIO(text, newline=""), delimiter=delimiter, skipinitialspace=True)
    rows, before = [], 0
    for cells in reader:
        whole = "".join(cells)
        if whole.strip() and not cells[0].startswith("#"):
            is_tidy = whole.split() == [whole] and "," not in whole
            rows.append(
                (before + 1, cells if is_tidy else [tidy(cell, delimiter != ",") for cell in cells])
            )
        before = reader.line_num
    return rows


def tidy(value: Any, decimal_commas: bool = True) -> str:
    """A cell in one line, a number with a decimal point."""
    cell = "" if value is None else " ".join(str(value).split())
    return (
        re.sub(r"(?<=\d),(?=\d)", ".", cell)
        if decimal_commas and "," in cell and is_number(cell)
        else cell
    )


def sheet_of(place: str, path: Path, sheet: str, stated: Iterable[str]) -> tuple[list, str]:
    """The rows of a sheet of a spreadsheet with their numbers, and its name: the one that is asked
    for, or the first that has a table of moduli.
    """
    openpyxl = reader_of(place, path, "a spreadsheet", "openpyxl", ", or save the sheet as CSV")
    with reading(place, "is no spreadsheet that can be read"):
        with closing(openpyxl.load_workbook(path, read_only=True, data_only=True)) as book:
            if sheet and sheet not in book.sheetnames:
                raise InputError(
                    f"{place}there is no sheet {sheet!r}; the sheets are "
                    f"{', '.join(book.sheetnames)}"
                )
            pages = {
                name: list(book[name].iter_rows(values_only=True))
                for name in ([sheet] if sheet else book.sheetnames)
            }
        rows = {}
        for name, page in pages.items():
            numbered = enumerate(([usual(tidy(value)) for value in row] for row in page), 1)
            rows[name] = [(number, cells) for number, cells in numbered if any(cells)]
        fit = [name for name, page in rows.items() if set(MODULI) & set(header_of(page, stated)[2])]
        if len(fit) > 1 and next(iter(rows)) not in fit:
            raise InputError(
                f"{place}the sheets {', '.join(fit)} have moduli; "
                f"state sheet = '{fit[0]}' or another"
            )
        name = next(iter(rows)) if next(iter(rows)) in fit or not fit else fit[0]
        refuse_formulas(place, openpyxl, path, name, pages[name])
    return rows[name], name


def is_missing(cell: str) -> bool:
    """Whether a cell has no value; dashes too are none."""
    return not cell.strip("-—=:") or cell.lower() in MISSING


def is_number(cell: str) -> bool:
    """Whether a cell is a number, perhaps with a unit or an sd."""
    return bool(is_plain_number(cell) or WITH_UNIT.match(cell) or PLUS_MINUS.match(cell))


def plain_numbers(cells: list[str]) -> bool:
    """Whether all cells are numbers and nothing else; of many rows soon."""
    try:
        return bool((np.abs(np.array(cells, float)) < 1e300).all())
    except ValueError:
        return all(map(is_plain_number, cells))


def value_of(number: str) -> float:
    """The value of a number as tables have it: 3,5 or 1d5 too."""
    return float(number.lower().replace(",", ".").replace("d", "e"))


def meanings_of(names: Sequence[str], stated: Iterable[str] = ()) -> list[str]:
    """What the core takes headers for; those that the user gave a meaning are 'stated'."""
    found = [call("file.column_name", header=without_mean(name))["text"] for name in names]
    own = {header.lower() for header in stated}
    return [
        "stated" if name.lower() in own else meaning
        for name, meaning in zip(names, found, strict=True)
    ]


def without_mean(name: str) -> str:
    """'Er (GPa)' of 'Mean Er (GPa)'."""
    return re.sub(r"\b[ _]*(mean|average|avg)[ _]*\b", " ", name, flags=re.I).strip() or name


def header_of(
    rows: list[tuple[int, list[str]]], stated: Iterable[str]
) -> tuple[int, int, list[str]]:
    """The place of the header among the first rows, how many of its names are known, and what they
    mean.
    """
    best: tuple[int, int, list[str]] = (0, 0, [])
    for i, (_, cells) in enumerate(rows[:60]):
        found = meanings_of(cells, stated) if sum(map(is_number, cells)) <= len(cells) // 2 else []
        if (known := len(set(found) - {""})) > best[1]:
            best = (i, known, found)
    return best


def understood(
    place: str,
    rows: list[tuple[int, list[str]]],
    sheet: str,
    stated: Iterable[str],
    is_plain: bool = True,
) -> LaboratoryTable:
    """The table of rows of cells with their numbers."""
    at, _, meanings = header_of(rows, stated)
    if not rows:
        return LaboratoryTable(place, [], [], [], [], sheet=sheet, is_plain=is_plain)
    line, names = rows[at]
    below = rows[at + 1 :]
    table = LaboratoryTable(
        place,
        list(names),
        meanings or [""] * len(names),
        [],
        [],
        header_line=line,
        sheet=sheet,
        is_plain=is_plain,
    )
    if at and (joined := joined_header(rows[at - 1][1], names, meanings, stated)):
        together = rows[at - 1][0], line
    elif (
        below
        and sum(map(is_number, below[0][1])) <= len(names) // 2
        and (joined := joined_header(names, below[0][1], meanings, stated))
    ):
        together, below = (line, below[0][0]), below[1:]
    else:
        joined = None
    if joined:
        table.names, table.meanings = joined
        table.note("lines {} and {} together are the header".format(*together))
    elif at:
        table.note(f"the header is on line {line}; {at} line{'s' * (at > 1)} above it left out")
    short = [
        without_mean(name) if meaning else name
        for name, meaning in zip(table.names, table.meanings)
    ]
    table.names, table.is_plain = short, table.is_plain and short == table.names
    width = max((j + 1 for j, name in enumerate(table.names) if name), default=0)
    table.names, table.meanings = table.names[:width], table.meanings[:width]
    table.rows = [
        cells if any(cells[width:]) else [*cells, *[""] * width][:width] for _, cells in below
    ]
    table.lines = [number for number, _ in below]
    table.leave_out(
        (i for i, (_, cells) in enumerate(below) if cells == names), "the header once more"
    )
    # Of a cell too many the core says the line.
    if all(len(row) == width for row in table.rows):
        clean(
            table,
            {} if sheet else {number: len(cells) for number, cells in below if len(cells) < width},
        )
    return table


def joined_header(
    above: list[str], below: list[str], meanings: list[str], stated: Iterable[str]
) -> tuple[list[str], list[str]] | None:
    """Names and meanings of two rows of headers, where the lower one completes the upper one, which
    stands over several columns; or None.
    """
    upper, last = [], ""
    for cell in [*above, *[""] * len(below)][: len(below)]:
        last = cell or last
        upper.append(last)
    choices = [
        [low, f"{up} {low}".strip(), up if not low else ""]
        for up, low in zip(upper, below, strict=True)
    ]
    found = [meanings_of(names, stated) for names in zip(*choices, strict=True)]
    best = [
        next((k for k in (1, 0, 2) if found[k][j] not in ("", "modulus_gpa")), 0)
        for j in range(len(below))
    ]
    # What stands below a hardness is its own.
    best = [1 if HARDNESS.fullmatch(up) else k for k, up in zip(best, upper, strict=True)]
    result = [found[k][j] for j, k in enumerate(best)]
    if len(set(result) - {""}) <= len(set(meanings) - {""}):
        return None
    return [choices[j][k] for j, k in enumerate(best)], result


def lines_in_words(lines: Iterable[int]) -> str:
    """'lines 3, 5, 9'; of many the first ones."""
    lines = list(lines)
    return (
        f"line{'s' * (len(lines) > 1)} "
        f"{', '.join(map(str, lines[:10]))}{', ..' if len(lines) > 10 else ''}"
    )


def clean(table: LaboratoryTable, short: dict[int, int]) -> None:
    """Leave out what is no measurement; make cells numbers, names of a grain one, tests without sds
    means. `short`: cells of lines with too few.
    """
    # The core reads it.
    if (
        table.rows
        and sum(bool(UNIT.fullmatch(cell)) for cell in table.rows[0]) > 1
        and not any(map(is_number, table.rows[0]))
    ):
        row = table.rows.pop(0)
        table.units = [(table.lines.pop(0), [cell if UNIT.fullmatch(cell) else "" for cell in row])]
        table.is_plain &= table.units[0][1] == row
    if not any(meaning in ANGLES or len(meaning) in (1, 2) for meaning in table.meanings):
        split_indices(table)
    first = [next(filter(None, row), "") for row in table.rows]
    # A single letter is the name of a grain, if nothing is missing.
    of_statistics = (
        i
        for i, name in enumerate(first)
        if STATISTICS.match(name) and (len(name) > 1 or "" in table.rows[i])
    )
    table.leave_out(of_statistics, "statistics of the table")
    table.leave_out(
        (
            i
            for i, row in enumerate(table.rows)
            if row.count("") == len(row) - 1 and not is_number("".join(row))
        ),
        "a remark",
    )
    if line := next((line for line in table.lines if line in short), 0):
        raise InputError(
            f"{table.place}line {line}: {short[line]} cells where the header has {len(table.names)}"
        )
    split_sds(table)
    refuse_words(table)
    grain = table.column("grain")
    needed = [
        j
        for j in dressed_columns(table)
        if table.meanings[j] in (*MODULI, "sd_gpa", *ANGLES) or len(table.meanings[j]) in (1, 2)
    ]
    needed = [
        j for j in (grain, *needed) if j >= 0 and not all(is_missing(row[j]) for row in table.rows)
    ]
    table.leave_out(
        (i for i, row in enumerate(table.rows) if any(is_missing(row[j]) for j in needed)),
        "a value is missing",
    )
    if grain >= 0:
        one_spelling(table, grain)
    standard_errors(table, grain)


def dressed_columns(table: LaboratoryTable) -> list[int]:
    """Columns of numbers that are read, in which some cells are more or less than a number."""
    read = [
        j
        for j, meaning in enumerate(table.meanings)
        if meaning and meaning not in (*WORDS, "stated")
    ]
    return [j for j in read if not plain_numbers([row[j] for row in table.rows])]


def split_sds(table: LaboratoryTable) -> None:
    """`109.7 ± 3.0` becomes two cells, `46.3°` and `112.3 GPa` numbers; `5 %` of the modulus
    GPa.
    """
    modulus, sd = table.column(*MODULI), table.column("sd_gpa")
    sds: dict[int, str] = {}
    if sd > 0 and ANY_SD.fullmatch(table.names[sd]) and HARDNESS.fullmatch(table.names[sd - 1]):
        raise InputError(
            f"{table.place}line {table.header_line}: the column "
            f"{table.names[sd]} follows {table.names[sd - 1]} and may be of "
            "that; name it sd_gpa if it is the sd of the modulus"
        )

    numbers = dressed_columns(table)
    for i, row in enumerate(table.rows):
        for j in (j for j in numbers if not is_plain_number(row[j])):
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
        sd = next(
            (
                j
                for j, name in enumerate(table.names)
                if RELATIVE.fullmatch(name) and SHARE.search(name)
            ),
            -1,
        )
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
    """GPa of a number of per cent, where the modulus is a number."""
    return repr(value_of(number) / 100 * value_of(modulus)) if is_plain_number(modulus) else number


def split_indices(table: LaboratoryTable) -> None:
    """A column of `[1 0 2]` or `(0001)` becomes columns of indices."""
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
            table.add_column(
                label, label, [indices[row[j]][k] if indices[row[j]] else "" for row in table.rows]
            )
        table.note(
            f"column {name}: indices of the {'direction' if kinds == {True} else 'plane'} along "
            "the indenter"
        )
        return


def indices_of(cell: str) -> list[str]:
    """The indices of `[1 0 -2]`, `(0001)` or `[11-20]`, a bar over a digit or a minus before it."""
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
    """Refuse what is no number where one is needed, all lines at once."""
    numbers = dressed_columns(table)
    cells = (
        (line, j, row[j])
        for line, row in zip(table.lines, table.rows, strict=True)
        for j in numbers
    )
    words = [
        (line, j, cell)
        for line, j, cell in cells
        if not is_missing(cell) and not is_plain_number(cell)
    ]
    wrong = [f"line {line}, column {table.names[j]}: {cell[:30]!r}" for line, j, cell in words]
    if len(wrong) > 1:
        raise InputError(
            f"{table.place}{len(wrong)} cells are no numbers: "
            f"{'; '.join(wrong[:12])}{'; ..' if len(wrong) > 12 else ''}"
        )


def one_spelling(table: LaboratoryTable, grain: int) -> None:
    """`G1`, `g1` and `G 1` are one grain, called as in its first row."""
    first: dict[str, str] = {}
    others: dict[str, str] = {}
    # Of 1-1 and 11 each is its own.
    keys = {
        name: re.sub(r"(?<!\d)[\s_-]+|[\s_-]+(?!\d)", "", name).casefold()
        for name in {row[grain] for row in table.rows}
    }
    for row in table.rows:
        name = first.setdefault(keys[row[grain]], row[grain])
        if row[grain] != name:
            others[row[grain]] = name
            row[grain] = name
    if others:
        pairs = ", ".join(f"{other} and {name}" for other, name in others.items())
        table.note(f"column {table.names[grain]}: taken for one grain: {pairs}")


@np.errstate(all="ignore")
def standard_errors(table: LaboratoryTable, grain: int) -> None:
    """Sds of means: of a standard deviation of N tests, or of repeated tests that have none, a
    pooled one where they are few.
    """
    modulus, sd = table.column(*MODULI), table.column("sd_gpa")
    number = next((j for j, name in enumerate(table.names) if COUNT.fullmatch(name)), -1)
    if (
        number >= 0
        and len(table.rows) > 2
        and [row[number] for row in table.rows] == [str(1 + i) for i in range(len(table.rows))]
    ):
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
        if wrong := [
            line
            for line, row in zip(table.lines, table.rows, strict=True)
            if not whole(row[number])
        ]:
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
    pooled = float(
        np.sqrt(sum(len(values) * np.var(values) for values in tests.values()) / max(1, freedom))
    )
    if not pooled > 0:
        return
    # Of tests with sds the core makes the means.
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
