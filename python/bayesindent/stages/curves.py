"""Step 0 in Python: curves and tests as files or as tables of Python, and the moduli that the core
infers.
"""

import csv
import os
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from ..core import InputError
from ..settings.keywords import takes, warn_of
from ..settings.problem import Problem
from .stage import run_stage


@dataclass(frozen=True)
class Curves:
    """The result of `bi.curves`; `bi.extract` takes it in place of a table.

    `table` has the columns grain, effective_modulus_gpa, sd_gpa (of the errors that grains do not
    share), and the orientation if the tests state it. `shared_errors` (grain, error) are relative
    errors that grains share, one column for each independent source of sd 1. `tip_radius_um` is
    mean and sd. `fits` has for each point of a loading the test, the load, the depth, the elastic
    fit and the probability that the point is elastic. `document` is the content of curves.json.
    """

    table: dict[str, list]
    shared_errors: np.ndarray
    tip_radius_um: tuple[float, float]
    fits: dict[str, list]
    document: dict

    def measurements(self) -> dict[str, list]:
        """The table with its shared errors as columns."""
        return self.table | {
            f"shared_{j}": list(column) for j, column in enumerate(self.shared_errors.T, 1)
        }


@takes("curves", without=("file", "files", "tests"))
def curves(
    curves: Any,
    tests: Any,
    references: Mapping | str | os.PathLike | None = None,
    *,
    crystal_sd: float | None = None,
    **settings: Any,
) -> Curves:
    """Infer the moduli of grains from curves of load and depth, with all errors that they share.

    Parameters
    ----------
    curves : path, list of paths, or table
        A CSV or a table of the columns test, time_s, depth_nm, load_mn (and stiffness_n_m); or the
        files of an instrument, one a test, whose names are those of the files.
    tests : path or table
        Columns test, grain or reference, and optional session, drift_nm_s, and the orientations of
        grains.
    references : dict or path, optional
        Isotropic references, {'quartz': (72, 0.5, 0.17)}: Young's modulus and its sd in GPa,
        Poisson's ratio; or a CSV of crystals, as `&references crystals` takes it. Without
        references only ratios of the moduli are known.
    crystal_sd : float, optional
        Relative sd of the moduli of references that are crystals.

    Examples
    --------
    >>> quartz = {"quartz": (72, 0.5, 0.17)}
    >>> moduli = bi.curves("curves.csv", "tests.csv", references=quartz, radius_um=5.0)
    >>> len(moduli.table["grain"])
    14
    """
    # Importing it takes time.
    from tempfile import TemporaryDirectory

    origin = "bi.curves"
    with TemporaryDirectory() as folder:
        settings["tests"] = file_of(tests, Path(folder) / "tests.csv")
        if isinstance(curves, str | os.PathLike) and Path(curves).suffix.lower() != ".csv":
            curves = [curves]
        if isinstance(curves, list | tuple):
            settings["files"] = [Path(file).absolute() for file in curves]
        else:
            settings["file"] = file_of(curves, Path(folder) / "curves.csv")
        problem = Problem.from_keywords(
            origin, curves=settings, references=references_of(references, crystal_sd)
        )
        document = run_stage(problem, "curves", folder)
        results = {
            name: read_columns(Path(folder) / f"{name}.csv")
            for name in ("measurements", "shared_errors", "fits")
        }
    warn_of(document)
    radius = document["tip"]["radius_um"]
    shared = [values for name, values in results["shared_errors"].items() if name != "grain"]
    table = results["measurements"]
    errors = np.array(shared, dtype=float).reshape(len(shared), len(table["grain"])).T
    return Curves(table, errors, (radius["mean"], radius["sd"]), results["fits"], document)


def references_of(references: Any, crystal_sd: float | None) -> dict | None:
    """The variables of &references; None if there are none."""
    if references is crystal_sd is None:
        return None
    if not isinstance(references, Mapping):
        return {"crystals": references, "crystal_sd": crystal_sd}
    try:
        moduli, sds, ratios = zip(*references.values(), strict=True)
    except (TypeError, ValueError):
        raise InputError(
            "each has Young's modulus, its sd and Poisson's ratio: {'quartz': (72, 0.5, 0.17)}",
            "bi.curves",
            "references",
        ) from None
    return {
        "name": list(references),
        "young_gpa": list(moduli),
        "young_sd_gpa": list(sds),
        "nu": list(ratios),
    }


def file_of(table: Any, path: Path) -> Path:
    """The file of a table; a table that is not a file is written to `path`."""
    if isinstance(table, str | os.PathLike):
        return Path(table).absolute()
    # Importing it takes time.
    from pandas import DataFrame

    DataFrame(table).to_csv(path, index=False)
    return path


def read_columns(path: Path) -> dict[str, list]:
    """The columns of a CSV of results: numbers, and the names of grains and tests as texts."""
    with path.open(encoding="utf-8", newline="") as file:
        header, *rows = csv.reader(file)
    columns: dict[str, list] = {}
    for name, *cells in zip(header, *rows):
        is_text = name in ("grain", "test")
        columns[name] = cells if is_text else [float(cell or "nan") for cell in cells]
    return columns
