"""Evidence regression and sequential design against closed forms, brute force and direct densities,
on the terms of real bases.
"""

import numpy as np
import pytest
from scipy.optimize import minimize
from scipy.stats import multivariate_normal, norm

import bayesindent as bi
from bayesindent.crystal.elasticity import stiffness_rows
from bayesindent.surrogate.basis import Basis
from support.learner import Learner, spread_crystals, spread_of, terms_of, to_modulus, to_y
from support.paper_domains import DOMAINS
from support.words import words

#: The paper's model with Eq. 6: 8 products x 2 harmonics; corrections: 29 and 141 terms.
BASES = {
    "paper": Basis.from_keywords(
        "cubic", DOMAINS["cubic"], model="paper", degree=1, bandlimit=4, prior_sd="equal"
    ),
    "small": Basis.from_keywords("cubic", DOMAINS["cubic"], degree=2),
    "large": Basis.from_keywords(degree=3),
}


#: Degrees of the terms in the crystal; of the paper's those of the products, two harmonics each.
DEGREES = {
    name: getattr(basis, "polynomial_degrees", np.repeat([0, 1, 1, 1, 2, 2, 2, 3], 2))
    for name, basis in BASES.items()
}

#: Rules that choose the next simulation.
RULES = words("design", "variance_of")

#: Of the logarithm of the fall: the values that are tried, and centre and sd of its normal prior
#: (docs/verification/surrogate.md).
FALLS, TYPICAL, SD = np.linspace(-2.1, -0.15, 14), -0.9, 0.12


def free_width(degrees, fall):
    """The prior's widths: a term of degree 0 is almost free, the others fall."""
    return np.where(degrees == 0, 100.0, fall ** np.maximum(0, degrees - 1))


class Case:
    """A learner with n simulations, and its model written out: terms, y, and widths of the
    prior.
    """

    def __init__(self, name, n_data, noise=0.02, seed=1, wave=0.0):
        self.basis = BASES[name]
        self.learner = Learner(self.basis)
        self.constants, self.angles = spread_crystals(self.basis, n_data, seed)
        stiffness = stiffness_rows(self.basis.symmetry, self.constants)
        theory = bi.halfspace_modulus(stiffness, self.angles)
        self.spread = spread_of(self.basis, stiffness)
        self.terms, self.scale = terms_of(self.basis, self.constants, self.angles)
        rng = np.random.default_rng(seed)
        coefficients = wave * rng.normal(size=self.basis.n_terms) * 0.2 ** DEGREES[name]
        self.modulus = theory * np.exp(
            0.1 + coefficients @ self.terms + noise * rng.normal(size=n_data)
        )
        self.learner.add(self.constants, self.angles, self.modulus, chosen=True)
        self.y = to_y(self.basis, self.modulus, self.scale) / self.spread
        self.terms = self.terms / self.spread

    @property
    def width(self):
        return self.learner.values("prior_width")

    def closed_form(self, terms, y, alpha, beta):
        covariance = np.linalg.inv(alpha * np.diag(self.width**-2) + beta * terms @ terms.T)
        return covariance @ (beta * terms @ y), covariance

    def density(self, alpha, beta, width):
        """ln p(y) with the covariance written out: the evidence."""
        covariance = (
            np.eye(len(self.y)) / beta + self.terms.T @ np.diag(width**2 / alpha) @ self.terms
        )
        return multivariate_normal(np.zeros(len(self.y)), covariance).logpdf(self.y)

    @property
    def unit(self):
        """About the size of y, by which precisions are meant."""
        return 1.0 if self.basis.logarithmic else 200.0


@pytest.mark.parametrize(
    "name, n_data", [("paper", 40), ("paper", 10), ("small", 40), ("small", 12), ("large", 30)]
)
def test_posterior_is_the_conjugate_one(name, n_data):
    case = Case(name, n_data)
    alpha, beta = 2.0 / case.unit**2, 300.0 / case.unit**2
    case.learner.fit(alpha, beta)
    mean, covariance = case.closed_form(case.terms, case.y, alpha, beta)
    assert case.learner.values("mean") == pytest.approx(mean, rel=1e-7, abs=1e-8 * case.unit)
    assert np.abs(case.learner.covariance() - covariance).max() <= 1e-8 * np.abs(covariance).max()
    stiffness = stiffness_rows(case.basis.symmetry, case.constants)
    assert case.learner.surrogate().predict(stiffness, case.angles)[0] == pytest.approx(
        to_modulus(case.basis, mean @ case.terms * case.spread, case.scale), rel=1e-8
    )


@pytest.mark.parametrize("name", BASES)
def test_prior_falls_with_the_degree(name):
    case = Case(name, 20, wave=1.0)
    case.learner.fit()
    fall = case.learner.precisions()["fall"]
    if name == "paper":
        assert np.array_equal(case.width, np.ones(case.basis.n_terms))
    else:
        assert case.width == pytest.approx(free_width(DEGREES[name], fall), rel=1e-12)


@pytest.mark.long_where("small")
@pytest.mark.parametrize("name, n_data", [("paper", 60), ("small", 60), ("large", 40)])
def test_evidence_is_maximised(name, n_data):
    """Over alpha and beta at the fall that was found, and over the falls that are tried, each with
    a normal prior of its logarithm.
    """
    case = Case(name, n_data, noise=0.05, wave=1.0)
    learner = case.learner
    learner.fit()
    found = learner.precisions()
    best = minimize(
        lambda x: -case.density(*np.exp(x), case.width),
        np.log([found["alpha"] * 2, found["beta"] / 2]),
        method="Nelder-Mead",
        options={"xatol": 1e-9, "fatol": 1e-11, "maxiter": 4000},
    )
    assert [found["alpha"], found["beta"]] == pytest.approx(np.exp(best.x), rel=1e-3)
    # Far from there the covariance is singular to rounding: by its eigenvalues.
    values, vectors = np.linalg.eigh(case.terms.T @ np.diag(case.width**2) @ case.terms)
    alpha, beta = np.meshgrid(
        found["alpha"] * np.geomspace(1e-8, 1e8, 60), found["beta"] * np.geomspace(1e-4, 1e4, 60)
    )
    variance = 1 / beta[..., None] + np.maximum(0, values) / alpha[..., None]
    densities = norm(scale=np.sqrt(variance)).logpdf(vectors.T @ case.y).sum(axis=-1)
    assert densities.max() <= -best.fun + 1e-7
    if name == "paper":
        assert found["log_evidence"] == pytest.approx(-best.fun, abs=1e-6)
        return
    values = {}
    for log_fall in FALLS:
        width = free_width(DEGREES[name], np.exp(log_fall))
        result = minimize(
            lambda x, width=width: -case.density(*np.exp(x), width),
            np.log([found["alpha"], found["beta"]]),
            method="Nelder-Mead",
            bounds=[(None, None), (None, -2 * np.log(case.basis.least_noise))],
            options={"xatol": 1e-5, "fatol": 1e-7, "maxiter": 2000},
        )
        values[log_fall] = -result.fun - 0.5 * ((log_fall - TYPICAL) / SD) ** 2
    best_of_all = max(values, key=values.get)
    assert np.log(found["fall"]) == pytest.approx(best_of_all, abs=1e-9)
    assert found["log_evidence"] == pytest.approx(values[best_of_all], abs=1e-4)


def test_the_fall_is_learnt():
    """Coefficients that fall fast or slowly: the fall that is found goes with them, as far as
    experience lets it.
    """
    basis, found = BASES["large"], []
    constants, angles = spread_crystals(basis, 400, 3)
    terms, scale = terms_of(basis, constants, angles)
    rng = np.random.default_rng(5)
    normal, noise = rng.normal(size=basis.n_terms), 0.001 * rng.normal(size=400)
    for fall in np.exp([TYPICAL - 0.6, TYPICAL + 0.4]):
        learner = Learner(basis)
        y = 0.1 * normal * fall ** np.maximum(0, DEGREES["large"] - 1) @ terms + noise
        learner.add(constants, angles, to_modulus(basis, y, scale), chosen=True)
        learner.fit()
        found.append(np.log(learner.precisions()["fall"]))
    assert TYPICAL - 0.7 < found[0] < TYPICAL - 0.2
    assert TYPICAL + 0.1 < found[1] < TYPICAL + 0.5


@pytest.mark.parametrize("name", ["paper", "large"])
def test_noise_is_bounded_below(name):
    case = Case(name, 12, noise=0.0)
    case.learner.fit()
    assert case.learner.precisions()["beta"] <= case.basis.least_noise**-2 * (1 + 1e-12)


def test_more_than_two_thousand_updates_equal_a_refit():
    # Not a multiple of the interval at which the posterior is computed afresh; precisions of the
    # prior over eight decades.
    case = Case("large", 2499)
    assert (case.width.max() / case.width.min()) ** 2 > 1e5
    case.learner.fit(1e-2, 1e4)
    updated = Learner(case.basis)
    updated.fit(1e-2, 1e4)
    updated.add(case.constants, case.angles, case.modulus)
    for values, expected in (
        (updated.values("mean"), case.learner.values("mean")),
        (updated.covariance(), case.learner.covariance()),
    ):
        assert np.abs(values - expected).max() <= 1e-8 * np.abs(expected).max()


@pytest.mark.parametrize(
    "name, n_data", [("paper", 40), ("small", 40), ("small", 24), ("large", 24)]
)
def test_leaving_out_equals_brute_force(name, n_data):
    case = Case(name, n_data)
    alpha, beta = 1.5 / case.unit**2, 2000.0 / case.unit**2
    case.learner.fit(alpha, beta)
    for groups in (np.arange(n_data), np.random.default_rng(2).integers(0, 6, n_data)):
        y, z, error_gpa = case.learner.leave_out(groups)
        moduli = to_modulus(case.basis, y * case.spread, case.scale)
        assert error_gpa == pytest.approx(np.abs(moduli - case.modulus).mean(), rel=1e-6)
        for i in range(n_data):
            rest = groups != groups[i]
            mean, covariance = case.closed_form(case.terms[:, rest], case.y[rest], alpha, beta)
            predicted, sd = (
                mean @ case.terms[:, i],
                np.sqrt(1 / beta + case.terms[:, i] @ covariance @ case.terms[:, i]),
            )
            assert moduli[i] == pytest.approx(
                to_modulus(case.basis, predicted * case.spread[i], case.scale[i]), rel=1e-6
            )
            assert z[i] == pytest.approx((case.y[i] - predicted) / sd, rel=1e-5, abs=1e-6)


@pytest.mark.parametrize("rule", RULES)
def test_any_acquisition(rule):
    """What any rule does. It chooses no candidate twice. Its choices and their variances are the
    same bits on 1, 2 and 4 threads, and whether they are made at once or in parts. The stated
    variance of y is that given all earlier choices; it is positive, and no choice raises the
    variance of any candidate. The choices lower the largest variance of M and its mean more than
    as many random candidates do, and a copy of a chosen candidate is not the next choice.
    """
    case = Case("small", 12)
    constants, angles = spread_crystals(case.basis, 400, 4)
    terms, scale = terms_of(case.basis, constants, angles)
    spread = spread_of(case.basis, stiffness_rows(case.basis.symmetry, constants))
    alpha, beta = 1.0, 1e4

    def chosen_by(parts, threads=1):
        learner = Learner(case.basis)
        learner.add(case.constants, case.angles, case.modulus, chosen=True)
        learner.set_candidates(constants, angles, rule)
        learner.fit(alpha, beta)
        variances, found = [learner.variances()], []
        for count in parts:
            found.append(learner.choose(count, threads=threads))
            variances.append(learner.variances())
        chosen, stated = (np.concatenate(part) for part in zip(*found, strict=True))
        return chosen, stated, np.array(variances)

    chosen, stated, variances = chosen_by([1] * 12)
    assert len(set(chosen)) == 12 and 0 <= min(chosen) <= max(chosen) < 400
    for parts, threads in (([12], 1), ([12], 2), ([5, 7], 4)):
        again = chosen_by(parts, threads)
        assert chosen.tolist() == again[0].tolist() and stated.tolist() == again[1].tolist()
    assert np.all(stated > 0) and np.all(np.diff(variances, axis=0) <= 1e-12 * variances[0])
    assert stated == pytest.approx(variances[np.arange(12), chosen], rel=1e-9)

    def left(numbers):
        """The variance of log M at all candidates, given the data and some of them."""
        data = np.column_stack([case.terms, (terms / spread)[:, numbers]])
        return spread**2 * np.einsum(
            "ij,ik,kj->j",
            terms / spread,
            case.closed_form(data, np.zeros(data.shape[1]), alpha, beta)[1],
            terms / spread,
        )

    case.learner.fit(alpha, beta)
    assert variances[-1] * spread**2 == pytest.approx(left(chosen), rel=1e-6)
    predicted = to_modulus(case.basis, case.learner.values("mean") @ terms, scale)
    rng = np.random.default_rng(3)
    others = [left(rng.choice(400, 12, replace=False)) for _ in range(20)]
    for size in (np.max, np.mean):
        found = size(predicted**2 * left(chosen))
        assert found < np.median([size(predicted**2 * other) for other in others]), size
    constants[chosen[0]], angles[chosen[0]] = constants[chosen[1]], angles[chosen[1]]
    copied, *_ = chosen_by([12])
    assert not {chosen[0], chosen[1]} <= set(copied[:3])


@pytest.mark.parametrize("rule", RULES)
@pytest.mark.parametrize("name", ["paper", "small"])
def test_choices_equal_exhaustive_search(name, rule):
    case = Case(name, 20)
    constants, angles = spread_crystals(case.basis, 50, 4)
    terms, scale = terms_of(case.basis, constants, angles)
    case.learner.set_candidates(constants, angles, rule)
    alpha, beta = 1.0 / case.unit**2, 50.0 / case.unit**2
    case.learner.fit(alpha, beta)
    predicted = to_modulus(case.basis, case.learner.values("mean") @ terms, scale)
    spread = spread_of(case.basis, stiffness_rows(case.basis.symmetry, constants))
    terms = terms / spread
    # |dM/dy|.
    importance = predicted if case.basis.logarithmic else np.ones(50)
    importance = importance * spread

    def worth(covariance, j):
        """What the choice of j would take from the mean variance of all; or its own variance."""
        reach = covariance @ terms[:, j]
        if rule != "imse":
            return importance[j] ** 2 * terms[:, j] @ reach
        after = covariance - np.outer(reach, reach) / (1 / beta + terms[:, j] @ reach)
        before, left = (
            np.einsum("ij,ik,kj->j", terms, matrix, terms) for matrix in (covariance, after)
        )
        return np.sum(importance**2 * (before - left))

    # One by one and several at once.
    parts = [case.learner.choose(count) for count in (5, 1, 1, 4, 1, 19)]
    chosen, variance = (np.concatenate(part) for part in zip(*parts, strict=True))
    data, left = case.terms, list(range(50))
    for choice, stated in zip(chosen, variance, strict=True):
        _, covariance = case.closed_form(data, np.zeros(data.shape[1]), alpha, beta)
        best = max(left, key=lambda j: worth(covariance, j))
        assert choice == best or worth(covariance, choice) == pytest.approx(
            worth(covariance, best), rel=1e-9
        )
        assert stated == pytest.approx(terms[:, choice] @ covariance @ terms[:, choice], rel=1e-7)
        data = np.column_stack([data, terms[:, choice]])
        left.remove(choice)
    modulus = np.random.default_rng(4).uniform(100, 200, len(chosen))
    case.learner.add(constants[chosen], angles[chosen], modulus, chosen=True)
    case.learner.update()
    y = np.concatenate([case.y, to_y(case.basis, modulus, scale[chosen]) / spread[chosen]])
    mean, covariance = case.closed_form(data, y, alpha, beta)
    assert case.learner.values("mean") == pytest.approx(mean, rel=1e-6, abs=1e-7 * case.unit)
    assert case.learner.variances() == pytest.approx(
        np.einsum("ij,ik,kj->j", terms, covariance, terms), rel=1e-6
    )
    assert np.abs(case.learner.covariance() - covariance).max() <= 1e-7 * np.abs(covariance).max()


@pytest.mark.parametrize("rule", RULES)
def test_equal_candidates_lowest_first_and_threads_alike(rule):
    basis = BASES["small"]
    one, angle = (part[:1] for part in spread_crystals(basis, 1, 7))
    learner = Learner(basis)
    learner.set_candidates(np.repeat(one, 5, axis=0), np.repeat(angle, 5, axis=0), rule)
    assert learner.choose(3)[0].tolist() == [0, 1, 2]
    # Copies of the best candidate far apart among many others.
    constants, angles = spread_crystals(basis, 700, 8)
    best = Learner(basis)
    best.set_candidates(constants, angles, rule)
    best.fit(1.0, 1e-4)
    first = best.choose(1)[0][0]
    copies = [3, 260, 301, 555, 698]
    constants[copies], angles[copies] = constants[first], angles[first]
    learner = Learner(basis)
    learner.set_candidates(constants, angles, rule)
    learner.fit(1.0, 1e-4)
    order = [
        number for _ in range(4) for number in learner.choose(5)[0] if number in {*copies, first}
    ]
    expected = sorted({*copies, first})
    assert order and order == expected[: len(order)]
    sequences = []
    for threads in (1, 2, 4):
        learner = Learner(BASES["large"])
        learner.set_candidates(*spread_crystals(BASES["large"], 3000, 9), rule)
        learner.fit(1.0, 1e4)
        chosen, variance = learner.choose(20, threads=threads)
        sequences.append((chosen.tolist(), variance.tolist()))
    assert sequences[0] == sequences[1] == sequences[2]


def test_a_failed_choice_is_undone():
    case = Case("small", 20)
    case.learner.set_candidates(*spread_crystals(case.basis, 30, 4))
    case.learner.fit(1.0, 50.0)
    before = case.learner.variances()
    case.learner.choose(3)
    assert not np.allclose(case.learner.variances(), before, rtol=1e-3)
    case.learner.update(exactly=True)
    assert case.learner.variances() == pytest.approx(before, rel=1e-10)
