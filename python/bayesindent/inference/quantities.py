"""Quantities of crystals by name: constants, averages, directional moduli, products of powers."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike

from ..core import call
from ..crystal.elasticity import stiffness_rows

__all__ = ["quantities", "quantity_names"]


def quantity_names(symmetry: str) -> dict[str, str]:
    """Quantities that are reported of a crystal and their units ('GPa', or '1' for ratios); the constants come first."""
    found = call("crystal.reported_quantities", symmetry=symmetry)
    return dict(zip(found["names"], found["units"], strict=True))


def quantities(symmetry: str, constants: ArrayLike, names: Sequence[str] | None = None) -> dict[str, np.ndarray]:
    """Quantities of stable crystals of a `symmetry`, constants (..., k) in GPa; each an array (...).

    `names`: any of the vocabulary of `&knowledge`, 'C33/C11', 'young[110]', 'compressibility[001]' (1/TPa), ..; without them those that
    are reported: constants, bulk modulus (of a single crystal under pressure, 1/S_iijj), averages of the polycrystal (Hill),
    anisotropy index (Eq. 14), and Young's moduli along directions that the crystal tells apart.
    """
    matrices = stiffness_rows(symmetry, constants)
    names = list(quantity_names(symmetry) if names is None else names)
    found = call("crystal.quantities", names=",".join(names), stiffness=matrices.reshape(-1, 6, 6))
    return {name: row.reshape(matrices.shape[:-2]) for name, row in zip(names, found["values"].T, strict=True)}
