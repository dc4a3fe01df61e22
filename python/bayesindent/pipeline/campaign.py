"""campaign.sqlite: every simulation that was ever made or imported, one row each, never changed.

A row is committed before the next simulation starts, so that an interrupted campaign loses at most what was under way. A point that
failed stays failed. Rows belong to a physics (mesh, element, estimator, revision of the numerics): several surrogates share a file,
and a new release does not orphan old results.
"""

import json
import sqlite3
from dataclasses import dataclass
from datetime import datetime, timezone
from pathlib import Path

import numpy as np

from ..core import InputError
from ..crystal.elasticity import constant_names

__all__ = ["IMPORTED", "Campaign", "Row"]

#: Marks the file as ours ('bayi'), and the version of its layout.
APPLICATION_ID, FORMAT = 0x62617969, 1

LAYOUT = f"""
CREATE TABLE physics (
    id INTEGER PRIMARY KEY,
    identity TEXT NOT NULL UNIQUE           -- JSON, keys sorted
);
CREATE TABLE simulation (
    id INTEGER PRIMARY KEY,
    physics_id INTEGER NOT NULL REFERENCES physics(id),
    position INTEGER NOT NULL,              -- order of choice within the physics, from 0
    symmetry TEXT NOT NULL,
    constants TEXT NOT NULL,                -- JSON list, GPa, in the package's order
    euler_deg TEXT NOT NULL,                -- JSON list, Bunge-Euler angles
    origin TEXT NOT NULL CHECK (origin IN ('simulated', 'told')),
    status TEXT NOT NULL CHECK (status IN ('done', 'failed')),
    message TEXT NOT NULL,                  -- why it failed
    indentation_modulus_gpa REAL,
    elements INTEGER,
    seconds REAL,
    depth_um TEXT,                          -- JSON list
    force_mn TEXT,                          -- JSON list
    created TEXT NOT NULL,                  -- UTC
    UNIQUE (physics_id, symmetry, constants, euler_deg)
);
CREATE INDEX simulation_by_position ON simulation (physics_id, position);
CREATE TRIGGER simulation_is_not_changed BEFORE UPDATE ON simulation
    BEGIN SELECT RAISE(ABORT, 'a stored simulation is never changed'); END;
CREATE TRIGGER simulation_is_not_deleted BEFORE DELETE ON simulation
    BEGIN SELECT RAISE(ABORT, 'a stored simulation is never deleted'); END;
PRAGMA application_id = {APPLICATION_ID};
PRAGMA user_version = {FORMAT};
"""

#: The file's word for the origin of a row that another program computed.
IMPORTED = "told"

#: Relative difference of two moduli below which an imported row says the same as a stored one.
SAME = 1e-6


@dataclass(frozen=True)
class Row:
    """One simulation: constants in GPa, angles in degrees, modulus in GPa (None if it failed), seconds, depths in um, forces in mN."""

    position: int
    symmetry: str
    constants: tuple
    euler_deg: tuple
    origin: str
    message: str
    modulus_gpa: float | None
    seconds: float | None
    elements: int | None
    depth_um: list | None
    force_mn: list | None


#: The columns of a `Row`, in its order.
COLUMNS = "position, symmetry, constants, euler_deg, origin, message, indentation_modulus_gpa, seconds, elements, depth_um, force_mn"


def _row(cells) -> Row:
    position, symmetry, constants, euler_deg, *numbers, depth, force = cells
    curve = (None if text is None else json.loads(text) for text in (depth, force))
    return Row(position, symmetry, tuple(json.loads(constants)), tuple(json.loads(euler_deg)), *numbers, *curve)


def _list(values) -> str:
    """Numbers as the file spells them: every double to its last bit."""
    return json.dumps([float(value) for value in values])


class Campaign:
    """The rows of one physics in a campaign file, which is made if it is not there.

    path: of the file; identity: a dict of plain values. Raises `InputError` if the file is damaged or something else.
    """

    def __init__(self, path, identity: dict):
        self.path = Path(path)
        self.path.parent.mkdir(parents=True, exist_ok=True)
        fresh = not self.path.exists() or self.path.stat().st_size == 0
        try:
            self._file = sqlite3.connect(self.path, timeout=60)
            self._file.execute("PRAGMA synchronous = FULL")
            self._open(fresh)
            with self._file:
                self._file.execute("INSERT OR IGNORE INTO physics (identity) VALUES (?)", (json.dumps(identity, sort_keys=True),))
            self.physics_id = self._value("SELECT id FROM physics WHERE identity = ?", json.dumps(identity, sort_keys=True))
        except sqlite3.DatabaseError as error:
            raise self._damaged(error) from error

    def _open(self, fresh: bool) -> None:
        if fresh:
            with self._file:
                self._file.executescript("BEGIN IMMEDIATE;" + LAYOUT + "COMMIT;")
            return
        if self._value("PRAGMA application_id") != APPLICATION_ID:
            raise InputError(f"{self.path}: is a database, but not a campaign of bayesindent; choose another output folder")
        if (version := self._value("PRAGMA user_version")) > FORMAT:
            raise InputError(f"{self.path}: was written by a newer version (format {version}, known: {FORMAT})")
        if (verdict := self._value("PRAGMA quick_check")) != "ok":
            raise self._damaged(verdict)

    def _damaged(self, why) -> InputError:
        return InputError(f"{self.path}: is not a campaign, or is damaged ({why}); restore a copy, or move it away to start a new one")

    def _value(self, statement: str, *values):
        """The first cell that a statement gives."""
        return self._file.execute(statement, values).fetchone()[0]

    def close(self) -> None:
        """Close the file."""
        self._file.close()

    def __enter__(self) -> "Campaign":
        return self

    def __exit__(self, *_) -> None:
        self.close()

    def _select(self, condition: str, *values) -> list[Row]:
        statement = f"SELECT {COLUMNS} FROM simulation WHERE physics_id = ? AND {condition} ORDER BY position, id"
        return [_row(cells) for cells in self._file.execute(statement, (self.physics_id, *values))]

    def rows(self, symmetry: str) -> list[Row]:
        """All rows of this physics and symmetry, in order of choice."""
        return self._select("symmetry = ?", symmetry)

    def find(self, symmetry: str, constants, euler_deg) -> Row | None:
        """The row of a point, constants (k,) in GPa and angles (3,) in degrees, if it is there."""
        found = self._select("symmetry = ? AND constants = ? AND euler_deg = ?", symmetry, _list(constants), _list(euler_deg))
        return found[0] if found else None

    def other_physics(self) -> list[str]:
        """Identities of the other physics in the file that have rows."""
        statement = "SELECT identity FROM physics WHERE id <> ? AND id IN (SELECT physics_id FROM simulation)"
        return [row[0] for row in self._file.execute(statement, (self.physics_id,))]

    def next_position(self) -> int:
        """The position of a row to come."""
        return self._value("SELECT COALESCE(MAX(position) + 1, 0) FROM simulation WHERE physics_id = ?", self.physics_id)

    def add(self, symmetry: str, constants, euler_deg, *, position: int | None = None, **result) -> None:
        """Store one result of a crystal, constants (k,) in GPa and angles (3,) in degrees, at this or the next position.

        result: modulus_gpa, elements, seconds, depth_um, force_mn, or without a modulus the message why it failed. Committed on return.
        A row that is there already, from another program at work on the same file, stays.
        """
        self._insert([(self.next_position() if position is None else position, symmetry, constants, euler_deg, "simulated", result)])

    def _insert(self, rows) -> None:
        cells = []
        for position, symmetry, constants, euler_deg, origin, result in rows:
            modulus, message = result.get("modulus_gpa"), result.get("message", "")
            if modulus is not None and not (np.isfinite(modulus) and modulus > 0):
                modulus, message = None, f"the modulus is {modulus} GPa"
            curves = [None if result.get(name) is None else _list(result[name]) for name in ("depth_um", "force_mn")]
            made = [None if modulus is None else float(modulus), result.get("seconds"), result.get("elements"), *curves]
            now = datetime.now(timezone.utc).isoformat(timespec="seconds")
            status = "failed" if modulus is None else "done"
            cells.append([position, symmetry, _list(constants), _list(euler_deg), origin, message, *made, self.physics_id, status, now])
        with self._file:
            self._file.executemany(
                f"INSERT INTO simulation ({COLUMNS}, physics_id, status, created) VALUES (?,?,?,?,?,?,?,?,?,?,?,?,?,?) "
                "ON CONFLICT (physics_id, symmetry, constants, euler_deg) DO NOTHING",
                cells,
            )

    def import_rows(self, symmetry: str, constants, euler_deg, modulus_gpa) -> int:
        """Import results of others: constants (n, k) in GPa, angles (n, 3) in degrees, moduli (n,) in GPa. Gives how many were new.

        Rows that are there already with the same modulus are skipped. Rows that contradict each other or a stored row are refused,
        all of them, before anything is stored.
        """
        new: dict = {}
        for i, (c, e, m) in enumerate(zip(constants, euler_deg, modulus_gpa, strict=True), start=1):
            if not (np.isfinite(m) and m > 0):
                raise InputError(f"row {i}: modulus_gpa is {m}; it must be positive")
            point = tuple(c), tuple(e)
            stored = self.find(symmetry, c, e)
            earlier = stored.modulus_gpa if stored is not None else new.get(point)
            what = f"row {i} ({', '.join(f'{name} {value:g}' for name, value in zip(constant_names(symmetry), c, strict=True))})"
            if stored is not None and earlier is None:
                raise InputError(
                    f"{what}: the campaign has this point as failed ({stored.message}); a stored row is never changed: leave the row out, "
                    "or import into a new campaign"
                )
            if earlier is not None and abs(earlier - m) > SAME * abs(m):
                raise InputError(
                    f"{what}: modulus_gpa is {m:g}, but the same point has {earlier:g} GPa "
                    f"{'in the campaign' if stored is not None else 'in an earlier row'}; one of them is wrong or of another "
                    "physics: leave one out, or import into a new campaign"
                )
            if earlier is None:
                new[point] = float(m)
        first = self.next_position()
        self._insert((first + i, symmetry, *point, IMPORTED, {"modulus_gpa": m}) for i, (point, m) in enumerate(new.items()))
        return len(new)
