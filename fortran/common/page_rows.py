"""A module of Fortran with the rows of the tables of a page in docs/: the cells of each column."""

import sys
from pathlib import Path

MODULE = """\
!> Made of docs/{name}.md by page_rows.py.
module {name}_rows
   implicit none
   private

{columns}
end module {name}_rows
"""


def text(words: str) -> str:
    """A constant of Fortran, on as many lines as it needs."""
    pieces = [words[i : i + 80].replace("'", "''") for i in range(0, len(words), 80)] or [""]
    return "' &\n         & //'".join(pieces).join("''")


def cells_of(line: str) -> list[str]:
    """The cells of a row of a table."""
    return [cell.strip() for cell in line[1:-1].split("|")]


def module(page: str, name: str) -> str:
    """The module of a page whose tables all have the same columns."""
    header, *rows = (cells_of(line) for line in page.splitlines() if line.startswith("| "))
    rows = [row for row in rows if row != header]
    columns = []
    for column, cells in zip(header, zip(*rows)):
        longest = max(len(cell.encode()) for cell in cells)
        values = ", &\n      & ".join(map(text, cells))
        columns.append(
            f"   character(len={longest}), parameter, public :: {column}_column({len(cells)}) = &\n"
            f"      & [character(len={longest}) :: &\n      & {values}]"
        )
    return MODULE.format(name=name, columns="\n".join(columns))


if __name__ == "__main__":
    source = Path(sys.argv[1])
    made = module(source.read_text(encoding="utf-8"), source.stem)
    Path(sys.argv[2]).write_text(made, encoding="utf-8")
