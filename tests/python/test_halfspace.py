"""Step 2 with the exact theory: every class, the reference posteriors, the prior where nothing is
stated, and further errors.
"""

import json
import re

import numpy as np
import pytest
from scipy import stats

import bayesindent as bi
from bayesindent.crystal.elasticity import constant_names, halfspace_modulus, stiffness_rows
from benchmarks.bench_truths import TRUTHS, Seeds
from support.densities import PRIOR, Posterior
from support.diagnostics import of_code
from support.reference_theory import FieldTheory
from support.step_2_cases import KIND, crystal, default_prior, table_of
from support.tree import REFERENCE

THEORY = bi.Surrogate.load("halfspace")


def measured(symmetry, constants, n, seed, share=0.02):
    """Synthetic measurements of the theory, with noise."""
    rng = np.random.default_rng(seed)
    angles = np.column_stack(
        [
            rng.uniform(0, 360, n),
            np.degrees(np.arccos(rng.uniform(0, 1, n))),
            rng.uniform(0, 360, n),
        ]
    )
    exact = halfspace_modulus(stiffness_rows(symmetry, [constants])[0], angles)
    return table_of(angles, exact * (1 + share * rng.normal(size=n)), share * exact)


#: A crystal of each class.
CRYSTALS = [
    "fused silica",
    "copper",
    "Zn",
    "rutile",
    "CaMoO4",
    "calcite",
    "dolomite",
    "aragonite",
    "diopside",
]


@pytest.mark.parametrize("name", [*CRYSTALS, "albite"])
def test_the_density_of_every_class(name):
    """Normal errors about the moduli of the exact theory, times the prior where nothing is stated,
    of stable crystals alone.
    """
    symmetry, constants = crystal(name)
    table = measured(symmetry, constants, 12, 1)
    posterior = Posterior.of(table, symmetry=symmetry, surrogate=THEORY, **KIND)
    points = constants * (1 + 0.03 * np.random.default_rng(2).standard_normal((20, len(constants))))
    # Much softer and stiffer than the moduli allow, and one that yields to a shear.
    points[-3:-1] = constants * np.array([[0.2], [4.0]])
    points[-1, 0] *= 0.01
    density, likelihood = posterior.evaluate(points)
    inside = np.flatnonzero(np.linalg.eigvalsh(stiffness_rows(symmetry, points)).min(axis=1) > 0)
    assert np.flatnonzero(np.isfinite(density)).tolist() == inside.tolist()
    assert inside.tolist() == list(range(19))
    exact = halfspace_modulus(stiffness_rows(symmetry, points[inside])[:, None], table["euler_deg"])
    read = posterior.moduli(points[inside], table["euler_deg"])[0]
    # By harmonics to degree 12, with which a chain begins.
    assert read == pytest.approx(exact, rel=5e-3)
    expected = stats.norm(read, table["sd_gpa"]).logpdf(table["modulus_gpa"]).sum(axis=1)
    assert likelihood[inside] == pytest.approx(expected, rel=1e-6)
    prior = default_prior(symmetry, points[inside], table["modulus_gpa"].mean())
    assert (density - likelihood)[inside] - density[0] + likelihood[0] == pytest.approx(
        prior - prior[0], abs=1e-6
    )


@pytest.mark.long
@pytest.mark.parametrize("name", CRYSTALS)
def test_chains_of_every_class(name):
    symmetry, constants = crystal(name)
    table = measured(symmetry, constants, 12, 1)
    result = bi.extract(
        table, symmetry=symmetry, seed=3, samples=100, burn_in=1500, chains=2, **KIND
    )
    draws = np.stack(
        [result.posterior[name].values.ravel() for name in constant_names(symmetry)], axis=1
    )
    # The moduli of the draws are the theory's, and explain what was measured.
    exact = halfspace_modulus(stiffness_rows(symmetry, draws)[:, None], table["euler_deg"])
    predicted = result.predictions["modulus"].values.reshape(*exact.shape)
    stated = bi.summary(result)["theory"]["largest_error_sd"]
    assert np.abs((predicted - exact) / table["sd_gpa"]).max() == pytest.approx(
        stated, rel=1e-3, abs=1e-6
    )
    # The aim is 0.02; chains as short as these may end a little above it after the last choice of
    # the degree.
    assert stated < 0.04
    misfit = (((exact - table["modulus_gpa"]) / table["sd_gpa"]) ** 2).mean()
    # Twelve residuals of unit variance: their mean square is within four of its sds.
    assert misfit < 1 + 4 * np.sqrt(2 / 12)
    # The prior of each draw, as the chain has it from log K.
    prior = default_prior(symmetry, draws, table["modulus_gpa"].mean())
    assert np.ptp(result.log_prior["constants"].values.ravel() - prior) < 1e-6


#: Effective samples; four seeds have 1,946 to 4,712 (the least differs between processors).
LEAST_SIZE = 1500


@pytest.mark.long
@pytest.mark.parametrize("name", ["CaMoO4", "dolomite", "aragonite"])
def test_few_grains_of_seven_and_more_constants_are_usable_by_default(name):
    """With nothing stated these posteriors are wide and curved: chains in coordinates that are not
    exact go astray there.
    """
    symmetry, constants = crystal(name)
    table = measured(symmetry, constants, 12, 2)
    means, sds = [], []
    for seed in (1, 2):
        summary = bi.summary(bi.extract(table, symmetry=symmetry, seed=seed, **KIND))
        assert summary["usable"]
        values = list(summary["parameters"].values())
        assert max(value["r_hat"] for value in values) < 1.01
        assert min(value["ess_bulk"] for value in values) > LEAST_SIZE
        means.append(np.array([value["mean"] for value in values]))
        sds.append(np.array([value["sd"] for value in values]))
    # Four errors of the difference of two means of so many draws.
    assert 4 * np.sqrt(2 / LEAST_SIZE) < 0.15
    assert (np.abs(means[0] - means[1]) < 0.15 * sds[0]).all()
    assert (np.abs(means[0] - constants) < 4 * sds[0]).all()


def test_uncertain_orientations_against_brute_force():
    """The likelihood of one grain, marginalised over many tilts of its direction, near where the
    error is small beside the noise.
    """
    symmetry, constants = crystal("Zn")
    stiffness = stiffness_rows(symmetry, [constants])[0]
    tilt, angles = 3.0, np.array([[20.0, 50.0, 10.0]])
    sd = 0.02 * halfspace_modulus(stiffness, angles)
    rng = np.random.default_rng(1)
    # Directions tilted by normal amounts in two components: with hexagonal symmetry only Phi
    # counts.
    shift = rng.normal(size=(2, 4000)) * np.radians(tilt)
    direction = np.array([np.sin(np.radians(50)), 0, np.cos(np.radians(50))])
    first, second = (
        np.array([np.cos(np.radians(50)), 0, -np.sin(np.radians(50))]),
        np.array([0.0, 1, 0]),
    )
    tilted = direction + shift[0][:, None] * first + shift[1][:, None] * second
    phi = np.degrees(np.arccos(tilted[:, 2] / np.linalg.norm(tilted, axis=1)))
    moduli = halfspace_modulus(stiffness, np.column_stack([0 * phi, phi, 0 * phi]))
    for value in np.quantile(moduli, [0.2, 0.5, 0.8]):
        table = table_of(angles, [value], sd)
        _, likelihood = Posterior.of(
            table, symmetry=symmetry, surrogate=THEORY, orientation_sd_deg=tilt, **KIND
        ).evaluate(constants)
        brute = np.log(
            np.mean(np.exp(-0.5 * ((value - moduli) / sd) ** 2) / (sd * np.sqrt(2 * np.pi)))
        )
        assert likelihood[0] == pytest.approx(brute, abs=0.03)
    # The column goes before the variable.
    row = {
        "phi1_deg": [20.0],
        "Phi_deg": [50.0],
        "phi2_deg": [10.0],
        "indentation_modulus_gpa": [value],
        "sd_gpa": sd,
    }
    certain = Posterior.of(row, symmetry=symmetry, surrogate=THEORY).evaluate(constants)[1]
    stated = Posterior.of(
        row | {"orientation_sd_deg": [tilt]}, symmetry=symmetry, surrogate=THEORY
    ).evaluate(constants)[1]
    assert stated == pytest.approx(likelihood, abs=1e-12)
    assert abs(certain - likelihood) > 0.01


def test_groups_have_a_calibration_error_each():
    """Against the covariance written out: sd² on the diagonal, and (calibration_sd)² m mᵀ within a
    group.
    """
    symmetry, constants = crystal("copper")
    table = measured(symmetry, constants, 7, 4)
    group = ["b", "a", "b", "b", "c", "a", "a"]
    errors = {"calibration_sd": 0.03, "scatter_sd": 0.01}
    posterior = Posterior.of(
        table | {"group": group}, symmetry=symmetry, surrogate=THEORY, **errors, **KIND
    )
    model = posterior.moduli(constants, table["euler_deg"])[0][0]
    same = np.equal.outer(group, group)
    covariance = np.diag(table["sd_gpa"] ** 2 + (0.01 * model) ** 2)
    covariance = covariance + same * np.outer(0.03 * model, 0.03 * model)
    residual = table["modulus_gpa"] - model
    expected = -0.5 * (
        residual @ np.linalg.solve(covariance, residual)
        + np.linalg.slogdet(2 * np.pi * covariance)[1]
    )
    # The draws of the moduli are the mean theory's here: it has no error of its own.
    assert posterior.evaluate(constants)[1][0] == pytest.approx(expected, abs=1e-9)
    assert posterior.groups == 3


@pytest.mark.long
def test_words_of_what_is_open():
    symmetry, constants = crystal("copper")
    document = bi.summary(
        bi.extract(
            measured(symmetry, constants, 40, 5),
            symmetry=symmetry,
            samples=500,
            burn_in=2000,
            **KIND,
        )
    )
    (found,) = of_code(document["warnings"], "not_determined")
    assert re.match(r"C11 \(prior \d+ %\), C12 \(prior \d+ %\)", found["subject"])
    helps = {
        each["subject"]: each["numbers"]
        for each in of_code(document["warnings"], "knowledge_helps")
    }
    (bulk,) = [name for name in helps if name.startswith("bulk_modulus to ")]
    assert re.fullmatch(r"bulk_modulus to ± [\d.]+ GPa would reduce the sd of C12", bulk)
    gain = next(
        row
        for row in document["identifiability"]
        if row["kind"] == "knowledge" and row["name"] == "bulk_modulus"
    )
    known = bi.summary(
        bi.extract(
            measured(symmetry, constants, 40, 5),
            symmetry=symmetry,
            samples=500,
            burn_in=2000,
            knowledge={"bulk_modulus": (137.1, 2.74)},
            **KIND,
        )
    )["parameters"]
    # What was promised, at other bulk moduli, and what came of it: the same order, far below what
    # was there.
    for name in constant_names(symmetry):
        assert gain["sd_then"][name] < 0.5 * document["parameters"][name]["sd"] or name == "C44"
    assert known["C12"]["sd"] < 0.2 * document["parameters"]["C12"]["sd"]


def test_prior_alone_is_uniform():
    """Isotropic, within bounds that stability cuts: flat in the constants, against a grid."""
    bounds = {"C11": (50, 400), "C12": (-100, 100)}
    table = {"euler_deg": np.zeros((1, 3)), "modulus_gpa": [100.0], "sd_gpa": [5.0]}
    c11, c12 = np.meshgrid(*(np.linspace(*ends, 2001) for ends in bounds.values()))
    bulk, shear = (c11 + 2 * c12) / 3, (c11 - c12) / 2
    posterior = Posterior.of(
        table,
        symmetry="isotropic",
        surrogate=THEORY,
        bounds=bounds,
        what=PRIOR,
        **KIND,
    )
    draws, _, _ = posterior.sample(
        method="ensemble", samples=20000, burn_in=2000, chains=1, threads=1, seed=1
    )
    weights = (bulk > 0) & (shear > 0)
    for found, values in ((draws[0, :, 0], c11), (draws[0, :, 1], c12)):
        mean = np.average(values, weights=weights)
        sd = np.sqrt(np.average((values - mean) ** 2, weights=weights))
        assert found.mean() == pytest.approx(mean, abs=0.05 * sd)
        assert found.std() == pytest.approx(sd, rel=0.05)


@pytest.mark.long
@pytest.mark.parametrize("name", ["trigonal_quartz"])
def test_references_of_lower_symmetry(name):
    """Posteriors by a theory and a sampler of others' making; forsterite takes two minutes and is
    compared by `bench references`.

    The prior's tails are so long that rare draws decide some of the sds, which then differ between
    independent ensembles of the reference as well (`sd_disagreement`); of these constants the
    quantiles are compared, with what would be two sds of a normal. Three runs with many samples
    bring the noise of the outermost quantile from 0.05 of its width to 0.01.
    """
    case = json.loads((REFERENCE / f"{name}.json").read_text())
    settings = {"symmetry": case["symmetry"], "samples": 40000, **KIND}
    runs = [bi.extract(REFERENCE / f"{name}.csv", seed=seed, **settings) for seed in (1, 2, 3)]
    assert all(bi.summary(run)["usable"] for run in runs)
    draws = np.stack(
        [np.ravel([run.posterior[constant].values for run in runs]) for constant in case["order"]]
    )
    sd, found = np.array(case["sd"]), draws.std(axis=1)
    assert (draws.mean(axis=1) - case["mean"]) / sd == pytest.approx(np.zeros(len(sd)), abs=0.15)
    expected = np.array(case["quantiles"])
    # Of a normal the sd is half the range between the shares 0.16 and 0.84: where it is much more,
    # rare draws decide it.
    certain = (np.array(case["sd_disagreement"]) < 0.03) & (
        2 * sd < 1.2 * (expected[3] - expected[1])
    )
    assert certain.any()
    assert found[certain] == pytest.approx(sd[certain], rel=0.10)
    correlations = np.corrcoef(draws)[np.ix_(certain, certain)]
    assert correlations == pytest.approx(np.array(case["corr"])[np.ix_(certain, certain)], abs=0.08)
    width = (expected[-1] - expected[0]) / 2
    quantiles = np.quantile(draws, case["quantile_shares"], axis=1)
    assert (quantiles - expected) / width == pytest.approx(np.zeros(expected.shape), abs=0.10)
    assert quantiles[3] - quantiles[1] == pytest.approx(expected[3] - expected[1], rel=0.10)
    moduli = [run.predictions["modulus"].values for run in runs]
    predicted = np.reshape(moduli, (-1, len(case["predicted_mean"])))
    mean, spread = predicted.mean(axis=0), np.array(case["predicted_sd"])
    assert (mean - case["predicted_mean"]) / spread == pytest.approx(np.zeros(len(mean)), abs=0.15)
    assert predicted.std(axis=0) == pytest.approx(spread, rel=0.15)


@pytest.mark.long
@pytest.mark.parametrize("name", ["beryllium"])
def test_seeds_agree(name):
    """Long tails and several modes: five seeds have the same means, or say that they cannot be
    used; others by `bench truths`.
    """
    truth = next(truth for truth in TRUTHS if truth.name == name)
    assert Seeds(truth, 5, 1).agree()


def test_the_density_of_21_constants_is_the_reference_s():
    """That of the independent theory, about the truth and where the prior reaches; chains are
    compared by `bench references`.
    """
    case = json.loads((REFERENCE / "triclinic_albite.json").read_text())
    file = REFERENCE / "triclinic_albite.csv"
    table = np.loadtxt(file, delimiter=",", skiprows=3)
    rng = np.random.default_rng(7)
    points = np.array(case["truth"]) * (1 + 0.03 * rng.standard_normal((10, 21)))
    # Towards crystals that yield to no pressure, which have nearly the same moduli.
    points[5:, :] += np.geomspace(20, 4000, 5)[:, None] * np.isin(
        case["order"], ["C11", "C12", "C13", "C22", "C23", "C33"]
    )
    theory = FieldTheory(
        "triclinic", table[:, :3], 24, 487, points=32, angles=32, newton=6, precision=float
    )
    exact = [
        halfspace_modulus(stiffness, table[:, :3])
        for stiffness in stiffness_rows("triclinic", points)
    ]
    assert np.array(exact) == pytest.approx(theory.moduli(points), rel=2e-5)
    # The field that a chain begins with is read less finely.
    ours = Posterior.of(file, symmetry="triclinic", surrogate=THEORY, **KIND)
    moduli, (density, likelihood) = ours.moduli(points, table[:, :3])[0], ours.evaluate(points)
    assert moduli == pytest.approx(np.array(exact), rel=2e-3)
    prior = default_prior("triclinic", points, table[:, 3].mean())
    assert density - likelihood - density[0] + likelihood[0] == pytest.approx(
        prior - prior[0], abs=1e-6
    )
    wanted = -0.5 * (((moduli - table[:, 3]) / table[:, 4]) ** 2).sum(axis=1)
    assert likelihood - wanted == pytest.approx(np.full(10, likelihood[0] - wanted[0]), abs=1e-6)
