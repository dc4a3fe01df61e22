"""What a surrogate is linear in; the core's basis under a handle."""

import numpy as np

from ..core import InputError, NativeObject, check, native
from ..crystal.elasticity import constant_names
from ..surrogate.domain import Domain

__all__ = ["Basis", "columns"]


class Basis(NativeObject):
    """Terms of a crystal and its orientation over a domain; see docs/surrogate.md.

    coordinates: 'box', 'dimensionless'. truncation: 'tensor', 'total'. degree 0..12 of the polynomials, even bandlimit 0..20 of the
    harmonics.
    """

    kind = "basis"

    def __init__(self, domain: Domain, coordinates: str, truncation: str, degree: int, bandlimit: int):
        handle, status, message = native.basis_new(
            domain.symmetry, domain.bounds, domain.anisotropy_cap, coordinates, truncation, [degree, bandlimit]
        )
        check(status, message)
        self._describe(handle, domain)

    @classmethod
    def of(cls, surrogate: int) -> "Basis":
        """The basis of the surrogate of a handle."""
        self = cls.__new__(cls)
        handle, status, message = native.surrogate_basis(surrogate)
        check(status, message)
        self._describe(handle, None)
        return self

    def _describe(self, handle: int, domain: Domain | None) -> None:
        self._hold(handle)
        facts = self._document()

        def array(name: str) -> np.ndarray:
            return self._array(name, facts.get(name, 0))

        own = domain or Domain(facts["symmetry"], array("c_min"), array("c_max"), facts["anisotropy_cap"])
        #: Degree of each term's harmonic, and of its polynomial in all coordinates together, (n_terms,).
        degrees = {name: array(name).astype(int) for name in ("directional_degrees", "polynomial_degrees")}
        #: Ranges of the coordinates, (m,).
        ranges = {name: array(name) for name in ("lower", "upper")}
        names = ("coordinates", "truncation", "degree", "bandlimit", "n_terms", "logarithmic", "least_noise")
        self.__dict__.update({"domain": own} | {name: facts.get(name) for name in names} | degrees | ranges)

    def __reduce__(self):
        return Basis, (self.domain, self.coordinates, self.truncation, self.degree, self.bandlimit)

    def terms(self, constants, euler_deg) -> tuple[np.ndarray, np.ndarray]:
        """Terms (n_terms, n) and scales (n,) in GPa of stable crystals (n, k) in GPa at angles (n, 3) in degrees."""
        terms, scale, status, message = native.basis_terms(self._handle, self.n_terms, *columns(constants, euler_deg, self.domain.symmetry))
        check(status, message)
        return terms, scale

    def to_y(self, modulus_gpa, scale) -> np.ndarray:
        """The quantity that is linear in the coefficients: M/scale, or its logarithm."""
        y = np.asarray(modulus_gpa, dtype=float) / scale
        return np.log(y) if self.logarithmic else y

    def to_modulus(self, y, scale) -> np.ndarray:
        """The modulus (GPa) of a y."""
        return scale * (np.exp(y) if self.logarithmic else np.asarray(y))

    def coverage(self, stiffness) -> tuple[np.ndarray, np.ndarray]:
        """Of crystals (n, 6, 6) in GPa: the largest of the coordinates, 1 at the end of its range, and whether a surrogate covers it."""
        reach, covered, status, message = native.basis_coverage(self._handle, np.moveaxis(np.asarray(stiffness, dtype=float), 0, -1))
        check(status, message)
        return reach, covered.astype(bool)


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
