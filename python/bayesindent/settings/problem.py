"""A namelist file, read, checked and resolved by the Fortran core, as plain Python values."""

import os
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from types import MappingProxyType

import f90nml
import numpy as np

from ..core import check, native
from ..crystal.elasticity import class_name, constant_names

__all__ = ["Points", "Problem", "Variable", "read_crystals", "read_measurements", "schema"]

_RESOLVED, _WARNINGS, _GROUPS, _STAGES, _CELLS = 1, 2, 3, 4, 10
_CRYSTALS, _MEASUREMENTS, _CANDIDATES = 1, 2, 3


@dataclass(frozen=True)
class Variable:
    """One row of the schema: what may stand in a namelist."""

    group: str
    group_meaning: str
    name: str
    kind: str
    per_constant: bool
    unit: str
    default: str
    allowed: str
    meaning: str


@dataclass(frozen=True)
class Points:
    """A table of n points: crystals with orientations, measurements, or candidates.

    `symmetry` is a list of n names (None in measurements), `constants` a list of n dicts (GPa), `stiffness` (n, 6, 6) in GPa
    (crystal frame) or None, `euler_deg` (n, 3), `modulus_gpa` and `sd_gpa` (n,) or None where the table has none (NaN in
    empty cells). `columns` and `rows` are the cells as written, to carry through.
    """

    symmetry: list
    constants: list
    stiffness: np.ndarray | None
    euler_deg: np.ndarray
    modulus_gpa: np.ndarray | None
    sd_gpa: np.ndarray | None
    columns: list
    rows: list

    def __len__(self) -> int:
        return len(self.rows)

    def constants_array(self) -> np.ndarray:
        """Constants (n, k) in GPa in the order of `constant_names`, of a table whose rows have one crystal class."""
        return np.array([list(row.values()) for row in self.constants])


class Problem(Mapping):
    """The resolved file `path` for `command` ('run', 'simulate', 'theory', 'build', 'extract', 'next' or 'check').

    `problem["design"]["budget"]` is a value as the command will use it, whether the file says it or not; a variable that has
    none is None, and one for each constant an array. Raises `InputError` with one line that names file, group and variable.
    """

    def __init__(self, path: str | os.PathLike, command: str = "run"):
        handle, status, message = native.problem_read(os.fsencode(path), command)
        check(status, message)
        try:
            self.path = Path(path)
            self.command = command
            self.resolved = _text(handle, _RESOLVED).decode()
            self.warnings = _items(_text(handle, _WARNINGS))
            self.stages = _text(handle, _STAGES).decode().split()
            self._given = frozenset(_items(_text(handle, _GROUPS)))
            self.crystals = _points(handle, _CRYSTALS)
            self.measurements = _points(handle, _MEASUREMENTS)
            self.candidates = _points(handle, _CANDIDATES)
        finally:
            native.problem_free(handle)
        self._groups = _load(self.resolved)
        self.folder = self.path.parent
        self.symmetry = class_name(self["problem"]["symmetry"])
        self.title = self["problem"]["title"]
        self.synthetic = self["problem"]["synthetic"]
        self.seed = self["problem"]["seed"]

    def has(self, group: str) -> bool:
        """Whether the file has this group, rather than the command its defaults."""
        return group in self._given

    def __getitem__(self, group: str) -> Mapping:
        try:
            return self._groups[group]
        except KeyError:
            raise KeyError(f"&{group} is neither in {self.path} nor needed by '{self.command}'") from None

    def __iter__(self) -> Iterator[str]:
        return iter(self._groups)

    def __len__(self) -> int:
        return len(self._groups)


def read_crystals(path: str | os.PathLike, symmetry: str) -> Points:
    """A CSV of crystals and orientations; `symmetry` is that of the rows that do not say theirs."""
    return _read(native.problem_read_crystals(os.fsencode(path), symmetry), _CRYSTALS)


def read_measurements(path: str | os.PathLike, *, sd_optional: bool = False) -> Points:
    """A CSV of orientations, modulus_gpa and sd_gpa (which may be absent only if `sd_optional`)."""
    return _read(native.problem_read_measurements(os.fsencode(path), int(sd_optional)), _MEASUREMENTS)


def schema() -> list[Variable]:
    """Every variable that a namelist file may set, in order."""
    rows = native.schema_text(native.schema_text_length()).tobytes().split(b"\x1e")[:-1]
    cells = [_items(row) for row in rows]
    return [Variable(*row[:4], row[4] == "1", *row[5:]) for row in cells]


def _read(result: tuple, table: int) -> Points:
    handle, status, message = result
    check(status, message)
    try:
        return _points(handle, table)
    finally:
        native.problem_free(handle)


def _load(resolved: str) -> dict:
    """The resolved namelist as {group: read-only {variable: value}}."""
    namelists = f90nml.reads(resolved)
    groups = {}
    for variable in schema():
        if variable.group not in namelists:
            continue
        value = namelists[variable.group].get(variable.name)
        if value is not None and variable.per_constant:
            value = np.array(value, dtype=float)
            value.flags.writeable = False
        elif value is not None and variable.kind == "real":
            value = float(value)
        groups.setdefault(variable.group, {})[variable.name] = value
    return {group: MappingProxyType(values) for group, values in groups.items()}


def _text(handle: int, item: int) -> bytes:
    return native.problem_text(handle, item, native.problem_text_length(handle, item)).tobytes()


def _items(text: bytes) -> list[str]:
    return [item.decode(errors="replace") for item in text.split(b"\x1f")[:-1]]


def _points(handle: int, table: int) -> Points | None:
    n = native.problem_table_rows(handle, table)
    if n < 0:
        return None
    symmetry, constants, stiffness, euler_deg, modulus, sd = native.problem_table(handle, table, n)
    rows = [_items(row) for row in _text(handle, _CELLS + table).split(b"\x1e")[:-1]]
    names = [row.tobytes().decode().strip() or None for row in np.asfortranarray(symmetry).T]
    return Points(
        symmetry=names,
        constants=[_named(name, column) for name, column in zip(names, constants.T.tolist(), strict=True)],
        stiffness=None if table == _MEASUREMENTS else np.ascontiguousarray(np.moveaxis(stiffness, -1, 0)),
        euler_deg=np.ascontiguousarray(euler_deg.T),
        modulus_gpa=None if np.isnan(modulus).all() else modulus,
        sd_gpa=None if np.isnan(sd).all() else sd,
        columns=rows[0],
        rows=rows[1:],
    )


def _named(symmetry: str | None, values: list[float]) -> dict[str, float]:
    """The constants of one row by name; `values` are padded to 21."""
    names = constant_names(symmetry) if symmetry else ()
    return dict(zip(names, values[: len(names)], strict=True))
