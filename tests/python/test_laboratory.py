"""The laboratory in the model: factor, contrast and scatter, assumptions, and reference grains.

Modules: laboratory.f90, nuisances.f90, techniques.f90, assumptions.f90.
"""

import numpy as np
import pytest
from scipy import stats

import bayesindent as bi
from bayesindent.crystal.elasticity import halfspace_modulus, stiffness_rows
from bayesindent.settings.problem import schema
from support.densities import PRIOR, Posterior
from support.diagnostics import codes
from support.step_2_cases import crystal
from support.tree import SOURCE

COPPER, BULK = (168.4, 121.4, 75.4), {"bulk_modulus": (137.1, 2.0)}
NAMES = ("C11", "C12", "C44")
#: Titanium of the literature, GPa.
TITANIUM = {"C11": 162.4, "C12": 92.0, "C44": 46.7, "C33": 180.7, "C13": 69.0}
ANGLES = ("phi1_deg", "Phi_deg", "phi2_deg")
#: What &measurements states for each nuisance: a variable that has the word 'inferred', or, of the
#: contrast, an sd.
INFERRED = {"contrast": {"contrast_sd": 0.2, "contrast_mean": 0.1}} | {
    one.name: {one.name: "inferred"}
    for one in schema()
    if one.group == "measurements" and "'inferred'" in one.allowed
}


def directions(n, seed):
    """Random orientations."""
    rng = np.random.default_rng(seed)
    phi = np.degrees(np.arccos(rng.uniform(-1, 1, n)))
    return np.column_stack([rng.uniform(0, 360, n), phi, rng.uniform(0, 360, n)])


def modulus(symmetry, constants, euler_deg):
    return halfspace_modulus(stiffness_rows(symmetry, [constants])[0], euler_deg)


def log_mean(symmetry, constants):
    """Mean of ln M over all directions."""
    return np.log(modulus(symmetry, constants, directions(20000, 1))).mean()


def measured(symmetry, constants, n=20, seed=3, *, factor=1.0, contrast=1.0, noise=0.02):
    """A table of a laboratory with this factor and this contrast."""
    euler = directions(n, seed)
    exact, mean = modulus(symmetry, constants, euler), log_mean(symmetry, constants)
    values = factor * np.exp(mean + contrast * (np.log(exact) - mean))
    sd = noise * values
    values = values + sd * np.random.default_rng(seed + 100).normal(size=n)
    return {"euler_deg": euler, "indentation_modulus_gpa": values, "sd_gpa": sd}


def titanium():
    table = row_table(SOURCE / "inputs" / "data" / "titanium_measured.csv")
    names = (*ANGLES, "sample_modulus_gpa", "sd_gpa")
    return {name: np.array(table[name], float) for name in names}


def row_table(path):
    """Columns of a CSV with remarks."""
    lines = [line for line in path.read_text().splitlines() if not line.startswith("#")]
    header, *rows = (line.split(",") for line in lines)
    return dict(zip(header, zip(*rows, strict=True), strict=True))


def means(document, names=NAMES):
    return np.array([document["parameters"][name]["mean"] for name in names])


@pytest.mark.parametrize("symmetry, name", [("cubic", "copper"), ("hexagonal", "Zn")])
def test_the_density_is_that_of_the_formula(symmetry, name):
    """Factor by its covariance, contrast and scatter at values of theirs."""
    constants = np.array(crystal(name)[1])
    table = measured(symmetry, constants, 12, contrast=0.7, factor=1.1)
    posterior = Posterior.of(
        table,
        surrogate=bi.Surrogate.load("halfspace"),
        symmetry=symmetry,
        technique="oliver_pharr",
        scatter="inferred",
    )
    points = np.array([[0.0, np.log(0.01)], [-0.4, np.log(0.03)], [0.3, np.log(0.002)]])
    found = posterior.evaluate(np.column_stack([np.tile(constants, (3, 1)), points]))
    expected = []
    exact, mean = modulus(symmetry, constants, table["euler_deg"]), log_mean(symmetry, constants)
    for log_contrast, log_scatter in points:
        values = np.exp(0.1 + mean + np.exp(log_contrast) * (np.log(exact) - mean))
        own = table["sd_gpa"] ** 2 + (np.exp(log_scatter) * values) ** 2
        covariance = np.diag(own) + 0.15**2 * np.outer(values, values)
        normal = stats.multivariate_normal(values, covariance)
        expected.append(
            normal.logpdf(table["indentation_modulus_gpa"])
            + stats.norm(-0.15, 0.4).logpdf(log_contrast)
            + stats.norm(np.log(0.01), np.log(3)).logpdf(log_scatter)
        )
    # What `evaluate` calls the likelihood has the priors of contrast and scatter. The degree of the
    # field, and twelve directions in place of all, change M_ref by 1e-3.
    assert found[1] == pytest.approx(expected, abs=0.15)


@pytest.mark.parametrize("stated", INFERRED)
def test_any_nuisance(stated):
    """What any parameter beside the constants does. It is one more coordinate, the logarithm of a
    positive number. The density of its prior is normalised if it is normal, and constant between
    the bounds if it is uniform; its mean and sd are the stated ones, and those of draws. At a
    neutral value, which is 1 or 0, the likelihood is that without the parameter; elsewhere it is
    not.
    """
    table = measured("cubic", COPPER, 12)
    asked = {"surrogate": bi.Surrogate.load("halfspace"), "symmetry": "cubic"}
    without = Posterior.of(table, **asked)
    posterior = Posterior.of(table, **asked, **INFERRED[stated])
    prior = Posterior.of(table, what=PRIOR, **asked, **INFERRED[stated])
    none = Posterior.of(table, what=PRIOR, **asked)
    assert (without.values["nuisances"], len(posterior.values["nuisances"].split())) == ("", 1)
    ((first, second),) = posterior.values["values"]
    normal = posterior.values["are_normal"] == "normal"

    def of_prior(x):
        points = np.column_stack([np.tile(COPPER, (len(x), 1)), x])
        return prior.evaluate(points)[0] - none.evaluate([COPPER])[0]

    mean, sd = (first, second) if normal else ((first + second) / 2, (second - first) / 12**0.5)
    x = mean + sd * np.linspace(-8, 8, 16001)
    density = np.exp(of_prior(x))
    total = density.sum() * (x[1] - x[0])
    assert total == pytest.approx(1 if normal else second - first, rel=1e-3)
    assert (density @ x / density.sum()) == pytest.approx(mean, abs=1e-3 * sd)
    assert density @ (x - mean) ** 2 / density.sum() == pytest.approx(sd**2, rel=2e-3)
    draws, *_ = prior.sample("direct", samples=4000, burn_in=0, chains=2, seed=1, threads=1)
    draws = draws[..., 3].ravel()
    # Four standard errors.
    assert draws.mean() == pytest.approx(mean, abs=4 * sd / np.sqrt(draws.size))
    assert draws.std() == pytest.approx(sd, rel=4 / np.sqrt(2 * draws.size))
    neutral, other = np.array([0.0, -30.0]), mean + sd * np.array([-1.2, 1.2])
    values = np.concatenate([neutral, other])
    points = np.column_stack([np.tile(COPPER, (4, 1)), values])
    with np.errstate(invalid="ignore"):
        effects = posterior.evaluate(points)[1] - of_prior(values)
    effects = np.abs(effects - without.evaluate([COPPER])[1])
    assert np.nanmin(effects[:2]) < 1e-7 and np.all(effects[2:] > 1e-3)


def test_any_nuisances_together():
    """Each has its own coordinate: where all others are neutral, the density is that of one alone
    times the priors of the others.
    """
    table = measured("cubic", COPPER, 12)
    asked = {"surrogate": bi.Surrogate.load("halfspace"), "symmetry": "cubic"}
    without = Posterior.of(table, **asked).evaluate([COPPER])[0]
    together = Posterior.of(
        table, **asked, **{name: word for one in INFERRED.values() for name, word in one.items()}
    )
    names = together.values["nuisances"].split()
    alone, values, of_prior = {}, {}, {}
    none = Posterior.of(table, what=PRIOR, **asked).evaluate([COPPER])[0]
    for stated in INFERRED.values():
        one, prior = (
            Posterior.of(table, **asked, **stated, **what) for what in ({}, {"what": PRIOR})
        )
        name = one.values["nuisances"]
        first, second = one.values["values"][0]
        middle = first if one.values["are_normal"] == "normal" else (first + second) / 2
        points = [[*COPPER, value] for value in (0.0, -30.0, middle + 0.3)]
        densities, priors = one.evaluate(points)[0], prior.evaluate(points)[0] - none
        with np.errstate(invalid="ignore"):
            neutral = np.nanargmin(np.abs(densities - priors - without)[:2])
        alone[name] = densities[2]
        values[name] = points[neutral][-1], points[2][-1]
        of_prior[name] = priors[neutral]
    assert len(names) == len(INFERRED) and set(names) == set(alone)
    for name in names:
        point = [values[other][other == name] for other in names]
        others = sum(of_prior[other] for other in names if other != name)
        found = together.evaluate([[*COPPER, *point]])[0]
        assert found == pytest.approx(alone[name] + others, abs=1e-6), name


def test_exact_data_have_no_laboratory_and_others_are_said_first():
    table = measured("cubic", COPPER, 8)
    short = {"samples": 100, "burn_in": 500, "chains": 2, "knowledge": BULK}
    exact = bi.summary(bi.extract(table, "cubic", technique="exact", **short))
    assumed = bi.summary(bi.extract(table, "cubic", **short))
    assert "technique_assumed" not in codes(exact["warnings"])
    others = [found for found in assumed["warnings"] if found["severity"] != "unusable"]
    assert codes(others)[0] == "technique_assumed"
    assert list(exact["parameters"]) == list(NAMES)
    assert list(assumed["parameters"]) == [*NAMES, "contrast"]
    assert exact["laboratory"]["log_contrast"]["prior_sd"] == 0
    assert assumed["laboratory"]["technique"] == "elastic_sphere"
    assert assumed["laboratory"]["log_factor"][0]["prior_sd"] == 0.05
    shared = table | {"shared_1": np.full(8, 0.02)}
    # The shared errors of curves contain that of the tip.
    found = bi.summary(bi.extract(shared, "cubic", **short))["laboratory"]
    assert (found["log_factor"][0]["prior_sd"], found["log_contrast"]["prior_sd"]) == (0, 0.05)


@pytest.mark.parametrize(
    "technique", ["exact", pytest.param("elastic_sphere", marks=pytest.mark.long)]
)
def test_a_silent_fault_shifts_the_constants_as_the_table_of_assumptions_says(technique):
    table = measured("cubic", COPPER)
    exact = modulus("cubic", COPPER, table["euler_deg"])
    values, mean = table["indentation_modulus_gpa"], log_mean("cubic", COPPER)
    asked = {"technique": technique, "knowledge": BULK}
    base = bi.summary(bi.extract(table, "cubic", **asked))
    asked |= {"samples": 2000, "burn_in": 3000}
    assumed = {row["assumption"]: row for row in base["assumptions"]}
    sds = np.array([base["parameters"][name]["sd"] for name in NAMES])
    should_be = {
        "kind: sample_modulus": values / (1 - 0.3**2),
        "factor": values * np.exp(-0.05),
        "contrast": values * np.exp(0.05 * (np.log(exact) - mean)),
        "added layer": 1 / (1 / values - 1 / 2000),
        "neighbours": values * np.exp(-np.log(0.9) * (np.log(exact) - mean)),
    }
    for name, moduli in should_be.items():
        other = bi.summary(
            bi.extract(table | {"indentation_modulus_gpa": moduli}, "cubic", **asked)
        )
        made = means(other) - means(base)
        stated = [assumed[name]["shift"][constant] for constant in NAMES]
        # A covariance with the change of the moduli, in their sds, over 15,000 draws; what is not
        # linear; and the noise of the two means.
        change = np.linalg.norm((moduli - values) / table["sd_gpa"])
        accuracy = sds * (3 * change / np.sqrt(15000) + 0.1) + 0.05 * np.abs(made)
        assert np.all(np.abs(made - stated) < accuracy), (name, made, stated)
    asked["knowledge"] = {"bulk_modulus": (139.1, 2)}
    other = bi.summary(bi.extract(table, "cubic", **asked))
    stated = [assumed["known: bulk_modulus"]["shift"][constant] for constant in NAMES]
    assert means(other) - means(base) == pytest.approx(stated, rel=0.1, abs=0.35)
    included = {name: row["included"] for name, row in assumed.items()}
    assert included["factor"] == included["contrast"] == (technique != "exact")
    assert included["known: bulk_modulus"] and not included["kind: sample_modulus"]
    assert assumed["kind: sample_modulus"]["text"].startswith("If these are moduli of the kind ")


def references(tmp_path, *crystals):
    """A file of reference crystals."""
    rows = ["reference,symmetry,C11,C12,C44,phi1_deg,Phi_deg,phi2_deg"]
    rows += [f"{name},cubic,{','.join(map(str, constants))},0,0,0" for name, constants in crystals]
    (tmp_path / "crystals.csv").write_text("\n".join(rows) + "\n")
    return tmp_path / "crystals.csv"


def with_references(tmp_path, grains, references):
    """The path of a table of grains and of references, (name, table)."""
    rows = ["reference,phi1_deg,Phi_deg,phi2_deg,indentation_modulus_gpa,sd_gpa"]
    for name, table in [("", grains), *references]:
        rows += [
            ",".join([name, *map(str, angles), repr(float(value)), repr(float(sd))])
            for angles, value, sd in zip(
                table["euler_deg"], table["indentation_modulus_gpa"], table["sd_gpa"], strict=True
            )
        ]
    (tmp_path / "table.csv").write_text("\n".join(rows) + "\n")
    return tmp_path / "table.csv"


def test_references_determine_the_factor_of_the_tip_and_the_contrast_of_elastic_contacts(tmp_path):
    """The linear update in closed form, in ln f and ln(1+k)."""
    silicon, noise, factor, contrast = (165.6, 63.9, 79.5), 0.01, 1.06, 0.95
    known = measured("cubic", silicon, 12, 5, factor=factor, contrast=contrast, noise=noise)
    grains = measured("cubic", COPPER, 10, factor=factor, contrast=contrast, noise=0.005)
    table = with_references(tmp_path, grains, [("Si", known)])
    asked = {
        "references": references(tmp_path, ("Si", silicon)),
        "knowledge": BULK,
        "samples": 1000,
        "burn_in": 2000,
    }
    exact, mean = modulus("cubic", silicon, known["euler_deg"]), log_mean("cubic", silicon)
    effect = np.column_stack([np.ones(12), np.log(exact) - mean])
    deviation = np.log(known["indentation_modulus_gpa"] / exact)
    prior = np.diag([0.05**2, 0.05**2])
    errors = noise**2 * np.eye(12) + 0.01**2
    precision = np.linalg.inv(prior) + effect.T @ np.linalg.solve(errors, effect)
    covariance = np.linalg.inv(precision)
    expected = covariance @ effect.T @ np.linalg.solve(errors, deviation)
    found = bi.summary(bi.extract(table, "cubic", technique="elastic_sphere", **asked))
    assert len(found["predicted"]) == 10
    laboratory = found["laboratory"]
    given = covariance[0, 0] - covariance[0, 1] ** 2 / covariance[1, 1]
    (of_factor,), of_contrast = laboratory["log_factor"], laboratory["log_contrast"]
    assert of_factor["prior_mean"] == pytest.approx(expected[0], abs=2e-3)
    assert of_factor["prior_sd"] == pytest.approx(np.sqrt(given), rel=0.01)
    assert of_contrast["prior_mean"] == pytest.approx(expected[1], abs=2e-3)
    assert of_contrast["prior_sd"] == pytest.approx(np.sqrt(covariance[1, 1]), rel=0.02)
    assert abs(of_factor["mean"] - np.log(factor)) < 3 * of_factor["sd"]
    del asked["references"]
    without = bi.summary(bi.extract(grains, "cubic", technique="elastic_sphere", **asked))
    assert found["parameters"]["C44"]["sd"] < 0.8 * without["parameters"]["C44"]["sd"]
    # Of plastic imprints the pile-up and the contrast of another metal stay unknown.
    asked |= {"references": tmp_path / "crystals.csv", "technique": "oliver_pharr"}
    plastic = bi.summary(bi.extract(table, "cubic", **asked))["laboratory"]
    assert plastic["log_contrast"]["prior_sd"] == pytest.approx(0.4)
    assert plastic["log_factor"][0]["prior_sd"] == pytest.approx(0.15, abs=0.01)


def test_references_that_are_not_known_are_refused(tmp_path):
    table = with_references(
        tmp_path, measured("cubic", COPPER, 4), [("W", measured("cubic", COPPER, 2))]
    )
    with pytest.raises(bi.InputError, match="line 6: the reference W is no crystal of &references"):
        bi.extract(table, "cubic", references=references(tmp_path, ("Si", COPPER)))


def test_a_calibration_sd_raises_no_false_alarm():
    """The shared column of the check is not made of predicted moduli: these have the
    orientations.
    """
    document = bi.summary(
        bi.extract(
            titanium(),
            "hexagonal",
            sample_nu=0.28,
            technique="exact",
            calibration_sd=0.2,
            samples=500,
            chains=2,
            knowledge={"bulk_modulus": (107, 3)},
        )
    )
    assert not {"unexplained", "misread"} & set(codes(document["warnings"]))


def of_titanium(knowledge, **asked):
    return bi.extract(
        titanium(),
        "hexagonal",
        sample_nu=0.28,
        technique="oliver_pharr",
        scatter="inferred",
        knowledge=knowledge,
        **{"samples": 2000, "burn_in": 3000} | asked,
    )


def test_titanium_with_the_constants_of_the_literature():
    result = of_titanium({name: (value, 0.02 * value) for name, value in TITANIUM.items()})
    found = bi.summary(result)["laboratory"]["log_factor"][0]
    assert found["mean"] == pytest.approx(0.21, abs=0.03)
    # The contrast at its median: its prior has the mean -0.15 of the logarithm.
    assert float(np.median(result.posterior["contrast"])) - 1 == pytest.approx(-0.56, abs=0.08)


def test_titanium_with_the_constants_fixed():
    known = {name: (value, 2e-4 * value) for name, value in TITANIUM.items()}
    document = bi.summary(of_titanium(known, contrast_mean=0.0, contrast_sd=1.0))
    # By least squares: ln f 0.212 ± 0.002, k -0.56 ± 0.06; the scatter is 1.4 %.
    factor, contrast = document["laboratory"]["log_factor"][0], document["parameters"]["contrast"]
    assert factor["mean"] == pytest.approx(0.212, abs=0.004)
    assert factor["sd"] == pytest.approx(0.002, abs=0.001)
    assert contrast["mean"] - 1 == pytest.approx(-0.56, abs=0.03)
    assert contrast["sd"] == pytest.approx(0.06, abs=0.01)
    assert document["parameters"]["scatter"]["mean"] == pytest.approx(0.015, abs=0.003)


@pytest.mark.long
def test_titanium_with_the_bulk_modulus_alone():
    document = bi.summary(of_titanium({"bulk_modulus": (107, 3)}))
    for name, value in TITANIUM.items():
        found = document["parameters"][name]
        assert abs(found["mean"] - value) < 2 * found["sd"], name
    assert document["parameters"]["contrast"]["share"]["prior"] > 0.4
    assert document["parameters"]["C44"]["verdict"] != "determined"
    budget = document["error_budget"]["C44"]
    assert sum(budget.values()) == pytest.approx(1)
    # The laboratory's factor and contrast, not the scatter of the moduli, limit C44.
    assert budget["calibration"] + budget["contrast"] > 5 * (budget["noise"] + budget["grains"])


def test_clean_tables_read_as_oliver_pharr():
    """The prior does not bias: `bench laboratory` has more."""
    z = []
    for seed in range(6):
        table = measured("cubic", COPPER, 20, seed)
        asked = {"technique": "oliver_pharr", "knowledge": BULK, "samples": 1000, "chains": 2}
        found = bi.summary(bi.extract(table, "cubic", **asked))["parameters"]["C44"]
        z.append((found["mean"] - COPPER[2]) / found["sd"])
    assert abs(np.mean(z)) < 0.5
