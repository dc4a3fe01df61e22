"""What a surrogate is linear in; the core's basis under a handle."""

import numpy as np

from ..core import InputError, NativeObject, check, native
from ..crystal.elasticity import constant_names
from ..settings.problem import Problem

__all__ = ["Basis", "columns"]


class Basis(NativeObject):
    """Terms of a crystal and its orientation over a domain, as &domain and &surrogate of a problem say; see docs/surrogate.md.

    `symmetry`: the class by whose constants crystals are given. `stiffness`: the range of the scale in GPa on which the terms depend, from 0 to
    the largest number where they do not. Of each term `directional_degrees` and `polynomial_degrees`.
    """

    kind = "basis"
    symmetry: str
    model: str
    n_terms: int
    logarithmic: bool
    _problem: Problem | None

    def __init__(self, problem: Problem):
        handle, status, message = native.basis_new(problem.handle)
        check(status, message)
        self._describe(handle, problem)

    @classmethod
    def of(cls, surrogate: int) -> "Basis":
        """The basis of the surrogate of a handle."""
        self = cls.__new__(cls)
        handle, status, message = native.surrogate_basis(surrogate)
        check(status, message)
        self._describe(handle, None)
        return self

    @classmethod
    def from_keywords(cls, symmetry: str | None = None, domain: dict | None = None, **surrogate) -> "Basis":
        """The basis of a symmetry with variables of &domain and &surrogate: `model`, `degree`, `bandlimit`, `truncation`."""
        return cls(Problem.from_keywords("Basis", problem={"symmetry": symmetry}, domain=domain or {}, surrogate=surrogate))

    def _describe(self, handle: int, problem: Problem | None) -> None:
        self._hold(handle)
        facts = self._document()
        arrays = ("c_min", "c_max", "poisson", "stiffness", "directional_degrees", "polynomial_degrees")
        values = {name: self._array(name, facts.get(name, 0)) for name in arrays}
        self.__dict__.update({"_problem": problem} | {name: value for name, value in facts.items() if name not in arrays} | values)

    def __reduce__(self):
        if self._problem is None:
            return super().__reduce__()
        return Basis, (self._problem,)

    def crystals(self, n: int, seed: int) -> tuple[np.ndarray, np.ndarray]:
        """n crystals (n, k) in GPa spread over the domain, and angles (n, 3) in degrees, indentation directions uniform on the sphere."""
        constants, euler_deg, status, message = native.basis_crystals(self._handle, seed, len(constant_names(self.symmetry)), n)
        check(status, message)
        return constants.T.copy(), euler_deg.T.copy()

    def terms(self, constants, euler_deg) -> tuple[np.ndarray, np.ndarray]:
        """Terms (n_terms, n) and scales (n,) in GPa of stable crystals (n, k) in GPa at angles (n, 3) in degrees."""
        terms, scale, status, message = native.basis_terms(self._handle, self.n_terms, *columns(constants, euler_deg, self.symmetry))
        check(status, message)
        return terms, scale

    def to_y(self, modulus_gpa, scale) -> np.ndarray:
        """The quantity that is linear in the coefficients: M/scale, or its logarithm."""
        y = np.asarray(modulus_gpa, dtype=float) / scale
        return np.log(y) if self.logarithmic else y

    def to_modulus(self, y, scale) -> np.ndarray:
        """The modulus (GPa) of a y."""
        return scale * (np.exp(y) if self.logarithmic else np.asarray(y))

    def coverage(self, stiffness) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Of crystals (n, 6, 6) in GPa: the largest of the coordinates, 1 at the end of its range; whether a surrogate covers it; and the
        scale in GPa, the geometric mean of the eigenvalues of the Kelvin stiffness."""
        reach, covered, scale, status, message = native.basis_coverage(self._handle, np.moveaxis(np.asarray(stiffness, dtype=float), 0, -1))
        check(status, message)
        return reach, covered.astype(bool), scale


def columns(constants, euler_deg, symmetry: str) -> tuple[np.ndarray, np.ndarray]:
    """Constants (k, n) in GPa and angles (3, n) in degrees as the core takes them."""
    k = len(constant_names(symmetry))
    values = np.atleast_2d(np.asarray(constants, dtype=float))
    angles = np.atleast_2d(np.asarray(euler_deg, dtype=float))
    if values.shape[1:] != (k,) or angles.shape[1:] != (3,):
        raise InputError(
            f"a {symmetry} crystal takes arrays (n, {k}) of constants and (n, 3) of angles, not {values.shape} and {angles.shape}"
        )
    if len(values) != len(angles):
        raise InputError(f"there are {len(values)} crystals but {len(angles)} orientations")
    if not (np.isfinite(values).all() and np.isfinite(angles).all()):
        raise InputError("a constant or an angle is not finite")
    return np.asfortranarray(values.T), np.asfortranarray(angles.T)
