"""Single crystals: stiffness, anisotropy, and the exact theory of the indented half-space."""

import numpy as np

from .core import InputError, check, native

__all__ = ["CONSTANTS", "SYMMETRIES", "anisotropy_index", "constants_array", "halfspace_modulus", "stiffness"]

#: The number the core gives each symmetry.
SYMMETRIES = {"cubic": 1, "hexagonal": 2, "triclinic": 3}

#: Names of the independent constants in the order in which arrays hold them.
CONSTANTS = {
    "cubic": ("C11", "C12", "C44"),
    "hexagonal": ("C11", "C12", "C44", "C33", "C13"),
    "triclinic": tuple(f"C{i}{j}" for i in range(1, 7) for j in range(i, 7)),
}


def constants_array(symmetry: str, constants: dict) -> np.ndarray:
    """Stack named constants (GPa, scalars or arrays that broadcast) into (..., k) in the order of `CONSTANTS`."""
    if symmetry not in SYMMETRIES:
        raise InputError(f"symmetry: '{symmetry}' is unknown; allowed: {', '.join(SYMMETRIES)}")
    names = CONSTANTS[symmetry]
    if set(constants) != set(names):
        raise InputError(f"a {symmetry} crystal takes the constants {', '.join(names)}, not {', '.join(constants) or 'none'}")
    return np.stack(np.broadcast_arrays(*(np.asarray(constants[name], dtype=float) for name in names)), axis=-1)


def stiffness(symmetry: str, **constants) -> np.ndarray:
    """Stiffness (..., 6, 6) in GPa, crystal frame, Voigt order 11,22,33,23,13,12, from constants in GPa.

    `symmetry` is 'cubic' (C11, C12, C44), 'hexagonal' (C11, C12, C44, C33, C13) or 'triclinic' (C11, C12, .. C66).
    Arrays of constants broadcast. Raises `InputError` for other names.
    """
    values = constants_array(symmetry, constants)
    flat = values.reshape(-1, values.shape[-1]).T
    matrices = native.crystal_stiffness(SYMMETRIES[symmetry], flat)
    return np.moveaxis(matrices, -1, 0).reshape(*values.shape[:-1], 6, 6)


def anisotropy_index(symmetry: str, constants) -> tuple[np.ndarray, np.ndarray]:
    """Universal anisotropy index (Eq. 14) and whether the crystal is Born-stable, of constants (..., k) in GPa."""
    values = np.asarray(constants, dtype=float)
    index, stable = native.crystal_anisotropy(SYMMETRIES[symmetry], values.reshape(-1, values.shape[-1]).T)
    return index.reshape(values.shape[:-1]), stable.astype(bool).reshape(values.shape[:-1])


def halfspace_modulus(stiffness, euler_deg, *, circular: bool = False, threads: int = 1) -> np.ndarray:
    """Exact indentation modulus in GPa of an anisotropic half-space under a rigid frictionless sphere.

    `stiffness` (..., 6, 6) in GPa, crystal frame; `euler_deg` (..., 3), Bunge-Euler angles in degrees; the two broadcast.
    `circular=True` gives the Vlassak-Nix value of a circular contact instead of Willis' ellipse. Raises `InputError` for
    a crystal or an angle that is not finite, or a crystal that is not stable.
    """
    matrices = np.asarray(stiffness, dtype=float)
    angles = np.radians(np.asarray(euler_deg, dtype=float))
    shape = np.broadcast_shapes(matrices.shape[:-2], angles.shape[:-1])
    matrices = np.broadcast_to(matrices, (*shape, 6, 6)).reshape(-1, 6, 6)
    angles = np.broadcast_to(angles, (*shape, 3)).reshape(-1, 3)
    if not np.isfinite(angles).all():
        raise InputError("an Euler angle is not finite")
    modulus, vlassak_nix, status, message = native.theory_moduli(np.moveaxis(matrices, 0, -1), angles.T, threads)
    check(status, message)
    return (vlassak_nix if circular else modulus).reshape(shape)
