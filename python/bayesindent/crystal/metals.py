"""Pure metals that come with the package: their constants, and their known compressibilities."""

import csv
from functools import cache
from math import isclose
from pathlib import Path
from types import SimpleNamespace

import numpy as np

from .elasticity import constant_names, quantities

#: What experiments under pressure determine; where the two are equal, the bulk modulus suffices.
COMPRESSIBILITIES = ("compressibility[100]", "compressibility[001]")

#: Sd of these quantities relative to the largest of them: the differences between handbooks.
SPREAD = 0.03


@cache
def metals() -> dict[str, SimpleNamespace]:
    """The pure metals that come with the package, by symbol.

    Each has its `name`, the word for its `structure`, its crystal class (`symmetry`), its
    `constants` in GPa at room temperature, and their `source`.
    """
    text = (Path(__file__).parents[1] / "data" / "metals.csv").read_text(encoding="utf-8")
    rows = csv.DictReader(line for line in text.splitlines() if not line.startswith("#"))
    found = {}
    for row in rows:
        constants = {
            name: float(value) for name, value in row.items() if name[1:].isdigit() and value
        }
        found[row["symbol"]] = SimpleNamespace(**row, constants=constants)
    return found


def known_of(metal: SimpleNamespace) -> dict[str, tuple[float, float]]:
    """Mean and sd of the bulk modulus in GPa or, where a crystal has two compressibilities, of
    these in 1/TPa.
    """
    values = np.array([metal.constants[name] for name in constant_names(metal.symmetry)])
    names = ("bulk_modulus", *COMPRESSIBILITIES)
    bulk, along_a, along_c = map(float, quantities(metal.symmetry, values, names).values())
    if isclose(along_a, along_c, rel_tol=1e-9):
        return {"bulk_modulus": (bulk, SPREAD * bulk)}
    sd = SPREAD * max(along_a, along_c)
    return dict(zip(COMPRESSIBILITIES, ((along_a, sd), (along_c, sd))))
