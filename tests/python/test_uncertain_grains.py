"""Moduli that may be of several grains, each with a probability: the likelihood is the sum over them."""

import numpy as np
import pytest
from densities import Posterior
from scipy import special, stats

import bayesindent as bi

COPPER = (168.4, 121.4, 75.4)
EULER = np.array([[0.0, 0, 0], [10, 50, 45], [20, 20, 10], [40, 70, 30], [60, 54.7, 45]])
OTHER, THIRD = np.array([5.0, 4, 3]), np.array([30.0, 45, 0])
#: Probabilities of the second and third grain of the second row.
P2, P3 = 0.3, 0.1
SD = np.array([3.0, 3, 4, 3, 5])


def table_of(moduli, second=None):
    """With the second row of three grains, or of that of these angles."""
    euler = EULER.copy()
    euler[1] = EULER[1] if second is None else second
    columns = dict(zip(("phi1_deg", "Phi_deg", "phi2_deg"), euler.T.tolist(), strict=True))
    columns |= {"indentation_modulus_gpa": list(moduli), "sd_gpa": SD.tolist()}
    if second is None:
        for suffix, angles, p in (("_2", OTHER, P2), ("_3", THIRD, P3)):
            for name, value in (*zip(("phi1_deg", "Phi_deg", "phi2_deg"), angles, strict=True), ("probability", p)):
                columns[f"{name}{suffix}"] = ["", value, "", "", ""]
    return columns


def theory(euler):
    return bi.halfspace_modulus(bi.stiffness("cubic", *COPPER), euler)


def density(moduli, second=None, **asked):
    posterior = Posterior.of(table_of(moduli, second), symmetry="cubic", surrogate=bi.Surrogate.load("halfspace"), **asked)
    return posterior.evaluate([COPPER])[1][0]


def sum_over_grains(moduli, **asked):
    """Of densities with one grain each: exact, with errors that measurements share too, where these are normal."""
    alone = [density(moduli, second, **asked) for second in (EULER[1], OTHER, THIRD)]
    return special.logsumexp(alone, b=[1 - P2 - P3, P2, P3]), alone[0]


#: What was measured in the second row: the modulus of the first grain, of the second, or of neither.
MEASURED = ["first", "second", "between"]


def measured(which):
    moduli = theory(EULER)
    moduli[1] = {"first": moduli[1], "second": theory(OTHER), "between": 0.5 * (moduli[1] + theory(OTHER))}[which]
    return moduli + np.array([2.0, 1, -3, 2, 4])


@pytest.mark.parametrize("which", MEASURED)
@pytest.mark.parametrize("errors", [{"likelihood": "normal"}, {"likelihood": "student"}, {"orientation_sd_deg": 2.0, "scatter_sd": 0.01}])
def test_the_density_is_the_sum_over_grains(which, errors):
    moduli = measured(which)
    exact, alone = sum_over_grains(moduli, **errors)
    assert density(moduli, **errors) == pytest.approx(exact, abs=1e-9)
    assert abs(alone - exact) > 0.1


@pytest.mark.parametrize("which", MEASURED)
@pytest.mark.parametrize("sd", [0.005, 0.02])
def test_with_an_error_that_all_share(which, sd):
    """By Laplace's approximation, which is 0.1 off where an error of half the difference between two grains is as likely as either."""
    moduli = measured(which)
    exact, alone = sum_over_grains(moduli, calibration_sd=sd)
    assert density(moduli, calibration_sd=sd) == pytest.approx(exact, abs=0.12 if which == "between" else 0.02)
    assert abs(alone - exact) > 0.1


def test_the_posterior_is_that_of_importance_sampling():
    """Between bounds, by the exact theory at points of a wide Student's t, weighted; the second row decides between its grains."""
    moduli = measured("between")
    bounds = {"C11": (130, 210), "C12": (90, 150), "C44": (50, 100)}
    posterior = Posterior.of(table_of(moduli), symmetry="cubic", surrogate=bi.Surrogate.load("halfspace"), bounds=bounds)
    draws = posterior.sample(method="ensemble", samples=3000, burn_in=3000, chains=2, threads=2, seed=5)[0].reshape(-1, 3)
    proposal = stats.multivariate_t(draws.mean(axis=0), 1.3 * np.cov(draws.T), df=6, seed=3)
    x = proposal.rvs(4000)
    x = x[np.all([(low < values) & (values < high) for values, (low, high) in zip(x.T, bounds.values(), strict=True)], axis=0)]
    c = bi.stiffness("cubic", *x.T)
    x, c = x[stable := np.linalg.eigvalsh(c)[:, 0] > 0], c[stable]
    angles = np.vstack([EULER, OTHER, THIRD])
    rows = np.array([bi.halfspace_modulus(one, angles) for one in c])
    of = [0, 1, 2, 3, 4, 1, 1]
    logs = stats.norm.logpdf(moduli[of], rows, SD[of])
    second = special.logsumexp(logs[:, [1, 5, 6]], b=[1 - P2 - P3, P2, P3], axis=1)
    logs = logs[:, [0, 2, 3, 4]].sum(axis=1) + second - proposal.logpdf(x)
    weights = np.exp(logs - logs.max())
    weights /= weights.sum()
    assert 1 / (weights**2).sum() > 1000
    mean = weights @ x
    sd = np.sqrt(weights @ (x - mean) ** 2)
    assert np.abs((draws.mean(axis=0) - mean) / sd).max() < 0.15
    assert draws.std(axis=0) == pytest.approx(sd, rel=0.1)


@pytest.mark.long
@pytest.mark.parametrize("mixture", [True, False])
def test_calibration(mixture):
    """Sixty sets of indents near boundaries, of crystals of the prior: ranks of C44 are uniform; with the likelier grain alone they are not."""
    rng, bounds = np.random.default_rng(4), {"C11": (150, 190), "C12": (110, 135), "C44": (60, 90)}
    low, high = np.transpose(list(bounds.values()))
    ranks = []
    for seed in range(60):
        truth = rng.uniform(low, high)
        euler = np.degrees([np.arccos(rng.uniform(-1, 1, 20)) if j == 1 else rng.uniform(0, 2 * np.pi, 20) for j in range(3)]).T
        p = rng.uniform(0.1, 0.45, 10)
        swapped = rng.uniform(size=10) < p
        moduli = bi.halfspace_modulus(bi.stiffness("cubic", *truth), euler)
        moduli = np.where(swapped, moduli[10:], moduli[:10]) + rng.normal(size=10) * 2.0
        table = dict(zip(("phi1_deg", "Phi_deg", "phi2_deg"), euler[:10].T.tolist(), strict=True))
        table |= {"indentation_modulus_gpa": moduli.tolist(), "sd_gpa": [2.0] * 10}
        if mixture:
            table |= dict(zip(("phi1_deg_2", "Phi_deg_2", "phi2_deg_2"), euler[10:].T.tolist(), strict=True)) | {
                "probability_2": p.tolist()
            }
        posterior = Posterior.of(table, symmetry="cubic", surrogate=bi.Surrogate.load("halfspace"), bounds=bounds)
        draws = posterior.sample(method="ensemble", samples=500, burn_in=1000, chains=2, threads=2, seed=seed)[0].reshape(-1, 3)
        ranks.append(np.mean(draws[:, 2] < truth[2]))
    assert (stats.kstest(ranks, "uniform").pvalue > 0.01) == mixture


@pytest.mark.parametrize(
    ("column", "value", "words"),
    [
        ("probability_2", 0.0, "has all of phi1_deg_2, Phi_deg_2, phi2_deg_2 and a probability_2 above 0, or none"),
        ("Phi_deg_3", "", "has all of phi1_deg_3"),
        ("probability_2", 1.5, "allowed 0.0 to 1.0"),
        ("probability_2", 0.95, "in all; allowed up to 0.99"),
    ],
)
def test_refusals(column, value, words):
    table = table_of(theory(EULER))
    table[column][1] = value
    with pytest.raises(bi.InputError, match=words):
        bi.Problem.from_keywords("f", {"measurements": table}, problem={"symmetry": "cubic"})


def test_what_may_be_of_other_grains_is_combined_with_none():
    table = table_of(theory(EULER)) | {"grain": ["a", "b", "b", "c", "c"]}
    for j, name in enumerate(("phi1_deg", "Phi_deg", "phi2_deg")):
        table[name] = [EULER[i, j] for i in (0, 1, 1, 3, 3)]
    assert len(bi.Problem.from_keywords("f", {"measurements": table}, problem={"symmetry": "cubic"}).measurements) == 4
