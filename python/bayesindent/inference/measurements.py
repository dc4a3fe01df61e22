"""Convert tables of Python to measurements, and keywords to a problem."""

import os
from collections.abc import Mapping
from operator import methodcaller
from typing import Any

import numpy as np

from ..core import InputError, located
from ..crystal.elasticity import angles_of, constant_names, stiffness_table
from ..settings.problem import Problem, grouped
from ..surrogate.surrogate import Surrogate

#: Groups whose variables are keywords.
GROUPS = ("problem", "indenter", "measurements", "prior", "sampler", "execution")


def problem_of(
    origin: str,
    surrogate: Surrogate,
    measurements: Any,
    *,
    symmetry: str | None = None,
    bounds: Mapping | None = None,
    knowledge: Mapping | None = None,
    velocities: Any = None,
    references: str | os.PathLike | None = None,
    **variables: Any,
) -> Problem:
    """The problem that keywords of the function `origin` state, checked like a namelist file.

    The keywords are those of `bi.extract`. `measurements` is a CSV file or an argument of
    `measurements_of`. Without a `symmetry` that of the surrogate is used, if it has only one.
    `variables` are those of `GROUPS`, and of the next measurement or the plan.
    """
    symmetry = symmetry or (surrogate.symmetry if len(surrogate.basis.c_min) else None)
    if symmetry is None:
        raise InputError(
            "symmetry is missing: this surrogate serves crystals of every class; state one, "
            "such as 'cubic'",
            origin,
        )
    groups = grouped(
        variables | {"symmetry": symmetry},
        ("plan", *GROUPS) if "constants" in variables else (*GROUPS, "next"),
    )
    tables: dict[str, Mapping] = {}
    needed = velocities is None and "constants" not in variables
    for name, variable, given in (
        ("velocities", "velocities", velocities),
        ("measurements", "file", measurements),
    ):
        if isinstance(given, str | os.PathLike):
            groups["measurements"][variable] = given
        elif given is not None or (needed and variable == "file"):
            tables[name] = measurements_of(given)
    if references:
        groups["references"] = {"crystals": references}
    if bounds:
        with located(origin, "prior"):
            groups["prior"] |= bounds_of(symmetry, bounds)
    if knowledge:
        if not isinstance(knowledge, Mapping):
            raise InputError(
                f"{knowledge!r}; allowed a dictionary, such as {{'bulk_modulus': (108, 2)}}",
                origin,
                "knowledge",
            )
        with located(origin, "knowledge"):
            said = [
                (name, *pair_of(name, pair, "(mean, sd)"))
                for name, pair in knowledge.items()
                if name not in ("stiffness", *ASIDE)
            ]
        groups["knowledge"] = dict(zip(("quantity", "mean", "sd"), zip(*said)))
        groups["knowledge"] |= {name: knowledge.get(name) for name in ASIDE}
        stiffness = knowledge.get("stiffness")
        if isinstance(stiffness, str | os.PathLike):
            groups["knowledge"]["stiffness_file"] = stiffness
        elif stiffness is not None:
            with located(origin, "knowledge", "stiffness_file"):
                tables = {"stiffness": stiffness_table(symmetry, *stiffness)} | tables
    return Problem.from_keywords(origin, tables, **groups)


#: Variables of `&knowledge` beside the quantities.
ASIDE = ("source", "stiffness_relative_sd")


def pair_of(name: str, value: Any, allowed: str) -> tuple:
    """A value that must be a pair."""
    if isinstance(value, str) or np.shape(value) != (2,):
        raise InputError(f"{name}: {value!r}; allowed {allowed}")
    return tuple(value)


#: Bounds in GPa of constants that have no stated ones; no crystal reaches them.
WIDEST = (-500.0, 5000.0)


def bounds_of(symmetry: str, bounds: Mapping) -> dict:
    """`c_min` and `c_max` from bounds of some constants; the other constants are unbounded, and so
    is an end that is None.
    """
    names = constant_names(symmetry)
    ends = {name: list(WIDEST) for name in names}
    for name, pair in bounds.items():
        if name not in ends:
            raise InputError(
                f"a {symmetry} crystal has no constant {name}; it has {', '.join(names)}"
            )
        pair = pair_of(name, pair, "(low, high)")
        ends[name] = [default if end is None else end for end, default in zip(pair, WIDEST)]
    sides = zip(("c_min", "c_max"), zip(*ends.values()), WIDEST)
    return {side: list(values) for side, values, widest in sides if set(values) != {widest}}


def measurements_of(table: Any) -> dict[str, list]:
    """The columns of a table of measurements.

    The table is a mapping, data frame, structured array or list of rows with the columns of a file
    of measurements, where euler_deg or orientation, (n, 3) or orix' Orientation, may replace the
    three angles. Or it is an object with euler_deg, modulus_gpa and sd_gpa, an array (n, 5) or
    (n, 4) of phi1, Phi, phi2, modulus and sd, or a result of `bi.curves`. The core interprets the
    columns.
    """
    if hasattr(table, "shared_errors"):
        table = table.measurements()
    if isinstance(table, list | tuple):
        if table and all(isinstance(row, Mapping) for row in table):
            table = {name: list(map(methodcaller("get", name), table)) for name in table[0]}
        else:
            table = _array(table)
    if isinstance(table, np.ndarray) and not table.dtype.names:
        if table.ndim != 2 or table.shape[1] not in (4, 5):
            raise InputError(
                "an array of measurements has columns phi1, Phi, phi2, modulus and sd: (n, 5), "
                f"not {table.shape}"
            )
        table = dict(zip((*ANGLES, "modulus_gpa", "sd_gpa"), table.T))
    elif isinstance(table, np.ndarray):
        table = {name: table[name] for name in table.dtype.names}
    elif hasattr(table, "euler_deg"):
        table = {name: getattr(table, name) for name in ("euler_deg", "modulus_gpa", "sd_gpa")}
    columns: dict[str, list] = {}
    for name in table:
        if name in ("euler_deg", "orientation"):
            angles = _array(table[name])
            if angles.ndim != 2 or angles.shape[1] != 3:
                raise InputError(
                    f"the measurements' euler_deg have shape {angles.shape}; allowed (n, 3): "
                    "phi1, Phi, phi2 of n grains"
                )
            columns |= dict(zip(ANGLES, angles.T.tolist()))
        elif table[name] is not None:
            columns[name] = np.atleast_1d(table[name]).tolist()
    lengths = {name: len(values) for name, values in columns.items()}
    if len(set(lengths.values())) > 1:
        raise InputError(f"the columns of the measurements have different lengths: {lengths}")
    if not any(lengths.values()):
        raise InputError("there are no measurements: at least one grain is needed")
    return columns


#: Bunge's angles in a table.
ANGLES = ("phi1_deg", "Phi_deg", "phi2_deg")


def _array(values: Any) -> np.ndarray:
    try:
        return angles_of(values)
    except (TypeError, ValueError):
        raise InputError(f"the measurements are no table of numbers: {str(values)[:60]}") from None
