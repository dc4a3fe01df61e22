"""Directions in a crystal class. The core represents each set of equivalent directions by one of
them, in a region of distinct directions.
"""

import numpy as np
from numpy.typing import ArrayLike

from ..core import call


def indentation_direction(euler_deg: ArrayLike) -> np.ndarray:
    """The direction of indentation (n, 3) in crystal axes for Bunge-Euler angles (n, 3) in
    degrees.
    """
    _, declination, phi2 = np.radians(np.reshape(euler_deg, (-1, 3))).T
    return np.column_stack(
        [
            np.sin(phi2) * np.sin(declination),
            np.cos(phi2) * np.sin(declination),
            np.cos(declination),
        ]
    )


def euler_of(directions: ArrayLike) -> np.ndarray:
    """Bunge-Euler angles (n, 3) in degrees, phi1 = 0, of grains that are indented along directions
    (n, 3) in crystal axes.
    """
    x, y, z = np.asarray(directions, dtype=float).T
    return np.column_stack(
        [
            np.zeros_like(x),
            np.degrees(np.arccos(np.clip(z, -1, 1))),
            np.degrees(np.arctan2(x, y)) % 360,
        ]
    )


def representative(symmetry: str, directions: ArrayLike) -> np.ndarray:
    """The equivalents of directions (n, 3) in the region of distinct directions of the class."""
    return call(
        "crystal.representatives", symmetry=symmetry, directions=np.reshape(directions, (-1, 3))
    )["values"]


def spread_of_directions(symmetry: str, n: int = 0) -> np.ndarray:
    """n directions (n, 3) that are far apart in the region of distinct directions of the class,
    its corners first; an even lattice of directions if n is 0.
    """
    return call("crystal.directions", symmetry=symmetry, count=n)["values"]
