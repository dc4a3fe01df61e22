"""Evidence regression and sequential design against closed forms, brute force and direct densities."""

import numpy as np
import pytest
from scipy.optimize import minimize
from scipy.stats import multivariate_normal

from bayesindent.surrogate.surrogate import Design


def problem(n_terms, n_data, seed=0, noise=0.05):
    rng = np.random.default_rng(seed)
    terms = rng.normal(size=(n_terms, n_data))
    weights = 4.0 ** rng.integers(0, 4, n_terms)
    prior_mean = rng.normal(size=n_terms)
    coefficients = prior_mean + rng.normal(size=n_terms) / np.sqrt(weights)
    y = coefficients @ terms + noise * rng.normal(size=n_data)
    return terms, weights, prior_mean, y


def closed_form(terms, weights, prior_mean, y, alpha, beta):
    covariance = np.linalg.inv(alpha * np.diag(weights) + beta * terms @ terms.T)
    return covariance @ (alpha * weights * prior_mean + beta * terms @ y), covariance


@pytest.mark.parametrize("n_terms, n_data", [(12, 40), (40, 12), (5, 5)])
def test_posterior_is_the_conjugate_one(n_terms, n_data):
    terms, weights, prior_mean, y = problem(n_terms, n_data)
    design = Design(weights, prior_mean, 1e-3)
    design.add(terms, y)
    design.fit(2.0, 300.0)
    mean, covariance = closed_form(terms, weights, prior_mean, y, 2.0, 300.0)
    assert design.mean() == pytest.approx(mean, rel=1e-9, abs=1e-10)
    assert design.covariance() == pytest.approx(covariance, rel=1e-9, abs=1e-12)


@pytest.mark.parametrize("n_terms, n_data", [(12, 40), (40, 12)])
def test_evidence_is_the_density_of_the_data(n_terms, n_data):
    terms, weights, prior_mean, y = problem(n_terms, n_data)
    design = Design(weights, prior_mean, 1e-3)
    design.add(terms, y)
    for alpha, beta in [(1.0, 100.0), (30.0, 4.0), (1e-2, 1e3)]:
        covariance = np.eye(n_data) / beta + terms.T @ np.diag(1 / (alpha * weights)) @ terms
        expected = multivariate_normal(prior_mean @ terms, covariance).logpdf(y)
        assert design.evidence([alpha], [beta])[0] == pytest.approx(expected, rel=1e-8, abs=1e-6)


@pytest.mark.parametrize("n_terms, n_data", [(12, 60), (30, 25)])
def test_evidence_is_maximised(n_terms, n_data):
    terms, weights, prior_mean, y = problem(n_terms, n_data, seed=3, noise=0.3)
    design = Design(weights, prior_mean, 1e-3)
    design.add(terms, y)
    alpha, beta, evidence = design.fit()
    found = minimize(
        lambda x: -design.evidence([np.exp(x[0])], [np.exp(x[1])])[0],
        [0.0, 0.0],
        method="Nelder-Mead",
        options={"xatol": 1e-9, "fatol": 1e-11, "maxiter": 4000},
    )
    assert evidence == pytest.approx(-found.fun, abs=1e-7)
    assert [alpha, beta] == pytest.approx(np.exp(found.x), rel=1e-3)
    grid = np.meshgrid(np.geomspace(1e-4, 1e4, 60), np.geomspace(1e-2, 1e4, 60))
    assert np.all(design.evidence(grid[0].ravel(), grid[1].ravel()) <= evidence + 1e-9)


def test_noise_is_bounded_below():
    terms, weights, prior_mean, y = problem(40, 12, noise=0.0)
    design = Design(weights, prior_mean, 1e-2)
    design.add(terms, y)
    _, beta, _ = design.fit()
    assert beta <= 1e4 * (1 + 1e-12)


def test_more_than_two_thousand_updates_equal_a_refit():
    rng = np.random.default_rng(1)
    # Not a multiple of the interval at which the posterior is computed afresh.
    n_terms, n_data = 135, 2499
    # Terms of very different size and a weak prior: a hard case for covariance updates.
    terms = rng.normal(size=(n_terms, n_data)) * np.geomspace(1, 1e-3, n_terms)[:, None]
    y = rng.normal(size=n_terms) @ terms + 0.01 * rng.normal(size=n_data)
    updated = Design(np.ones(n_terms), np.zeros(n_terms), 1e-3)
    updated.fit(1e-2, 1e4)
    for k in range(n_data):
        updated.update(terms[:, k], y[k])
    refit = Design(np.ones(n_terms), np.zeros(n_terms), 1e-3)
    refit.add(terms, y)
    refit.fit(1e-2, 1e4)
    assert np.abs(updated.mean() - refit.mean()).max() <= 1e-8 * np.abs(refit.mean()).max()
    assert np.abs(updated.covariance() - refit.covariance()).max() <= 1e-8 * np.abs(refit.covariance()).max()


@pytest.mark.parametrize("n_terms, n_data", [(12, 40), (40, 24)])
def test_leaving_out_equals_brute_force(n_terms, n_data):
    terms, weights, prior_mean, y = problem(n_terms, n_data, noise=0.2)
    design = Design(weights, prior_mean, 1e-3)
    design.add(terms, y)
    alpha, beta = 1.5, 20.0
    design.fit(alpha, beta)
    rng = np.random.default_rng(2)
    for groups in (np.arange(n_data), rng.integers(0, 6, n_data)):
        residual, sd = design.leave_out(groups)
        for i in range(n_data):
            rest = groups != groups[i]
            mean, covariance = closed_form(terms[:, rest], weights, prior_mean, y[rest], alpha, beta)
            assert residual[i] == pytest.approx(y[i] - mean @ terms[:, i], rel=1e-7, abs=1e-9)
            assert sd[i] == pytest.approx(np.sqrt(1 / beta + terms[:, i] @ covariance @ terms[:, i]), rel=1e-7)


def test_choices_equal_exhaustive_search():
    terms, weights, prior_mean, y = problem(12, 20)
    rng = np.random.default_rng(4)
    candidates = rng.normal(size=(12, 50))
    importance = rng.uniform(0.5, 2.0, 50)
    design = Design(weights, prior_mean, 1e-3)
    design.add(terms, y)
    design.set_candidates(candidates)
    alpha, beta = 1.0, 50.0
    design.fit(alpha, beta)
    # Across the number of choices that are kept apart, one by one and several at once.
    parts = [design.choose(count, importance) for count in (5, 1, 1, 4, 1, 19)]
    chosen, variance = (np.concatenate(part) for part in zip(*parts, strict=True))
    data, left = terms, list(range(50))
    for choice, stated in zip(chosen, variance, strict=True):
        _, covariance = closed_form(data, weights, prior_mean, np.zeros(data.shape[1]), alpha, beta)
        values = np.einsum("ij,ik,kj->j", candidates, covariance, candidates)
        best = max(left, key=lambda j: importance[j] ** 2 * values[j])
        assert choice == best
        assert stated == pytest.approx(values[best], rel=1e-8)
        data = np.column_stack([data, candidates[:, best]])
        left.remove(best)
    values_chosen = rng.normal(size=len(chosen))
    design.add(candidates[:, chosen], values_chosen)
    design.settle()
    mean, covariance = closed_form(data, weights, prior_mean, np.concatenate([y, values_chosen]), alpha, beta)
    assert design.mean() == pytest.approx(mean, rel=1e-7, abs=1e-9)
    assert design.variances() == pytest.approx(np.einsum("ij,ik,kj->j", candidates, covariance, candidates), rel=1e-8)
    assert design.covariance() == pytest.approx(covariance, rel=1e-8, abs=1e-12)


def test_equal_candidates_lowest_first_and_threads_alike():
    rng = np.random.default_rng(7)
    base = rng.normal(size=(6, 1))
    design = Design(np.ones(6), np.zeros(6), 1e-3)
    design.set_candidates(np.repeat(base, 5, axis=1))
    assert design.choose(3)[0].tolist() == [0, 1, 2]
    # Copies far apart among many others, over more choices than are kept apart.
    many = rng.normal(size=(6, 700)) / 10
    copies = [3, 260, 301, 555, 698]
    many[:, copies] = base
    design = Design(np.ones(6), np.zeros(6), 0.5)
    design.set_candidates(many)
    order = [number for _ in range(4) for number in design.choose(5)[0] if number in copies]
    assert order == copies[: len(order)] and len(order) >= 3
    candidates = rng.normal(size=(20, 3000))
    sequences = []
    for threads in (1, 2, 4):
        design = Design(np.ones(20), np.zeros(20), 1e-3)
        design.set_candidates(candidates)
        chosen, variance = design.choose(60, threads=threads)
        sequences.append((chosen.tolist(), variance.tolist()))
    assert sequences[0] == sequences[1] == sequences[2]


def test_a_failed_choice_is_undone():
    terms, weights, prior_mean, y = problem(12, 20)
    design = Design(weights, prior_mean, 1e-3)
    design.add(terms, y)
    design.set_candidates(np.random.default_rng(4).normal(size=(12, 30)))
    design.fit(1.0, 50.0)
    before = design.variances()
    design.choose(3)
    assert not np.allclose(design.variances(), before, rtol=1e-3)
    design.settle(exactly=True)
    assert design.variances() == pytest.approx(before, rel=1e-10)
