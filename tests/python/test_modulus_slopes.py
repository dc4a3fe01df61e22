"""Derivatives of moduli as observations of a regression, against the rows written out: differences
of the terms along the coordinates of the logarithm of the stiffness.
"""

import numpy as np
import pytest
from scipy.linalg import expm, logm
from scipy.spatial.transform import Rotation
from scipy.stats import multivariate_normal

import bayesindent as bi
from bayesindent.crystal.elasticity import stiffness_rows
from bayesindent.surrogate.basis import Basis
from support.learner import Learner, spread_crystals, spread_of, terms_of, to_y
from support.paper_domains import DOMAINS
from support.stroh import tensor

#: The paper's model, and corrections of 29 and 141 terms.
BASES = {
    "paper": Basis.from_keywords("cubic", DOMAINS["cubic"], model="paper", degree=1, bandlimit=4),
    "small": Basis.from_keywords(degree=2),
    "large": Basis.from_keywords(degree=3),
}
ROOTS = np.sqrt([1, 1, 1, 2, 2, 2])
KELVIN = np.outer(ROOTS, ROOTS)
UPPER = np.triu_indices(6)
VOIGT = ((0, 0), (1, 1), (2, 2), (1, 2), (0, 2), (0, 1))
STEP = 1e-4


def directions(basis):
    """Orthonormal symmetric matrices: a basis of the logarithms of all Kelvin stiffnesses, or of
    those of the class.
    """
    if basis.logarithmic:
        units = [np.eye(21)[k] for k in range(21)]
        matrices = [stiffness_rows("triclinic", [unit])[0] * KELVIN for unit in units]
    else:
        matrices = [stiffness_rows(basis.symmetry, [u])[0] * KELVIN for u in np.eye(3)]
    span = np.linalg.qr(np.reshape(matrices, (len(matrices), 36)).T)[0]
    return span.T.reshape(-1, 6, 6)


def in_other_axes(stiffness, turn):
    """A stiffness after a rotation of its axes, by its tensor."""
    turned = np.einsum("ai,bj,ck,dm,ijkm->abcd", turn, turn, turn, turn, tensor(stiffness))
    return np.array([[turned[i, j, k, m] for k, m in VOIGT] for i, j in VOIGT])


def axes_of(angles):
    """Rotation from crystal to sample axes."""
    return Rotation.from_euler("ZXZ", angles, degrees=True).as_matrix()


def rows_of(basis, constants, angles, modulus, gradient):
    """The terms of a crystal and of its derivatives, (n_terms, 1 + k), and y of them."""
    stiffness = stiffness_rows(basis.symmetry, [constants])[0]
    spread, logarithm = spread_of(basis, [stiffness])[0], logm(stiffness * KELVIN).real
    names = np.array(
        [[int(digit) - 1 for digit in name[1:]] for name in bi.constants(basis.symmetry)]
    )
    near = [(logarithm, np.zeros(3))]
    for matrix in directions(basis):
        near += [(logarithm + sign * STEP * matrix, np.zeros(3)) for sign in (-1, 1)]
    if not basis.logarithmic:
        for axis in np.eye(3)[1:]:
            near += [(logarithm, sign * np.degrees(STEP) * axis) for sign in (-1, 1)]
    crystals = [expm(log) / KELVIN for log, _ in near]
    euler = [angles + turn for _, turn in near]
    terms, scale = terms_of(basis, [c[tuple(names.T)] for c in crystals], euler)
    moduli = []
    for crystal, other in zip(crystals, euler, strict=True):
        turned = in_other_axes(crystal, axes_of(angles).T @ axes_of(other))
        moduli.append(modulus + gradient @ (turned - stiffness)[UPPER])
    y = to_y(basis, moduli, scale)
    rows = np.column_stack([terms[:, 0], (terms[:, 2::2] - terms[:, 1::2]) / (2 * STEP)]) / spread
    return rows, np.concatenate([y[:1], (y[2::2] - y[1::2]) / (2 * STEP)]) / spread


class Case:
    """A learner with n simulations and their derivatives, and its model written out."""

    def __init__(self, name, n, seed=1):
        self.basis, rng = BASES[name], np.random.default_rng(seed)
        self.constants, self.angles = spread_crystals(self.basis, n, seed)
        stiffness = stiffness_rows(self.basis.symmetry, self.constants)
        self.modulus = 1.1 * bi.halfspace_modulus(stiffness, self.angles)
        self.gradients = 0.3 * rng.normal(size=(n, 21))
        found = [self.rows(i) for i in range(n)]
        self.terms = np.column_stack([rows for rows, _ in found])
        self.y = np.concatenate([y for _, y in found])
        self.group = np.repeat(np.arange(n), len(found[0][1]))
        self.is_slope = np.concatenate([np.arange(len(y)) > 0 for _, y in found])
        self.learner = Learner(self.basis)
        self.learner.add(
            self.constants, self.angles, self.modulus, chosen=True, by_stiffness=self.gradients
        )
        self.unit = 1.0 if self.basis.logarithmic else 200.0

    def rows(self, i):
        point = self.constants[i], self.angles[i], self.modulus[i], self.gradients[i]
        return rows_of(self.basis, *point)

    def precision(self, beta, noise):
        return beta / np.where(self.is_slope, noise, 1.0) ** 2

    def posterior(self, alpha, beta, noise, used=slice(None)):
        weights, terms = self.precision(beta, noise)[used], self.terms[:, used]
        width = self.learner.values("prior_width")
        covariance = np.linalg.inv(alpha * np.diag(width**-2) + weights * terms @ terms.T)
        return covariance @ (weights * terms @ self.y[used]), covariance

    def density(self, alpha, beta, noise, width):
        prior = self.terms.T @ np.diag(width**2 / alpha) @ self.terms
        covariance = np.diag(1 / self.precision(beta, noise)) + prior
        return multivariate_normal(np.zeros(len(self.y)), covariance).logpdf(self.y)


@pytest.mark.parametrize("name, n", [("paper", 6), ("large", 3), ("large", 9)])
def test_the_posterior_is_the_conjugate_one(name, n):
    case = Case(name, n)
    alpha, beta = 2.0 / case.unit**2, 300.0 / case.unit**2
    case.learner.fit(alpha, beta)
    mean, covariance = case.posterior(alpha, beta, case.learner.precisions()["slope_noise"])
    assert case.learner.values("mean") == pytest.approx(mean, rel=1e-4, abs=1e-4 * case.unit)
    assert np.abs(case.learner.covariance() - covariance).max() <= 1e-4 * np.abs(covariance).max()


@pytest.mark.parametrize("name, n", [("paper", 8), ("large", 4)])
def test_the_noise_of_derivatives_is_that_of_largest_evidence(name, n):
    case = Case(name, n)
    case.learner.fit()
    found = case.learner.precisions()
    width = case.learner.values("prior_width")
    prior = -0.5 * ((np.log(found["fall"]) + 0.9) / 0.12) ** 2 if name == "large" else 0.0
    best = case.density(found["alpha"], found["beta"], found["slope_noise"], width)
    assert found["log_evidence"] == pytest.approx(best + prior, abs=1e-3)
    for factor in (0.8, 1.25):
        assert (
            case.density(factor * found["alpha"], found["beta"], found["slope_noise"], width) < best
        )
        assert (
            case.density(found["alpha"], factor * found["beta"], found["slope_noise"], width) < best
        )
    for factor in np.exp([-0.5, 0.5]):
        noise = factor * found["slope_noise"]
        # The tried values end there.
        if not -1.01 < np.log(noise) < 4.01:
            continue
        others = [
            case.density(ratio * found["alpha"], scale * found["beta"], noise, width)
            for ratio in (0.7, 1, 1.4)
            for scale in (0.6, 0.8, 1, 1.25, 1.6)
        ]
        assert max(others) < best + 1e-6


@pytest.mark.parametrize("name, n", [("paper", 6), ("large", 4), ("large", 9)])
def test_a_simulation_is_left_out_with_its_derivatives(name, n):
    case = Case(name, n)
    alpha, beta = 1.5 / case.unit**2, 2000.0 / case.unit**2
    case.learner.fit(alpha, beta)
    noise = case.learner.precisions()["slope_noise"]
    y, z, _ = case.learner.leave_out(np.arange(n))
    values = np.flatnonzero(~case.is_slope)
    for i in range(n):
        mean, covariance = case.posterior(alpha, beta, noise, case.group != i)
        terms = case.terms[:, values[i]]
        sd = np.sqrt(1 / beta + terms @ covariance @ terms)
        assert y[i] == pytest.approx(mean @ terms, rel=1e-3, abs=1e-5 * case.unit)
        assert z[i] == pytest.approx((case.y[values[i]] - mean @ terms) / sd, rel=1e-3, abs=1e-4)


@pytest.mark.parametrize("name", ["paper", "small"])
def test_choices_equal_exhaustive_search(name):
    """Each choice lowers the mean variance most, given the derivatives that come with it."""
    case = Case(name, 3)
    constants, angles = spread_crystals(case.basis, 25, 4)
    case.learner.set_candidates(constants, angles, "imse", with_slopes=True)
    alpha, beta = 1.0 / case.unit**2, 50.0 / case.unit**2
    case.learner.fit(alpha, beta)
    noise, slope = case.learner.precisions()["slope_noise"], np.ones(25)
    rows = [
        rows_of(case.basis, *point, 100.0, np.zeros(21))[0] / np.array([1.0] + [noise] * (m - 1))
        for point in zip(constants, angles, strict=True)
        for m in [len(case.y) // 3]
    ]
    terms = np.column_stack([block[:, 0] for block in rows])
    if case.basis.logarithmic:
        spread = spread_of(case.basis, stiffness_rows(case.basis.symmetry, constants))
        scale = terms_of(case.basis, constants, angles)[1]
        slope = spread * scale * np.exp(spread * (case.learner.values("mean") @ terms))

    def mean_variance(information):
        return np.sum(slope**2 * np.sum(terms * np.linalg.solve(information, terms), axis=0))

    information = np.linalg.inv(case.posterior(alpha, beta, noise)[1])
    chosen, _ = case.learner.choose(5)
    left = list(range(25))
    for choice in chosen:
        after = {j: mean_variance(information + beta * rows[j] @ rows[j].T) for j in left}
        assert after[choice] <= min(after.values()) * (1 + 1e-6)
        information = information + beta * rows[choice] @ rows[choice].T
        left.remove(choice)
    covariance = np.linalg.inv(information)
    assert case.learner.variances() == pytest.approx(
        np.sum(terms * (covariance @ terms), axis=0), rel=1e-4
    )


def test_a_polynomial_is_found_from_fewer_simulations_than_terms():
    """A correction of 141 terms from nine simulations and their derivatives."""
    basis, rng = BASES["large"], np.random.default_rng(3)
    degrees = np.asarray(basis.polynomial_degrees)
    coefficients = 0.02 * rng.normal(size=basis.n_terms) * 0.4**degrees

    def simulate(constants, angles):
        terms, scale = terms_of(basis, constants, angles)
        return scale * np.exp(coefficients @ terms)

    constants, angles = spread_crystals(basis, 9, 5)
    gradients = np.array(
        [
            (
                simulate(point + 1e-3 * np.eye(21), np.tile(euler, (21, 1)))
                - simulate(point - 1e-3 * np.eye(21), np.tile(euler, (21, 1)))
            )
            / 2e-3
            for point, euler in zip(constants, angles, strict=True)
        ]
    )
    unseen = spread_crystals(basis, 50, 6)
    errors = []
    for given in (None, gradients):
        learner = Learner(basis)
        learner.add(constants, angles, simulate(constants, angles), chosen=True, by_stiffness=given)
        learner.fit()
        stiffness = stiffness_rows(basis.symmetry, unseen[0])
        predicted = learner.surrogate().predict(stiffness, unseen[1])[0]
        errors.append(np.std(predicted / simulate(*unseen)))
    assert errors[1] < 0.2 * errors[0] and errors[1] < 5e-4


def test_derivatives_are_kept_with_the_surrogate():
    """And are used again when simulations are left out."""
    case = Case("large", 9)
    case.learner.fit()
    surrogate = case.learner.surrogate()
    np.testing.assert_allclose(surrogate.data["by_stiffness"], case.gradients)
    _, z = surrogate.leave_out(np.arange(9))
    expected = case.learner.leave_out(np.arange(9))[1]
    np.testing.assert_allclose(np.abs(z), np.abs(expected), rtol=1e-6)
