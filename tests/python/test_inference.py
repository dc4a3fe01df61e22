"""Step 2, its density and its chains, against reference posteriors, closed forms, brute force and
itself.
"""

import copy

import arviz as az
import numpy as np
import pytest
from scipy import stats
from scipy.linalg import block_diag

import bayesindent as bi
from bayesindent.crystal.elasticity import constant_names, stiffness_rows
from support.densities import EXTRACTION, PRIOR, Posterior
from support.learner import spread_of, surrogate_of, terms_of
from support.step_2_cases import KIND, columns, crystal, reference, rough_correction, table_of
from support.theory_cases import SIZES, theory_surrogate
from support.tree import REFERENCE

# The reference posteriors


def test_posterior_meets_reference(symmetry, documents):
    case, _ = reference(symmetry)
    document = documents[symmetry]
    mean = np.array([document["parameters"][name]["mean"] for name in constant_names(symmetry)])
    sd = np.array([document["parameters"][name]["sd"] for name in constant_names(symmetry)])
    # Twice to three times what three seeds gave at most; the references are chains too.
    assert np.abs((mean - case["mean"]) / case["sd"]).max() < 0.05
    assert sd == pytest.approx(case["sd"], rel=0.03)
    assert np.abs(np.array(document["correlation"]) - case["corr"]).max() < 0.03
    predicted = np.array([item["mean"] for item in document["predicted"]])
    assert np.abs(predicted - case["predicted_mean"]).max() < 0.15
    assert [item["sd"] for item in document["predicted"]] == pytest.approx(
        case["predicted_sd"], rel=0.05
    )
    for item in document["parameters"].values():
        assert item["r_hat"] < 1.01
        assert item["ess_bulk"] > 20000
    assert document["theory"]["largest_error_sd"] < 0.02
    assert document["prior"]["share_covered"] == 1


#: Of 4 chains of 700,000 sweeps: least effective size, and four standard errors of the means (in
#: sds) and sds (relative) at that size.
@pytest.mark.long
@pytest.mark.parametrize(
    ("symmetry", "least", "mean", "sd"), [("cubic", 2000, 0.09, 0.05), ("hexagonal", 120, 0.3, 0.1)]
)
def test_the_papers_sampler_agrees(symmetry, least, mean, sd):
    surrogate = theory_surrogate(symmetry, *SIZES[symmetry])
    posterior = Posterior.of(
        table_of(*columns(symmetry)),
        surrogate=surrogate,
        surrogate_variance="none",
        **reference(symmetry)[1],
    )
    draws, _, acceptance = posterior.sample(
        method="scmh", samples=700_000, burn_in=20000, chains=4, threads=2, seed=5
    )
    expected, *_ = posterior.sample(
        method="ensemble", samples=20000, burn_in=8000, chains=4, threads=2, seed=6
    )
    assert acceptance == pytest.approx(0.23, abs=0.05)
    for j in range(draws.shape[-1]):
        assert az.ess(draws[:, ::35, j]) > least
        assert draws[..., j].mean() == pytest.approx(
            expected[..., j].mean(), abs=mean * expected[..., j].std()
        )
        assert draws[..., j].std() == pytest.approx(expected[..., j].std(), rel=sd)


@pytest.mark.long_where("hexagonal")
def test_bit_identical_for_any_number_of_threads(symmetry, surrogates):
    posterior = Posterior.of(
        table_of(*columns(symmetry)), surrogate=surrogates[symmetry], **reference(symmetry)[1]
    )
    for method in ("ensemble", "scmh"):
        runs = [
            posterior.sample(method=method, samples=100, burn_in=600, chains=4, threads=n, seed=3)
            for n in (1, 2, 4)
        ]
        for run in runs[1:]:
            for a, b in zip(runs[0], run, strict=True):
                assert np.array_equal(a, b)
        assert not np.array_equal(runs[0][0][0], runs[0][0][1])


# The density


def moduli_of(model, symmetry, c, angles):
    """Moduli of the model, GPa, dM/dy, and terms; a correction's theory is the exact one."""
    constants = np.repeat(np.atleast_2d(c), len(angles), axis=0)
    if model.symmetry == symmetry:
        terms, scale = terms_of(model.basis, constants, angles)
        m = model.coefficients @ terms
        assert scale == pytest.approx(1, rel=0)
        return m, np.ones_like(m), terms
    stiffness = stiffness_rows(symmetry, constants)
    terms, _ = terms_of(model.basis, stiffness[(slice(None), *np.triu_indices(6))], angles)
    m = bi.halfspace_modulus(stiffness, angles) * np.exp(model.coefficients @ terms)
    spread = spread_of(model.basis, stiffness)
    return m, m * spread, terms / spread


def brute_force(
    m, slope, terms, model, measured, sd, kind="indentation_modulus", full=True, calibration=0.0
):
    """Eq. 13 with the covariance written out, by dense algebra."""
    if kind == "effective_modulus":
        d = (1 - 0.07**2) / 1140.0
        slope, m = slope / (1 + d * m) ** 2, 1 / (1 / m + d)
    elif kind == "sample_modulus":
        slope, m = slope * (1 - 0.3**2), m * (1 - 0.3**2)
    v = np.diag(np.asarray(sd) ** 2)
    if full:
        design = terms * slope
        v = v + design.T @ model.covariance @ design + np.diag(slope**2) / model.beta
    v = v + calibration**2 * np.outer(m, m)
    return stats.multivariate_normal(m, v).logpdf(measured)


@pytest.mark.long_where("sample_modulus", "hexagonal")
@pytest.mark.parametrize("kind", ["indentation_modulus", "effective_modulus", "sample_modulus"])
@pytest.mark.parametrize("family", ["correction", "paper"])
@pytest.mark.parametrize(
    ("full", "calibration"), [(False, 0.0), (True, 0.0), (False, 0.03), (True, 0.03)]
)
def test_likelihood_is_the_dense_one(rough, symmetry, kind, family, full, calibration):
    model = rough[symmetry, family]
    case, settings = reference(symmetry)
    angles, measured, sd = columns(symmetry)
    posterior = Posterior.of(
        table_of(angles, measured, sd),
        surrogate=model,
        surrogate_variance="full" if full else "none",
        calibration_sd=calibration,
        **settings | {"modulus_kind": kind},
    )
    plain = Posterior.of(
        table_of(angles, measured, sd), surrogate=model, surrogate_variance="none", **settings
    )
    points = np.array(case["truth"]) * np.linspace(0.95, 1.0, 4)[:, None]
    _, likelihood = posterior.evaluate(points)
    for point, value in zip(points, likelihood, strict=True):
        m, slope, terms = moduli_of(model, symmetry, point, angles)
        # Of a correction the theory is read from its expansion, with an error of its own.
        read = plain.moduli([point], angles)[0][0]
        assert read == pytest.approx(m, rel=1e-3 if family == "correction" else 1e-10)
        expected = brute_force(
            read,
            slope * read / m if family == "correction" else slope,
            terms,
            model,
            measured,
            sd,
            kind,
            full,
            calibration,
        )
        assert value == pytest.approx(expected, rel=1e-8, abs=1e-6)


@pytest.mark.long_where("quartz", "Zn")
@pytest.mark.parametrize("name", ["forsterite", "quartz", "albite", "Zn"])
@pytest.mark.parametrize(
    "domain",
    [{}, {"stiffness_min_gpa": 30.0, "stiffness_max_gpa": 300.0}],
    ids=["any scale", "a range"],
)
def test_a_correction_of_all_classes_serves_each(name, domain):
    """The same with a covariance of full rank, of which the core keeps what matters."""
    model = rough_correction(degree=3, directions=141, sd=0.02, beta=1e8, domain=domain)
    rng = np.random.default_rng(6)
    angles = np.column_stack(
        [
            rng.uniform(0, 360, 8),
            np.degrees(np.arccos(rng.uniform(0, 1, 8))),
            rng.uniform(0, 360, 8),
        ]
    )
    symmetry, point = crystal(name)
    stiffness = stiffness_rows(symmetry, [point])[0]
    m, slope, terms = moduli_of(model, symmetry, point, angles)
    mean, sd = model.predict(np.repeat(stiffness[None], 8, axis=0), angles)
    assert mean == pytest.approx(m, rel=1e-9)
    variance = np.einsum("in,ij,jn->n", terms, model.covariance, terms) + 1 / model.beta
    assert sd == pytest.approx(slope * np.sqrt(variance), rel=1e-8)
    measured, noise = m * (1 + 0.02 * rng.normal(size=8)), np.full(8, 0.02 * m.mean())
    values = {}
    for full in (False, True):
        settings = {"symmetry": symmetry, "surrogate_variance": "full" if full else "none", **KIND}
        posterior = Posterior.of(table_of(angles, measured, noise), surrogate=model, **settings)
        values[full] = posterior.evaluate([point])[1][0]
        assert values[full] == pytest.approx(
            brute_force(m, slope, terms, model, measured, noise, full=full), abs=0.1
        )
    assert abs(values[True] - values[False]) > 0.02


def test_student_t_by_quadrature(rough):
    """Without common errors the product of densities; with a calibration error Laplace's
    approximation against the integral.
    """
    model = rough["cubic", "paper"]
    case, settings = reference("cubic")
    angles, measured, sd = columns("cubic")
    measured = measured.copy()
    measured[3] += 40.0
    settings |= {"surrogate_variance": "none", "likelihood": "student", "student_dof": 4.0}
    m, _, _ = moduli_of(model, "cubic", case["truth"], angles)
    _, value = Posterior.of(table_of(angles, measured, sd), surrogate=model, **settings).evaluate(
        case["truth"]
    )
    scale = np.asarray(sd) * np.sqrt(0.5)
    assert value[0] == pytest.approx(stats.t(4.0, m, scale).logpdf(measured).sum(), abs=1e-8)
    assert stats.t(4.0, m, scale).std() == pytest.approx(sd)
    _, value = Posterior.of(
        table_of(angles, measured, sd), surrogate=model, calibration_sd=0.02, **settings
    ).evaluate(case["truth"])
    e = np.linspace(-0.2, 0.2, 20001)
    density = (
        stats.t(4.0, m[:, None] * (1 + e), scale[:, None]).logpdf(measured[:, None]).sum(axis=0)
    )
    density = density + stats.norm(0, 0.02).logpdf(e)
    assert value[0] == pytest.approx(np.log(np.trapezoid(np.exp(density), e)), abs=0.03)


@pytest.mark.long
def test_inferred_scale(surrogates):
    angles, measured, sd = columns("cubic")
    _, settings = reference("cubic")
    known = Posterior.of(
        table_of(angles, measured, 2 * sd),
        surrogate=surrogates["cubic"],
        surrogate_variance="none",
        **settings,
    )
    inferred = Posterior.of(
        table_of(angles, measured, sd),
        surrogate=surrogates["cubic"],
        surrogate_variance="none",
        scale="inferred",
        **settings,
    )
    assert inferred.evaluate([225, 135, 118, np.log(2)])[1] == pytest.approx(
        known.evaluate([225, 135, 118])[1], rel=1e-12
    )
    result = bi.extract(
        {"euler_deg": angles, "modulus_gpa": measured},
        surrogate=surrogates["cubic"],
        scale="inferred",
        surrogate_variance="none",
        samples=3000,
        **settings,
    )
    # With a flat logarithm the sum of the squared residuals in units of the factor has the mean n,
    # whatever else there is.
    factor = result.posterior["sd_factor"].sel(draw=result.predictions.draw).values
    squares = ((result.predictions["modulus"].values - measured) ** 2).sum(axis=-1) / factor**2
    assert squares.mean() == pytest.approx(len(measured), abs=4 * np.sqrt(2 * len(measured) / 3000))
    with pytest.raises(bi.InputError, match="sd_gpa"):
        bi.extract(
            {"euler_deg": angles, "modulus_gpa": measured},
            surrogate=surrogates["cubic"],
            **settings,
        )


def test_knowledge(surrogates, symmetry):
    case, settings = reference(symmetry)
    data = table_of(*columns(symmetry))
    knowledge = {
        "C44": (110.0, 7.0),
        "bulk_modulus": (150.0, 3.0),
        "polycrystal_young": (200.0, 9.0),
        "polycrystal_poisson": (0.3, 0.02),
        "C12/C11": (0.6, 0.1),
        "young[110]": (230.0, 20.0),
    }
    if symmetry == "hexagonal":  # of a cubic crystal it says the same as the bulk modulus
        knowledge["compressibility[001]"] = (2.0, 0.1)
    plain = Posterior.of(data, surrogate=surrogates[symmetry], **settings).evaluate(case["truth"])[
        0
    ]
    value = Posterior.of(
        data, surrogate=surrogates[symmetry], knowledge=knowledge, **settings
    ).evaluate(case["truth"])[0]
    known = bi.quantities(symmetry, case["truth"], list(knowledge))
    assert value - plain == pytest.approx(
        -0.5 * sum(((known[key] - mean) / sd) ** 2 for key, (mean, sd) in knowledge.items())
    )


def from_the_prior(posterior, settings):
    """Points of a posterior by brute force: many of the flat prior, drawn again by their
    likelihoods.
    """
    rng = np.random.default_rng(3)
    low, high = np.array(list(settings["bounds"].values())).T
    points = low + (high - low) * rng.random((2_000_000, len(low)))
    density = posterior.evaluate(points)[0]
    weights = np.exp(density - density.max())
    # The sd of such a sample is known to some per cent.
    assert weights.sum() ** 2 / (weights**2).sum() > 1000
    return points[rng.choice(len(points), 20000, p=weights / weights.sum())]


@pytest.mark.long
def test_known_bulk_modulus_closes_the_hidden_direction(surrogates, documents):
    _, settings = reference("cubic")
    result = bi.extract(
        REFERENCE / "cubic_fe3si.csv",
        surrogate=surrogates["cubic"],
        knowledge={"bulk_modulus": (165.0, 3.3)},
        surrogate_variance="none",
        samples=4000,
        **settings,
    )
    assert documents["cubic"]["parameters"]["C12"]["sd"] > 24
    posterior = Posterior.of(
        table_of(*columns("cubic")),
        surrogate=surrogates["cubic"],
        knowledge={"bulk_modulus": (165.0, 3.3)},
        surrogate_variance="none",
        **settings,
    )
    assert result.posterior["C12"].values.std() == pytest.approx(
        from_the_prior(posterior, settings)[:, 1].std(), rel=0.05
    )
    assert result.posterior["C12"].values.std() < 7


@pytest.mark.long
@pytest.mark.parametrize("calibration_sd", [0.0, 0.03])
def test_calibration_error_widens_the_mean_modulus(surrogates, calibration_sd):
    """Against brute force; 3 % of 225 GPa are 6.8 GPa, less what the bounds forbid."""
    _, settings = reference("cubic")
    asked = settings | {"surrogate_variance": "none", "calibration_sd": calibration_sd}
    table = table_of(*columns("cubic"))
    result = bi.extract(table, surrogate=surrogates["cubic"], samples=4000, **asked)
    posterior = Posterior.of(table, surrogate=surrogates["cubic"], **asked)
    expected = (
        posterior.moduli(from_the_prior(posterior, settings), table["euler_deg"])[0]
        .mean(axis=1)
        .std()
    )
    assert result.predictions["modulus"].mean("grain").values.std() == pytest.approx(
        expected, rel=0.08
    )
    assert expected == pytest.approx({0.0: 1.35, 0.03: 6.5}[calibration_sd], rel=0.08)


@pytest.mark.parametrize("family", ["correction", "paper"])
def test_predictions_with_surrogate_uncertainty(rough, family):
    """The errors of the surrogate given the data, against the conditional normal distribution by
    dense algebra.
    """
    model = rough["cubic", family]
    case, settings = reference("cubic")
    angles, measured, sd = columns("cubic")
    new = np.array([[0.0, 0.0, 0.0], [0.0, 54.7356, 45.0]])
    posterior = Posterior.of(
        table_of(angles, measured, sd), surrogate=model, calibration_sd=0.02, **settings
    )
    moduli, factor = posterior.moduli(np.repeat([case["truth"]], 40000, axis=0), new, seed=4)
    every = np.vstack([angles, new])
    m, slope, terms = moduli_of(model, "cubic", case["truth"], every)
    design = terms * slope
    common = design.T @ model.covariance @ design
    n = len(angles)
    v = (
        common[:n, :n]
        + 0.02**2 * np.outer(m[:n], m[:n])
        + np.diag(sd**2 + slope[:n] ** 2 / model.beta)
    )
    # Of the two moduli and of the relative calibration error.
    cross = np.column_stack([common[:n, n:], 0.02**2 * m[:n]])
    mean = np.append(m[n:], 0.0) + cross.T @ np.linalg.solve(v, measured - m[:n])
    covariance = block_diag(common[n:, n:], 0.02**2) - cross.T @ np.linalg.solve(v, cross)
    drawn = np.column_stack([moduli, factor - 1])
    sds = np.sqrt(np.diag(covariance))
    # Of a correction the theory is read from its expansion.
    assert np.abs((drawn.mean(axis=0) - mean) / sds).max() < 4 / np.sqrt(40000) + (
        0.05 if family == "correction" else 0
    )
    assert np.cov(drawn.T) / np.outer(sds, sds) == pytest.approx(
        covariance / np.outer(sds, sds), abs=0.03
    )


def test_the_smallest_sds_have_a_density(rough):
    """Where the surrogate's errors are a million times the measurements', whose sums lose all
    digits.
    """
    model = rough["cubic", "paper"]
    case, settings = reference("cubic")
    angles, measured, _ = columns("cubic")
    sure = surrogate_of(model.basis, model.coefficients, model.covariance, beta=1e30)
    values = []
    for sd in (1e-4, 1e-6, 1e-8):
        posterior = Posterior.of(
            table_of(angles, measured, np.full(11, sd)), surrogate=sure, **settings
        )
        values.append(posterior.evaluate(case["truth"])[1][0] * sd**2)
    # Five harmonics cannot meet eleven moduli: the misfit that is left grows as 1/sd².
    assert values == pytest.approx([values[0]] * 3, rel=1e-3)
    assert values[0] < 0


@pytest.mark.long_where("hexagonal", "2")
@pytest.mark.parametrize("grains", [1, 2])
@pytest.mark.parametrize(
    "sampler",
    [
        {"samples": 300, "burn_in": 3000},
        {"samples": 10, "burn_in": 10, "chains": 1, "method": "scmh"},
    ],
)
def test_few_grains_and_few_draws(surrogates, symmetry, grains, sampler):
    angles, measured, sd = (values[:grains] for values in columns(symmetry))
    document = bi.summary(
        bi.extract(
            table_of(angles, measured, sd),
            surrogate=surrogates[symmetry],
            **sampler,
            **reference(symmetry)[1],
        )
    )
    assert len(document["predicted"]) == grains
    combinations = [row for row in document["identifiability"] if row["kind"] == "combination"]
    assert len(combinations) == len(document["parameters"])
    assert all(0 <= row["sd"] < row["prior_sd"] * 5 for row in combinations)
    assert combinations[0]["sd"] < 0.5 * combinations[0]["prior_sd"]


@pytest.mark.long
def test_one_bound_alone(surrogates):
    table = REFERENCE / "cubic_fe3si.csv"
    free, capped, floored = (
        bi.extract(
            table, symmetry="cubic", surrogate=surrogates["cubic"], samples=2000, **KIND, **settings
        )
        .posterior["C11"]
        .values
        for settings in ({}, {"bounds": {"C11": (None, 180)}}, {"bounds": {"C11": (230, None)}})
    )
    assert free.max() > 200
    assert capped.max() <= 180
    assert floored.min() >= 230
    assert floored.max() > 250


@pytest.mark.long
def test_prior_and_posterior_have_streams_of_their_own(surrogates):
    """The chains of the prior are not those that its density has with the posterior's seed."""
    settings = reference("cubic")[1] | {"seed": 3}
    table = table_of(*columns("cubic"))
    found = Posterior.of(table, surrogate=surrogates["cubic"], what=EXTRACTION, **settings).values[
        "prior_draws"
    ]
    prior = Posterior.of(table, surrogate=surrogates["cubic"], what=PRIOR, **settings)
    draws = prior.sample(
        method="ensemble", samples=2500, burn_in=5000, chains=4, threads=2, seed=3
    )[0]
    assert found.shape == draws.shape
    assert not np.isin(found, draws).any()


def test_a_density_is_frozen_and_not_copied(surrogates):
    posterior = Posterior.of(
        table_of(*columns("cubic")), surrogate=surrogates["cubic"], **reference("cubic")[1]
    )
    with pytest.raises(TypeError, match="cannot be copied"):
        copy.copy(posterior.analysis)
    with pytest.raises(AttributeError, match="frozen"):
        posterior.analysis.dimension = 7
    assert not {"predicted", "document"} & set(posterior.values), "Step 2 was not done"
