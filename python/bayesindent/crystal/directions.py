"""Directions that a crystal class tells apart: of each set of equivalent ones the core takes one."""

import numpy as np

from ..core import native
from ..crystal.elasticity import class_name

__all__ = ["all_alike", "direction_lattice", "euler_of", "indentation_direction", "representative", "spread_of_directions"]


def indentation_direction(euler_deg) -> np.ndarray:
    """The direction of indentation (n, 3) in crystal axes at Bunge-Euler angles (n, 3) in degrees."""
    _, declination, phi2 = np.radians(np.reshape(euler_deg, (-1, 3))).T
    return np.column_stack([np.sin(phi2) * np.sin(declination), np.cos(phi2) * np.sin(declination), np.cos(declination)])


def euler_of(directions) -> np.ndarray:
    """Bunge-Euler angles (n, 3) in degrees, phi1 = 0, of grains that are indented along directions (n, 3) in crystal axes."""
    x, y, z = np.asarray(directions, dtype=float).T
    return np.column_stack([np.zeros_like(x), np.degrees(np.arccos(np.clip(z, -1, 1))), np.degrees(np.arctan2(x, y)) % 360])


def representative(symmetry: str, directions) -> np.ndarray:
    """Of directions (n, 3) those that stand for them in the region that the class tells apart."""
    vectors = np.asarray(directions, dtype=float).reshape(-1, 3)
    return native.region_representatives(class_name(symmetry), vectors.T, 0.0)[0].T


def all_alike(symmetry: str, directions, angle_deg: float) -> bool:
    """Whether one of directions (n, 3) has all others within an angle."""
    vectors = np.asarray(directions, dtype=float).reshape(-1, 3)
    return bool(native.region_representatives(class_name(symmetry), vectors.T, np.radians(angle_deg))[1])


def direction_lattice(symmetry: str) -> np.ndarray:
    """Directions (m, 3) evenly over the region that the class tells apart."""
    name = class_name(symmetry)
    return native.region_directions(name, 0, native.region_directions(name, 0, 1)[0])[1].T


def spread_of_directions(symmetry: str, n: int) -> np.ndarray:
    """n directions (n, 3) that are far apart in the region that the class tells apart, its corners first."""
    return native.region_directions(class_name(symmetry), n, n)[1].T
