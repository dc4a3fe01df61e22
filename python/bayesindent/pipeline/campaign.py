"""campaign.sqlite: every simulation that was ever made or imported, one row each, never changed. The core keeps it, for both programs."""

import json
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from ..core import NativeObject, call, native

__all__ = ["Campaign", "Row"]


@dataclass(frozen=True)
class Row:
    """One simulation: constants in GPa, angles in degrees, modulus in GPa (None if it failed), seconds, depths in um, forces in mN.

    position: order of choice within the physics, from 0; imported: another program computed it; message: why it failed.
    """

    position: int
    symmetry: str
    constants: tuple
    euler_deg: tuple
    imported: bool
    message: str
    modulus_gpa: float | None
    seconds: float | None
    elements: int | None
    depth_um: list | None
    force_mn: list | None


class Campaign(NativeObject):
    """The rows of one physics in a campaign file, which is made if it is not there; see fortran/pipeline/campaign.f90.

    path: of the file; identity: a dict of plain values. Raises `InputError` if the file is damaged or something else.
    """

    kind = "campaign"

    def __init__(self, path, identity: dict):
        self.path = Path(path)
        self._hold(call("campaign_open", self.path, json.dumps(identity, sort_keys=True)))

    def close(self) -> None:
        """Close the file."""
        native.object_release(self.__dict__.pop("_handle", 0))

    def __enter__(self) -> "Campaign":
        return self

    def __exit__(self, *_) -> None:
        self.close()

    def rows(self, symmetry: str = "") -> list[Row]:
        """All rows of this physics, of one symmetry or of all, in order of choice."""
        return self._select(symmetry, [])

    def find(self, symmetry: str, constants, euler_deg) -> Row | None:
        """The row of a point, constants (k,) in GPa and angles (3,) in degrees, if it is there."""
        return next(iter(self._select(symmetry, [*constants, *euler_deg])), None)

    def _select(self, symmetry: str, point: list) -> list[Row]:
        sizes = call("campaign_select", self.handle, symmetry, point)
        columns, values, text = call("campaign_selected", self.handle, *sizes)
        words, values, start, rows = text.split("\0"), values.tolist(), 0, []
        for i, numbers in enumerate(columns.T.tolist()):
            position, imported, failed, modulus, seconds, elements, *euler_deg = numbers[:9]
            parts = []
            for count in numbers[9:]:
                parts.append(values[start : start + int(count)])
                start += int(count)
            constants, depth, force = parts
            row = Row(
                position=int(position),
                symmetry=words[2 * i],
                constants=tuple(constants),
                euler_deg=tuple(euler_deg),
                imported=bool(imported),
                message=words[2 * i + 1],
                modulus_gpa=None if failed else modulus,
                seconds=seconds or None,
                elements=int(elements) or None,
                depth_um=depth or None,
                force_mn=force or None,
            )
            rows.append(row)
        return rows

    def other_physics(self) -> list[str]:
        """Identities of the other physics in the file that have rows."""
        return self._facts()[1]

    def next_position(self) -> int:
        """The position of a row to come."""
        return self._facts()[0]

    def _facts(self) -> tuple[int, list[str]]:
        position, identities = call("campaign_facts", self.handle)
        return position, identities.split("\n") if identities else []

    def add(self, symmetry: str, constants, euler_deg, *, position: int = -1, **result) -> None:
        """Store one result of a crystal, constants (k,) in GPa and angles (3,) in degrees, at this or, of -1, the next position.

        result: modulus_gpa, elements, seconds, depth_um, force_mn, or without a modulus the message why it failed. Committed on return.
        A row that is there already, from another program at work on the same file, stays.
        """
        modulus = result.get("modulus_gpa")
        numbers = position, modulus is None, modulus or 0, result.get("seconds") or 0, result.get("elements") or 0
        curve = [[] if result.get(name) is None else result[name] for name in ("depth_um", "force_mn")]
        point = [*constants, *euler_deg]
        call("campaign_add", self.handle, symmetry, point, numbers, np.transpose(curve), result.get("message", ""))

    def import_rows(self, symmetry: str, constants, euler_deg, modulus_gpa) -> int:
        """Import results of others: constants (n, k) in GPa, angles (n, 3) in degrees, moduli (n,) in GPa. Gives how many were new.

        Rows that are there already with the same modulus are skipped. Rows that contradict each other or a stored row are refused,
        all of them, before anything is stored.
        """
        return call("campaign_import", self.handle, symmetry, np.transpose(constants), np.transpose(euler_deg), modulus_gpa)
