"""Quantities of crystals by name: constants, averages, directional moduli, products of powers."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike

from ..core import call

__all__ = ["quantities", "quantity_names"]


def quantity_names(symmetry: str) -> dict[str, str]:
    """Quantities that are reported of a crystal and their units ('GPa', or '1' for ratios); the constants come first."""
    found = call("crystal.quantities", symmetry=symmetry)
    return dict(zip(found["names"], found["units"], strict=True))


def quantities(symmetry: str, constants: ArrayLike, names: Sequence[str] | None = None) -> dict[str, np.ndarray]:
    """Quantities of stable crystals of a `symmetry`, constants (..., k) in GPa; each an array (...).

    `names`: any of the vocabulary of `&knowledge`, 'C33/C11', 'young[110]', 'compressibility[001]' (1/TPa), ..; without them those that
    are reported: constants, bulk modulus (of a single crystal under pressure, 1/S_iijj), averages of the polycrystal (Hill),
    anisotropy index (Eq. 14), and Young's moduli along directions that the crystal tells apart.
    """
    values = np.asarray(constants, dtype=float)
    names = list(quantity_names(symmetry) if names is None else names)
    n = values.shape[-1]
    found = call("crystal.quantities", symmetry=symmetry, names="\n".join(names), n_constants=n, constants=values.reshape(-1, n))
    return {name: row.reshape(values.shape[:-1]) for name, row in zip(names, found["values"].T, strict=True)}
