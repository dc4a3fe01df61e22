"""Step 2 against reference posteriors, closed forms, brute force and itself."""

import copy
import json

import arviz as az
import numpy as np
import pytest
from paper_domains import DOMAINS
from scipy import stats
from scipy.linalg import block_diag

import bayesindent as bi
from bayesindent.crystal.elasticity import constant_names, stiffness_rows
from bayesindent.inference.measurements import measurements_of
from bayesindent.inference.posterior import EXTRACTION, PRIOR, Posterior
from bayesindent.inference.quantities import quantity_names
from bayesindent.pipeline.step_2 import extract_stage, next_stage
from bayesindent.settings.problem import read_measurements
from bayesindent.surrogate.basis import Basis
from conftest import REFERENCE

NAMES = {"cubic": "cubic_fe3si", "hexagonal": "hex_titanium"}
SIZES = {"cubic": (6, 10), "hexagonal": (5, 8)}


def reference(symmetry):
    case = json.loads((REFERENCE / f"{NAMES[symmetry]}.json").read_text())
    bounds = dict(zip(constant_names(symmetry), zip(*case["bounds"], strict=True), strict=True))
    return case, {"bounds": bounds, "anisotropy_cap": case["anisotropy_cap"]}


def theory_surrogate(symmetry, degree, bandlimit, coordinates="dimensionless", points=4000, truncation="total"):
    """Least squares on half-space theory over the paper's domain; the covariance is that of the regression."""
    domain = DOMAINS[symmetry]
    constants, angles = domain.crystals(points, seed=2)
    basis = Basis(domain, coordinates, truncation, degree, bandlimit)
    modulus = bi.halfspace_modulus(bi.stiffness(symmetry, **dict(zip(constant_names(symmetry), constants.T, strict=True))), angles)
    terms, scale = basis.terms(constants, angles)
    normal = terms @ terms.T + 1e-8 * np.eye(basis.n_terms)
    y = basis.to_y(modulus, scale)
    coefficients = np.linalg.solve(normal, terms @ y)
    variance = np.mean((y - coefficients @ terms) ** 2)
    covariance = variance * np.linalg.inv(normal)
    return bi.Surrogate(basis, coefficients, covariance, alpha=1.0, beta=1 / variance, sd_inflation=1.3)


@pytest.fixture(scope="module", params=["cubic", "hexagonal"])
def symmetry(request):
    return request.param


@pytest.fixture(scope="module")
def surrogates():
    return {symmetry: theory_surrogate(symmetry, *SIZES[symmetry]) for symmetry in SIZES}


@pytest.fixture(scope="module")
def rough():
    """Surrogates with few terms and large uncertainties, where these matter."""
    models = {}
    for symmetry, coordinates, truncation in (
        ("cubic", "dimensionless", "total"), ("hexagonal", "dimensionless", "total"), ("cubic", "box", "tensor"), ("hexagonal", "box", "tensor"),
    ):  # fmt: skip
        model = theory_surrogate(symmetry, 2, 4, coordinates, 1500, truncation)
        root = np.random.default_rng(1).normal(size=(model.basis.n_terms, 6))
        size = (0.005 if coordinates == "dimensionless" else 0.5) / np.sqrt(model.basis.n_terms)
        model = bi.Surrogate(model.basis, model.coefficients, size**2 * root @ root.T, alpha=1.0, beta=model.beta, sd_inflation=1.3)
        models[symmetry, coordinates] = model
    return models


@pytest.fixture(scope="module")
def results(surrogates):
    """The reference data sets with surrogate uncertainty off."""
    return {
        symmetry: bi.extract(
            surrogates[symmetry], REFERENCE / f"{NAMES[symmetry]}.csv", surrogate_variance="none", samples=20000, **reference(symmetry)[1]
        )
        for symmetry in SIZES
    }


@pytest.fixture(scope="module")
def documents(results):
    return {symmetry: bi.summary(result) for symmetry, result in results.items()}


def columns(symmetry):
    points = read_measurements(REFERENCE / f"{NAMES[symmetry]}.csv")
    return points.euler_deg, points.modulus_gpa, points.sd_gpa


def table_of(euler_deg, modulus_gpa, sd_gpa=None):
    return {"euler_deg": euler_deg, "modulus_gpa": modulus_gpa} | ({} if sd_gpa is None else {"sd_gpa": sd_gpa})


# The reference posteriors


def test_posterior_meets_reference(symmetry, documents):
    case, _ = reference(symmetry)
    document = documents[symmetry]
    mean = np.array([document["parameters"][name]["mean"] for name in constant_names(symmetry)])
    sd = np.array([document["parameters"][name]["sd"] for name in constant_names(symmetry)])
    assert np.abs((mean - case["mean"]) / case["sd"]).max() < 0.15
    assert sd == pytest.approx(case["sd"], rel=0.10)
    assert np.abs(np.array(document["correlation"]) - case["corr"]).max() < 0.05
    predicted = np.array([item["mean"] for item in document["predicted"]])
    assert np.abs(predicted - case["predicted_mean"]).max() < 0.3
    assert [item["sd"] for item in document["predicted"]] == pytest.approx(case["predicted_sd"], rel=0.10)
    for item in document["parameters"].values():
        assert item["r_hat"] < 1.01
        assert item["ess_bulk"] > 2000


#: Of 4 chains of 400,000 sweeps: least effective size, and four standard errors of the means (in sds) and sds (relative) at that size.
@pytest.mark.parametrize(("symmetry", "least", "mean", "sd"), [("cubic", 2000, 0.09, 0.05), ("hexagonal", 120, 0.3, 0.1)])
def test_the_papers_sampler_agrees(symmetry, least, mean, sd, surrogates, documents):
    posterior = Posterior.of(surrogates[symmetry], table_of(*columns(symmetry)), surrogate_variance="none", **reference(symmetry)[1])
    draws, _, acceptance = posterior.sample(method="scmh", samples=400_000, burn_in=20000, chains=4, threads=2, seed=5)
    assert acceptance == pytest.approx(0.23, abs=0.03)
    for j, item in enumerate(documents[symmetry]["parameters"].values()):
        assert az.ess(draws[:, ::20, j]) > least
        assert draws[..., j].mean() == pytest.approx(item["mean"], abs=mean * item["sd"])
        assert draws[..., j].std() == pytest.approx(item["sd"], rel=sd)


def test_bit_identical_for_any_number_of_threads(symmetry, surrogates):
    posterior = Posterior.of(surrogates[symmetry], table_of(*columns(symmetry)), **reference(symmetry)[1])
    for method in ("ensemble", "scmh"):
        runs = [posterior.sample(method=method, samples=300, burn_in=3000, chains=4, threads=n, seed=3) for n in (1, 2, 4)]
        for run in runs[1:]:
            for a, b in zip(runs[0], run, strict=True):
                assert np.array_equal(a, b)
        assert not np.array_equal(runs[0][0][0], runs[0][0][1])


# The density


def brute_force(model, c, angles, measured, sd, kind="indentation_modulus", full=True, calibration=0.0):
    """Eq. 13 with the covariance written out, by dense algebra."""
    basis = model.basis
    terms, scale = basis.terms(np.repeat(np.atleast_2d(c), len(angles), axis=0), angles)
    y = model.coefficients @ terms
    m = basis.to_modulus(y, scale)
    slope = m if basis.coordinates == "dimensionless" else np.ones_like(m)
    if kind == "effective_modulus":
        d = (1 - 0.07**2) / 1140.0
        slope, m = slope / (1 + d * m) ** 2, 1 / (1 / m + d)
    elif kind == "sample_modulus":
        slope, m = slope * (1 - 0.3**2), m * (1 - 0.3**2)
    v = np.diag(np.asarray(sd) ** 2)
    if full:
        design = terms * slope
        v = v + model.sd_inflation**2 * (design.T @ model.covariance @ design + np.diag(slope**2) / model.beta)
    v = v + calibration**2 * np.outer(m, m)
    return stats.multivariate_normal(m, v).logpdf(measured), m


@pytest.mark.parametrize("kind", ["indentation_modulus", "effective_modulus", "sample_modulus"])
@pytest.mark.parametrize("coordinates", ["dimensionless", "box"])
@pytest.mark.parametrize(("full", "calibration"), [(False, 0.0), (True, 0.0), (False, 0.03), (True, 0.03)])
def test_likelihood_is_the_dense_one(rough, symmetry, kind, coordinates, full, calibration):
    model = rough[symmetry, coordinates]
    case, settings = reference(symmetry)
    angles, measured, sd = columns(symmetry)
    posterior = Posterior.of(
        model,
        table_of(angles, measured, sd),
        modulus_kind=kind,
        surrogate_variance="full" if full else "none",
        calibration_sd=calibration,
        **settings,
    )
    points = np.array(case["truth"]) * np.linspace(0.95, 1.0, 4)[:, None]
    _, likelihood = posterior.evaluate(points)
    for point, value in zip(points, likelihood, strict=True):
        expected, _ = brute_force(model, point, angles, measured, sd, kind, full, calibration)
        assert value == pytest.approx(expected, rel=1e-9, abs=1e-6)


def test_student_t_by_quadrature(rough):
    """Without common errors the product of densities; with a calibration error Laplace's approximation against the integral."""
    model = rough["cubic", "dimensionless"]
    case, settings = reference("cubic")
    angles, measured, sd = columns("cubic")
    measured = measured.copy()
    measured[3] += 40.0
    settings |= {"surrogate_variance": "none", "likelihood": "student", "student_dof": 4.0}
    _, m = brute_force(model, case["truth"], angles, measured, sd, full=False)
    _, value = Posterior.of(model, table_of(angles, measured, sd), **settings).evaluate(case["truth"])
    scale = np.asarray(sd) * np.sqrt(0.5)
    assert value[0] == pytest.approx(stats.t(4.0, m, scale).logpdf(measured).sum(), abs=1e-8)
    assert stats.t(4.0, m, scale).std() == pytest.approx(sd)
    _, value = Posterior.of(model, table_of(angles, measured, sd), calibration_sd=0.02, **settings).evaluate(case["truth"])
    e = np.linspace(-0.2, 0.2, 20001)
    density = stats.t(4.0, m[:, None] * (1 + e), scale[:, None]).logpdf(measured[:, None]).sum(axis=0)
    density = density + stats.norm(0, 0.02).logpdf(e)
    assert value[0] == pytest.approx(np.log(np.trapezoid(np.exp(density), e)), abs=0.03)


def test_inferred_scale(surrogates):
    angles, measured, sd = columns("cubic")
    _, settings = reference("cubic")
    known = Posterior.of(surrogates["cubic"], table_of(angles, measured, 2 * sd), surrogate_variance="none", **settings)
    inferred = Posterior.of(surrogates["cubic"], table_of(angles, measured, sd), surrogate_variance="none", scale="inferred", **settings)
    assert inferred.evaluate([225, 135, 118, np.log(2)])[1] == pytest.approx(known.evaluate([225, 135, 118])[1], rel=1e-12)
    result = bi.extract(
        surrogates["cubic"],
        {"euler_deg": angles, "modulus_gpa": measured},
        scale="inferred",
        surrogate_variance="none",
        samples=3000,
        **settings,
    )
    # With a flat logarithm the sum of the squared residuals in units of the factor has the mean n, whatever else there is.
    factor = result.posterior["sd_factor"].sel(draw=result.predictions.draw).values
    squares = ((result.predictions["modulus"].values - measured) ** 2).sum(axis=-1) / factor**2
    assert squares.mean() == pytest.approx(len(measured), abs=4 * np.sqrt(2 * len(measured) / 3000))
    with pytest.raises(bi.InputError, match="sd_gpa"):
        bi.extract(surrogates["cubic"], {"euler_deg": angles, "modulus_gpa": measured}, **settings)


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
        "compressibility[001]": (2.0, 0.1),
    }
    plain = Posterior.of(surrogates[symmetry], data, **settings).evaluate(case["truth"])[0]
    value = Posterior.of(surrogates[symmetry], data, knowledge=knowledge, **settings).evaluate(case["truth"])[0]
    known = bi.quantities(symmetry, case["truth"], list(knowledge))
    assert value - plain == pytest.approx(-0.5 * sum(((known[key] - mean) / sd) ** 2 for key, (mean, sd) in knowledge.items()))


def from_the_prior(posterior, settings):
    """Points of a posterior by brute force: many of the flat prior, drawn again by their likelihoods."""
    rng = np.random.default_rng(3)
    low, high = np.array(list(settings["bounds"].values())).T
    points = low + (high - low) * rng.random((2_000_000, len(low)))
    density = posterior.evaluate(points)[0]
    weights = np.exp(density - density.max())
    # The sd of such a sample is known to some per cent.
    assert weights.sum() ** 2 / (weights**2).sum() > 1000
    return points[rng.choice(len(points), 20000, p=weights / weights.sum())]


def test_known_bulk_modulus_closes_the_hidden_direction(surrogates, documents):
    _, settings = reference("cubic")
    result = bi.extract(
        surrogates["cubic"],
        REFERENCE / "cubic_fe3si.csv",
        knowledge={"bulk_modulus": (165.0, 3.3)},
        surrogate_variance="none",
        samples=4000,
        **settings,
    )
    assert documents["cubic"]["parameters"]["C12"]["sd"] > 24
    posterior = Posterior.of(
        surrogates["cubic"], table_of(*columns("cubic")), knowledge={"bulk_modulus": (165.0, 3.3)}, surrogate_variance="none", **settings
    )
    assert result.posterior["C12"].values.std() == pytest.approx(from_the_prior(posterior, settings)[:, 1].std(), rel=0.05)
    assert result.posterior["C12"].values.std() < 7


@pytest.mark.parametrize("calibration_sd", [0.0, 0.03])
def test_calibration_error_widens_the_mean_modulus(surrogates, calibration_sd):
    """Against brute force; 3 % of 225 GPa are 6.8 GPa, less what the bounds forbid."""
    _, settings = reference("cubic")
    asked = settings | {"surrogate_variance": "none", "calibration_sd": calibration_sd}
    table = table_of(*columns("cubic"))
    result = bi.extract(surrogates["cubic"], table, samples=4000, **asked)
    posterior = Posterior.of(surrogates["cubic"], table, **asked)
    expected = posterior.moduli(from_the_prior(posterior, settings), table["euler_deg"])[0].mean(axis=1).std()
    assert result.predictions["modulus"].mean("grain").values.std() == pytest.approx(expected, rel=0.08)
    assert expected == pytest.approx({0.0: 1.35, 0.03: 6.5}[calibration_sd], rel=0.08)


def test_predictions_with_surrogate_uncertainty(rough):
    """The errors of the surrogate given the data, against the conditional normal distribution by dense algebra."""
    model = rough["cubic", "dimensionless"]
    case, settings = reference("cubic")
    angles, measured, sd = columns("cubic")
    new = np.array([[0.0, 0.0, 0.0], [0.0, 54.7356, 45.0]])
    posterior = Posterior.of(model, table_of(angles, measured, sd), calibration_sd=0.02, **settings)
    moduli, factor = posterior.moduli(np.repeat([case["truth"]], 40000, axis=0), new, seed=4)
    every = np.vstack([angles, new])
    terms, scale = model.basis.terms(np.repeat([case["truth"]], len(every), axis=0), every)
    m = model.basis.to_modulus(model.coefficients @ terms, scale)
    design = terms * m
    common = model.sd_inflation**2 * design.T @ model.covariance @ design
    n = len(angles)
    v = common[:n, :n] + 0.02**2 * np.outer(m[:n], m[:n]) + np.diag(sd**2 + model.sd_inflation**2 * m[:n] ** 2 / model.beta)
    # Of the two moduli and of the relative calibration error.
    cross = np.column_stack([common[:n, n:], 0.02**2 * m[:n]])
    mean = np.append(m[n:], 0.0) + cross.T @ np.linalg.solve(v, measured - m[:n])
    covariance = block_diag(common[n:, n:], 0.02**2) - cross.T @ np.linalg.solve(v, cross)
    drawn = np.column_stack([moduli, factor - 1])
    sds = np.sqrt(np.diag(covariance))
    assert np.abs((drawn.mean(axis=0) - mean) / sds).max() < 4 / np.sqrt(40000)
    assert np.cov(drawn.T) / np.outer(sds, sds) == pytest.approx(covariance / np.outer(sds, sds), abs=0.03)


def test_the_smallest_sds_have_a_density(rough):
    """Where the surrogate's errors are a million times the measurements', whose sums lose all digits."""
    model = rough["cubic", "dimensionless"]
    case, settings = reference("cubic")
    angles, measured, _ = columns("cubic")
    sure = bi.Surrogate(model.basis, model.coefficients, model.covariance, alpha=1.0, beta=1e30, sd_inflation=1.0)
    values = []
    for sd in (1e-4, 1e-6, 1e-8):
        posterior = Posterior.of(sure, table_of(angles, measured, np.full(11, sd)), **settings)
        values.append(posterior.evaluate(case["truth"])[1][0] * sd**2)
    # Five harmonics cannot meet eleven moduli: the misfit that is left grows as 1/sd².
    assert values == pytest.approx([values[0]] * 3, rel=1e-3)
    assert values[0] < 0


@pytest.mark.parametrize("grains", [1, 2])
@pytest.mark.parametrize("sampler", [{"samples": 300, "burn_in": 3000}, {"samples": 10, "burn_in": 10, "chains": 1, "method": "scmh"}])
def test_few_grains_and_few_draws(surrogates, symmetry, grains, sampler):
    angles, measured, sd = (values[:grains] for values in columns(symmetry))
    document = bi.summary(bi.extract(surrogates[symmetry], table_of(angles, measured, sd), **sampler, **reference(symmetry)[1]))
    assert len(document["predicted"]) == grains
    combinations = [row for row in document["identifiability"] if row["kind"] == "combination"]
    assert len(combinations) == len(document["parameters"])
    assert all(0 <= row["sd"] < row["prior_sd"] * 5 for row in combinations)
    assert combinations[0]["contraction"] > 0.9


def test_one_bound_alone(surrogates):
    table = REFERENCE / "cubic_fe3si.csv"
    free, capped, floored = (
        bi.extract(surrogates["cubic"], table, samples=2000, **settings).posterior["C11"].values
        for settings in ({}, {"c_max": [180, 600, 600]}, {"c_min": [230, 1, 1]})
    )
    assert free.max() > 200
    assert capped.max() <= 180
    assert floored.min() >= 230
    assert floored.max() > 250


def test_prior_and_posterior_have_streams_of_their_own(surrogates):
    """The chains of the prior are not those that its density has with the posterior's seed."""
    settings = reference("cubic")[1] | {"seed": 3}
    table = table_of(*columns("cubic"))
    found = Posterior.of(surrogates["cubic"], table, what=EXTRACTION, **settings).values("prior_draws")
    prior = Posterior.of(surrogates["cubic"], table, what=PRIOR, **settings)
    draws = prior.sample(method="ensemble", samples=2500, burn_in=5000, chains=4, threads=2, seed=3)[0]
    assert found.T.shape == draws.shape
    assert not np.isin(found.T, draws).any()


def test_copies_are_made_anew(surrogates):
    posterior = Posterior.of(surrogates["cubic"], table_of(*columns("cubic")), **reference("cubic")[1])
    point = [[225.0, 135.0, 118.0]]
    assert copy.copy(posterior).evaluate(point)[0] == posterior.evaluate(point)[0]
    with pytest.raises(AttributeError, match="frozen"):
        posterior.dimension = 7
    with pytest.raises(bi.InputError, match="Step 2 was not done"):
        posterior.values("predicted")
    with pytest.raises(bi.InputError, match="has no colour"):
        posterior.values("colour")


# What the results say


def test_identifiability(results, documents, symmetry):
    rows = documents[symmetry]["identifiability"]
    combinations = [row for row in rows if row["kind"] == "combination"]
    assert [row["name"] for row in rows if row["kind"] == "quantity"] == list(quantity_names(symmetry))
    contraction = [row["contraction"] for row in combinations]
    assert contraction == sorted(contraction, reverse=True)
    # Two combinations of three, three of five.
    identified = {"cubic": 2, "hexagonal": 3}[symmetry]
    assert min(contraction[:identified]) > 0.9
    assert max(contraction[identified:]) < 0.5
    # Combinations are not correlated with each other, in the posterior or before.
    exponents = np.array([list(row["exponents"].values()) for row in combinations])
    for group in (results[symmetry].posterior, results[symmetry].prior):
        logs = exponents @ np.log([group[name].values.ravel() for name in constant_names(symmetry)])
        assert np.corrcoef(logs) == pytest.approx(np.eye(len(logs)), abs=1e-6)
    young = next(row for row in rows if row["name"] == "polycrystal_young")
    assert young["contraction"] > 0.95


def test_verdicts(documents):
    lines = "\n".join(documents["cubic"]["warnings"])
    assert "C12 and C11 trade off" in lines
    assert "the data decided" in lines
    assert "the prior decided" in lines
    assert "C44 piles up at its bound of 120" in lines
    assert "not mixed" not in lines


def test_poor_chains_are_told_of(surrogates):
    _, settings = reference("hexagonal")
    result = bi.extract(surrogates["hexagonal"], REFERENCE / "hex_titanium.csv", method="scmh", samples=500, burn_in=500, **settings)
    assert any("have not mixed" in line for line in bi.summary(result)["warnings"])


def test_outlying_grain_is_named(surrogates):
    angles, measured, sd = columns("cubic")
    _, settings = reference("cubic")
    measured = measured.copy()
    measured[4] += 45.0
    table = {"euler_deg": angles, "modulus_gpa": measured, "sd_gpa": sd}
    normal, student = (
        bi.extract(surrogates["cubic"], table, samples=3000, likelihood=likelihood, **settings) for likelihood in ("normal", "student")
    )
    for result in (normal, student):
        assert any("grain 5 disagrees" in line for line in bi.summary(result)["warnings"])
    # Student's t gives it less weight.
    others = [result.predictions["modulus"].mean().item() for result in (normal, student)]
    assert others[0] - others[1] > 1.0


def warnings_of(surrogate, euler_deg):
    """What is said of grains in these orientations."""
    n = len(euler_deg)
    return Posterior.of(surrogate, table_of(np.array(euler_deg), np.full(n, 200.0), np.full(n, 4.0))).problem.warnings


def test_orientations_are_judged(surrogates):
    assert "one grain" in warnings_of(surrogates["cubic"], [[10.0, 20.0, 30.0]])[0]
    assert "the orientations are all alike" in warnings_of(surrogates["cubic"], [[0.0, 20.0, 30.0], [50.0, 20.0, 60.0]])[0]
    assert "the orientations are all alike" in warnings_of(surrogates["hexagonal"], [[0.0, 30.0, 10.0], [0.0, 150.0, 80.0]])[0]
    assert warnings_of(surrogates["hexagonal"], [[0.0, 30.0, 10.0], [0.0, 70.0, 80.0]]) == []
    assert any("radians" in line for line in warnings_of(surrogates["cubic"], [[0.1, 0.2, 0.3], [1.0, 2.0, 3.0]]))


def test_refusals(surrogates):
    model = surrogates["cubic"]
    angles, measured, sd = columns("cubic")
    table = {"euler_deg": angles, "modulus_gpa": measured, "sd_gpa": sd}
    for settings, words in (
        ({"bounds": {"C33": (1, 2)}}, "C33"),
        ({"bounds": {"C11": (250, 50)}}, "&prior c_min: C11 = 250.0 GPa is not below"),
        ({"bounds": {"C11": (100, 110), "C12": (120, 130)}}, "&prior c_max: no crystal"),
        ({"bounds": {"C11": (1000, 1001), "C12": (990, 991), "C44": (1, 2)}}, "outside the surrogate's domain"),
        ({"anisotropy_cap": -1.0}, "anisotropy_cap"),
        ({"method": "gibbs"}, "method"),
        ({"modulus_kind": "E"}, "modulus_kind"),
        ({"knowledge": {"hardness": (1, 1)}}, "hardness.*allowed"),
        ({"knowledge": {"C44": (100, 0)}}, "&knowledge sd: 0"),
        ({"colour": "blue"}, "colour"),
        ({"calibration_sd": 3.0}, "&measurements calibration_sd: 3.0"),
        ({"samples": 0}, "samples"),
    ):
        with pytest.raises(bi.InputError, match=words):
            bi.extract(model, table, **settings)
    with pytest.raises(bi.InputError, match="sd"):
        bi.extract(model, table | {"sd_gpa": 0 * sd})
    with pytest.raises(bi.InputError, match="looks like MPa"):
        bi.extract(model, table | {"modulus_gpa": 1000 * measured})
    with pytest.raises(bi.InputError, match="Phi"):
        bi.extract(model, table | {"euler_deg": angles + np.array([0, 100, 0])})
    with pytest.raises(bi.InputError, match="at least one grain"):
        bi.extract(model, {"euler_deg": np.zeros((0, 3)), "modulus_gpa": [], "sd_gpa": []})
    box = theory_surrogate("cubic", 2, 4, "box", 400, "tensor")
    with pytest.raises(bi.InputError, match="C44.*outside the surrogate's domain"):
        bi.extract(box, table, bounds={"C44": (121, 160)})


def test_tables_of_measurements():
    names = ("phi1_deg", "Phi_deg", "phi2_deg", "modulus_gpa", "sd_gpa")
    rows = np.array([[46.3, 88.7, 199.3, 219.0, 4.5], [10.0, 20.0, 30.0, 210.0, 4.0]])
    columns = dict(zip(names, rows.T, strict=True))
    structured = np.array([tuple(row) for row in rows], dtype=[(name, float) for name in names])
    named = [dict(zip(names, row, strict=True)) for row in rows]
    for table in (columns, structured, structured.view(np.recarray), named, rows, rows.tolist()):
        angles, modulus, sd = measurements_of(table)
        assert np.array_equal(np.column_stack([angles, modulus, sd]), rows)
    assert measurements_of(rows[:, :4])[2] is None
    for table, said in (
        (rows[:, :3], "an array of measurements"),
        (columns | {"sd_gpa": ["a", "b"]}, "no table of numbers"),
        ({"Phi_deg": [1.0]}, "no column 'phi1_deg'"),
    ):
        with pytest.raises(bi.InputError, match=said):
            measurements_of(table)


def test_bounds_outside_a_box_are_refused():
    box = theory_surrogate("cubic", 2, 4, "box", 400, "tensor")
    with pytest.raises(
        bi.InputError, match="C44: the bounds 100.0 .. 160.0 GPa are outside the surrogate's domain; allowed: 15.0 .. 120.0"
    ):
        bi.extract(box, REFERENCE / "cubic_fe3si.csv", bounds={"C44": (100, 160)}, samples=1000, chains=2)


def test_ratios_that_the_surrogate_does_not_know_are_cut_and_told(surrogates):
    result = bi.extract(surrogates["cubic"], REFERENCE / "cubic_fe3si.csv", bounds={"C44": (1, 5000)}, samples=1000, chains=2)
    assert any("the surrogate knows" in line for line in bi.summary(result)["warnings"])


def test_kinds_of_modulus_agree(surrogates):
    """The same data given as three kinds of modulus has the same posterior, up to the noise of the sampler."""
    angles, measured, sd = columns("cubic")
    _, settings = reference("cubic")
    d = (1 - 0.07**2) / 1140.0
    tables = {
        "indentation_modulus": (measured, sd),
        "effective_modulus": (1 / (1 / measured + d), sd / (1 + d * measured) ** 2),
        "sample_modulus": ((1 - 0.3**2) * measured, (1 - 0.3**2) * sd),
    }
    means = []
    for kind, (values, sds) in tables.items():
        table = {"euler_deg": angles, "modulus_gpa": values, "sd_gpa": sds}
        result = bi.extract(surrogates["cubic"], table, modulus_kind=kind, samples=5000, **settings)
        means.append([result.posterior[name].values.mean() for name in constant_names("cubic")])
    assert np.ptp(means, axis=0) == pytest.approx([0, 0, 0], abs=1.0)


def test_simulation_based_calibration(surrogates):
    """Ranks of truths drawn from the prior among draws of their posteriors are uniform (Talts et al. 2018); a small one."""
    rng = np.random.default_rng(12)
    model = surrogates["cubic"]
    _, settings = reference("cubic")
    angles, measured, sd = columns("cubic")
    prior = Posterior.of(model, table_of(angles, measured, sd), what=PRIOR, **settings)
    truths = prior.sample(method="ensemble", samples=2000, burn_in=5000, chains=4, threads=2, seed=1)[0].reshape(-1, 3)[::200]
    ranks = []
    for k, truth in enumerate(truths):
        modulus, _ = model.predict(stiffness_rows("cubic", [truth])[0], angles)
        posterior = Posterior.of(
            model, table_of(angles, modulus + sd * rng.normal(size=len(sd)), sd), surrogate_variance="none", **settings
        )
        draws = posterior.sample(method="ensemble", samples=2000, burn_in=8000, chains=1, threads=1, seed=k)[0][0, ::21]
        statistics = np.column_stack([draws, posterior.evaluate(draws)[1]])
        ranks.append((statistics < np.append(truth, posterior.evaluate(truth)[1])).mean(axis=0))
    for values in np.array(ranks).T:
        assert stats.kstest(values, "uniform").pvalue > 0.002


# Next grain


def test_gain_by_brute_force(surrogates, results):
    """The gain of each candidate against its definition, by a double loop over draws."""
    _, settings = reference("cubic")
    table = table_of(*columns("cubic"))
    settings |= {"surrogate_variance": "none", "sd_gpa": 4.5, "count": 1}
    few = results["cubic"].isel(draw=slice(None, None, 200))
    draws = np.stack([few.posterior[name].values.ravel() for name in constant_names("cubic")], axis=1)
    found, wanted = (bi.next_grain(surrogates["cubic"], table, target=target, result=few, **settings) for target in ("all", "C44"))
    angles = np.array([item["euler_deg"] for item in found["candidates"]])
    assert len(angles) == 153
    predicted, _ = Posterior.of(surrogates["cubic"], table, **settings).moduli(draws, angles)
    v = np.linspace(predicted.min() - 30, predicted.max() + 30, 1500)
    for c in (0, 50, 152):
        density = stats.norm(predicted[:, c], 4.5).pdf(v[:, None]) / len(draws)
        p = density.sum(axis=1)
        gain = -np.trapezoid(p * np.log(p), v) - 0.5 * np.log(2 * np.pi * np.e * 4.5**2)
        assert found["candidates"][c]["gain"] == pytest.approx(gain, abs=2e-3)
        first, second = density @ draws[:, 2], density @ draws[:, 2] ** 2
        left = np.trapezoid(second - first**2 / p, v)
        assert wanted["candidates"][c]["gain"] == pytest.approx(1 - left / draws[:, 2].var(), abs=2e-3)
    gains = [item["gain"] for item in found["candidates"]]
    assert found["suggestions"][0]["euler_deg"] == found["candidates"][int(np.argmax(gains))]["euler_deg"]


def test_suggestions_do_not_repeat(surrogates, results, symmetry):
    _, settings = reference(symmetry)
    settings |= {"surrogate_variance": "none", "result": results[symmetry], "seed": 3, "count": 5, "target": "C44"}
    table = REFERENCE / f"{NAMES[symmetry]}.csv"
    one, two = (bi.next_grain(surrogates[symmetry], table, workers=n, **settings)["suggestions"] for n in (1, 2))
    assert one == two
    angles = np.radians([item["euler_deg"] for item in one])
    sine = np.sin(angles[:, 1])
    direction = np.column_stack([np.sin(angles[:, 2]) * sine, np.cos(angles[:, 2]) * sine, np.cos(angles[:, 1])])
    apart = np.degrees(np.arccos(np.clip(direction @ direction.T, -1, 1)))[np.triu_indices(5, 1)]
    assert apart.min() >= 4.99
    assert all(item["gain"] > 0 for item in one)


def test_errors_that_measurements_share_teach_nothing_of_the_constants(surrogates, results):
    """With a calibration error a further grain tells less of the constants, however much it tells of that error."""
    _, settings = reference("cubic")
    settings |= {"surrogate_variance": "none", "sd_gpa": 1.0, "count": 1}
    table = REFERENCE / "cubic_fe3si.csv"
    free, shared = (
        bi.next_grain(surrogates["cubic"], table, calibration_sd=sd, samples=4000, **settings)["suggestions"][0] for sd in (0.0, 0.05)
    )
    # The predictions spread more by what is not known of the calibration, which is no more to be learnt about the constants.
    assert shared["sd"] > free["sd"]
    assert shared["gain"] < 0.5 * np.log(1 + (shared["sd"] / 1.0) ** 2) - 0.2


def test_targets(surrogates, results):
    table = REFERENCE / "cubic_fe3si.csv"
    settings = reference("cubic")[1] | {"surrogate_variance": "none", "result": results["cubic"], "count": 1}
    gains = {t: bi.next_grain(surrogates["cubic"], table, target=t, **settings)["candidates"] for t in ("C44/C11", "C44^2 C11^-2", "C44")}
    # The logarithm of a square has four times the variance, before and after.
    assert [item["gain"] for item in gains["C44/C11"]] == pytest.approx([item["gain"] for item in gains["C44^2 C11^-2"]])
    assert gains["C44"] != gains["C44/C11"]
    for target, words in (("C77", "C77.*allowed"), ("C14", "zero"), ("hardness", "unknown"), ("young[000]", "unknown")):
        with pytest.raises(bi.InputError, match=f"&next target: .*{words}"):
            bi.next_grain(surrogates["cubic"], table, target=target, **settings)


@pytest.mark.parametrize("sd_gpa", [1e-5, 1e-7, 1e-9])
def test_a_precise_next_measurement_is_no_burden(surrogates, results, sd_gpa):
    settings = reference("cubic")[1] | {"surrogate_variance": "none", "result": results["cubic"], "count": 2}
    gains = [
        bi.next_grain(surrogates["cubic"], REFERENCE / "cubic_fe3si.csv", sd_gpa=sd, **settings)["suggestions"][0]["gain"]
        for sd in (sd_gpa, 10 * sd_gpa)
    ]
    assert gains[0] - gains[1] == pytest.approx(np.log(10))


# The stages


def test_stages(tmp_path, surrogates):
    surrogates["cubic"].save(tmp_path / "model.txt")
    (tmp_path / "data.csv").write_text((REFERENCE / "cubic_fe3si.csv").read_text())
    (tmp_path / "case.nml").write_text(
        "&problem symmetry = 'cubic' /\n&surrogate file = 'model.txt' /\n&measurements file = 'data.csv' /\n"
        "&prior c_min = 50, 40, 15  c_max = 250, 150, 120  anisotropy_cap = 7.2 /\n&knowledge quantity = 'bulk_modulus' mean = 165.0 sd = 3.3 /\n"
        "&sampler samples = 2000 /\n&next target = 'C44'  count = 3 /\n"
    )
    problem = bi.Problem(tmp_path / "case.nml", "run")
    document = extract_stage(problem, tmp_path / "out", None)
    assert document["parameters"]["C12"]["sd"] < 7
    stored = az.from_netcdf(str(tmp_path / "out" / "posterior.nc"), engine="h5netcdf")
    assert stored.posterior["C44"].shape == (4, 2000)
    suggestions = next_stage(problem, tmp_path / "out", None)
    assert len(suggestions["suggestions"]) == 3
    (tmp_path / "case.nml").write_text(
        "&problem symmetry = 'hexagonal' /\n&surrogate file = 'model.txt' /\n&measurements file = 'data.csv' /\n&sampler samples = 100 /\n"
    )
    with pytest.raises(bi.InputError, match=r"case.nml: &surrogate file: .*for cubic crystals"):
        extract_stage(bi.Problem(tmp_path / "case.nml", "run"), tmp_path / "out", None)
