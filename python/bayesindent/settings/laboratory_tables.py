"""Tables of measurements as laboratories have them, text or spreadsheet, made into the plain table that the core reads.

A plain table stays as it is. Of others the header is found below other lines, rows of statistics and incomplete rows are left out, cells such
as `46.3°`, `109.7 ± 3.0`, `5 %` and `[1 0 2]` become numbers, and repeated tests without sds become means with standard errors. Each change is
said in a note. Lines keep their numbers, so that messages of the core name those of the file.
"""

import csv
import re
import sys
import warnings
from collections import Counter
from collections.abc import Iterable, Iterator, Sequence
from contextlib import closing, contextmanager
from dataclasses import dataclass, field
from importlib import import_module
from io import StringIO
from pathlib import Path
from types import ModuleType
from typing import Any

import numpy as np

from ..core import InputError, call

__all__ = ["LaboratoryTable", "laboratory_table", "meanings_of", "reader_of", "reading"]

#: Moduli, most specific first; an sd; what says which test of which grain a row is.
MODULI = ("indentation_modulus_gpa", "effective_modulus_gpa", "sample_modulus_gpa", "modulus_gpa")
ANGLES = ("phi1_deg", "Phi_deg", "phi2_deg")
WORDS = ("grain", "group", "test", "reference", "session")
#: Cells that say that there is no value; the last is what some instruments write.
MISSING = {"", "-", "–", "—", ".", "n/a", "na", "nan", "none", "null", "nil", "missing", "#n/a", "#div/0!", "#value!", "#ref!", "#num!", "1.797e308", "1.797e+308", "1.797693e+308"}  # fmt: skip
#: Names of rows of statistics, as they begin.
STATISTICS = re.compile(
    r"(mean|average|avg|median|std|st\.? ?dev|stdev|standard|sd|sem|% ?cov|cov|cv|coefficient|min|max|count|number|range|sum|n)\b[^0-9]*$",
    re.I,
)
NUMBER = r"[+-]?(?:\d+[.,]?\d*|[.,]\d+)(?:[eEdD][+-]?\d+)?"
is_plain_number = re.compile(NUMBER).fullmatch
PLUS_MINUS = re.compile(rf"({NUMBER})\s*(?:±|\+/-|\+-)\s*({NUMBER})\s*(\S*)$")
WITH_UNIT = re.compile(rf"({NUMBER})\s*(°|deg|GPa|nm|um|µm|μm|mN|s|%)$")
#: A cell of a row of units.
UNIT = re.compile(r"[\[(]?(deg|degrees?|°|rad|radians|[GMk]?Pa|um|µm|μm|nm|mm|m?N|%|-)[\])]?", re.I)
INDICES = re.compile(r"([\[({<])\s*(-?\d[-\d\s,.;\u0304\u0305]*)[\])}>]$")
#: Names of numbers of tests, and of their standard deviation; `sd_gpa` is that of the value.
COUNT = re.compile(r"n|count|((n|number of|no\. of)[ _]?)?(tests|indents)", re.I)
DEVIATION = re.compile(r"(?!sd_gpa$).*\b(std|st[ ._]*dev|stddev|standard[ _]deviation|sd)\b", re.I)
#: Longer files are plain tables.
MOST_LINES = 200_000
#: Own sds of grains with fewer tests are those of all.
FEW_TESTS = 10


def reader_of(place: str, path: Path, kind: str, module: str, otherwise: str = "") -> ModuleType:
    """The `module` of another package that reads a file of this `kind`, which is there. `place` begins the message of a refusal; `otherwise`:
    what else can be done than to install the package."""
    package = module.partition(".")[0]
    try:
        import_module(package)
        found = import_module(module)
    except ImportError:
        raise InputError(
            f"{place}reading {kind} needs {package}, which is not installed: {sys.executable} -m pip install {package}{otherwise}"
        ) from None
    if not path.is_file():
        raise InputError(f"{place}the file does not exist")
    return found


@contextmanager
def reading(place: str, words: str) -> Iterator[None]:
    """Whatever a damaged file makes its reader raise is a refusal, with a message of `place` and `words`; the reader's warnings and
    words, which may quote the file, are left out."""
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            yield
    except InputError:
        raise
    except Exception as error:
        raise InputError(f"{place}{words} ({type(error).__name__})") from None


@dataclass
class LaboratoryTable:
    """A table and what was understood: `names` of its columns, what the core takes each for (`meanings`, '' for nothing), and `rows` of cells,
    each with its `lines` number; of a row of `units` both. `notes` say what was changed, `left_out` rows by number with their reason; `is_plain`: nothing was changed."""

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
        return next((self.meanings.index(meaning) for meaning in meanings if meaning in self.meanings), -1)

    def leave_out(self, rows: Iterable[int], reason: str) -> None:
        """Rows by their number from 0 that are not read."""
        rows = set(rows)
        if rows:
            self.left_out |= {self.lines[i]: reason for i in rows}
            self.note(f"{len(rows)} of {len(self.rows)} rows left out, {reason}: {lines_in_words(self.lines[i] for i in sorted(rows))}")
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
        read = [
            name if name == meaning else f"{name} as {meaning}" for name, meaning in zip(self.names, self.meanings, strict=True) if meaning
        ]
        unread = [name for name, meaning in zip(self.names, self.meanings, strict=True) if name and not meaning]
        left = "; ".join(f"line {line} ({reason})" for line, reason in list(self.left_out.items())[:6]) or "no row"
        where = f"sheet {self.sheet}, " if self.sheet else ""
        return [
            f"{self.place.removesuffix(': ')}: {grains} grains in {len(self.rows)} rows, {where}header on line {self.header_line}",
            f"  read: {', '.join(read)}" + (f"; not read: {', '.join(unread)}" if unread else ""),
            f"  left out: {left}" + (", .." if len(self.left_out) > 6 else ""),
        ]

    def page(self) -> str:
        """The plain table, on the lines that its rows have in the file; '' if that is plain itself."""
        if self.is_plain:
            return ""
        text = StringIO()
        writer = csv.writer(text, delimiter="\t", lineterminator="\n")
        at = 1
        for line, cells in [(self.header_line, self.names), *self.units, *zip(self.lines, self.rows, strict=True)]:
            text.write("\n" * (line - at))
            writer.writerow([*cells, *[""] * (len(self.names) - len(cells))])
            at = line + 1
        return text.getvalue()


def laboratory_table(place: str, path: Path, sheet: str = "", stated: Iterable[str] = ()) -> LaboratoryTable | None:
    """The table of a file; None if it is none that needs changes, or none at all, which is the core's to say. `place` begins the message of a
    refusal; `sheet`: of a spreadsheet; `stated`: headers that the user gave a meaning."""
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
        rows = rows_of(text)
    if header_of(rows, stated)[1] < 2:
        return None
    table = understood(place, rows, "", stated)
    if encoding:
        table.note(f"read as {encoding}")
    return table


def decoded(content: bytes) -> tuple[str, str]:
    """A text and its encoding, '' if that is UTF-8; no text if it is none."""
    if content[:2] in (b"\xff\xfe", b"\xfe\xff"):
        return content.decode("utf-16", "replace"), "UTF-16"
    if b"\0" in content:
        return "", ""
    try:
        return content.decode("utf-8-sig"), ""
    except UnicodeDecodeError:
        return content.decode("cp1252", "replace"), "Windows-1252"


def rows_of(text: str) -> list[tuple[int, list[str]]]:
    """Cells with the number of their line, of what separates most lines into as many: tabs, semicolons or commas."""
    lines = text.splitlines()
    alike = {mark: max(Counter(line.count(mark) for line in lines if mark in line).values(), default=0) for mark in "\t;,"}
    # As many lines may have decimal commas.
    delimiter = max("\t;,", key=lambda mark: alike[mark] - 0.5 * (mark == ","))
    reader = csv.reader(StringIO(text, newline=""), delimiter=delimiter, skipinitialspace=True)
    rows, before = [], 0
    for cells in reader:
        if any(map(str.strip, cells)) and not cells[0].startswith("#"):
            rows.append((before + 1, [tidy(cell, delimiter != ",") for cell in cells]))
        before = reader.line_num
    return rows


def tidy(value: Any, decimal_commas: bool = True) -> str:
    """A cell in one line, a number with a decimal point."""
    cell = "" if value is None else " ".join(str(value).split())
    return re.sub(r"(?<=\d),(?=\d)", ".", cell) if decimal_commas and is_number(cell) else cell


def sheet_of(place: str, path: Path, sheet: str, stated: Iterable[str]) -> tuple[list, str]:
    """The rows of a sheet of a spreadsheet with their numbers, and its name: the one that is asked for, or the first that has a table of moduli."""
    openpyxl = reader_of(place, path, "a spreadsheet", "openpyxl", ", or save the sheet as CSV")
    with reading(place, "is no spreadsheet that can be read"):
        with closing(openpyxl.load_workbook(path, read_only=True, data_only=True)) as book:
            if sheet and sheet not in book.sheetnames:
                raise InputError(f"{place}there is no sheet {sheet!r}; the sheets are {', '.join(book.sheetnames)}")
            pages = {name: list(book[name].iter_rows(values_only=True)) for name in ([sheet] if sheet else book.sheetnames)}
        rows = {}
        for name, page in pages.items():
            numbered = enumerate(([tidy(value) for value in row] for row in page), 1)
            rows[name] = [(number, cells) for number, cells in numbered if any(cells)]
        fit = [name for name, page in rows.items() if set(MODULI) & set(header_of(page, stated)[2])]
        if len(fit) > 1 and next(iter(rows)) not in fit:
            raise InputError(f"{place}the sheets {', '.join(fit)} have moduli; state sheet = '{fit[0]}' or another")
        name = next(iter(rows)) if next(iter(rows)) in fit or not fit else fit[0]
        refuse_formulas(place, openpyxl, path, name, pages[name])
    return rows[name], name


def refuse_formulas(place: str, openpyxl: ModuleType, path: Path, sheet: str, values: list) -> None:
    """Refuse formulas whose values were never computed."""
    with closing(openpyxl.load_workbook(path, read_only=True)) as book:
        found = [
            cell.coordinate
            for row, known in zip(book[sheet].iter_rows(), values, strict=False)
            for cell, value in zip(row, known, strict=False)
            if value is None and isinstance(cell.value, str) and cell.value.startswith("=")
        ]
    if found:
        raise InputError(
            f"{place}the sheet {sheet} has formulas without a stored value ({', '.join(found[:10])}{', ..' if len(found) > 10 else ''}): "
            "open it in a spreadsheet program and save it, or write the values"
        )


def is_number(cell: str) -> bool:
    """Whether a cell is a number, perhaps with a unit or an sd."""
    return bool(is_plain_number(cell) or WITH_UNIT.match(cell) or PLUS_MINUS.match(cell))


def value_of(number: str) -> float:
    """The value of a number as tables have it: 3,5 or 1d5 too."""
    return float(number.lower().replace(",", ".").replace("d", "e"))


def meanings_of(names: Sequence[str], stated: Iterable[str] = ()) -> list[str]:
    """What the core takes headers for; those that the user gave a meaning are 'stated'."""
    found = [call("file.column_name", header=without_mean(name))["text"] for name in names]
    own = {header.lower() for header in stated}
    return ["stated" if name.lower() in own else meaning for name, meaning in zip(names, found, strict=True)]


def without_mean(name: str) -> str:
    """'Er (GPa)' of 'Mean Er (GPa)'."""
    return re.sub(r"\b[ _]*(mean|average|avg)[ _]*\b", " ", name, flags=re.I).strip() or name


def header_of(rows: list[tuple[int, list[str]]], stated: Iterable[str]) -> tuple[int, int, list[str]]:
    """The place of the header among the first rows, how many of its names are known, and what they mean."""
    best: tuple[int, int, list[str]] = (0, 0, [])
    for i, (_, cells) in enumerate(rows[:60]):
        found = meanings_of(cells, stated) if sum(map(is_number, cells)) <= len(cells) // 2 else []
        if (known := len(set(found) - {""})) > best[1]:
            best = (i, known, found)
    return best


def understood(place: str, rows: list[tuple[int, list[str]]], sheet: str, stated: Iterable[str], is_plain: bool = True) -> LaboratoryTable:
    """The table of rows of cells with their numbers."""
    at, _, meanings = header_of(rows, stated)
    if not rows:
        return LaboratoryTable(place, [], [], [], [], sheet=sheet, is_plain=is_plain)
    line, names = rows[at]
    below = rows[at + 1 :]
    table = LaboratoryTable(place, list(names), meanings or [""] * len(names), [], [], header_line=line, sheet=sheet, is_plain=is_plain)
    if at and (joined := joined_header(rows[at - 1][1], names, meanings, stated)):
        together = rows[at - 1][0], line
    elif below and not any(map(is_number, below[0][1])) and (joined := joined_header(names, below[0][1], meanings, stated)):
        together, below = (line, below[0][0]), below[1:]
    else:
        joined = None
    if joined:
        table.names, table.meanings = joined
        table.note("lines {} and {} together are the header".format(*together))
    elif at:
        table.note(f"the header is on line {line}; {at} line{'s' * (at > 1)} above it left out")
    short = [without_mean(name) if meaning else name for name, meaning in zip(table.names, table.meanings)]
    if short != table.names:
        table.names, table.is_plain = short, False
    width = max((j + 1 for j, name in enumerate(table.names) if name), default=0)
    table.names, table.meanings = table.names[:width], table.meanings[:width]
    table.rows = [cells if any(cells[width:]) else [*cells, *[""] * width][:width] for _, cells in below]
    table.lines = [number for number, _ in below]
    # Of a cell too many the core says the line.
    if all(len(row) == width for row in table.rows):
        clean(table, {} if sheet else {number: len(cells) for number, cells in below if len(cells) < width})
    return table


def joined_header(above: list[str], below: list[str], meanings: list[str], stated: Iterable[str]) -> tuple[list[str], list[str]] | None:
    """Names and meanings of two rows of headers, where the lower one completes the upper one, which stands over several columns; or None."""
    upper, last = [], ""
    for cell in [*above, *[""] * len(below)][: len(below)]:
        last = cell or last
        upper.append(last)
    choices = [[low, f"{up} {low}".strip(), up if not low else ""] for up, low in zip(upper, below, strict=True)]
    found = [meanings_of(names, stated) for names in zip(*choices, strict=True)]
    best = [next((k for k in (1, 0, 2) if found[k][j] and found[k][j] != "modulus_gpa"), 0) for j in range(len(below))]
    result = [found[k][j] for j, k in enumerate(best)]
    if len(set(result) - {""}) <= len(set(meanings) - {""}):
        return None
    return [choices[j][k] for j, k in enumerate(best)], result


def lines_in_words(lines: Iterable[int]) -> str:
    """'lines 3, 5, 9'; of many the first ones."""
    lines = list(lines)
    return f"line{'s' * (len(lines) > 1)} {', '.join(map(str, lines[:10]))}{', ..' if len(lines) > 10 else ''}"


def clean(table: LaboratoryTable, short: dict[int, int]) -> None:
    """Leave out what is no measurement, turn cells into numbers, one name for each grain, and means for tests without sds. `short`: the
    number of cells of lines that have too few."""
    # The core reads it.
    if table.rows and all(not cell or UNIT.fullmatch(cell) for cell in table.rows[0]):
        table.units = [(table.lines.pop(0), table.rows.pop(0))]
    if not any(meaning in ANGLES or len(meaning) in (1, 2) for meaning in table.meanings):
        split_indices(table)
    table.leave_out(
        (i for i, row in enumerate(table.rows) if i and STATISTICS.match(next(filter(None, row), ""))), "statistics of the table"
    )
    table.leave_out((i for i, row in enumerate(table.rows) if row.count("") == len(row) - 1 and not is_number("".join(row))), "a remark")
    if line := next((line for line in table.lines if line in short), 0):
        raise InputError(f"{table.place}line {line}: {short[line]} cells where the header has {len(table.names)}")
    split_sds(table)
    refuse_words(table)
    grain = table.column("grain")
    needed = [j for j, name in enumerate(table.meanings) if name in (*MODULI, "sd_gpa", *ANGLES, "grain") or len(name) in (1, 2)]
    needed = [j for j in needed if any(row[j].lower() not in MISSING for row in table.rows)]
    table.leave_out((i for i, row in enumerate(table.rows) if any(row[j].lower() in MISSING for j in needed)), "a value is missing")
    if grain >= 0:
        one_spelling(table, grain)
    standard_errors(table, grain)


def numeric_columns(table: LaboratoryTable) -> list[int]:
    """Columns of numbers that are read."""
    return [j for j, meaning in enumerate(table.meanings) if meaning and meaning not in WORDS and meaning != "stated"]


def split_sds(table: LaboratoryTable) -> None:
    """`109.7 ± 3.0` becomes two cells, `46.3°` and `112.3 GPa` numbers; `5 %` of the modulus GPa."""
    modulus, sd = table.column(*MODULI), table.column("sd_gpa")
    sds: dict[int, str] = {}
    numbers = numeric_columns(table)
    for i, row in enumerate(table.rows):
        for j in (j for j in numbers if not is_plain_number(row[j])):
            if (found := PLUS_MINUS.match(row[j])) and j == modulus and sd < 0:
                row[j], sds[i] = found[1], found[2]
            if (found := WITH_UNIT.match(row[j])) and (found[2] != "%" or (j == sd and modulus >= 0)):
                is_share = found[2] == "%"
                row[j] = repr(value_of(found[1]) / 100 * value_of(row[modulus])) if is_share and is_plain_number(row[modulus]) else found[1]
                table.is_plain = False
    if sds:
        table.add_column("sd_gpa", "sd_gpa", [sds.get(i, "") for i in range(len(table.rows))])
        table.note(f"column {table.names[modulus]}: what follows ± is its sd")
    if sd >= 0 and "%" in table.names[sd] and modulus >= 0 and all(is_plain_number(row[sd]) for row in table.rows):
        for row in table.rows:
            row[sd] = repr(value_of(row[sd]) / 100 * value_of(row[modulus]))
        table.note(f"column {table.names[sd]}: per cent of the modulus")
        table.names[sd] = "sd_gpa"


def split_indices(table: LaboratoryTable) -> None:
    """A column of `[1 0 2]` or `(0001)` becomes columns of indices."""
    for j, name in enumerate(list(table.names)):
        cells = [row[j] for row in table.rows if row[j].lower() not in MISSING and not STATISTICS.match(row[j])]
        found = [INDICES.match(cell) for cell in cells]
        if not cells or not all(found):
            continue
        kinds = {cell[0] in "[<" for cell in cells}
        indices = {row[j]: indices_of(row[j]) for row in table.rows}
        counts = {len(value) for value in indices.values() if value}
        if len(kinds) > 1 or counts not in ({3}, {4}):
            raise InputError(
                f"{table.place}column {name}: directions [..] or planes (..) of three indices, or all of four, are read; not {', '.join(cells[:3])}"
            )
        labels = ("u v w" if counts == {3} else "u v t w") if kinds == {True} else ("h k l" if counts == {3} else "h k i l")
        for k, label in enumerate(labels.split()):
            table.add_column(label, label, [indices[row[j]][k] if indices[row[j]] else "" for row in table.rows])
        table.note(f"column {name}: indices of the {'direction' if kinds == {True} else 'plane'} along the indenter")
        return


def indices_of(cell: str) -> list[str]:
    """The indices of `[1 0 -2]`, `(0001)` or `[11-20]`, a bar over a digit or a minus before it."""
    found = INDICES.match(cell)
    if not found:
        return []
    inside = re.sub(r"(\d)[\u0304\u0305]", r"-\1", found[2]).strip()
    return re.findall(r"-?\d+", inside) if re.search(r"[\s,;.]", inside) else re.findall(r"-?\d", inside)


def refuse_words(table: LaboratoryTable) -> None:
    """Refuse what is no number where one is needed, all lines at once."""
    wrong = [
        f"line {line}, column {table.names[j]}: {row[j][:30]!r}"
        for line, row in zip(table.lines, table.rows, strict=True)
        for j in numeric_columns(table)
        if row[j].lower() not in MISSING and not is_plain_number(row[j])
    ]
    if len(wrong) > 1:
        raise InputError(f"{table.place}{len(wrong)} cells are no numbers: {'; '.join(wrong[:12])}{'; ..' if len(wrong) > 12 else ''}")


def one_spelling(table: LaboratoryTable, grain: int) -> None:
    """`G1`, `g1` and `G 1` are one grain, called as in its first row."""
    first: dict[str, str] = {}
    others: dict[str, str] = {}
    for row in table.rows:
        name = first.setdefault(re.sub(r"[\s_-]+", "", row[grain]).casefold(), row[grain])
        if row[grain] != name:
            others[row[grain]] = name
            row[grain] = name
    if others:
        table.note(
            f"column {table.names[grain]}: taken for one grain: {', '.join(f'{other} and {name}' for other, name in others.items())}"
        )


@np.errstate(all="ignore")
def standard_errors(table: LaboratoryTable, grain: int) -> None:
    """Sds of means: of a standard deviation of N tests, or of repeated tests that have none, a pooled one where they are few."""
    modulus, sd = table.column(*MODULI), table.column("sd_gpa")
    number = next((j for j, name in enumerate(table.names) if COUNT.fullmatch(name)), -1)
    counts = [row[number] for row in table.rows] if number >= 0 else [""]
    numbers = sd >= 0 and all(is_plain_number(row[sd]) for row in table.rows)
    if numbers and DEVIATION.search(table.names[sd]) and all(re.fullmatch(r"0*[1-9]\d{0,8}", count) for count in counts):
        for row, count in zip(table.rows, counts, strict=True):
            row[sd] = repr(value_of(row[sd]) / float(np.sqrt(int(count))))
        table.note(
            f"column {table.names[sd]}: a standard deviation of {table.names[number]} tests, divided by its root: the standard error of the mean"
        )
    if sd >= 0 or grain < 0 or modulus < 0 or not all(is_plain_number(row[modulus]) for row in table.rows):
        return
    tests: dict[str, list[float]] = {}
    for row in table.rows:
        tests.setdefault(row[grain], []).append(value_of(row[modulus]))
    freedom = len(table.rows) - len(tests)
    pooled = float(np.sqrt(sum(len(values) * np.var(values) for values in tests.values()) / max(1, freedom)))
    if not pooled > 0:
        return
    # Of tests with sds the core makes the means.
    sds = {name: float(np.std(values, ddof=1)) if len(values) >= FEW_TESTS else pooled for name, values in tests.items()}
    table.add_column("sd_gpa", "sd_gpa", [repr(sds[row[grain]]) for row in table.rows])
    table.note(
        f"{len(table.rows)} tests of {len(tests)} grains became means with standard errors; the sd of a test is {pooled:.3g} GPa, pooled over "
        f"grains with fewer than {FEW_TESTS} tests ({freedom} degrees of freedom)"
    )
