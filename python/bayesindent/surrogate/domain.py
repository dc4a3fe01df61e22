"""Which crystals a surrogate is taught, and points spread over them."""

from dataclasses import dataclass

import numpy as np

from ..core import InputError, check, native
from ..crystal.elasticity import class_name, constant_names

__all__ = ["Domain"]


@dataclass(frozen=True)
class Domain:
    """Born-stable crystals of a class within bounds (GPa, order of `constant_names`) whose anisotropy index (Eq. 14) is not above a cap."""

    symmetry: str
    c_min: tuple[float, ...]
    c_max: tuple[float, ...]
    anisotropy_cap: float

    def __post_init__(self):
        object.__setattr__(self, "symmetry", class_name(self.symmetry))
        for name in ("c_min", "c_max"):
            object.__setattr__(self, name, tuple(map(float, getattr(self, name))))
        object.__setattr__(self, "anisotropy_cap", float(self.anisotropy_cap))
        if len(self.c_min) != len(self.c_max):
            raise InputError(f"there are {len(self.c_min)} lower bounds and {len(self.c_max)} upper ones")
        # The core says what is wrong with the bounds.
        self.contains(np.empty((0, len(constant_names(self.symmetry)))))

    @property
    def bounds(self) -> np.ndarray:
        """Bounds (k, 2) of the k constants, GPa."""
        return np.column_stack([self.c_min, self.c_max])

    def contains(self, constants) -> np.ndarray:
        """Whether each row of constants (n, k) in GPa is within bounds, stable, and below the cap."""
        values = np.asarray(constants, dtype=float).reshape(-1, len(self.c_min))
        inside, status, message = native.domain_admits(self.symmetry, self.bounds, self.anisotropy_cap, values.T)
        check(status, message)
        return inside.astype(bool)

    def latin(self, n: int, seed: int, n_angles: int = 0) -> np.ndarray:
        """The first n admissible points (n, k + n_angles) of a Latin hypercube; the last columns are in [0, 1)."""
        from scipy.stats import qmc

        k = len(self.c_min)
        size = n
        for _ in range(40):
            unit = qmc.LatinHypercube(k + n_angles, rng=np.random.default_rng(seed)).random(size)
            points = np.column_stack([qmc.scale(unit[:, :k], self.c_min, self.c_max), unit[:, k:]])
            points = points[self.contains(points[:, :k])]
            if len(points) >= n:
                return points[:n]
            share = len(points) / size
            size = int(np.ceil(1.02 * n / share)) + 8 if share > 0 else 4 * size
            if size > 4_000_000:
                break
        raise InputError("the domain holds (almost) no stable crystal below the anisotropy cap")

    def crystals(self, n: int, seed: int) -> tuple[np.ndarray, np.ndarray]:
        """n admissible crystals (n, k) in GPa and angles (n, 3) in degrees, indentation directions uniform on the sphere."""
        points = self.latin(n, seed, n_angles=3)
        u = points[:, -3:]
        # Phi within 0..90: a direction and its opposite are the same indentation.
        angles = np.column_stack([360 * u[:, 0], np.degrees(np.arccos(1 - u[:, 1])), 360 * u[:, 2]])
        return points[:, :-3], angles
