"""The two reference data sets, and the paper's model fitted to the half-space theory that they were
made with.
"""

import json

import numpy as np

from bayesindent.crystal.elasticity import (
    constant_names,
    halfspace_modulus,
    stiffness,
    stiffness_rows,
)
from bayesindent.surrogate.basis import Basis
from bayesindent.surrogate.surrogate import Surrogate
from support.learner import spread_crystals, surrogate_of, terms_of
from support.measured_tables import read_measurements
from support.paper_domains import DOMAINS
from support.tree import REFERENCE

__all__ = ["FILES", "SIZES", "SYMMETRIES", "Case", "theory_surrogate"]

SYMMETRIES = ("cubic", "hexagonal")

FILES = {"cubic": "cubic_fe3si", "hexagonal": "hex_titanium"}
#: Degree and bandlimit of the paper.
SIZES = {"cubic": (2, 10), "hexagonal": (2, 4)}


class Case:
    """A reference data set: surrogate, angles, moduli, sds, and the settings of its prior."""

    def __init__(self, symmetry: str):
        self.symmetry, self.names = symmetry, constant_names(symmetry)
        document = json.loads((REFERENCE / f"{FILES[symmetry]}.json").read_text())
        self.truth = np.array(document["truth"])
        self.lower, self.upper = np.array(document["bounds"])
        self.settings = {
            "bounds": dict(zip(self.names, zip(*document["bounds"], strict=True), strict=True)),
            "anisotropy_cap": document["anisotropy_cap"],
            "modulus_kind": "indentation_modulus",
        }
        self.table = read_measurements(
            REFERENCE / f"{FILES[symmetry]}.csv", symmetry, modulus_kind="indentation_modulus"
        )
        self.euler_deg, self.modulus_gpa, self.sd_gpa = (
            self.table.euler_deg,
            self.table.modulus_gpa,
            self.table.sd_gpa,
        )
        self.surrogate = theory_surrogate(symmetry, *SIZES[symmetry], points=6000)

    def theory(self, constants, euler_deg) -> np.ndarray:
        """Half-space moduli of one crystal in many orientations."""
        return halfspace_modulus(
            stiffness(self.symmetry, **dict(zip(self.names, constants, strict=True))), euler_deg
        )


def theory_surrogate(
    symmetry: str, degree: int, bandlimit: int, truncation: str = "tensor", points: int = 4000
) -> Surrogate:
    """The paper's model by least squares on half-space theory over the paper's domain; the
    covariance is that of the regression.
    """
    basis = Basis.from_keywords(
        symmetry,
        DOMAINS[symmetry],
        model="paper",
        truncation=truncation,
        degree=degree,
        bandlimit=bandlimit,
    )
    constants, angles = spread_crystals(basis, points, 2)
    y = halfspace_modulus(stiffness_rows(symmetry, constants), angles)
    terms, _ = terms_of(basis, constants, angles)
    values, vectors = np.linalg.eigh(terms @ terms.T)
    inverse = (vectors / np.maximum(values, 1e-8)) @ vectors.T
    coefficients = inverse @ (terms @ y)
    variance = np.mean((y - coefficients @ terms) ** 2)
    return surrogate_of(basis, coefficients, variance * inverse, beta=1 / variance)
