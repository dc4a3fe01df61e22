"""campaign.sqlite as Python's sqlite3 reads it."""

import json
import sqlite3
from collections import namedtuple
from contextlib import closing
from pathlib import Path

__all__ = ["Row", "rows"]

Row = namedtuple(
    "Row", "position symmetry constants euler_deg imported message modulus_gpa seconds elements depth_um force_mn"
)  # fmt: skip

STORED = """SELECT position, symmetry, constants, euler_deg, origin, message, indentation_modulus_gpa, seconds, elements, depth_um, force_mn
FROM simulation JOIN physics ON physics.id = physics_id WHERE identity LIKE ? ORDER BY physics_id, position"""


def rows(path: Path, physics: str = "%") -> list[Row]:
    """The rows of a campaign in order of choice: constants and angles are tuples, curves lists, and None is what the file has not.

    `physics`: only those of an identity like this pattern of SQL.
    """
    with closing(sqlite3.connect(path)) as file:
        found = []
        for position, symmetry, constants, euler_deg, origin, message, *numbers, depth, force in file.execute(STORED, [physics]):
            lists = tuple(json.loads(constants)), tuple(json.loads(euler_deg))
            curve = [values and json.loads(values) for values in (depth, force)]
            found.append(Row(position, symmetry, *lists, origin == "told", message, *numbers, *curve))
        return found
