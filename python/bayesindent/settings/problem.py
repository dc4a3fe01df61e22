"""Settings of a namelist file or of keywords as plain Python values; the core reads, checks and
resolves them.
"""

import json
import os
from collections import namedtuple
from collections.abc import Callable, Collection, Iterable, Iterator, Mapping
from dataclasses import dataclass, fields
from functools import cache, cached_property, partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from ..common.result_files import as_csv
from ..core import InputError, NativeObject, call, located
from ..crystal.elasticity import constant_names

if TYPE_CHECKING:
    from ..lab.table import LaboratoryTable


#: Tables that may have semicolons or tabs between their cells, and the variables that name them.
CONVERTED = {
    "velocities": "measurements.velocities",
    "stiffness": "knowledge.stiffness_file",
    "candidates": "next.candidates",
    "texture": "measurements.texture",
}
#: Functions that convert texts of a namelist, by kind of variable.
CONVERSIONS: dict[str, Callable] = {
    "logical": lambda text: text == ".true.",
    "integer": int,
    "real": float,
}


@dataclass(frozen=True)
class Variable:
    """One variable of the schema of namelists. Its `shape` is 'one' value, one for each of the
    'constants', or a 'list'.
    """

    group: str
    group_meaning: str
    name: str
    kind: str
    shape: str
    unit: str
    default: str
    allowed: str
    meaning: str

    def value_of(self, texts: list[str]) -> Any:
        """The value that texts of a namelist represent."""
        values = [CONVERSIONS.get(self.kind, str)(text) for text in texts]
        if self.shape == "one":
            return values[0]
        return np.array(values) if self.kind == "real" else values


@dataclass(frozen=True)
class Stage:
    """A command that reads a namelist, the groups that it needs, and the file of its document."""

    name: str
    groups: tuple[str, ...]
    document: str


class Points:
    """A table of n points of a problem: crystals with orientations, measurements, or candidates.
    The core holds the table; attributes are copies.

    For crystals `constants` is a list of n dicts (GPa), and `stiffness` (n, 6, 6) in GPa (crystal
    frame). `euler_deg` is (n, 3). `modulus_gpa` and `sd_gpa` are (n,) with NaN for empty cells, or
    None if no cell has a number. `modulus_kind` is the kind of the measured modulus. `names` are
    those of the grains, or None.
    """

    def __init__(self, problem: "Problem", facts: dict):
        self.problem, self._facts = problem, facts
        self.modulus_kind, self.names = facts.get("kind"), facts.get("names")

    def __len__(self) -> int:
        return self._facts["n"]

    def _given(self, name: str) -> np.ndarray | None:
        """The numbers of a column; None if there are none."""
        values = self._facts.get(name, np.nan)
        return None if np.isnan(values).all() else values

    @cached_property
    def constants(self) -> list[dict]:
        """Constants of each row by name, GPa."""
        names = [constant_names(symmetry) for symmetry in self._facts["classes"]]
        rows = zip(self._facts["class"].tolist(), self._facts["constants"].tolist())
        return [dict(zip(names[number - 1], values)) for number, values in rows]

    stiffness = property(lambda self: self._facts["stiffness"])
    euler_deg = property(lambda self: self._facts["euler_deg"])
    modulus_gpa = property(lambda self: self._given("modulus_gpa"))
    sd_gpa = property(lambda self: self._given("sd_gpa"))

    def write(self, path: str | os.PathLike, columns: Mapping[str, np.ndarray]) -> None:
        """Write the table of the crystals with further columns of n numbers, which replace columns
        of the same name.
        """
        self.problem._call(
            "write_crystals",
            path=path,
            names=",".join(columns),
            values=np.stack(list(columns.values())),
        )


def _table(name: str, doc: str) -> Any:
    """A property of problems: the table `name`, or None if the problem has none."""

    def points(problem: "Problem") -> Points | None:
        facts = problem._tables[name]
        return Points(problem, facts) if "n" in facts else None

    return property(points, doc=doc)


class Problem(NativeObject):
    """The resolved namelist file `path` for `command`: 'run' or a stage, such as 'extract'.

    `changes` is a namelist whose variables replace those of the file.

    `settings` has the value of every variable, stated or default, as `settings.design.budget`. It
    is None without a value, and an array if there is a value for each constant.
    `settings.design.given` is true if the file has the group &design. `crystals`, `measurements`,
    `candidates` (of &design) and `grains` (of &next) are the tables (`Points`) that the file names,
    or None. Raises `InputError` with one line that names file, group and variable.

    Examples
    --------
    >>> problem = bi.Problem("grains.nml", "extract")
    >>> problem.settings.problem.symmetry, len(problem.measurements)
    ('cubic', 10)
    """

    kind = "problem"

    def __init__(self, path: str | os.PathLike, command: str = "run", changes: str = ""):
        self._made_of: tuple = (type(self), (path, command, changes))
        self._fill(call("file.problem", path=path, command=command, changes=changes), Path(path))

    @classmethod
    def from_keywords(
        cls, origin: str, tables: Mapping[str, Mapping] | None = None, **groups: Mapping | None
    ) -> "Problem":
        """The problem of variables by group, as `specimen={"geometry": "block"}`. They are
        arguments of the function `origin`.

        The messages are those of a file with these values. Values that are None are left out.
        `tables` are the tables 'measurements', 'velocities' and 'stiffness' (of `&knowledge`), each
        with columns of equal length by name.
        """
        made_of = partial(cls.from_keywords, origin, tables, **groups), ()
        return cls.parse(origin, namelist_of(origin, groups), tables, made_of)

    @classmethod
    def parse(
        cls,
        origin: str,
        text: str,
        tables: Mapping[str, Mapping] | None = None,
        made_of: tuple = (),
    ) -> "Problem":
        """The problem of a namelist's text. Messages begin with the origin. `made_of` is what
        `__reduce__` returns; if it is empty, the problem cannot be copied.
        """
        self = cls.__new__(cls)
        self._made_of = made_of
        made = call("file.problem", path=origin, content=text, command="", changes="")
        self._fill(made, Path(origin), tables)
        return self

    def _fill(self, made: dict, path: Path, tables: Mapping[str, Mapping] | None = None) -> None:
        """Read the tables that the problem `made` by the core names, load them into the core, and
        set the attributes. `tables` are those of `from_keywords`.
        """
        self._hold(made["handle"], frozen=False)
        facts = typed(self._call("describe")) | {"folder": path.parent}
        tables = dict(tables or {})
        source: Any = tables.pop("measurements", None)
        pages: dict[str, Any] = {name: columns_as_csv(table) for name, table in tables.items()}
        if names := facts.get("curves.files"):
            # Modules for tables are imported only for those that need them: it takes time.
            from ..lab.instruments import curves_of_files

            with located(path, "curves", "files"):
                curves = curves_of_files(path.parent, names, facts["curves.drift_removed"])
            pages["curves"] = columns_as_csv(curves)
        for name, variable in CONVERTED.items():
            if file := facts.get(variable):
                from ..lab.reading import text_with_commas

                pages[name] = text_with_commas(path.parent / file)
        file = facts.get("knowledge.stiffness_file")
        sd = facts.get("knowledge.stiffness_relative_sd")
        if file and (sd or file.endswith(".json")) and (path.parent / file).is_file():
            from ..lab.tensors import known_stiffness

            with located(path, "knowledge", "stiffness_file"), located(file):
                matrix = known_stiffness(path.parent / file, facts.get("problem.symmetry"), sd)
            pages["stiffness"] = columns_as_csv(matrix)
        #: The measurements as a laboratory's table, or None.
        self.table: LaboratoryTable | None = None
        #: The orientation map with the indents, or None.
        self.map: Any = None
        #: Diagnostics of the measurements: codes and subjects.
        notes: list[tuple[str, str]] = []
        if file := facts.get("measurements.file"):
            source = path.parent / file
        if source is not None:
            from ..lab.canonical import canonical_table

            with located(path, "measurements", "file" if file else ""), located(file or ""):
                found = canonical_table(source, facts, path)
            if found:
                self.table, self.map, pages["measurements"] = found.table, found.map, found.page
                subject = f"the table {file or ''}".strip()
                notes = [("table_changed", f"{subject}: {note}") for note in found.table.notes]
        if self.map is not None:
            # The indented directions if the axes of the positions are exchanged or reversed.
            pages["misread"] = self.map.grid.misread(self.map.positions)
            notes += self.map.warnings
        for code, subject in notes:
            self._call("warn", code=code, subject=subject)
        facts = typed(self._call("load", **pages))
        self.path, self.folder = path, path.parent
        self.resolved, self.warnings = facts["resolved"], json.loads(facts["warnings"])
        self.stages = facts["stages"].split()
        self.settings = _settings(facts)
        self._tables = {
            name: self._call("table", table=name)
            for name in ("crystals", "measurements", "candidates", "grains")
        }
        self._frozen = True

    crystals = _table("crystals", "The crystals of `&crystals`, or None.")
    measurements = _table("measurements", "The measurements, or None.")
    candidates = _table("candidates", "The candidates of `&design`, or None.")
    grains = _table("grains", "The grains of `&next`, or None.")

    def __repr__(self) -> str:
        asked = f"asks for {', '.join(self.stages)}" if self.stages else "asks for nothing"
        return (
            f"<Problem {self.path}: "
            f"{self.settings.problem.symmetry or 'crystals of every class'}; {asked}>"
        )

    def __reduce__(self) -> tuple:
        return self._made_of or super().__reduce__()


def columns_as_csv(table: Mapping[str, Iterable]) -> str:
    """The text of a CSV of columns of equal length."""
    return as_csv(list(table), zip(*table.values(), strict=True))


def namelist_of(origin: str, groups: Mapping[str, Mapping | None]) -> str:
    """A namelist of variables by group, which are arguments of `origin`. Values that are None are
    left out.
    """
    text = ""
    for group, values in groups.items():
        if values is None:
            continue
        text += f"&{group}\n"
        for name, value in values.items():
            if value is not None:
                with located(origin, group, name):
                    text += f"  {name} = {spelled(value)}\n"
        text += "/\n"
    return text


def spelled(value: Any) -> str:
    """The text of a value in a namelist."""
    value = value.tolist() if isinstance(value, np.ndarray | np.generic) else value
    if isinstance(value, bool):
        return ".true." if value else ".false."
    if isinstance(value, int | float):
        return repr(value)
    if isinstance(value, str | os.PathLike):
        return "'" + os.fspath(value).replace("'", "''") + "'"
    if isinstance(value, Mapping):
        value = [f"{key} = {item}" for key, item in value.items()]
    if isinstance(value, list | tuple) and value:
        return ", ".join(spelled(item) for item in value)
    raise InputError(f"{str(value)[:80]} is neither number nor text, nor a list of them")


def read_crystals(path: str | os.PathLike, symmetry: str) -> Points:
    """Read a CSV of crystals and orientations; rows without a class have this `symmetry`."""
    holder = Problem.__new__(Problem)
    holder._hold(call("file.crystals", path=path, symmetry=symmetry)["handle"])
    return Points(holder, holder._call("table", table="crystals"))


@cache
def schema() -> tuple[Variable, ...]:
    """Every variable that a namelist may set, in order."""
    listed = call("settings.list")
    return tuple(map(Variable, *(listed[field.name] for field in fields(Variable))))


@cache
def stages() -> tuple[Stage, ...]:
    """The commands that read a namelist: 'run', then the stages in order."""
    rows = batched(call("settings.list")["stages"], len(fields(Stage)))
    return tuple(Stage(name, tuple(groups.split()), *more) for name, groups, *more in rows)


def typed(found: dict) -> dict:
    """Named values of the core. Settings, which the core returns as texts, get their types."""
    names = {f"{variable.group}.{variable.name}": variable for variable in schema()}
    return {
        name: names[name].value_of(value) if name in names else value
        for name, value in found.items()
    }


def grouped(values: Mapping, groups: Collection[str]) -> dict[str, dict]:
    """Values of variables by group, from values by name. If several groups have a name, its value
    belongs to the first of them.
    """
    found: dict[str, dict] = {group: {} for group in groups}
    for name, value in values.items():
        having = {variable.group for variable in schema() if variable.name == name}
        for group in groups:
            if group in having:
                found[group][name] = value
                break
    return found


def batched(values: list, n: int) -> Iterator[list]:
    """Rows of n values."""
    return (values[i : i + n] for i in range(0, len(values), n))


#: Make a class of frozen objects from its name and its fields.
_frozen_type = cache(namedtuple)


def _settings(values: dict) -> Any:
    """The values of all groups as frozen objects in a frozen object; lists become tuples, and
    arrays are read-only.
    """
    groups: dict[str, dict] = {}
    for variable in schema():
        value = values.get(f"{variable.group}.{variable.name}")
        if isinstance(value, np.ndarray):
            value.flags.writeable = False
        group = groups.setdefault(variable.group, {"given": values[f"{variable.group}.given"]})
        group[variable.name] = tuple(value) if isinstance(value, list) else value
    whole = {
        name: _frozen_type(f"{name}_settings", tuple(group))(**group)
        for name, group in groups.items()
    }
    return _frozen_type("settings", tuple(whole))(**whole)
