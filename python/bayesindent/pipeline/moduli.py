"""Tables of crystals with their moduli."""

from pathlib import Path

import numpy as np

from ..core import call, document
from ..settings.problem import Points

__all__ = ["as_measured", "identified", "write_moduli"]


def identified(points: Points, row: int) -> dict:
    """Constants and orientation of a row."""
    return {"constants": points.constants[row], "euler_deg": points.euler_deg[row].tolist()}


def write_moduli(file: Path, problem, points: Points, modulus) -> None:
    """The rows of the points with every kind of modulus, of indentation moduli in GPa (None where there is none)."""
    kinds = document(0, "settings")["modulus_kinds"].split(", ")
    measured, moduli = problem.settings.measurements, np.array(modulus, dtype=float)
    points.write(file, {f"{kind}_gpa": as_measured(measured, moduli, kind) for kind in kinds})


def as_measured(measurements, modulus, kind: str = "") -> np.ndarray:
    """Indentation moduli in GPa as the kind of modulus that the settings of &measurements say, or another one."""
    numbers = measurements.indenter_modulus_gpa, measurements.indenter_nu, measurements.sample_nu
    values = call("moduli_of_kind", kind or measurements.modulus_kind, *numbers, np.ravel(modulus))
    return values.reshape(np.shape(modulus))
