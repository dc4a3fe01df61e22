"""Single crystals: stiffness, anisotropy, and the exact theory of the indented half-space."""

import numpy as np

from ..core import InputError, check, native

__all__ = ["CONSTANTS", "SYMMETRIES", "anisotropy_index", "constants_array", "halfspace_modulus", "stiffness", "stiffness_rows"]

#: The number the core gives each symmetry.
SYMMETRIES = {"cubic": 1, "hexagonal": 2, "triclinic": 3}

#: Names of the independent constants in the order in which arrays hold them.
CONSTANTS = {
    "cubic": ("C11", "C12", "C44"),
    "hexagonal": ("C11", "C12", "C44", "C33", "C13"),
    "triclinic": tuple(f"C{i}{j}" for i in range(1, 7) for j in range(i, 7)),
}

#: A stiffness is symmetric if its halves differ by no more than this share of its largest entry.
SYMMETRIC = 1e-6


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


def stiffness_rows(symmetry: str, constants) -> np.ndarray:
    """Stiffness (n, 6, 6) of rows of constants (n, k)."""
    values = np.asarray(constants, dtype=float)
    return stiffness(symmetry, **dict(zip(CONSTANTS[symmetry], values.T, strict=True)))


def anisotropy_index(symmetry: str, constants) -> tuple[np.ndarray, np.ndarray]:
    """Universal anisotropy index (Eq. 14) and whether the crystal is Born-stable, of constants (..., k) in GPa."""
    values = np.asarray(constants, dtype=float)
    index, stable = native.crystal_anisotropy(SYMMETRIES[symmetry], values.reshape(-1, values.shape[-1]).T)
    return index.reshape(values.shape[:-1]), stable.astype(bool).reshape(values.shape[:-1])


def oriented_crystals(stiffness, euler_deg) -> tuple[np.ndarray, np.ndarray]:
    """Stiffness (..., 6, 6) in GPa and angles (..., 3) in radians of what users give, checked for shape, symmetry and finite angles."""
    matrices, angles = np.asarray(stiffness, dtype=float), np.asarray(euler_deg, dtype=float)
    if matrices.shape[-2:] != (6, 6):
        raise InputError(f"a stiffness has the shape (6, 6), not {matrices.shape}; bi.stiffness makes it from constants")
    if angles.shape[-1:] != (3,):
        raise InputError(f"a crystal has three Euler angles (phi1, Phi, phi2) in degrees; their shape is {angles.shape}")
    if not np.isfinite(angles).all():
        raise InputError("an Euler angle is not finite")
    transposed = np.swapaxes(matrices, -1, -2)
    if np.any(np.abs(matrices - transposed) > SYMMETRIC * np.abs(matrices).max(axis=(-2, -1), keepdims=True, initial=0.0)):
        raise InputError("a stiffness is not symmetric")
    return matrices, np.radians(angles)


def halfspace_modulus(stiffness, euler_deg, *, circular: bool = False, threads: int = 1) -> np.ndarray:
    """Exact indentation modulus in GPa of an anisotropic half-space under a rigid frictionless sphere.

    `stiffness` (..., 6, 6) in GPa, crystal frame; `euler_deg` (..., 3), Bunge-Euler angles in degrees; the two broadcast.
    `circular=True` gives the Vlassak-Nix value of a circular contact instead of Willis' ellipse. Raises `InputError` for
    a crystal or an angle that is not finite, a crystal that is not stable, or shapes that do not fit.
    """
    matrices, angles = oriented_crystals(stiffness, euler_deg)
    try:
        shape = np.broadcast_shapes(matrices.shape[:-2], angles.shape[:-1])
    except ValueError:
        raise InputError(f"crystals {matrices.shape[:-2]} and angles {angles.shape[:-1]} do not broadcast") from None
    matrices = np.broadcast_to(matrices, (*shape, 6, 6)).reshape(-1, 6, 6)
    angles = np.broadcast_to(angles, (*shape, 3)).reshape(-1, 3)
    modulus, vlassak_nix, status, message = native.theory_moduli(np.moveaxis(matrices, 0, -1), angles.T, threads)
    check(status, message)
    return (vlassak_nix if circular else modulus).reshape(shape)
