"""What the tests of Step 2 share: the reference data sets, the exact theory, and surrogates of
which little is known.
"""

import json

import numpy as np
import pytest
from scipy import stats

import bayesindent as bi
from bayesindent.crystal.elasticity import constant_names, stiffness_rows
from bayesindent.surrogate.basis import Basis
from support.csv_tables import numbers, row_named
from support.learner import spread_crystals, surrogate_of, terms_of
from support.measured_tables import read_measurements
from support.theory_cases import FILES, SYMMETRIES, theory_surrogate
from support.tree import REFERENCE

__all__ = [
    "KIND",
    "columns",
    "crystal",
    "default_prior",
    "parts_of",
    "reference",
    "rough_correction",
    "table_of",
]


#: What the reference moduli are, and the other moduli of tests, which have no laboratory.
KIND = {"modulus_kind": "indentation_modulus", "technique": "exact"}


def reference(symmetry):
    case = json.loads((REFERENCE / f"{FILES[symmetry]}.json").read_text())
    bounds = dict(zip(constant_names(symmetry), zip(*case["bounds"], strict=True), strict=True))
    return case, {
        "symmetry": symmetry,
        "bounds": bounds,
        "anisotropy_cap": case["anisotropy_cap"],
        **KIND,
    }


@pytest.fixture(scope="session", params=["cubic", "hexagonal"])
def symmetry(request):
    return request.param


@pytest.fixture(scope="session")
def surrogates():
    """The theory that the reference data sets were made with."""
    return dict.fromkeys(SYMMETRIES, bi.Surrogate.load("halfspace"))


def rough_correction(degree=2, directions=6, sd=0.01, beta=1e5, domain=None):
    """A correction of random coefficients, with an sd of y that comes from a few directions of
    these, which matter alike.
    """
    basis = Basis.from_keywords(domain=domain, model="correction", degree=degree)
    rng = np.random.default_rng(1)
    terms = terms_of(basis, *spread_crystals(basis, 1000, 3))[0]
    values, vectors = np.linalg.eigh(terms @ terms.T / 1000)
    root = (
        (vectors / np.sqrt(values))
        @ vectors.T
        @ np.linalg.qr(rng.normal(size=(basis.n_terms, directions)))[0]
    )
    covariance = sd**2 / directions * root @ root.T + 1e-14 * np.diag(1 / np.mean(terms**2, axis=1))
    coefficients = (
        rng.normal(size=basis.n_terms)
        * np.array([0.1, 0.05, 0.01, 0.003])[basis.polynomial_degrees.astype(int)]
    )
    return surrogate_of(basis, coefficients, covariance, beta=beta, fall=0.3)


@pytest.fixture(scope="session")
def rough():
    """Surrogates with few terms and large uncertainties, where these matter."""
    models = dict.fromkeys(
        [(symmetry, "correction") for symmetry in SYMMETRIES], rough_correction()
    )
    for symmetry in SYMMETRIES:
        model = theory_surrogate(symmetry, 2, 4, points=1500)
        root = np.random.default_rng(1).normal(size=(model.basis.n_terms, 6))
        covariance = 0.65**2 / model.basis.n_terms * root @ root.T
        models[symmetry, "paper"] = surrogate_of(
            model.basis, model.coefficients, covariance, beta=model.beta
        )
    return models


class References(dict):
    """The posteriors of the reference data sets by symmetry, each sampled when it is first asked
    for.
    """

    def __missing__(self, symmetry):
        self[symmetry] = bi.extract(
            REFERENCE / f"{FILES[symmetry]}.csv", samples=40000, **reference(symmetry)[1]
        )
        return self[symmetry]


@pytest.fixture(scope="session")
def results():
    return References()


class Summaries(dict):
    """What is said of them."""

    def __init__(self, results):
        super().__init__()
        self.results = results

    def __missing__(self, symmetry):
        self[symmetry] = bi.summary(self.results[symmetry])
        return self[symmetry]


@pytest.fixture(scope="session")
def documents(results):
    return Summaries(results)


def crystal(name):
    """Class and constants of a real crystal."""
    row = row_named(REFERENCE / "crystals.csv", name)
    return row["symmetry"], numbers([row], constant_names(row["symmetry"]))[0]


def columns(symmetry):
    points = read_measurements(REFERENCE / f"{FILES[symmetry]}.csv", symmetry, **KIND)
    return points.euler_deg, points.modulus_gpa, points.sd_gpa


def table_of(euler_deg, modulus_gpa, sd_gpa=None):
    return {"euler_deg": euler_deg, "modulus_gpa": modulus_gpa} | (
        {} if sd_gpa is None else {"sd_gpa": sd_gpa}
    )


def parts_of(stiffness):
    """Contrast log(3K/2G), log-anisotropy and scale of stiffnesses (n, 6, 6), by their
    logarithms.
    """
    values, vectors = kelvin_axes(stiffness)
    logarithm = vectors @ (np.log(values)[..., None] * np.swapaxes(vectors, -1, -2))
    trace = np.trace(logarithm, axis1=-2, axis2=-1)
    dilatation = logarithm[..., :3, :3].sum(axis=(-2, -1)) / 3
    shear = (trace - dilatation) / 5
    anisotropy = np.sqrt(
        np.maximum(0, (logarithm**2).sum(axis=(-2, -1)) - dilatation**2 - 5 * shear**2)
    )
    return dilatation - shear, anisotropy, trace / 6


def kelvin_axes(stiffness):
    """Eigenvalues and eigenvectors of Kelvin's matrix of stiffnesses (..., 6, 6)."""
    unit = np.diag([1, 1, 1, 2**0.5, 2**0.5, 2**0.5])
    return np.linalg.eigh(unit @ stiffness @ unit)


def log_volume(symmetry, constants):
    """log |d log K / d c| at constants (n, k), up to a number of the class: divided differences of
    the logarithm in K's own axes.
    """
    values, vectors = kelvin_axes(stiffness_rows(symmetry, constants))
    left, right = values[:, :, None], values[:, None, :]
    ratio = (left - right) / (left + right)
    safe = np.where(np.abs(ratio) < 1e-4, 0.5, ratio)
    quotient = (
        2 / (left + right) * np.where(safe == ratio, np.arctanh(safe) / safe, 1 + ratio**2 / 3)
    )
    unit = np.diag([1, 1, 1, 2**0.5, 2**0.5, 2**0.5])
    directions = unit @ stiffness_rows(symmetry, np.eye(len(constant_names(symmetry)))) @ unit
    turned = np.swapaxes(vectors, 1, 2)[:, None] @ directions @ vectors[:, None] * quotient[:, None]
    turned = turned.reshape(len(values), len(directions), 36)
    return np.linalg.slogdet(turned @ np.swapaxes(turned, 1, 2))[1] / 2


def default_prior(symmetry, constants, mean_modulus):
    """Logarithm of the density, of constants (n, k), where not all bounds are stated, up to a
    number.
    """
    contrast, anisotropy, scale = parts_of(stiffness_rows(symmetry, constants))
    # Of an isotropic solid with this modulus.
    young = mean_modulus * (1 - 0.3**2)
    middle = (np.log(young / (1 - 0.6)) + 5 * np.log(young / 1.3)) / 6
    density = (
        stats.norm(1.07, 0.6).logpdf(contrast)
        + stats.norm(middle, np.log(5)).logpdf(scale)
        + log_volume(symmetry, constants)
    )
    k = len(constant_names(symmetry)) - 2
    if k > 0:
        along = np.outer(anisotropy, np.eye(k)[0])
        density = density + stats.multivariate_t(shape=0.6**2 / k * np.eye(k), df=3).logpdf(along)
    return density
