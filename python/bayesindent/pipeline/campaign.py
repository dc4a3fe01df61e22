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
    """One simulation: constants in GPa, angles in degrees, modulus in GPa (None if it failed)."""

    position: int
    symmetry: str
    constants: tuple
    euler_deg: tuple
    origin: str
    status: str
    message: str
    modulus_gpa: float | None
    seconds: float | None
    elements: int | None
    depth_um: list | None
    force_mn: list | None


#: The columns of a `Row`, in its order.
COLUMNS = (
    "position, symmetry, constants, euler_deg, origin, status, message, indentation_modulus_gpa, seconds, elements, depth_um, force_mn"
)


def _row(cells) -> Row:
    """A row of the file; lists are stored as JSON."""
    position, symmetry, constants, euler_deg, *numbers, depth, force = cells
    curve = (None if text is None else json.loads(text) for text in (depth, force))
    return Row(position, symmetry, tuple(json.loads(constants)), tuple(json.loads(euler_deg)), *numbers, *curve)


def _key(symmetry: str, constants, euler_deg) -> tuple[str, str, str]:
    """A point as the file spells it: every double to its last bit."""
    return symmetry, json.dumps([float(v) for v in constants]), json.dumps([float(v) for v in euler_deg])


class Campaign:
    """The rows of one physics in a campaign file, which is made if it is not there.

    `identity` is a dict of plain values. Raises `InputError` if the file is damaged or something else.
    """

    def __init__(self, path, identity: dict):
        self.path = Path(path)
        self.path.parent.mkdir(parents=True, exist_ok=True)
        fresh = not self.path.exists() or self.path.stat().st_size == 0
        try:
            self._file = sqlite3.connect(self.path, timeout=60)
            self._file.execute("PRAGMA synchronous = FULL")
            self._open(fresh)
            self.physics_id = self._physics(json.dumps(identity, sort_keys=True))
        except sqlite3.DatabaseError as error:
            raise InputError(
                f"{self.path}: is not a campaign, or is damaged ({error}); restore a copy, or move it away to start a new one"
            ) from error

    def _open(self, fresh: bool) -> None:
        if fresh:
            with self._file:
                self._file.executescript("BEGIN IMMEDIATE;" + LAYOUT + "COMMIT;")
            return
        application = self._file.execute("PRAGMA application_id").fetchone()[0]
        version = self._file.execute("PRAGMA user_version").fetchone()[0]
        if application != APPLICATION_ID:
            raise InputError(f"{self.path}: is a database, but not a campaign of bayesindent; choose another output folder")
        if version > FORMAT:
            raise InputError(f"{self.path}: was written by a newer version (format {version}, known: {FORMAT})")
        verdict = self._file.execute("PRAGMA quick_check").fetchone()[0]
        if verdict != "ok":
            raise InputError(f"{self.path}: is damaged ({verdict}); restore a copy, or move it away to start a new one")

    def _physics(self, identity: str) -> int:
        with self._file:
            self._file.execute("INSERT OR IGNORE INTO physics (identity) VALUES (?)", (identity,))
        return self._file.execute("SELECT id FROM physics WHERE identity = ?", (identity,)).fetchone()[0]

    def close(self) -> None:
        """Close the file."""
        self._file.close()

    def __enter__(self) -> "Campaign":
        return self

    def __exit__(self, *_) -> None:
        self.close()

    def rows(self, symmetry: str) -> list[Row]:
        """All rows of this physics and symmetry, in order of choice."""
        cursor = self._file.execute(
            f"SELECT {COLUMNS} FROM simulation WHERE physics_id = ? AND symmetry = ? ORDER BY position, id", (self.physics_id, symmetry)
        )
        return [_row(cells) for cells in cursor]

    def find(self, symmetry: str, constants, euler_deg) -> Row | None:
        """The row of a point, if it is there."""
        cells = self._file.execute(
            f"SELECT {COLUMNS} FROM simulation WHERE physics_id = ? AND symmetry = ? AND constants = ? AND euler_deg = ?",
            (self.physics_id, *_key(symmetry, constants, euler_deg)),
        ).fetchone()
        return None if cells is None else _row(cells)

    def other_physics(self) -> list[str]:
        """Identities of the other physics in the file that have rows."""
        return [
            row[0]
            for row in self._file.execute(
                "SELECT identity FROM physics WHERE id <> ? AND id IN (SELECT physics_id FROM simulation)", (self.physics_id,)
            )
        ]

    def next_position(self) -> int:
        """The position of a row to come."""
        return self._file.execute(
            "SELECT COALESCE(MAX(position) + 1, 0) FROM simulation WHERE physics_id = ?", (self.physics_id,)
        ).fetchone()[0]

    def add(
        self,
        symmetry: str,
        constants,
        euler_deg,
        *,
        modulus_gpa: float | None = None,
        message: str = "",
        position: int | None = None,
        elements: int | None = None,
        seconds: float | None = None,
        depth_um=None,
        force_mn=None,
        origin: str = "simulated",
    ) -> None:
        """Store one result; without a modulus it failed, and `message` says why. Committed on return.

        A row that is there already, from another program at work on the same file, stays.
        """
        if modulus_gpa is not None and not (np.isfinite(modulus_gpa) and modulus_gpa > 0):
            modulus_gpa, message = None, f"the modulus is {modulus_gpa} GPa"
        curves = [None if values is None else json.dumps([float(v) for v in values]) for values in (depth_um, force_mn)]
        where = self.next_position() if position is None else position
        with self._file:
            self._file.execute(
                "INSERT INTO simulation (physics_id, position, symmetry, constants, euler_deg, origin, status, message, "
                "indentation_modulus_gpa, elements, seconds, depth_um, force_mn, created) VALUES (?,?,?,?,?,?,?,?,?,?,?,?,?,?) "
                "ON CONFLICT (physics_id, symmetry, constants, euler_deg) DO NOTHING",
                (
                    self.physics_id,
                    where,
                    *_key(symmetry, constants, euler_deg),
                    origin,
                    "failed" if modulus_gpa is None else "done",
                    message,
                    None if modulus_gpa is None else float(modulus_gpa),
                    elements,
                    seconds,
                    *curves,
                    datetime.now(timezone.utc).isoformat(timespec="seconds"),
                ),
            )

    def import_rows(self, symmetry: str, constants, euler_deg, modulus_gpa) -> int:
        """Import results of others: constants (n, k), angles (n, 3), moduli (n,). Gives how many were new.

        Rows that are there already with the same modulus are skipped. Rows that contradict each other or a stored row are refused,
        all of them, before anything is stored.
        """
        new = {}
        for i, (c, e, m) in enumerate(zip(constants, euler_deg, modulus_gpa, strict=True), start=1):
            if not (np.isfinite(m) and m > 0):
                raise InputError(f"row {i}: modulus_gpa is {m}; it must be positive")
            key = _key(symmetry, c, e)
            stored = self.find(symmetry, c, e)
            earlier = stored.modulus_gpa if stored is not None else new.get(key)
            what = ", ".join(f"{name} {value:g}" for name, value in zip(constant_names(symmetry), c, strict=True))
            if stored is not None and earlier is None:
                raise InputError(
                    f"row {i} ({what}): the campaign has this point as failed ({stored.message}); a stored row is never "
                    "changed: leave the row out, or import into a new campaign"
                )
            if earlier is not None and abs(earlier - m) > SAME * abs(m):
                raise InputError(
                    f"row {i} ({what}): modulus_gpa is {m:g}, but the same point has {earlier:g} GPa "
                    f"{'in the campaign' if stored is not None else 'in an earlier row'}; one of them is wrong or of another "
                    "physics: leave one out, or import into a new campaign"
                )
            if earlier is None:
                new[key] = float(m)
        position, now = self.next_position(), datetime.now(timezone.utc).isoformat(timespec="seconds")
        with self._file:
            self._file.executemany(
                "INSERT INTO simulation (physics_id, position, symmetry, constants, euler_deg, origin, status, message, "
                "indentation_modulus_gpa, created) VALUES (?,?,?,?,?,?,'done','',?,?)",
                [(self.physics_id, position + i, *key, IMPORTED, m, now) for i, (key, m) in enumerate(new.items())],
            )
        return len(new)
