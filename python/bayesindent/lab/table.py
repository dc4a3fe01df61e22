"""The table of a laboratory while it becomes a canonical one."""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field

import pandas as pd

from ..core import InputError
from .columns import ANGLES, DIRECTIONS, abridged


@dataclass
class LaboratoryTable:
    """A table of texts and how it is read.

    `cells` has a row for each line of the file, which is its index, and columns 0, 1, .. `names`
    are the headers, `meanings` the canonical names ('' for none), and `units` the words of a row of
    units ('' for none). `blank` are lines that separate blocks of rows, and `short` has the number
    of cells of the lines that have too few. `stated` are the headers that the user names. `notes`
    describe what was changed, and `left_out` gives a reason for each line left out. `doubtful` are
    numbers, by line and column, that can be read in two ways.
    """

    names: list[str]
    meanings: list[str]
    cells: pd.DataFrame
    units: list[str]
    header_line: int = 1
    sheet: str = ""
    blank: set[int] = field(default_factory=set)
    short: dict[int, int] = field(default_factory=dict)
    stated: set[str] = field(default_factory=set)
    notes: list[str] = field(default_factory=list)
    left_out: dict[int, str] = field(default_factory=dict)
    doubtful: dict[tuple[int, int], str] = field(default_factory=dict)

    def note(self, words: str) -> None:
        """Describe a change."""
        self.notes.append(words)

    def column(self, *meanings: str) -> int:
        """The first column with one of the meanings, -1 if there is none."""
        found = (self.meanings.index(name) for name in meanings if name in self.meanings)
        return next(found, -1)

    def oriented(self) -> list[str]:
        """The meanings of the columns that state orientations."""
        return [name for name in self.meanings if name in ANGLES or name in DIRECTIONS]

    def refuse_orientations(self) -> None:
        """Refuse a table that states orientations, which another file has."""
        for name in self.oriented():
            raise InputError(
                f"the column {name} states the orientation too; one of them is allowed"
            )

    def leave_out(self, lines: Iterable[int], reason: str) -> None:
        """Remove the rows of these lines, and note them and the reason."""
        lines = sorted(set(lines))
        if lines:
            self.left_out |= dict.fromkeys(lines, reason)
            self.note(
                f"{len(lines)} of {len(self.cells)} rows left out, {reason}: "
                f"{lines_in_words(lines)}"
            )
            self.cells = self.cells.drop(index=lines)

    def add_column(self, meaning: str, cells: Sequence[str]) -> None:
        """Append a column of texts, or replace the one that has this meaning."""
        j = self.column(meaning)
        if j < 0:
            j = len(self.names)
            self.names.append(meaning)
            self.meanings.append(meaning)
            self.units.append("")
        self.cells[j] = list(cells)

    def words(self, grains: int) -> list[str]:
        """Three lines that describe how the table is read."""
        pairs = [pair for pair in zip(self.names, self.meanings) if pair[0]]
        read = [name if name == own else f"{name} as {own}" for name, own in pairs if own]
        unread = [name for name, own in pairs if not own]
        reasons = [f"line {line} ({reason})" for line, reason in self.left_out.items()]
        where = f"sheet {self.sheet}, " if self.sheet else ""
        return [
            f"{grains} grains in {len(self.cells)} rows, {where}header on line {self.header_line}",
            f"  read: {', '.join(read)}" + (f"; not read: {', '.join(unread)}" if unread else ""),
            f"  left out: {'; '.join(reasons[:6]) or 'no row'}"
            + (", .." if len(reasons) > 6 else ""),
        ]


def lines_in_words(lines: Iterable[int]) -> str:
    """Line numbers as 'lines 3, 5, 9'; at most the first ten."""
    lines = list(lines)
    return f"line{'s' * (len(lines) > 1)} {abridged(lines)}"
