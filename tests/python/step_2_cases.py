"""What the tests of Step 2 share: the reference data sets, and surrogates fitted to the half-space theory."""

import json

import numpy as np
import pytest
from theory_cases import FILES, SIZES, theory_surrogate

import bayesindent as bi
from bayesindent.crystal.elasticity import constant_names
from bayesindent.settings.problem import read_measurements
from conftest import REFERENCE

__all__ = ["columns", "reference", "table_of"]


def reference(symmetry):
    case = json.loads((REFERENCE / f"{FILES[symmetry]}.json").read_text())
    bounds = dict(zip(constant_names(symmetry), zip(*case["bounds"], strict=True), strict=True))
    return case, {"bounds": bounds, "anisotropy_cap": case["anisotropy_cap"]}


@pytest.fixture(scope="session", params=["cubic", "hexagonal"])
def symmetry(request):
    return request.param


@pytest.fixture(scope="session")
def surrogates():
    return {symmetry: theory_surrogate(symmetry, *SIZES[symmetry]) for symmetry in SIZES}


@pytest.fixture(scope="session")
def rough():
    """Surrogates with few terms and large uncertainties, where these matter."""
    models = {}
    for symmetry, coordinates, truncation in (
        ("cubic", "dimensionless", "total"), ("hexagonal", "dimensionless", "total"), ("cubic", "box", "tensor"), ("hexagonal", "box", "tensor"),
    ):  # fmt: skip
        model = theory_surrogate(symmetry, 2, 4, coordinates, truncation, 1500)
        root = np.random.default_rng(1).normal(size=(model.basis.n_terms, 6))
        size = (0.005 if coordinates == "dimensionless" else 0.5) / np.sqrt(model.basis.n_terms)
        model = bi.Surrogate(model.basis, model.coefficients, size**2 * root @ root.T, alpha=1.0, beta=model.beta, sd_inflation=1.3)
        models[symmetry, coordinates] = model
    return models


@pytest.fixture(scope="session")
def results(surrogates):
    """The reference data sets with surrogate uncertainty off."""
    return {
        symmetry: bi.extract(
            REFERENCE / f"{FILES[symmetry]}.csv",
            surrogate=surrogates[symmetry],
            surrogate_variance="none",
            samples=20000,
            **reference(symmetry)[1],
        )
        for symmetry in SIZES
    }


@pytest.fixture(scope="session")
def documents(results):
    return {symmetry: bi.summary(result) for symmetry, result in results.items()}


def columns(symmetry):
    points = read_measurements(REFERENCE / f"{FILES[symmetry]}.csv")
    return points.euler_deg, points.modulus_gpa, points.sd_gpa


def table_of(euler_deg, modulus_gpa, sd_gpa=None):
    return {"euler_deg": euler_deg, "modulus_gpa": modulus_gpa} | ({} if sd_gpa is None else {"sd_gpa": sd_gpa})
