"""Rows of campaign.sqlite as Python's sqlite3 reads them, and a campaign with moduli from
elsewhere.
"""

import json
import sqlite3
from collections import namedtuple
from contextlib import closing
from pathlib import Path

from bayesindent.settings.problem import Problem, read_crystals
from bayesindent.stages.build import tell

__all__ = ["Row", "count_rows", "past_trigger", "rows", "table", "told"]

Row = namedtuple(
    "Row",
    "position symmetry constants euler_deg imported message modulus_gpa seconds elements "
    "depth_um force_mn",
)

STORED = """
SELECT position, symmetry, constants, euler_deg, origin, message, indentation_modulus_gpa,
  seconds, elements, depth_um, force_mn
FROM simulation JOIN physics ON physics.id = physics_id
WHERE identity LIKE ? ORDER BY physics_id, position"""


def past_trigger(file: sqlite3.Connection, trigger: str, statement: str) -> None:
    """Perform a statement that a trigger of the campaign forbids, and leave the schema as it is."""
    made_by = file.execute("SELECT sql FROM sqlite_master WHERE name = ?", [trigger]).fetchone()[0]
    file.execute(f"DROP TRIGGER {trigger}")
    file.execute(statement)
    file.execute(made_by)
    file.commit()


def rows(path: Path, physics: str = "%") -> list[Row]:
    """The rows of a campaign in order of choice, with constants and angles as tuples and curves as
    lists.

    A value that the file does not have is None. `physics` restricts the rows to identities like
    this pattern of SQL.
    """
    with closing(sqlite3.connect(path)) as file:
        found = []
        for (
            position,
            symmetry,
            constants,
            euler_deg,
            origin,
            message,
            *numbers,
            depth,
            force,
        ) in file.execute(STORED, [physics]):
            lists = tuple(json.loads(constants)), tuple(json.loads(euler_deg))
            curve = [values and json.loads(values) for values in (depth, force)]
            found.append(
                Row(position, symmetry, *lists, origin == "told", message, *numbers, *curve)
            )
        return found


def count_rows(campaign) -> int:
    """The number of simulations in a campaign; 0 before its file exists."""
    if not campaign.exists():
        return 0
    try:
        with sqlite3.connect(f"file:{campaign}?mode=ro", uri=True) as file:
            return file.execute("SELECT count(*) FROM simulation").fetchone()[0]
    except sqlite3.OperationalError:
        return 0


HEADER = ("C11", "C12", "C44", "phi1_deg", "Phi_deg", "phi2_deg")


def table(folder, points, name="points.csv", moduli=None):
    """Write a table of cubic crystals whose numbers keep all bits."""
    lines = [",".join(HEADER + ("modulus_gpa",) * (moduli is not None))]
    lines += [",".join(map(repr, map(float, point))) for point in points]
    if moduli is not None:
        lines[1:] = [f"{line},{modulus!r}" for line, modulus in zip(lines[1:], moduli, strict=True)]
    (folder / name).write_text("\n".join(lines) + "\n")
    return folder / name


def told(folder, points, moduli):
    """Import these moduli by `build --tell` into a campaign with the physics of the theory; return
    its document.
    """
    folder.mkdir(exist_ok=True)
    text = (
        "&problem symmetry = 'cubic' /\n"
        "&simulation simulator = 'theory' /\n"
        "&domain log_anisotropy_max = 3 /\n"
        "&design budget = 8 /\n"
    )
    (folder / "b.nml").write_text(text)
    path = table(folder, points, "told.csv", moduli)
    return tell(
        Problem(folder / "b.nml", "build"), folder, read_crystals(path, "cubic"), "told.csv"
    )
