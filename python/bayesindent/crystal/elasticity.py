"""Single crystals: stiffness, anisotropy, quantities by name (constants, averages, directional
moduli, products of powers), and the exact theory of the indented half-space.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import cache
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from ..core import InputError, call


def quantity_names(symmetry: str) -> dict[str, str]:
    """The quantities of a crystal in reports and their units ('GPa', or '1' for ratios). The
    constants come first: those of the class, or all if the symmetry is ''.
    """
    found = call("crystal.reported_quantities", symmetry=symmetry)
    return dict(zip(found["names"], found["units"]))


def quantities(
    symmetry: str | ArrayLike,
    constants: ArrayLike | None = None,
    names: Sequence[str] | None = None,
) -> dict[str, np.ndarray]:
    """Quantities of stable crystals, each an array (...), from a stiffness (..., 6, 6) in GPa of
    `stiffness`, or from a `symmetry` with its constants (..., k) in GPa.

    `names` are any that `knowledge` of `bi.extract` takes, such as 'C33/C11', 'young[110]' and
    'compressibility[001]' (1/TPa). The default are the quantities of reports: constants, bulk
    modulus (of a single crystal under pressure, 1/S_iijj), averages of the polycrystal (Hill),
    anisotropy index (Eq. 14), and Young's moduli along distinct directions.

    Examples
    --------
    >>> found = bi.quantities("cubic", [168.4, 121.4, 75.4], ["bulk_modulus", "young[111]"])
    >>> {name: round(float(value), 1) for name, value in found.items()}
    {'bulk_modulus': 137.1, 'young[111]': 191.1}
    """
    if isinstance(symmetry, str):
        matrices = stiffness_rows(symmetry, [] if constants is None else constants)
    else:
        matrices, symmetry = oriented_crystals(symmetry, np.zeros(3))[0], ""
    names = list(quantity_names(symmetry) if names is None else names)
    found = call("crystal.quantities", names=",".join(names), stiffness=matrices.reshape(-1, 6, 6))
    return {name: row.reshape(matrices.shape[:-2]) for name, row in zip(names, found["values"].T)}


#: The largest difference between the halves of a symmetric stiffness, as a share of its largest
#: entry.
SYMMETRIC = 1e-6


@cache
def _crystal_class(symmetry: str) -> tuple[str, tuple[str, ...]]:
    found = call("crystal.class", symmetry=symmetry)
    return found["name"], tuple(found["constants"])


def class_name(symmetry: str) -> str:
    """The canonical name of the crystal class that `symmetry` names: 'cubic' for 'm-3m'. Raises
    `InputError` for other texts.
    """
    return _crystal_class(symmetry)[0]


def constant_names(symmetry: str) -> tuple[str, ...]:
    """Names of the independent constants of the crystal class that `symmetry` names, in the order
    in which arrays hold them.

    Examples
    --------
    >>> bi.constants("hcp")
    ('C11', 'C12', 'C44', 'C33', 'C13')
    """
    return _crystal_class(symmetry)[1]


def stiffness(symmetry: str, *values: ArrayLike, **constants: ArrayLike) -> np.ndarray:
    """Stiffness (..., 6, 6) in GPa, crystal frame, Voigt order 11,22,33,23,13,12, from constants in
    GPa.

    `symmetry` names a crystal class ('cubic', 'hcp', '4/mmm', ..). The constants are `values` in
    the order of `bi.constants(symmetry)`, or keywords, C11=168.4. Arrays of constants broadcast.
    Raises `InputError` for other names, or another number of values.

    Examples
    --------
    >>> copper = bi.stiffness("cubic", C11=168.4, C12=121.4, C44=75.4)
    >>> copper.shape
    (6, 6)
    """
    names = constant_names(symmetry)
    given = dict(zip(names, values)) | constants
    if set(given) != set(names) or len(given) < len(values) + len(constants):
        stated = [*[f"{len(values)} values"] * bool(values), *constants]
        raise InputError(
            f"a {symmetry} crystal takes the constants {', '.join(names)}, not "
            f"{', '.join(stated) or 'none'}"
        )
    return stiffness_rows(
        symmetry,
        np.stack(np.broadcast_arrays(*(given[name] for name in names)), axis=-1),
    )


def stiffness_rows(symmetry: str, constants: ArrayLike) -> np.ndarray:
    """Stiffness (..., 6, 6) in GPa of constants (..., k) in the order of `constant_names`."""
    k = len(constant_names(symmetry))
    values = finite_rows(f"a {symmetry} crystal", "constant", constants, k)
    return call("crystal.stiffness", symmetry=symmetry, constants=values.reshape(-1, k))[
        "stiffness"
    ].reshape(*values.shape[:-1], 6, 6)


def stiffness_table(symmetry: str, mean: ArrayLike, covariance: ArrayLike) -> dict[str, list]:
    """The columns of a file of `&knowledge stiffness_file`: means (k,) in GPa and covariance (k, k)
    in GPa² of the constants.
    """
    names = constant_names(symmetry)
    mean, covariance = np.asarray(mean, dtype=float), np.asarray(covariance, dtype=float)
    if mean.shape != (len(names),) or covariance.shape != 2 * mean.shape:
        raise InputError(
            f"means and covariance have shapes {mean.shape} and {covariance.shape}; "
            f"allowed ({len(names)},) and {2 * (len(names),)} for {', '.join(names)}"
        )
    return {"row": ["mean", *names]} | dict(zip(names, np.vstack([mean, covariance]).T.tolist()))


def anisotropy_index(stiffness: ArrayLike) -> np.ndarray:
    """Universal anisotropy index (Eq. 14), of `stiffness` (..., 6, 6) in GPa; NaN where the crystal
    is not Born-stable.

    Examples
    --------
    >>> copper = bi.stiffness("cubic", 168.4, 121.4, 75.4)
    >>> round(float(bi.anisotropy_index(copper)), 2)
    1.82
    """
    return _averages(stiffness)[0]


def log_anisotropy(stiffness: ArrayLike) -> np.ndarray:
    """Norm of the anisotropic part of log K, K the Kelvin form of `stiffness` (..., 6, 6) in GPa;
    NaN if unstable.

    Examples
    --------
    >>> copper = bi.stiffness("cubic", 168.4, 121.4, 75.4)
    >>> round(float(bi.log_anisotropy(copper)), 2)
    1.28
    """
    return _averages(stiffness)[1]


def polycrystal_averages(stiffness: ArrayLike) -> dict[str, np.ndarray]:
    """Voigt's and Reuss's bulk and shear moduli (GPa) of `stiffness` (..., 6, 6) in GPa; Reuss's
    NaN where not Born-stable.

    Examples
    --------
    >>> found = bi.polycrystal_averages(bi.stiffness("cubic", 168.4, 121.4, 75.4))
    >>> {name: round(float(value), 1) for name, value in found.items()}
    {'bulk_voigt': 137.1, 'shear_voigt': 54.6, 'bulk_reuss': 137.1, 'shear_reuss': 40.0}
    """
    names = ("bulk_voigt", "shear_voigt", "bulk_reuss", "shear_reuss")
    return dict(zip(names, _averages(stiffness)[2:]))


def _averages(stiffness: ArrayLike) -> np.ndarray:
    """Eq. 14, log-anisotropy and the four averages (6, ...)."""
    matrices = np.asarray(stiffness, dtype=float)
    return call("crystal.averages", stiffness=matrices.reshape(-1, 6, 6))["values"].T.reshape(
        6, *matrices.shape[:-2]
    )


def finite_rows(crystal: str, what: str, values: ArrayLike, n: int) -> np.ndarray:
    """Check that values (..., n) are finite; messages call them n of `what` of a `crystal`."""
    array = np.asarray(values, dtype=float)
    if array.shape[-1:] != (n,):
        raise InputError(f"{crystal} has {n} {what}s; their shape is {array.shape}")
    if not np.isfinite(array).all():
        raise InputError(f"of {crystal} one {what} is not finite")
    return array


def oriented_crystals(stiffness: ArrayLike, euler_deg: ArrayLike) -> tuple[np.ndarray, np.ndarray]:
    """Check the shape and symmetry of stiffnesses (..., 6, 6) in GPa and the shape of angles
    (..., 3) in degrees, which must be finite, and return both as arrays.
    """
    matrices = np.asarray(stiffness, dtype=float)
    angles = finite_rows("a crystal", "Euler angle", angles_of(euler_deg), 3)
    if matrices.shape[-2:] != (6, 6):
        raise InputError(
            f"a stiffness has the shape (6, 6), not {matrices.shape}; bi.stiffness makes it "
            "from constants"
        )
    most = SYMMETRIC * np.abs(matrices).max(axis=(-2, -1), keepdims=True, initial=0.0)
    if not np.allclose(matrices, np.swapaxes(matrices, -1, -2), 0, most, equal_nan=True):
        raise InputError("a stiffness is not symmetric")
    return matrices, angles


def angles_of(orientations: Any) -> np.ndarray:
    """Bunge-Euler angles in degrees of an array or of orix' Orientation, which is a rotation from
    sample to crystal as well.
    """
    if hasattr(orientations, "to_euler"):
        orientations = orientations.to_euler(degrees=True)
    return np.asarray(orientations, dtype=float)


def crystal_rows(
    stiffness: ArrayLike, euler_deg: ArrayLike, **numbers: ArrayLike
) -> tuple[dict[str, np.ndarray], tuple[int, ...]]:
    """Stiffness (n, 6, 6) in GPa, angles (n, 3) in degrees and other numbers (n, 1) for the core,
    and the shape to which they broadcast.
    """
    matrices, angles = oriented_crystals(stiffness, euler_deg)
    arrays = {"crystals": (matrices, (6, 6)), "angles": (angles, (3,))}
    for name, values in numbers.items():
        arrays[name] = np.asarray(values, dtype=float)[..., None], (1,)
    shapes = {name: array.shape[: array.ndim - len(cell)] for name, (array, cell) in arrays.items()}
    try:
        shape = np.broadcast_shapes(*shapes.values())
    except ValueError:
        raise InputError(
            " and ".join(f"{name} {found}" for name, found in shapes.items()) + " do not broadcast"
        ) from None
    if 0 in shape:
        raise InputError("there are no crystals")
    rows = (np.broadcast_to(x, shape + cell).reshape(-1, *cell) for x, cell in arrays.values())
    return dict(zip(("stiffness", "euler_deg", *numbers), rows)), shape


def halfspace_modulus(
    stiffness: ArrayLike, euler_deg: ArrayLike, *, circular: bool = False, threads: int = 1
) -> np.ndarray:
    """Exact indentation modulus in GPa of an anisotropic half-space under a rigid frictionless
    sphere.

    `stiffness` (..., 6, 6) in GPa, crystal frame; `euler_deg` (..., 3), Bunge-Euler angles in
    degrees; the two broadcast. `circular=True` gives the Vlassak-Nix value of a circular contact
    instead of Willis' ellipse; `threads` share the crystals. Raises `InputError` for a crystal or
    an angle that is not finite, a crystal that is not stable, or shapes that do not fit.

    Examples
    --------
    >>> copper = bi.stiffness("cubic", 168.4, 121.4, 75.4)
    >>> bi.halfspace_modulus(copper, [[0, 0, 0], [0, 54.7356, 45]]).round(1)
    array([134. , 151.6])
    """
    rows, shape = crystal_rows(stiffness, euler_deg)
    return call("crystal.theory", **rows, threads=threads)["values"][int(circular)].reshape(shape)


def rayleigh_velocity(
    stiffness: ArrayLike, euler_deg: ArrayLike, propagation_deg: ArrayLike, density_kg_m3: ArrayLike
) -> np.ndarray:
    """Speed in m/s of the surface (Rayleigh) wave of an anisotropic half-space; `rayleigh_modes`
    says whether the wave is detected. `stiffness` and `euler_deg` as in `halfspace_modulus`;
    `propagation_deg` (...), the direction in the surface, from the sample's x; `density_kg_m3`
    (...).

    Examples
    --------
    >>> copper = bi.stiffness("cubic", 168.4, 121.4, 75.4)
    >>> round(float(bi.rayleigh_velocity(copper, [0, 0, 0], 0, 8960)))
    2012
    """
    return rayleigh_modes(stiffness, euler_deg, propagation_deg, density_kg_m3)[0]


def rayleigh_modes(
    stiffness: ArrayLike, euler_deg: ArrayLike, propagation_deg: ArrayLike, density_kg_m3: ArrayLike
) -> np.ndarray:
    """Speed in m/s of the waves of `rayleigh_velocity`, that of the slowest bulk wave in the same
    direction, and the share of the normal component in the square of the displacement at the
    surface, (3, ...). A wave within 3 % of the bulk wave, or with a share below 0.2, is hardly
    excited: an instrument then detects the pseudo-surface wave.
    """
    rows, shape = crystal_rows(
        stiffness, euler_deg, propagation_deg=propagation_deg, density_kg_m3=density_kg_m3
    )
    if not (
        np.isfinite(rows["propagation_deg"] + rows["density_kg_m3"]).all()
        and (rows["density_kg_m3"] > 0).all()
    ):
        raise InputError(
            "a direction of propagation or a density is not finite, or a density is not "
            "positive (kg/m3)"
        )
    return call("crystal.waves", **rows)["values"].reshape(3, *shape)
