"""Directions that a crystal class tells apart."""

import numpy as np

__all__ = ["direction_lattice", "euler_of", "indentation_direction", "representative"]


def indentation_direction(euler_deg) -> np.ndarray:
    """The direction of indentation (n, 3) in crystal axes at Bunge-Euler angles (n, 3) in degrees."""
    _, declination, phi2 = np.radians(np.reshape(euler_deg, (-1, 3))).T
    return np.column_stack([np.sin(phi2) * np.sin(declination), np.cos(phi2) * np.sin(declination), np.cos(declination)])


def euler_of(directions) -> np.ndarray:
    """Bunge-Euler angles (n, 3) in degrees, phi1 = 0, of grains that are indented along directions (n, 3) in crystal axes."""
    x, y, z = np.asarray(directions).T
    return np.column_stack([np.zeros_like(x), np.degrees(np.arccos(np.clip(z, -1, 1))), np.degrees(np.arctan2(x, y)) % 360])


def representative(symmetry: str, directions) -> np.ndarray:
    """Of directions (n, 3) those that stand for them in the region that the class tells apart."""
    x = np.abs(np.asarray(directions, dtype=float))
    if symmetry == "hexagonal":
        return np.column_stack([np.hypot(x[:, 0], x[:, 1]), np.zeros(len(x)), x[:, 2]])
    least, middle, most = np.sort(x, axis=1).T
    return np.column_stack([middle, least, most])


def direction_lattice(symmetry: str) -> np.ndarray:
    """Directions (m, 3) over the region that the class tells apart."""
    if symmetry == "hexagonal":
        angle = np.radians(np.arange(0, 91, 2))
        return np.column_stack([np.sin(angle), np.zeros_like(angle), np.cos(angle)])
    n = 16
    corners = np.array([[0, 0, 1], [1, 0, 1] / np.sqrt(2), [1, 1, 1] / np.sqrt(3)])
    shares = np.array([(i, j, n - i - j) for i in range(n + 1) for j in range(n + 1 - i)]) / n
    directions = shares @ corners
    return directions / np.linalg.norm(directions, axis=1, keepdims=True)
