"""Evidence regression and sequential design against closed forms, brute force and direct densities, on the terms of real bases."""

import numpy as np
import pytest
from paper_domains import DOMAINS
from scipy.optimize import minimize
from scipy.stats import multivariate_normal

import bayesindent as bi
from bayesindent.crystal.elasticity import stiffness_rows
from bayesindent.surrogate.basis import Basis
from bayesindent.surrogate.learner import Learner

CUBIC = DOMAINS["cubic"]
#: 12 and 60 terms.
SMALL, LARGE = (2, 4), (4, 8)


def crystals(n, seed=0):
    return CUBIC.crystals(n, seed)


class Case:
    """A learner with n simulations, and its model written out: terms, y, weights and mean of the prior."""

    def __init__(self, size, n_data, prior="theory", noise=0.02, seed=1):
        self.basis = Basis(CUBIC, "dimensionless", "total", *size)
        self.learner = Learner(self.basis, prior)
        self.constants, self.angles = crystals(n_data, seed)
        theory = bi.halfspace_modulus(stiffness_rows("cubic", self.constants), self.angles)
        self.modulus = theory * np.exp(0.1 + noise * np.random.default_rng(seed).normal(size=n_data))
        self.learner.add(self.constants, self.angles, self.modulus, chosen=True)
        self.terms, self.scale = self.basis.terms(self.constants, self.angles)
        self.y = self.basis.to_y(self.modulus, self.scale)
        self.weights, self.prior_mean = self.learner.values("weights"), self.learner.values("prior_mean")

    def closed_form(self, terms, y, alpha, beta):
        covariance = np.linalg.inv(alpha * np.diag(self.weights) + beta * terms @ terms.T)
        return covariance @ (alpha * self.weights * self.prior_mean + beta * terms @ y), covariance


@pytest.mark.parametrize("prior", ["zero", "theory"])
@pytest.mark.parametrize("size, n_data", [(SMALL, 40), (LARGE, 12), (SMALL, 12)])
def test_posterior_is_the_conjugate_one(size, n_data, prior):
    case = Case(size, n_data, prior)
    case.learner.fit(2.0, 300.0)
    mean, covariance = case.closed_form(case.terms, case.y, 2.0, 300.0)
    assert case.learner.values("mean") == pytest.approx(mean, rel=1e-8, abs=1e-9)
    assert case.learner.covariance() == pytest.approx(covariance, rel=1e-8, abs=1e-11)
    assert case.learner.predict(case.constants, case.angles) == pytest.approx(case.scale * np.exp(mean @ case.terms), rel=1e-9)


@pytest.mark.parametrize("size, n_data", [(SMALL, 40), (LARGE, 12)])
def test_evidence_is_the_density_of_the_data(size, n_data):
    case = Case(size, n_data)
    for alpha, beta in [(100.0, 100.0), (3e3, 4.0), (10.0, 1e3)]:
        covariance = np.eye(n_data) / beta + case.terms.T @ np.diag(1 / (alpha * case.weights)) @ case.terms
        expected = multivariate_normal(case.prior_mean @ case.terms, covariance).logpdf(case.y)
        assert case.learner.evidence([alpha], [beta])[0] == pytest.approx(expected, rel=1e-8, abs=1e-6)


@pytest.mark.parametrize("size, n_data", [(SMALL, 60), (LARGE, 25)])
def test_evidence_is_maximised(size, n_data):
    learner = Case(size, n_data, noise=0.1).learner
    learner.fit()
    found = learner.precisions()
    best = minimize(
        lambda x: -learner.evidence([np.exp(x[0])], [np.exp(x[1])])[0],
        np.log([found["alpha"] * 2, found["beta"] / 2]),
        method="Nelder-Mead",
        options={"xatol": 1e-9, "fatol": 1e-11, "maxiter": 4000},
    )
    assert found["log_evidence"] == pytest.approx(-best.fun, abs=1e-7)
    assert [found["alpha"], found["beta"]] == pytest.approx(np.exp(best.x), rel=1e-3)
    grid = np.meshgrid(np.geomspace(1e-4, 1e8, 60), np.geomspace(1e-2, 1e6, 60))
    assert np.all(learner.evidence(grid[0].ravel(), grid[1].ravel()) <= found["log_evidence"] + 1e-9)


def test_noise_is_bounded_below():
    case = Case(LARGE, 12, noise=0.0)
    case.learner.fit()
    assert case.learner.precisions()["beta"] <= case.basis.least_noise**-2 * (1 + 1e-12)


def test_more_than_two_thousand_updates_equal_a_refit():
    # Not a multiple of the interval at which the posterior is computed afresh; precisions of the prior over five decades.
    case = Case(LARGE, 2499)
    assert case.weights.max() / case.weights.min() > 1e7
    case.learner.fit(1e-2, 1e4)
    updated = Learner(case.basis, "theory")
    updated.fit(1e-2, 1e4)
    updated.add(case.constants, case.angles, case.modulus)
    for values, expected in (
        (updated.values("mean"), case.learner.values("mean")),
        (updated.covariance(), case.learner.covariance()),
    ):
        assert np.abs(values - expected).max() <= 1e-8 * np.abs(expected).max()


@pytest.mark.parametrize("size, n_data", [(SMALL, 40), (LARGE, 24)])
def test_leaving_out_equals_brute_force(size, n_data):
    case = Case(size, n_data)
    alpha, beta = 1.5, 2000.0
    case.learner.fit(alpha, beta)
    for groups in (np.arange(n_data), np.random.default_rng(2).integers(0, 6, n_data)):
        modulus, z = case.learner.leave_out(groups)
        for i in range(n_data):
            rest = groups != groups[i]
            mean, covariance = case.closed_form(case.terms[:, rest], case.y[rest], alpha, beta)
            predicted, sd = mean @ case.terms[:, i], np.sqrt(1 / beta + case.terms[:, i] @ covariance @ case.terms[:, i])
            assert modulus[i] == pytest.approx(case.scale[i] * np.exp(predicted), rel=1e-7)
            assert z[i] == pytest.approx((case.y[i] - predicted) / sd, rel=1e-6, abs=1e-7)
    with pytest.raises(bi.InputError, match=f"each of {n_data} simulations"):
        case.learner.leave_out([1, 2])


@pytest.mark.parametrize("rule", ["modulus", "log_modulus"])
def test_choices_equal_exhaustive_search(rule):
    case = Case(SMALL, 20)
    constants, angles = crystals(50, seed=4)
    terms, scale = case.basis.terms(constants, angles)
    case.learner.set_candidates(constants, angles, rule)
    alpha, beta = 1.0, 50.0
    case.learner.fit(alpha, beta)
    importance = scale * np.exp(case.learner.values("mean") @ terms) if rule == "modulus" else np.ones(50)
    # Across the number of choices that are deferred, one by one and several at once.
    parts = [case.learner.choose(count) for count in (5, 1, 1, 4, 1, 19)]
    chosen, variance = (np.concatenate(part) for part in zip(*parts, strict=True))
    data, left = case.terms, list(range(50))
    for choice, stated in zip(chosen, variance, strict=True):
        _, covariance = case.closed_form(data, np.zeros(data.shape[1]), alpha, beta)
        values = np.einsum("ij,ik,kj->j", terms, covariance, terms)
        best = max(left, key=lambda j: importance[j] ** 2 * values[j])
        assert choice == best
        assert stated == pytest.approx(values[best], rel=1e-8)
        data = np.column_stack([data, terms[:, best]])
        left.remove(best)
    modulus = np.random.default_rng(4).uniform(100, 200, len(chosen))
    case.learner.add(constants[chosen], angles[chosen], modulus, chosen=True)
    case.learner.update()
    y = np.concatenate([case.y, case.basis.to_y(modulus, scale[chosen])])
    mean, covariance = case.closed_form(data, y, alpha, beta)
    assert case.learner.values("mean") == pytest.approx(mean, rel=1e-7, abs=1e-8)
    assert case.learner.variances(50) == pytest.approx(np.einsum("ij,ik,kj->j", terms, covariance, terms), rel=1e-7)
    assert case.learner.covariance() == pytest.approx(covariance, rel=1e-7, abs=1e-11)


def test_equal_candidates_lowest_first_and_threads_alike():
    basis = Basis(CUBIC, "dimensionless", "total", *SMALL)
    one, angle = (part[:1] for part in crystals(1, seed=7))
    learner = Learner(basis, "zero")
    learner.set_candidates(np.repeat(one, 5, axis=0), np.repeat(angle, 5, axis=0))
    assert learner.choose(3)[0].tolist() == [0, 1, 2]
    # Copies of the farthest candidate far apart among many others.
    constants, angles = crystals(700, seed=8)
    best = Learner(basis, "zero")
    best.set_candidates(constants, angles)
    first = best.choose(1)[0][0]
    copies = [3, 260, 301, 555, 698]
    constants[copies], angles[copies] = constants[first], angles[first]
    learner = Learner(basis, "zero")
    learner.set_candidates(constants, angles)
    learner.fit(1.0, 1e-4)
    order = [number for _ in range(4) for number in learner.choose(5)[0] if number in {*copies, first}]
    expected = sorted({*copies, first})
    assert order == expected[: len(order)] and len(order) >= 3
    sequences = []
    for threads in (1, 2, 4):
        learner = Learner(Basis(CUBIC, "dimensionless", "total", *LARGE), "theory")
        learner.set_candidates(*crystals(3000, seed=9))
        chosen, variance = learner.choose(60, threads=threads)
        sequences.append((chosen.tolist(), variance.tolist()))
    assert sequences[0] == sequences[1] == sequences[2]


def test_a_failed_choice_is_undone():
    case = Case(SMALL, 20)
    case.learner.set_candidates(*crystals(30, seed=4))
    case.learner.fit(1.0, 50.0)
    before = case.learner.variances(30)
    case.learner.choose(3)
    assert not np.allclose(case.learner.variances(30), before, rtol=1e-3)
    case.learner.update(exactly=True)
    assert case.learner.variances(30) == pytest.approx(before, rel=1e-10)
