"""The case studies as problems: their namelists with another seed, simulator or size, what a
build leaves, and results that are kept.
"""

import json
import sqlite3
from collections.abc import Callable
from contextlib import closing
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import f90nml
import numpy as np

from bayesindent.common.result_files import plain, write_text
from bayesindent.crystal.elasticity import anisotropy_index, halfspace_modulus, stiffness_rows
from bayesindent.settings.problem import Problem
from bayesindent.stages.stage import run_stage
from bayesindent.surrogate.surrogate import Surrogate
from reproduction.regression import Terms
from support.paper_domains import DOMAINS
from support.tree import SOURCE

__all__ = [
    "INPUTS",
    "Pool",
    "build",
    "independent_crystals",
    "kept",
    "namelist_of",
]

INPUTS = SOURCE / "inputs" / "case_studies"


def kept(path: Path, inputs: Any, compute: Callable[[], Any]) -> Any:
    """The result that is kept in a file with these inputs, or else that of `compute`, which is then
    kept.
    """
    inputs = json.loads(json.dumps(plain(inputs)))
    if path.exists():
        stored = json.loads(path.read_text(encoding="utf-8"))
        if stored["inputs"] == inputs:
            return stored["result"]
    text = json.dumps(plain({"inputs": inputs, "result": compute()}))
    write_text(path, text)
    return json.loads(text)["result"]


def namelist_of(name: str, workers: int, **groups: dict) -> f90nml.Namelist:
    """The namelist of a case study with these variables changed, and paths that hold anywhere."""
    namelist = f90nml.read(INPUTS / f"{name}_paper.nml")
    namelist["execution"] = {"workers": workers}
    if "measurements" in namelist:
        table = INPUTS / namelist["measurements"]["file"]
        namelist["measurements"]["file"] = str(table.resolve())
    for group, variables in groups.items():
        namelist[group] = {**namelist.get(group, {}), **variables}
    return namelist


def by_theory() -> dict[str, dict]:
    """The groups with which theory takes the place of finite elements."""
    return {"simulation": {"simulator": "theory"}, "specimen": {"geometry": "halfspace"}}


def problem_of(namelist: f90nml.Namelist, folder: Path, command: str) -> Problem:
    """The problem of a namelist, which is written into its folder."""
    folder.mkdir(parents=True, exist_ok=True)
    path = folder / "problem.nml"
    if not path.exists() or path.read_text() != f"{namelist}\n":
        write_text(path, f"{namelist}\n")
    return Problem(path, command)


def build(namelist: f90nml.Namelist, folder: Path) -> dict:
    """Step 1 of a namelist in a folder: the document of `build`, which is kept."""
    stated = {name: group for name, group in namelist.todict().items() if name != "execution"}
    return kept(
        folder / "kept.json",
        stated,
        lambda: run_stage(problem_of(namelist, folder, "build"), "build", folder),
    )


def independent_crystals(symmetry: str, count: int, seed: int) -> tuple[np.ndarray, np.ndarray]:
    """Constants (n, k) in GPa, uniform over the paper's domain, and angles (n, 3) in degrees:
    directions uniform on the sphere (cubic), Phi uniform (hexagonal).
    """
    domain, rng = DOMAINS[symmetry], np.random.default_rng(seed)
    low, high = np.array(domain["c_min"], float), np.array(domain["c_max"], float)
    found = np.zeros((0, len(low)))
    while len(found) < count:
        tried = low + (high - low) * rng.random((count, len(low)))
        matrices = stiffness_rows(symmetry, tried)
        stable = np.linalg.eigvalsh(matrices)[:, 0] > 0
        tried, matrices = tried[stable], matrices[stable]
        admitted = anisotropy_index(matrices) <= domain["anisotropy_cap"]
        found = np.concatenate([found, tried[admitted]])
    angles = np.zeros((count, 3))
    if symmetry == "cubic":
        angles[:, 1] = np.degrees(np.arccos(rng.uniform(-1, 1, count)))
        angles[:, 2] = rng.uniform(0, 360, count)
    else:
        angles[:, 1] = rng.uniform(0, 90, count)
    return found[:count], angles


def derivatives_in(campaign: Path) -> dict[tuple, list[float]]:
    """The derivatives by the stiffness, (21,), of the simulations of a campaign that have them, by
    constants and angles.
    """
    with closing(sqlite3.connect(campaign)) as file:
        rows = file.execute(
            "SELECT constants, euler_deg, modulus_by_stiffness FROM simulation"
            " WHERE modulus_by_stiffness <> '[]'"
        ).fetchall()
    found = ([json.loads(text) for text in row] for row in rows)
    return {(*constants, *euler): slopes for constants, euler, slopes in found}


@dataclass(frozen=True)
class Pool:
    """Simulations: constants (n, k) in GPa, angles (n, 3) in degrees, moduli (n,) in GPa; the first
    ones are those of the paper's sequence, in its order, of which `initial` begin it, and all but
    the last `unseen` ones are of it. `by_stiffness` (n, 21) has the derivatives of the moduli, if
    they are known.
    """

    symmetry: str
    constants: np.ndarray
    euler_deg: np.ndarray
    modulus: np.ndarray
    initial: int = 0
    unseen: int = 0
    by_stiffness: np.ndarray | None = None

    @classmethod
    def of_build(cls, symmetry: str, folder: Path, document: dict, initial: int) -> "Pool":
        """All simulations of a build."""
        data, unseen = Surrogate.load(folder / "surrogate.txt").data, document["validation"]
        constants = np.concatenate([data["constants"], unseen["constants"]])
        euler_deg = np.concatenate([data["euler_deg"], unseen["euler_deg"]])
        known = derivatives_in(folder / "campaign.sqlite")
        crystals = np.column_stack([constants, euler_deg])
        return cls(
            symmetry,
            constants,
            euler_deg,
            np.concatenate([data["modulus_gpa"], unseen["simulated"]]),
            initial,
            len(unseen["simulated"]),
            np.array([known[tuple(row)] for row in crystals.tolist()]) if known else None,
        )

    @classmethod
    def of_theory(cls, symmetry: str, constants: np.ndarray, euler_deg: np.ndarray) -> "Pool":
        """Crystals with the moduli of the exact theory."""
        modulus = halfspace_modulus(stiffness_rows(symmetry, constants), euler_deg)
        return cls(symmetry, constants, euler_deg, modulus)

    def last(self, many: int) -> "Pool":
        """The last ones."""
        return Pool(
            self.symmetry, self.constants[-many:], self.euler_deg[-many:], self.modulus[-many:]
        )

    @property
    def coordinates(self) -> np.ndarray:
        """The constants by Eq. 2, (n, k)."""
        low, high = (np.array(DOMAINS[self.symmetry][name], float) for name in ("c_min", "c_max"))
        return (2 * self.constants - low - high) / (high - low)

    @property
    def direction(self) -> np.ndarray:
        """The axis of the indenter in crystal axes, (n, 3)."""
        _, tilt, turn = np.radians(self.euler_deg).T
        return np.stack(
            [np.sin(turn) * np.sin(tilt), np.cos(turn) * np.sin(tilt), np.cos(tilt)], axis=1
        )

    def terms(self, degree: int, bandlimit: int) -> Terms:
        """The terms of Eq. 1."""
        return Terms.of(self.symmetry, self.coordinates, self.direction, degree, bandlimit)
