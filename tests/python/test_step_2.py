"""What Step 2 says of its chains, what it refuses, and what it suggests to measure next."""

import arviz as az
import numpy as np
import pytest
from scipy import stats
from scipy.linalg import eigh

import bayesindent as bi
from bayesindent.crystal.elasticity import constant_names, quantity_names, stiffness_rows
from bayesindent.inference.measurements import measurements_of
from bayesindent.program.cli import main
from bayesindent.stages.results_folder import read_posterior
from bayesindent.stages.stage import run_stage
from support.densities import EXTRACTION, Posterior
from support.diagnostics import codes, of_code
from support.step_2_cases import KIND, columns, reference, rough_correction, table_of
from support.theory_cases import FILES, theory_surrogate
from support.tree import REFERENCE

# What the results say


def logarithms(symmetry, group, most=4000):
    """log K (n, 36), K the Kelvin stiffness, of every so many draws."""
    stride = max(1, group["C11"].size // most)
    draws = np.stack(
        [group[name].values[:, ::stride].ravel() for name in constant_names(symmetry)], axis=1
    )
    weights = np.sqrt([1, 1, 1, 2, 2, 2])
    values, vectors = np.linalg.eigh(stiffness_rows(symmetry, draws) * weights[:, None] * weights)
    return (vectors * np.log(values)[:, None, :] @ np.swapaxes(vectors, 1, 2)).reshape(
        len(draws), 36
    )


@pytest.mark.long_where("hexagonal")
def test_identifiability(results, documents, symmetry):
    rows = documents[symmetry]["identifiability"]
    combinations = [row for row in rows if row["kind"] == "combination"]
    assert [row["name"] for row in rows if row["kind"] == "quantity"] == list(
        quantity_names(symmetry)
    )
    # A compressibility of a cubic crystal is that of its bulk modulus.
    offered = [
        "bulk_modulus",
        "polycrystal_young",
        *["compressibility[100], compressibility[001]"] * (symmetry == "hexagonal"),
    ]
    assert [row["name"] for row in rows if row["kind"] == "knowledge"] == offered
    # Two combinations of three, three of five: the data have not halved the prior's sd of the
    # others.
    identified = {"cubic": 2, "hexagonal": 3}[symmetry]
    ratio = [(row["sd"] / row["prior_sd"]) ** 2 for row in combinations]
    assert max(ratio[:identified]) < 0.1
    assert min(ratio[identified:]) > 0.25
    # Bounds cut the reference sets: of titanium even the best combination owes a third to them.
    assert combinations[0]["share"]["measurements"] > 0.6
    # An independent way: log K of the draws, and the generalised eigenvalues of the two covariances
    # in the space that the prior spans.
    after, before = (
        logarithms(symmetry, group)
        for group in (results[symmetry].posterior, results[symmetry].prior)
    )
    space = np.linalg.svd(before - before.mean(axis=0), full_matrices=False)[2][: len(combinations)]
    values = eigh(np.cov(space @ after.T), np.cov(space @ before.T), eigvals_only=True)
    assert ratio == pytest.approx(values, rel=0.02)
    # The shares of normal errors of known sds, from the exact moduli of the grains. The noise of so
    # many draws is 0.01.
    euler_deg, _, sds = columns(symmetry)
    names, after = constant_names(symmetry), results[symmetry].posterior
    stride = after["C11"].size // 20000
    draws = np.stack([after[name].values[:, ::stride].ravel() for name in names], axis=1)
    crystals = np.repeat(stiffness_rows(symmetry, draws), len(sds), axis=0)
    moduli = bi.halfspace_modulus(crystals, np.tile(euler_deg, (len(draws), 1)))
    moduli = moduli.reshape(len(draws), len(sds))
    for name, values in zip(names, draws.T, strict=True):
        pull = (values - values.mean()) @ (moduli - moduli.mean(axis=0)) / len(values)
        expected = (pull**2 / sds**2).sum() / values.var()
        share = documents[symmetry]["parameters"][name]["share"]["measurements"]
        assert share == pytest.approx(expected, abs=0.05)


def test_verdicts(documents):
    warnings = documents["cubic"]["warnings"]
    limits = {
        found["subject"]: found["numbers"]["limit"] for found in of_code(warnings, "truncated")
    }
    # The density at the limit of C11 is a third of the greatest one, where the rule begins.
    limits.pop("upper limit of C11", None)
    assert limits == pytest.approx({"upper limit of C12": 150.0, "upper limit of C44": 120.0})
    parameters = documents["cubic"]["parameters"]
    assert [row["verdict"] for row in parameters.values()] == [
        "not_determined",
        "not_determined",
        "weak",
    ]
    open_constants = ", ".join(
        f"{name} (prior {100 * parameters[name]['share']['prior']:.0f} %)"
        for name in ("C11", "C12")
    )
    (found,) = of_code(warnings, "not_determined")
    assert found["subject"] == open_constants
    # What would help follows, the bulk modulus first.
    helpful = warnings[warnings.index(found) + 1]
    assert helpful["code"] == "knowledge_helps"
    assert helpful["subject"].startswith("bulk_modulus to ± ")
    assert not of_code(warnings, "not_mixed", "poorly_mixed")
    # Limits that are stated make no result unusable.
    assert not of_code(documents["cubic"]["warnings"], "outside_surrogate")
    assert documents["cubic"]["usable"] and documents["cubic"]["reasons"] == []


@pytest.mark.long
def test_poor_chains_are_told_of(surrogates):
    _, settings = reference("hexagonal")
    result = bi.extract(
        REFERENCE / "hex_titanium.csv",
        surrogate=surrogates["hexagonal"],
        method="scmh",
        samples=500,
        burn_in=500,
        **settings,
    )
    document = bi.summary(result)
    (found,) = of_code(document["warnings"], "not_mixed", "poorly_mixed")
    assert found["code"] == "not_mixed" and found["severity"] == "unusable"
    assert len(document["reasons"]) == 1 and found["text"] in document["reasons"][0]
    assert not document["usable"]


@pytest.mark.long
def test_outlying_grain_is_named(surrogates):
    angles, measured, sd = columns("cubic")
    _, settings = reference("cubic")
    measured = measured.copy()
    measured[4] += 45.0
    table = {"euler_deg": angles, "modulus_gpa": measured, "sd_gpa": sd}
    normal, student = (
        bi.extract(
            table, surrogate=surrogates["cubic"], samples=3000, likelihood=likelihood, **settings
        )
        for likelihood in ("normal", "student")
    )
    found = [rival["explanation"] for rival in bi.summary(normal)["diagnosis"]]
    assert "outliers: 5" in found
    # Student's t gives it less weight.
    others = [result.predictions["modulus"].mean().item() for result in (normal, student)]
    assert others[0] - others[1] > 1.0


def warnings_of(symmetry, euler_deg):
    """What is said of grains in these orientations."""
    n, theory = len(euler_deg), bi.Surrogate.load("halfspace")
    table = table_of(np.array(euler_deg), np.full(n, 200.0), np.full(n, 4.0))
    return Posterior.of(table, surrogate=theory, symmetry=symmetry, **KIND).problem.warnings


def test_orientations_are_judged():
    alike = [[0.0, 20.0, 30.0], [50.0, 20.0, 60.0]]
    opposite = [[0.0, 30.0, 10.0], [0.0, 150.0, 80.0]]
    assert warnings_of("cubic", [[10.0, 20.0, 30.0]])[0]["code"] == "one_grain"
    assert warnings_of("cubic", alike)[0]["code"] == "orientations_alike"
    assert warnings_of("hexagonal", opposite)[0]["code"] == "orientations_alike"
    two = [[0.0, 30.0, 10.0], [0.0, 70.0, 80.0]]
    first = warnings_of("hexagonal", two)[0]
    assert first["code"] == "few_directions"
    assert first["numbers"] == {"directions": 2, "needed": 3, "constants": 5}
    assert warnings_of("hexagonal", [*two, [0.0, 50.0, 0.0]]) == []
    radians = warnings_of("cubic", [[0.1, 0.2, 0.3], [1.0, 2.0, 3.0]])
    # It comes before advice on constants that are not determined.
    assert "angles_like_radians" in codes(radians)
    worst = next(found for found in radians if found["code"] == "angles_like_radians")
    assert worst["consequence"] == "undetermined" and "angles = 'radians'" in worst["remedy"]


def test_refusals():
    model = theory_surrogate("cubic", 2, 4, points=400)
    angles, measured, sd = columns("cubic")
    table = {"euler_deg": angles, "modulus_gpa": measured, "sd_gpa": sd}
    for settings, words in (
        ({"bounds": {"C33": (1, 2)}}, "C33"),
        ({"bounds": {"C11": (250, 50)}}, "bounds: the lower bound of C11, 250.0 GPa, is not below"),
        ({"bounds": {"C11": (100, 110), "C12": (120, 130)}}, "bounds: no crystal"),
        (
            {"bounds": {"C11": (1000, 1001), "C12": (990, 991), "C44": (1, 2)}},
            "outside the surrogate's domain",
        ),
        ({"anisotropy_cap": -1.0}, "anisotropy_cap"),
        ({"method": "gibbs"}, "method"),
        ({"modulus_kind": "E"}, "modulus_kind"),
        ({"knowledge": {"hardness": (1, 1)}}, "hardness.*allowed"),
        ({"knowledge": {"C44": (100, 0)}}, "knowledge sd: 0"),
        ({"colour": "blue"}, "colour"),
        ({"calibration_sd": 3.0}, "calibration_sd: 3.0"),
        ({"samples": 0}, "samples"),
    ):
        with pytest.raises(bi.InputError, match=words):
            bi.extract(table, surrogate=model, **KIND | settings)
    with pytest.raises(bi.InputError, match="sd_gpa: 0"):
        bi.extract(table | {"sd_gpa": 0 * sd}, surrogate=model, **KIND)
    with pytest.raises(bi.InputError, match="looks like MPa"):
        bi.extract(table | {"modulus_gpa": 1000 * measured}, surrogate=model, **KIND)
    with pytest.raises(bi.InputError, match="Phi"):
        bi.extract(table | {"euler_deg": angles + np.array([0, 100, 0])}, surrogate=model, **KIND)
    with pytest.raises(bi.InputError, match="at least one grain"):
        bi.extract(
            {"euler_deg": np.zeros((0, 3)), "modulus_gpa": [], "sd_gpa": []}, surrogate=model
        )
    with pytest.raises(bi.InputError, match="bounds: the prior is outside the surrogate's domain"):
        bi.extract(table, surrogate=model, bounds={"C44": (121, 160)}, **KIND)


def test_tables_of_measurements():
    names = ("phi1_deg", "Phi_deg", "phi2_deg", "modulus_gpa", "sd_gpa")
    rows = np.array([[46.3, 88.7, 199.3, 219.0, 4.5], [10.0, 20.0, 30.0, 210.0, 4.0]])
    columns = dict(zip(names, rows.T, strict=True))
    structured = np.array([tuple(row) for row in rows], dtype=[(name, float) for name in names])
    named = [dict(zip(names, row, strict=True)) for row in rows]
    for table in (columns, structured, structured.view(np.recarray), named, rows, rows.tolist()):
        found = measurements_of(table)
        assert tuple(found) == names and np.array_equal(np.column_stack(list(found.values())), rows)
    assert "sd_gpa" not in measurements_of(rows[:, :4])
    together = measurements_of(
        {"euler_deg": rows[:, :3], "Er": rows[:, 3], "id": ["a", "b"], "sd_gpa": None}
    )
    assert (list(together), together["id"]) == ([*names[:3], "Er", "id"], ["a", "b"])
    for table, said in (
        (rows[:, :3], "an array of measurements"),
        (columns | {"euler_deg": rows[:, :2]}, r"shape \(2, 2\); allowed \(n, 3\)"),
        (columns | {"sd_gpa": [4.0]}, "different lengths"),
        ([*rows.astype(str).tolist(), ["a"] * 5], "no table of numbers"),
    ):
        with pytest.raises(bi.InputError, match=said):
            measurements_of(table)


def ends_of(result):
    """The limits that end the draws: those of the surrogate, and stated ones; and the document."""
    document = bi.summary(result)
    outside, stated = (
        of_code(document["warnings"], code) for code in ("outside_surrogate", "truncated")
    )
    return {limit["subject"] for limit in outside}, {limit["subject"] for limit in stated}, document


def test_a_box_that_ends_a_posterior_is_named():
    box = theory_surrogate("cubic", 2, 4, points=400)
    bounds = {"C11": (150, 250), "C12": (40, 100), "C44": (100, 140)}
    result = bi.extract(
        REFERENCE / "cubic_fe3si.csv",
        surrogate=box,
        bounds=bounds,
        anisotropy_cap=7.2,
        samples=1000,
        chains=2,
        **KIND,
    )
    outside, stated, document = ends_of(result)
    # All of this prior is stable and below the cap; half of its range of C44 is below 120: four sds
    # of twenty thousand trials.
    assert document["prior"]["share_covered"] == pytest.approx(0.5, abs=0.015)
    assert "upper limit of C44" in outside
    assert "upper limit of C44" not in stated
    assert not document["usable"]
    first = document["warnings"][0]
    assert (first["code"], first["severity"]) == ("outside_surrogate", "unusable")
    assert first["subject"] == "upper limit of C44"
    assert first["numbers"]["limit"] == pytest.approx(120.0)
    assert first["text"] in document["reasons"][0]
    assert result.posterior["C44"].max() <= 120


@pytest.mark.long
def test_crystals_that_the_surrogate_does_not_know_are_cut(rough):
    settings = {
        "symmetry": "cubic",
        "bounds": {"C11": (60, 5000), "C12": (20, 5000), "C44": (1, 5000)},
        "anisotropy_cap": 1e3,
        **KIND,
    }
    result = bi.extract(
        REFERENCE / "cubic_fe3si.csv",
        surrogate=rough["cubic", "correction"],
        samples=1000,
        chains=2,
        **settings,
    )
    assert bi.summary(result)["prior"]["share_covered"] < 1
    draws = np.stack(
        [result.posterior[name].values.ravel() for name in constant_names("cubic")], axis=1
    )
    assert not rough["cubic", "correction"].outside(stiffness_rows("cubic", draws)).any()


@pytest.mark.long
def test_a_range_of_the_scale_ends_a_posterior_and_is_named():
    narrow = rough_correction(domain={"stiffness_min_gpa": 180.0, "stiffness_max_gpa": 185.0})
    settings = {
        "symmetry": "cubic",
        "bounds": {"C11": (150, 250), "C12": (90, 150), "C44": (80, 140)},
        "anisotropy_cap": 7.2,
        **KIND,
    }
    result = bi.extract(
        REFERENCE / "cubic_fe3si.csv", surrogate=narrow, samples=1000, chains=2, **settings
    )
    c11, c12, c44 = (result.posterior[name].values.ravel() for name in constant_names("cubic"))
    scale = (c11 + 2 * c12) ** (1 / 6) * (c11 - c12) ** (1 / 3) * (2 * c44) ** (1 / 2)
    assert scale.min() >= 180
    assert scale.max() <= 185
    counts = np.histogram(scale, 20)[0]
    sides = {side for side, k in (("lower", 0), ("upper", -1)) if 3 * counts[k] > counts.max()}
    outside, _, document = ends_of(result)
    assert sides
    assert {name.split()[0] for name in outside if name.endswith("stiffness_gpa")} == sides
    assert not document["usable"]
    found = [each["subject"] for each in of_code(document["warnings"], "outside_surrogate")]
    assert {f"{side} limit of stiffness_gpa" for side in sides} <= set(found)


@pytest.mark.long
def test_kinds_of_modulus_agree(surrogates):
    """The same data given as three kinds of modulus has the same posterior, up to the noise of the
    sampler.
    """
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
        result = bi.extract(
            table, surrogate=surrogates["cubic"], samples=20000, **settings | {"modulus_kind": kind}
        )
        means.append([result.posterior[name].values.mean() for name in constant_names("cubic")])
    # Some 33,000 effective samples of C12, whose sd is 27 GPa: four sds of a difference are 0.84.
    assert np.ptp(means, axis=0) == pytest.approx([0, 0, 0], abs=0.84)


# Next grain


def test_gain_by_brute_force(surrogates, results):
    """The gain of each candidate against its definition, by a double loop over draws."""
    _, settings = reference("cubic")
    table = table_of(*columns("cubic"))
    settings |= {"surrogate_variance": "none", "sd_gpa": 4.5, "count": 1}
    few = results["cubic"].isel(draw=slice(None, None, 200))
    draws = np.stack(
        [few.posterior[name].values.ravel() for name in constant_names("cubic")], axis=1
    )
    found, wanted = (
        bi.next_grain(table, surrogate=surrogates["cubic"], target=target, result=few, **settings)
        for target in ("all", "C44")
    )
    angles = np.array([item["euler_deg"] for item in found["candidates"]])
    assert len(angles) == 153
    # By the theory itself, which `next` reads as finely as the draws need.
    predicted = bi.halfspace_modulus(stiffness_rows("cubic", draws)[:, None], angles)
    v = np.linspace(predicted.min() - 30, predicted.max() + 30, 1500)
    for c in (0, 50, 152):
        density = stats.norm(predicted[:, c], 4.5).pdf(v[:, None]) / len(draws)
        p = density.sum(axis=1)
        gain = -np.trapezoid(p * np.log(p), v) - 0.5 * np.log(2 * np.pi * np.e * 4.5**2)
        assert found["candidates"][c]["gain"] == pytest.approx(gain, abs=2e-3)
        first, second = density @ draws[:, 2], density @ draws[:, 2] ** 2
        left = np.trapezoid(second - first**2 / p, v)
        assert wanted["candidates"][c]["gain"] == pytest.approx(
            1 - left / draws[:, 2].var(), abs=2e-3
        )
    gains = [item["gain"] for item in found["candidates"]]
    assert (
        found["suggestions"][0]["euler_deg"]
        == found["candidates"][int(np.argmax(gains))]["euler_deg"]
    )


@pytest.mark.long_where("hexagonal")
def test_suggestions_do_not_repeat(surrogates, results, symmetry):
    _, settings = reference(symmetry)
    settings |= {
        "surrogate_variance": "none",
        "result": results[symmetry],
        "seed": 3,
        "count": 5,
        "target": "C44",
    }
    table = REFERENCE / f"{FILES[symmetry]}.csv"
    one, two = (
        bi.next_grain(table, surrogate=surrogates[symmetry], workers=n, **settings)["suggestions"]
        for n in (1, 2)
    )
    assert one == two
    angles = np.radians([item["euler_deg"] for item in one])
    sine = np.sin(angles[:, 1])
    direction = np.column_stack(
        [np.sin(angles[:, 2]) * sine, np.cos(angles[:, 2]) * sine, np.cos(angles[:, 1])]
    )
    apart = np.degrees(np.arccos(np.clip(direction @ direction.T, -1, 1)))[np.triu_indices(5, 1)]
    assert apart.min() >= 4.99
    assert all(item["gain"] > 0 for item in one)


@pytest.mark.long
def test_errors_that_measurements_share_teach_nothing_of_the_constants(surrogates, results):
    """With a calibration error a further grain tells less of the constants, however much it tells
    of that error.
    """
    _, settings = reference("cubic")
    settings |= {"surrogate_variance": "none", "sd_gpa": 1.0, "count": 1}
    table = REFERENCE / "cubic_fe3si.csv"
    free, shared = (
        bi.next_grain(
            table, surrogate=surrogates["cubic"], calibration_sd=sd, samples=4000, **settings
        )["suggestions"][0]
        for sd in (0.0, 0.05)
    )
    # The predictions spread more by what is not known of the calibration, which is no more to be
    # learnt about the constants.
    assert shared["sd"] > free["sd"]
    assert shared["gain"] < 0.5 * np.log(1 + (shared["sd"] / 1.0) ** 2) - 0.2


@pytest.mark.long
def test_small_gains_are_not_those_of_chance(surrogates):
    """Errors that measurements share are drawn, 2000 times: by chance alone their variance would be
    off by 3 %, and gains by 0.016 nats.
    """
    settings = reference("cubic")[1] | {
        "surrogate": surrogates["cubic"],
        "surrogate_variance": "none",
        "calibration_sd": 0.1,
    }
    table = REFERENCE / "cubic_fe3si.csv"
    result = bi.extract(table, samples=4000, **settings)
    gains = []
    for seed in range(4):
        found = bi.next_grain(table, result=result, seed=seed, sd_gpa=3.0, count=1, **settings)
        gains.append([item["gain"] for item in found["candidates"]])
    assert np.ptp(gains, axis=0).max() < 0.004


def test_targets(surrogates, results):
    table = REFERENCE / "cubic_fe3si.csv"
    settings = reference("cubic")[1] | {
        "surrogate_variance": "none",
        "result": results["cubic"],
        "count": 1,
    }
    gains = {
        t: bi.next_grain(table, surrogate=surrogates["cubic"], target=t, **settings)["candidates"]
        for t in ("C44/C11", "C44^2 C11^-2", "C44")
    }
    # The logarithm of a square has four times the variance, before and after.
    assert [item["gain"] for item in gains["C44/C11"]] == pytest.approx(
        [item["gain"] for item in gains["C44^2 C11^-2"]]
    )
    assert gains["C44"] != gains["C44/C11"]
    for target, words in (
        ("C77", "C77.*allowed"),
        ("C14", "zero"),
        ("hardness", "unknown"),
        ("young[000]", "unknown"),
    ):
        with pytest.raises(bi.InputError, match=f"target: .*{words}"):
            bi.next_grain(table, surrogate=surrogates["cubic"], target=target, **settings)


@pytest.mark.long
@pytest.mark.parametrize("sd_gpa", [1e-5, 1e-7, 1e-9])
def test_a_precise_next_measurement_is_no_burden(surrogates, results, sd_gpa):
    settings = reference("cubic")[1] | {
        "surrogate_variance": "none",
        "result": results["cubic"],
        "count": 2,
    }
    gains = [
        bi.next_grain(
            REFERENCE / "cubic_fe3si.csv", surrogate=surrogates["cubic"], sd_gpa=sd, **settings
        )["suggestions"][0]["gain"]
        for sd in (sd_gpa, 10 * sd_gpa)
    ]
    assert gains[0] - gains[1] == pytest.approx(np.log(10))


# The stages


def test_stages(tmp_path):
    theory_surrogate("cubic", 2, 4, points=400).save(tmp_path / "model.txt")
    (tmp_path / "data.csv").write_text((REFERENCE / "cubic_fe3si.csv").read_text())
    (tmp_path / "case.nml").write_text(
        "&problem symmetry = 'cubic' /\n"
        "&surrogate file = 'model.txt' /\n"
        "&measurements file = 'data.csv', modulus_kind = 'indentation_modulus' /\n"
        "&prior c_min = 50, 40, 15  c_max = 250, 150, 120  anisotropy_cap = 7.2 /\n"
        "&knowledge quantity = 'bulk_modulus' mean = 165.0 sd = 3.3 /\n"
        "&sampler samples = 300 burn_in = 500 chains = 2 /\n"
        "&next target = 'C44'  count = 3 /\n"
    )
    out = tmp_path / "out"
    assert main(["extract", str(tmp_path / "case.nml"), "--output", str(out)]) == 0
    stored = az.from_netcdf(str(out / "posterior.nc"), engine="h5netcdf")
    assert stored.posterior["C44"].shape == (2, 300)
    draws = read_posterior(out)["draws"]
    assert all(
        (stored.posterior[name].values == draws[..., j]).all()
        for j, name in enumerate(constant_names("cubic"))
    )
    document = run_stage(bi.Problem(tmp_path / "case.nml", "run"), "extract", out)
    assert document["parameters"]["C12"]["sd"] < 7
    assert (read_posterior(out)["draws"] == draws).all()

    def suggested(draws=None):
        """The suggestions of `next`, or those from given draws."""
        problem = bi.Problem(tmp_path / "case.nml", "run")
        if draws is None:
            return run_stage(problem, "next", out)["suggestions"]
        return Posterior(problem, surrogate).suggest(problem, draws.reshape(-1, 3))["suggestions"]

    surrogate = bi.Surrogate.load(tmp_path / "model.txt")
    suggestions = suggested()
    assert len(suggestions) == 3
    # `next` resumes from that posterior, and from none of other measurements.
    assert suggestions == suggested(draws)
    (tmp_path / "data.csv").write_text(
        (REFERENCE / "cubic_fe3si.csv").read_text().rstrip().rpartition("\n")[0] + "\n"
    )
    fewer = Posterior(bi.Problem(tmp_path / "case.nml", "run"), surrogate, EXTRACTION).values[
        "draws"
    ]
    assert suggested() == suggested(fewer) != suggested(draws)
    (tmp_path / "case.nml").write_text(
        "&problem symmetry = 'hexagonal' /\n"
        "&surrogate file = 'model.txt' /\n"
        "&measurements file = 'data.csv', modulus_kind = 'indentation_modulus' /\n"
        "&sampler samples = 100 /\n"
    )
    with pytest.raises(bi.InputError, match=r"case.nml: &surrogate file: .*for cubic crystals"):
        run_stage(bi.Problem(tmp_path / "case.nml", "run"), "extract", out)
