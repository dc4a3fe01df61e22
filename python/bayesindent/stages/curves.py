"""Step 0 in Python: the core infers the moduli of grains from curves and tests, which are files or
tables of Python.
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
    share), and the orientation if the tests state it. Column j of `shared_errors` (grain, error)
    has the relative errors of the moduli that one sd of the source j causes; the sources are
    independent. `tip_radius_um` is the mean and the sd. `fits` has a row for each point of each
    loading: the test, the load, the depth, the elastic fit, and the probability that the point is
    elastic. `document` is the content of curves.json.
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
        files of an instrument, one for each test, which has the name of its file.
    tests : path or table
        Columns test, grain or reference. Optional columns are session, drift_nm_s, and the
        orientations of grains.
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
    # Imported here, because the import takes time.
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
    # The shape is (grain, 0) if grains share no errors.
    shared = [values for name, values in results["shared_errors"].items() if name != "grain"]
    table = results["measurements"]
    errors = np.array(shared, dtype=float).reshape(len(shared), len(table["grain"])).T
    return Curves(table, errors, (radius["mean"], radius["sd"]), results["fits"], document)


def references_of(references: Any, crystal_sd: float | None) -> dict | None:
    """The variables of &references; None if none is stated."""
    if references is None and crystal_sd is None:
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
    """The path of a table that is a file. Another table is written to `path` first."""
    if isinstance(table, str | os.PathLike):
        return Path(table).absolute()
    # Imported here, because the import takes time.
    from pandas import DataFrame

    DataFrame(table).to_csv(path, index=False)
    return path


def read_columns(path: Path) -> dict[str, list]:
    """Read the columns of a CSV of results: numbers, and the names of grains and tests as texts."""
    with path.open(encoding="utf-8", newline="") as file:
        header, *rows = csv.reader(file)
    columns: dict[str, list] = {}
    for name, *cells in zip(header, *rows):
        is_text = name in ("grain", "test")
        columns[name] = cells if is_text else [float(cell or "nan") for cell in cells]
    return columns
