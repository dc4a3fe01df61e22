"""The basis functions of a surrogate, which the core holds under a handle."""

from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from ..core import InputError, NativeObject
from ..crystal.elasticity import constant_names, finite_rows
from ..settings.problem import Problem


class Basis(NativeObject):
    """Terms of a crystal and its orientation over a domain, of &domain and &surrogate of a problem
    or of a surrogate; see docs/surrogate.md.

    `symmetry` is the class whose constants describe crystals. `stiffness` is the range in GPa of
    the scale on which the terms depend; it is unbounded if they do not depend on it.
    `polynomial_degrees` has an entry for each term of a correction.
    """

    kind = "basis"
    symmetry: str
    model: str
    n_terms: int
    logarithmic: bool
    c_min: np.ndarray
    c_max: np.ndarray
    poisson: np.ndarray
    stiffness: np.ndarray
    polynomial_degrees: np.ndarray

    def __init__(self, source: Problem | NativeObject):
        self._hold(source._call("basis")["handle"])
        self.__dict__.update(
            dict.fromkeys(("c_min", "c_max", "poisson", "stiffness"), np.zeros(0))
            | self._call("describe")
        )

    @classmethod
    def from_keywords(
        cls, symmetry: str | None = None, domain: dict | None = None, **surrogate: Any
    ) -> "Basis":
        """The basis of a symmetry from variables of &domain and &surrogate: `model`, `degree`,
        `bandlimit`, `truncation`.
        """
        return cls(
            Problem.from_keywords(
                "Basis", problem={"symmetry": symmetry}, domain=domain or {}, surrogate=surrogate
            )
        )

    def coverage(self, stiffness: ArrayLike) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """For crystals (n, 6, 6) in GPa the largest of their coordinates, which is 1 at the end of
        its range; whether a surrogate is valid for them; and the scale in GPa, the geometric mean
        of the eigenvalues of the Kelvin stiffness.
        """
        distance, valid, scale = self._call("validity", stiffness=stiffness, threads=1)["values"]
        return distance, valid.astype(bool), scale

    def rows(self, constants: ArrayLike, euler_deg: ArrayLike) -> dict[str, np.ndarray]:
        """Check constants (n, k) in GPa and angles (n, 3) in degrees, and return them by name."""
        k = len(constant_names(self.symmetry))
        values = np.atleast_2d(finite_rows(f"a {self.symmetry} crystal", "constant", constants, k))
        angles = np.atleast_2d(finite_rows("a crystal", "Euler angle", euler_deg, 3))
        if len(values) != len(angles):
            raise InputError(f"there are {len(values)} crystals but {len(angles)} orientations")
        return {"constants": values, "euler_deg": angles}
