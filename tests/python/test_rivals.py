"""Other models of the measurements: injected faults are named, and make the result unusable where
they change it; what is stated right stays usable.
"""

import numpy as np
import pytest

import bayesindent as bi
from bayesindent.crystal.elasticity import constant_names, halfspace_modulus, stiffness_rows
from support.densities import Posterior
from support.diagnostics import codes, of_code
from support.evidence import THEORY, laplace_log_z, nested_log_z
from support.step_2_cases import KIND

SHORT = {"samples": 25, "burn_in": 400, "chains": 2, "technique": "exact"} | KIND
CRYSTALS = {
    "copper": ("cubic", (168.4, 121.4, 75.4)),
    "zinc": ("hexagonal", (163.7, 36.4, 38.8, 63.5, 53.0)),
    "titanium": ("hexagonal", (162.4, 92.0, 46.7, 180.7, 69.0)),
    "tungsten": ("cubic", (523.0, 203.0, 160.0)),
    "aluminium": ("cubic", (107.3, 60.8, 28.3)),
    "naphthalene": (
        "2/m",
        (7.8, 4.45, 3.4, -0.6, 9.9, 2.3, -2.7, 11.9, 2.9, 3.3, -0.5, 2.1, 4.15),
    ),
    "tin": ("tetragonal", (72.3, 59.4, 35.8, 88.4, 22.0, 24.0)),
}


def measured(name, grains=20, seed=1, noise=0.02, stated=0.02):
    """A table of grains in random orientations by the exact theory."""
    symmetry, constants = CRYSTALS[name]
    rng = np.random.default_rng(seed)
    euler = np.column_stack(
        [
            rng.uniform(0, 360, grains),
            np.degrees(np.arccos(rng.uniform(-1, 1, grains))),
            rng.uniform(0, 360, grains),
        ]
    )
    modulus = halfspace_modulus(stiffness_rows(symmetry, [constants])[0], euler)
    table = {
        "euler_deg": euler,
        "modulus_gpa": modulus * (1 + noise * rng.normal(size=grains)),
        "sd_gpa": stated * modulus,
    }
    return table, rng


def diagnosed(table, symmetry, **settings):
    """The document, of which all that holds for any diagnosis is checked."""
    document = bi.summary(bi.extract(table, symmetry=symmetry, **SHORT | settings))
    odds = [rival["log_odds"] for rival in document["diagnosis"]]
    assert odds == sorted(odds, reverse=True) and np.all(np.isfinite(odds))
    for rival in document["diagnosis"]:
        assert rival["group"] in ("symmetry", "orientations", "time", "noise", "statements")
        assert rival["explanation"] and isinstance(rival["remedy"], str)
        of_class = rival["remedy"].partition("symmetry = ")[2].strip("'") or symmetry
        assert list(rival["constants"]) == list(constant_names(of_class))
    return document


def compared(table, symmetry, **settings):
    """What explains a table, without chains; see `diagnose` of `Posterior`."""
    return Posterior.of(table, surrogate=THEORY, symmetry=symmetry, **KIND, **settings).diagnose()


def assert_unusable(document, *expected):
    """Whether the result cannot be used for these reasons, and its headline is the first one."""
    assert not document["usable"]
    found = [item for item in document["warnings"] if item["severity"] == "unusable"]
    assert set(expected) <= set(codes(found))
    assert found[0]["code"] == expected[0]


def test_zinc_declared_cubic():
    table, _ = measured("zinc")
    document = diagnosed(table, "cubic")
    best = document["diagnosis"][0]
    assert best["explanation"] == "hexagonal crystals" and best["log_odds"] > 500
    assert best["remedy"] == "symmetry = 'hexagonal'"
    assert_unusable(document, "other_model", "unexplained", "residuals_wrong")
    assert "determined" not in [item["verdict"] for item in document["parameters"].values()]
    # Once it is stated, nothing explains the measurements better.
    again = diagnosed(table, "hexagonal")
    assert again["diagnosis"][0]["log_odds"] < 3
    assert not of_code(again["warnings"], "other_model", "other_model_likely")


@pytest.mark.parametrize(
    ("name", "stated", "expected"),
    [("titanium", "cubic", "hexagonal"), ("tin", "cubic", "tetragonal")],
)
def test_wrong_class(name, stated, expected):
    best = diagnosed(measured(name)[0], stated)["diagnosis"][0]
    assert best["explanation"] == f"{expected} crystals" and best["log_odds"] > 20


def test_seven_of_twenty_moduli_too_high():
    table, rng = measured("copper")
    rows = np.sort(rng.choice(20, 7, replace=False))
    table["modulus_gpa"][rows] *= 1.6
    document = diagnosed(table, "cubic")
    assert document["diagnosis"][0]["group"] == "noise"
    named = ", ".join(str(row + 1) for row in rows)
    assert document["diagnosis"][0]["explanation"].endswith(f": {named}")
    assert f"outliers: {named}" in [rival["explanation"] for rival in document["diagnosis"]]
    assert_unusable(document, "other_model", "residuals_wrong")


def test_two_outliers():
    table, _ = measured("copper")
    table["modulus_gpa"][[3, 11]] *= 1.3
    best = diagnosed(table, "cubic")["diagnosis"][0]
    assert best["explanation"] == "outliers: 4, 12" and best["log_odds"] > 100
    # The constants without the outliers agree with those of the rest of the table.
    kept = np.delete(np.arange(20), [3, 11])
    rest = {name: np.asarray(values)[kept] for name, values in table.items()}
    expected = bi.summary(
        bi.extract(rest, symmetry="cubic", **SHORT | {"samples": 1000, "burn_in": 2000})
    )["parameters"]
    for name, item in best["constants"].items():
        assert item["mean"] == pytest.approx(expected[name]["mean"], abs=0.5 * expected[name]["sd"])


@pytest.mark.parametrize(("likelihood", "remedy"), [("normal", "student"), ("student", "look at")])
def test_the_remedy_of_outliers_is_not_stated_already(likelihood, remedy):
    table, _ = measured("copper")
    table["modulus_gpa"][[1, 3, 5, 7]] *= 1.5
    rivals = diagnosed(table, "cubic", likelihood=likelihood)["diagnosis"]
    (found,) = (rival for rival in rivals if rival["explanation"] == "outliers: 2, 4, 6, 8")
    assert remedy in found["remedy"]


def test_equal_bounds_state_a_constant():
    table, _ = measured("copper")
    known = {"C12": (121.4, 121.4)}
    with pytest.raises(bi.InputError, match="C12 has equal bounds.* quantity = 'C12', mean, sd"):
        diagnosed(table, "cubic", bounds=known)
    bounds = {"C11": (50, 400), "C44": (10, 200)} | known
    document = diagnosed(table, "cubic", bounds=bounds, samples=2500, burn_in=1000)
    verdicts = {name: item["verdict"] for name, item in document["parameters"].items()}
    assert verdicts == {"C11": "determined", "C12": "stated", "C44": "determined"}
    assert not of_code(document["warnings"], "not_determined", "truncated")


def test_drift_with_the_rows():
    table, _ = measured("copper")
    table["modulus_gpa"] *= 1 + 0.1 * np.linspace(-0.5, 0.5, 20)
    best = diagnosed(table, "cubic")["diagnosis"][0]
    assert best["explanation"] == "a drift of the moduli with row" and best["log_odds"] > 7


def test_sds_too_small():
    """The moduli follow their orientations all the same."""
    table, _ = measured("copper", noise=0.04, stated=0.04 / 3)
    document = diagnosed(table, "cubic")
    assert document["diagnosis"][0]["group"] == "noise"
    assert document["diagnosis"][0]["log_odds"] > 10
    assert_unusable(document, "other_model", "residuals_wrong")
    assert document["checks"]["misfit"]["order_log_odds"] > 0
    assert not of_code(document["warnings"], "unexplained")


@pytest.mark.parametrize(
    ("reading", "change"),
    [
        ("reverse order", lambda euler: euler[::-1]),
        ("one row further up", lambda euler: np.roll(euler, 1, axis=0)),
    ],
)
def test_readings_of_the_table(reading, change):
    table, _ = measured("titanium", 30)
    table["euler_deg"] = change(table["euler_deg"])
    best = diagnosed(table, "hexagonal")["diagnosis"][0]
    assert reading in best["explanation"] and best["log_odds"] > 7


def test_shuffled_orientations():
    table, rng = measured("titanium", 30)
    table["euler_deg"] = table["euler_deg"][rng.permutation(30)]
    document = diagnosed(table, "hexagonal")
    assert document["checks"]["misfit"]["order_log_odds"] > 0
    assert of_code(document["warnings"], "unexplained")


def test_axes_that_the_class_makes_equal():
    """With x reversed a monoclinic crystal is one of the same class. What is left of the odds is
    the share of one of ten to twenty readings in one of five groups, and the error of Laplace's
    approximation in thirteen dimensions.
    """
    table, _ = measured("naphthalene", 40)
    found = compared(table, "2/m")
    odds = dict(zip(found["rivals"], found["log_odds"], strict=True))
    reversed_axes = next(name for name in odds if "the crystal axes with x reversed" in name)
    assert -np.log(5 * 20) - 2 < odds[reversed_axes] < -np.log(5 * 10) + 2


@pytest.mark.parametrize("name", ["copper", "titanium", "tin"])
def test_clean_tables(name):
    table, _ = measured(name, 30, 4)
    document = diagnosed(table, CRYSTALS[name][0])
    assert document["diagnosis"][0]["log_odds"] < 3
    assert not of_code(
        document["warnings"], "other_model", "unexplained", "residuals_wrong", "limit_excludes"
    )


@pytest.mark.parametrize(
    ("name", "grains"),
    [("copper", 5), ("copper", 20), ("copper", 200), ("tungsten", 40), ("aluminium", 40)],
)
def test_clean_tables_of_few_and_many_grains(name, grains):
    """Also of crystals that are nearly isotropic."""
    found = compared(measured(name, grains, 7)[0], "cubic")
    assert found["log_odds"][0] < 3
    assert found["p"] > 1e-3


def test_a_thousand_grains_with_sds_12_percent_too_small():
    """Chi-square finds it, but it hardly matters."""
    found = compared(measured("copper", 1000, 5, stated=0.02 * 0.88)[0], "cubic")
    assert found["log_odds"][0] < 7
    assert found["p"] < 1e-6 and found["factor"] < 1.3


def test_two_outliers_of_six_hundred_grains():
    table, _ = measured("copper", 600)
    table["modulus_gpa"][[122, 457]] *= 1.3
    found = compared(table, "cubic")
    assert found["rivals"][0] == "noise: outliers: 123, 458" and found["log_odds"][0] > 100


def test_a_crystal_that_contradicts_the_default_prior():
    """Bulk over shear modulus is a thirtieth of the usual: neither a measurement nor the knowledge
    alone is blamed.
    """
    bulk, shear = 4.0, 45.0
    symmetry, _ = CRYSTALS["copper"]
    table, rng = measured("copper")
    constants = (bulk + 4 * shear / 3, bulk - 2 * shear / 3, 50.0)
    modulus = halfspace_modulus(stiffness_rows(symmetry, [constants])[0], table["euler_deg"])
    table["modulus_gpa"] = modulus * (1 + 0.02 * rng.normal(size=20))
    table["sd_gpa"] = 0.02 * modulus
    document = diagnosed(table, symmetry, knowledge={"bulk_modulus": (bulk, 0.1)})
    named = of_code(document["warnings"], "other_model", "other_model_likely")
    assert "a crystal that the default prior takes as improbable" in named[0]["subject"]
    assert not of_code(document["warnings"], "knowledge_contradicts", "knowledge_conflict")
    assert document["diagnosis"][2]["log_odds"] < 3


@pytest.mark.parametrize("name", ["copper", "titanium"])
def test_evidence_against_nested_sampling(name):
    """A ridge that bounds cut, in three dimensions and in five."""
    table, _ = measured(name)
    symmetry, constants = CRYSTALS[name]
    bounds = {
        constant: (0.75 * value, 1.2 * value)
        for constant, value in zip(constant_names(symmetry), constants, strict=True)
    }
    expected, error = nested_log_z(table, bounds, symmetry=symmetry)
    assert laplace_log_z(table, bounds, symmetry=symmetry) == pytest.approx(
        expected, abs=0.5 + 2 * error
    )


def test_bounds_that_exclude_the_crystal():
    table, _ = measured("copper", 40)
    bounds = {"C11": (100, 300), "C12": (50, 250), "C44": (110, 160)}
    document = diagnosed(table, "cubic", bounds=bounds)
    assert_unusable(document, "limit_excludes")


def test_bounds_of_one_constant_truncate_the_default_prior():
    """An end of the range of bounds counts as none; elsewhere a limit near the middle of what is
    determined excludes half of it and is no error.
    """
    table, _ = measured("copper", 40)
    sides = {"C44": (70.0, 75.0)}
    document = diagnosed(table, "cubic", bounds=sides)
    assert any("default prior" in words for words in document["prior"]["density"])
    assert document["parameters"]["C11"]["mean"] < 300
    assert not of_code(document["warnings"], "limit_excludes")
    assert (
        diagnosed(table, "cubic", bounds=sides | {"C11": (-500, 5000)})["parameters"]
        == (document["parameters"])
    )


def test_one_end_of_a_constant():
    table, _ = measured("copper")
    document = diagnosed(table, "cubic", bounds={"C12": (100.0, None), "C44": (None, 90.0)})
    assert "bounds in GPa: C12 above 100.0, C44 up to 90.0" in document["prior"]["density"]


def test_bounds_and_knowledge_that_contradict():
    """Copper whose bulk modulus is stated right, and bounds that exclude it. The moduli alone admit
    both, so that either may be wrong, and both are named.
    """
    table, _ = measured("copper", 24)
    bounds = {"C11": (250, 350), "C12": (180, 260), "C44": (60, 120)}
    document = diagnosed(table, "cubic", bounds=bounds, knowledge={"bulk_modulus": (137.1, 2.7)})
    first, second = document["diagnosis"][:2]
    assert {first["explanation"], second["explanation"]} == {
        "bulk_modulus = 137.1 of another crystal",
        "crystals beyond the limits of the prior",
    }
    assert first["log_odds"] - 4 < second["log_odds"] > 300
    assert not document["usable"]


def test_sharp_knowledge_is_widened_and_said_so():
    table, _ = measured("copper")
    document = diagnosed(table, "cubic", knowledge={"bulk_modulus": (137.1, 1e-4)})
    (found,) = of_code(document["warnings"], "knowledge_sharp")
    assert found["subject"] == "bulk_modulus = 137.1 ± 0.14 GPa"
    known = document["prior"]["knowledge"][0]
    assert known["sd"] == pytest.approx(0.1371)
    document = diagnosed(table, "cubic", knowledge={"bulk_modulus": (137.1, 0.1371)})
    assert not of_code(document["warnings"], "knowledge_sharp")


def test_a_stated_model_whose_integral_is_lost():
    """Beta brass with an outlier among five grains: the best crystal is nearly unstable, where the
    cheap theory of the comparison is far off. No other model is named by hundreds.
    """
    symmetry, constants = "cubic", (129.0, 110.0, 82.0)
    rng = np.random.default_rng(1)
    euler = np.column_stack(
        [
            rng.uniform(0, 360, 5),
            np.degrees(np.arccos(rng.uniform(-1, 1, 5))),
            rng.uniform(0, 360, 5),
        ]
    )
    modulus = halfspace_modulus(stiffness_rows(symmetry, [constants])[0], euler)
    table = {"euler_deg": euler, "modulus_gpa": modulus * (1 + 0.02 * rng.normal(size=5))}
    table |= {"sd_gpa": 0.02 * modulus}
    table["modulus_gpa"][1] *= 1.3
    document = diagnosed(table, symmetry)
    # Chi-square, and so twice the log odds that any model can gain, is below a hundred.
    assert document["checks"]["misfit"]["chi_square"] < 100
    assert document["diagnosis"][0]["log_odds"] < 50


def test_a_second_phase_beside_a_stated_scatter():
    """The errors of the moduli are those of the scatter."""
    table, _ = measured("tungsten", 24, noise=0.003, stated=0.003)
    table["modulus_gpa"][[2, 7, 11, 15, 20]] *= 0.7
    rivals = diagnosed(table, "cubic", scatter_sd=0.02)["diagnosis"]
    named = "grains of a second phase, about 0.7 times as stiff: 3, 8, 12, 16, 21"
    assert named in [rival["explanation"] for rival in rivals[:3]]


def test_bounds_of_another_unit_end_in_bounded_time():
    """C44 of copper within 500 .. 600: only extremely anisotropic crystals are left."""
    table, _ = measured("copper")
    bounds = {"C11": (100, 300), "C12": (50, 250), "C44": (500, 600)}
    document = diagnosed(table, "cubic", bounds=bounds)
    assert_unusable(document, "limit_excludes", "other_model", "residuals_wrong")
    assert document["diagnosis"][0]["explanation"] == "crystals beyond the limits of the prior"


def test_a_compressibility_in_the_wrong_unit():
    """2.4 1/TPa, as 0.0024 1/GPa."""
    table, _ = measured("copper")
    with pytest.raises(bi.InputError, match="no stable solid has this knowledge"):
        diagnosed(table, "cubic", knowledge={"compressibility[100]": (0.0024, 0.00005)})


def test_object():
    """`bi.analysis` has the same list as the document."""
    table, _ = measured("copper")
    found = bi.analysis(table, symmetry="cubic", **SHORT)
    assert found.diagnosis() == found.summary()["diagnosis"]
