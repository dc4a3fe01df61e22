"""How results lean on the prior, against runs with another prior; the evidence, against nested
sampling and plain integration.
"""

import json

import dynesty
import numpy as np
import pytest

import bayesindent as bi
from support.densities import DENSITY, PRIOR, Posterior
from support.diagnostics import of_code
from support.step_2_cases import KIND, columns, reference, table_of
from support.theory_cases import theory_surrogate

NAMES = ("C11", "C12", "C44")


@pytest.fixture(scope="module")
def model():
    """A surrogate that is soon evaluated."""
    return theory_surrogate("cubic", 2, 4, points=400)


def moments(result):
    draws = np.stack([result.posterior[name].values.ravel() for name in NAMES])
    return draws.mean(axis=1), draws.std(axis=1)


def changes_of(result):
    return {
        (row["name"], row.get("side"), row.get("to", 0) > row.get("from", 0)): row
        for row in bi.summary(result)["sensitivity"]
    }


@pytest.mark.long
def test_another_prior(surrogates):
    """Against chains of the other priors."""
    _, settings = reference("cubic")
    settings |= {"surrogate": surrogates["cubic"], "samples": 20000}
    table = table_of(*columns("cubic"))
    base = bi.extract(table, **settings)
    mean, sd = moments(base)
    changes = changes_of(base)
    low, high = (np.array(ends) for ends in zip(*settings["bounds"].values(), strict=True))
    assert {(name, side) for name, side, _ in changes if name != "measure"} == {
        *((name, side) for name in NAMES for side in ("lower", "upper")),
        ("anisotropy_cap", "upper"),
    }
    cases = {("measure", None, False): {"measure": "logarithms"}}
    for j in (1, 2):
        for out in (False, True):
            bounds = settings["bounds"] | {NAMES[j]: (low[j], high[j] * (1.1 if out else 0.9))}
            cases[NAMES[j], "upper", out] = {"bounds": bounds}
    shifts = {}
    for key, asked in cases.items():
        row = changes[key]
        other_mean, other_sd = moments(bi.extract(table, **(settings | asked)))
        shift = np.array([row["shift_sd"][name] for name in NAMES])
        shifts[key] = np.abs((other_mean - mean) / sd).max()
        assert row["exact"] == (not key[2])
        # Exact but for the noise of draws, of which a bound that cuts leaves some per cent; or an
        # estimate of what was not drawn.
        assert shift == pytest.approx((other_mean - mean) / sd, abs=0.06 if row["exact"] else 0.35)
        assert [row["sd_ratio"][name] for name in NAMES] == pytest.approx(
            other_sd / sd, abs=0.05 if row["exact"] else 0.2
        )
    # The bounds do matter here, and it is said which do most.
    assert shifts["C12", "upper", True] > 0.1
    assert shifts["C44", "upper", True] > 0.5
    first = of_code(bi.summary(base)["warnings"], "prior_matters", "measure_matters")[0]
    assert first["code"] == "prior_matters"
    assert " with the upper limit of C" in first["subject"]


@pytest.mark.long
def test_limits_where_not_all_bounds_are_stated(surrogates):
    """Without bounds there is no limit to move; with upper ones alone only these, and no other
    measure.
    """
    table, settings = (
        table_of(*columns("cubic")),
        {"surrogate": surrogates["cubic"], "symmetry": "cubic", "samples": 1000, **KIND},
    )
    assert changes_of(bi.extract(table, **settings)) == {}
    one = changes_of(bi.extract(table, bounds={"C11": (None, 250)}, **settings))
    assert {(name, side) for name, side, _ in one} == {(name, "upper") for name in NAMES}
    assert one["C11", "upper", False]["to"] == pytest.approx(225)


@pytest.mark.long
def test_nothing_is_told_where_the_data_decide():
    """Fifty grains, the bulk modulus known, and bounds far away."""
    rng = np.random.default_rng(2)
    angles = np.column_stack(
        [
            rng.uniform(0, 360, 50),
            np.degrees(np.arccos(rng.uniform(0, 1, 50))),
            rng.uniform(0, 360, 50),
        ]
    )
    moduli = bi.halfspace_modulus(
        np.repeat(bi.stiffness("cubic", C11=168.4, C12=121.4, C44=75.4)[None], 50, axis=0), angles
    )
    table = table_of(angles, moduli * (1 + 0.01 * rng.normal(size=50)), 0.01 * moduli)
    bounds = {"C11": (50, 400), "C12": (30, 300), "C44": (20, 200)}
    document = bi.summary(
        bi.extract(
            table,
            symmetry="cubic",
            bounds=bounds,
            knowledge={"bulk_modulus": (137.1, 1.0)},
            samples=3000,
            **KIND,
        )
    )
    assert not of_code(document["warnings"], "prior_matters", "measure_matters")
    assert (
        max(abs(value) for row in document["sensitivity"] for value in row["shift_sd"].values())
        < 0.1
    )


@pytest.mark.long
@pytest.mark.parametrize("case", ["plain", "knowledge and logarithms"])
def test_evidence(model, case):
    """Over the box dynesty's, and the mean of the likelihood over points of it; both less the share
    of the box that is in the prior.
    """
    _, settings = reference("cubic")
    bounds = settings["bounds"] | {"C44": (80.0, 140.0)}
    table = table_of(*columns("cubic"))
    asked = settings | {"surrogate": model, "surrogate_variance": "none", "bounds": bounds}
    if case != "plain":
        asked |= {"knowledge": {"bulk_modulus": (165.0, 5.0)}, "measure": "logarithms"}
    result = bi.extract(table, samples=4000, evidence=True, **asked)
    found = bi.summary(result)["evidence"]
    assert 0 < found["sd"] < 0.03
    posterior, prior = (Posterior.of(table, what=what, **asked) for what in (DENSITY, PRIOR))
    low, high = (np.array(ends) for ends in zip(*bounds.values(), strict=True))
    unit = np.random.default_rng(4).random((400_000, 3))
    alone = prior.evaluate(low + (high - low) * unit)[0]
    # The posterior is nowhere else but where its draws are.
    draws = np.stack([result.posterior[name].values.ravel() for name in NAMES])
    least, most = np.maximum(low, draws.min(axis=1) - 5), np.minimum(high, draws.max(axis=1) + 5)
    both = posterior.evaluate(least + (most - least) * unit)[0]
    weights = np.exp(both - both.max())
    assert weights.sum() ** 2 / (weights**2).sum() > 2500
    expected = (
        both.max()
        + np.log(weights.mean() * np.prod(most - least))
        - np.log(np.exp(alone).mean() * np.prod(high - low))
    )
    assert found["log_z"] == pytest.approx(expected, abs=0.08)
    if case == "plain":
        share = np.isfinite(alone).mean()
        sampler = dynesty.NestedSampler(
            lambda x: max(-1e30, posterior.evaluate(x)[1][0]),
            lambda u: low + (high - low) * u,
            3,
            nlive=300,
            rstate=np.random.default_rng(5),
        )
        sampler.run_nested(dlogz=0.1, print_progress=False)
        results = sampler.results
        assert results.logzerr[-1] < 0.25
        assert found["log_z"] == pytest.approx(
            results.logz[-1] - np.log(share), abs=4 * results.logzerr[-1]
        )


def test_evidence_tells_of_itself(model):
    """Only where it is asked for, with the word that it depends on the bounds."""
    asked = reference("cubic")[1] | {"surrogate": model, "samples": 1000}
    table = table_of(*columns("cubic"))
    with_it, without = (
        bi.summary(bi.extract(table, evidence=evidence, **asked)) for evidence in (True, False)
    )
    assert "evidence" not in without
    line = next(line for line in with_it["prior"]["words"] if line.startswith("evidence"))
    assert "depends on the limits" in line
    assert f"log Z = {with_it['evidence']['log_z']:.2f}" in line
    assert json.dumps(with_it["parameters"]) == json.dumps(without["parameters"])
