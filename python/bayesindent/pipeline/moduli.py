"""Tables of crystals with their moduli."""

from pathlib import Path

import numpy as np

from ..common.result_files import cell, write_csv
from ..settings.problem import Points, schema

__all__ = ["identified", "joined", "write_moduli"]


def identified(points: Points, row: int) -> dict:
    """Constants and orientation of a row."""
    return {"constants": points.constants[row], "euler_deg": points.euler_deg[row].tolist()}


def write_moduli(file: Path, problem, points: Points, modulus) -> None:
    """The rows of the points with the three kinds of modulus, of indentation moduli in GPa (None where there is none)."""
    write_csv(file, *joined(points, moduli_of_three_kinds(problem, np.array(modulus, dtype=float))))


def moduli_of_three_kinds(problem, modulus: np.ndarray) -> dict[str, np.ndarray]:
    """The indentation modulus M, and what an instrument reports: 1/E_eff = 1/M + (1-nu_i^2)/E_i, and E_s = (1-nu_s^2) M."""
    defaults = {v.name: v.default for v in schema() if v.group == "measurements"}
    settings = problem.get("measurements", {})
    young, nu_indenter, nu_sample = (
        float(settings.get(name, defaults[name])) for name in ("indenter_modulus_gpa", "indenter_nu", "sample_nu")
    )
    return {
        "indentation_modulus_gpa": modulus,
        "effective_modulus_gpa": 1 / (1 / modulus + (1 - nu_indenter**2) / young),
        "sample_modulus_gpa": (1 - nu_sample**2) * modulus,
    }


def joined(points: Points, columns: dict) -> tuple[list[str], list[list]]:
    """Header and rows of a table as it was written, with columns added or, where it has them, replaced."""
    kept = [i for i, name in enumerate(points.columns) if name not in columns]
    header = [points.columns[i] for i in kept] + list(columns)
    rows = [[*(row[i] for i in kept), *(cell(values[number]) for values in columns.values())] for number, row in enumerate(points.rows)]
    return header, rows
