"""Pure metals that come with the package: their constants, and what handbooks know of them."""

import csv
from functools import cache
from math import isclose
from pathlib import Path
from types import SimpleNamespace

import numpy as np

from .elasticity import constant_names, quantities

#: What pressure tells of a crystal: the bulk modulus, and by it alone where these are equal.
COMPRESSIBILITIES = ("compressibility[100]", "compressibility[001]")

#: Relative sd of these quantities: what handbooks differ by, of the largest of them.
SPREAD = 0.03


@cache
def metals() -> dict[str, SimpleNamespace]:
    """The pure metals that come with the package by their symbols: the `name`, the word for its
    `structure`, the crystal class (`symmetry`), the `constants` in GPa at room temperature, and
    their `source`.
    """
    text = (Path(__file__).parents[1] / "data" / "metals.csv").read_text(encoding="utf-8")
    rows = csv.DictReader(line for line in text.splitlines() if not line.startswith("#"))
    constants = (
        (row, {name: float(value) for name, value in row.items() if name[1:].isdigit() and value})
        for row in rows
    )
    return {row["symbol"]: SimpleNamespace(**row, constants=own) for row, own in constants}


def known_of(metal: SimpleNamespace) -> dict[str, tuple[float, float]]:
    """Mean and sd of what high pressure tells: bulk modulus in GPa, or compressibilities in
    1/TPa.
    """
    values = np.array([metal.constants[name] for name in constant_names(metal.symmetry)])
    means = {
        name: float(value)
        for name, value in quantities(
            metal.symmetry, values, ("bulk_modulus", *COMPRESSIBILITIES)
        ).items()
    }
    isotropic = isclose(*(means[name] for name in COMPRESSIBILITIES), rel_tol=1e-9)
    known = ("bulk_modulus",) if isotropic else COMPRESSIBILITIES
    return {name: (means[name], SPREAD * max(means[other] for other in known)) for name in known}
