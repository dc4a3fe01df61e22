"""Which crystals a surrogate covers, and points spread over them."""

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from ..core import InputError, check, native
from ..crystal.elasticity import anisotropy_index, constant_names, stiffness_rows

__all__ = ["DEFAULT_BOUNDS", "Domain"]

#: Bounds of the constants (GPa) of the paper's two studies, and the largest anisotropy index that it met.
DEFAULT_BOUNDS = {
    "cubic": ((50.0, 40.0, 15.0), (250.0, 150.0, 120.0), 7.2),
    "hexagonal": ((80.0, 40.0, 30.0, 70.0, 40.0), (240.0, 120.0, 90.0, 210.0, 90.0), 66.2),
}

#: The number the core gives coordinates.
COORDINATES = {"box": 1, "dimensionless": 2}


@dataclass(frozen=True)
class Domain:
    """Born-stable crystals within bounds (GPa, order of `constant_names`) whose anisotropy index (Eq. 14) does not exceed a cap."""

    symmetry: str
    c_min: tuple
    c_max: tuple
    anisotropy_cap: float

    def __post_init__(self):
        k = len(constant_names(self.symmetry))
        if len(self.c_min) != k or len(self.c_max) != k:
            raise InputError(f"a {self.symmetry} domain has {k} bounds, not {len(self.c_min)} and {len(self.c_max)}")
        for name, low, high in zip(constant_names(self.symmetry), self.c_min, self.c_max, strict=True):
            if not low < high:
                raise InputError(f"the bounds of {name} are {low} and {high} GPa; the lower must be below the upper")

    @classmethod
    def default(cls, symmetry: str) -> "Domain":
        """The domain of the paper."""
        return cls(symmetry, *DEFAULT_BOUNDS[symmetry])

    def contains(self, constants) -> np.ndarray:
        """Whether each row of constants (n, k) is within bounds, stable, and below the cap."""
        values = np.atleast_2d(np.asarray(constants, dtype=float))
        inside = np.all((values >= self.c_min) & (values <= self.c_max), axis=1)
        return inside & (anisotropy_index(stiffness_rows(self.symmetry, values)) <= self.anisotropy_cap)

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
        """n admissible crystals (n, k) and angles (n, 3) in degrees, indentation directions uniform on the sphere."""
        points = self.latin(n, seed, n_angles=3)
        u = points[:, -3:]
        # Phi within 0..90: a direction and its opposite are the same indentation.
        angles = np.column_stack([360 * u[:, 0], np.degrees(np.arccos(1 - u[:, 1])), 360 * u[:, 2]])
        return points[:, :-3], angles

    @cached_property
    def ratio_ranges(self) -> tuple[np.ndarray, np.ndarray]:
        """Ranges of the dimensionless coordinates over the domain, slightly widened."""
        k = len(self.c_min)
        lower, upper, status, message = native.domain_ranges(
            self.symmetry, self.c_min, self.c_max, self.anisotropy_cap, COORDINATES["dimensionless"], k - 1
        )
        check(status, message)
        return lower, upper

    def ranges(self, coordinates: str) -> tuple[np.ndarray, np.ndarray]:
        """Ranges of the raw coordinates of a basis."""
        if coordinates == "dimensionless":
            return self.ratio_ranges
        return np.array(self.c_min, dtype=float), np.array(self.c_max, dtype=float)
