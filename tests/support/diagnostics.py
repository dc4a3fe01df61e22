"""Diagnostics in the warnings of documents and problems, and in those of Python: tests look at
codes, subjects and numbers, not at sentences.
"""

import re
from contextlib import contextmanager

import pytest

import bayesindent as bi
from support.tree import SOURCE

__all__ = ["ROWS", "codes", "filled", "issues", "notes", "of_code", "rows_of"]


def rows_of(page: str) -> list[dict[str, str]]:
    """The rows of all tables of docs/diagnostics.md, cells by the names of their columns."""
    lines = [line for line in page.splitlines() if line.startswith("|")]
    cells = [[cell.strip() for cell in line.strip("|").split("|")] for line in lines]
    header = cells[0]
    return [
        dict(zip(header, row, strict=True))
        for row in cells
        if row != header and not re.fullmatch("[-:]+", row[0])
    ]


#: Rows of docs/diagnostics.md by their codes.
ROWS = {
    row["code"]: row
    for row in rows_of((SOURCE / "docs" / "diagnostics.md").read_text(encoding="utf-8"))
}


def filled(code: str, subject: str = "", numbers=None) -> dict:
    """A diagnostic as documents have it, its texts filled by Python's format."""
    row, numbers = ROWS[code], numbers or {}
    places = {"subject": subject, **numbers}
    return {
        "code": code,
        "severity": row["severity"],
        "consequence": row["consequence"],
        "subject": subject,
        "numbers": numbers,
        "text": row["sentence"].format(**places),
        "remedy": row["remedy"].format(**places),
    }


def codes(warnings) -> list[str]:
    """The codes of diagnostics in their order."""
    return [found["code"] for found in warnings]


def of_code(warnings, *wanted: str) -> list[dict]:
    """The diagnostics with one of these codes."""
    return [found for found in warnings if found["code"] in wanted]


def notes(warnings) -> str:
    """What was changed in tables, a line each. A note is the subject of its diagnostic, since it
    is a comment line of table.csv, too.
    """
    return "\n".join(found["subject"] for found in of_code(warnings, "table_changed"))


@contextmanager
def issues(code: str):
    """Warnings of Python with a diagnostic of this code are issued in the block; the list has,
    after it, the diagnostics of all that were issued there.
    """
    found: list[dict] = []
    with pytest.warns(bi.BayesindentWarning) as told:
        yield found
    found += [
        item.message.diagnostic for item in told if isinstance(item.message, bi.BayesindentWarning)
    ]
    assert code in codes(found), codes(found)
