"""Simulations at the posterior of the measurements: the loop of Step 1 that Step 2 closes."""

import json

import numpy as np
import pytest

import bayesindent as bi
from bayesindent.crystal.elasticity import stiffness_rows
from support.diagnostics import issues, of_code

COPPER = (168.4, 121.4, 75.4)
#: What a specimen does to the exact modulus of a half-space: a made-up one, smooth in the crystal,
#: by up to 30 %.
ANGLES = np.column_stack(
    [
        np.linspace(5, 340, 9),
        np.degrees(np.arccos(np.linspace(0.97, 0.05, 9))),
        np.linspace(12, 300, 9),
    ]
)


def specimen(stiffness, euler_deg):
    """The modulus of a grain over something softer: made up, smooth in the crystal."""
    modulus = float(bi.halfspace_modulus(stiffness, np.asarray(euler_deg)[None])[0])
    return (
        modulus
        * (1.0 - 0.3 / (1.0 + 120.0 / modulus))
        * (1.0 + 0.01 * np.log(np.linalg.det(stiffness) ** (1 / 6) / 100) ** 2)
    )


def table(constants=COPPER, noise=0.01, seed=3):
    stiffness = stiffness_rows("cubic", [constants])[0]
    exact = np.array([specimen(stiffness, angles) for angles in ANGLES])
    return {
        "phi1_deg": ANGLES[:, 0],
        "Phi_deg": ANGLES[:, 1],
        "phi2_deg": ANGLES[:, 2],
        "modulus_gpa": exact * (1 + noise * np.random.default_rng(seed).normal(size=len(exact))),
        "sd_gpa": noise * exact,
    }


def problem_of(folder, rows, **groups):
    folder.mkdir(exist_ok=True)
    file = folder / "grains.csv"
    np.savetxt(
        file,
        np.column_stack(list(rows.values())),
        delimiter=",",
        header=",".join(rows),
        comments="",
    )
    grain = {
        "geometry": "grain",
        "grain_radius_um": 3,
        "estimator": "curve",
        "matrix": "isotropic",
        "matrix_young_gpa": 60,
        "matrix_nu": 0.3,
    }
    asked = {
        "problem": {"symmetry": "cubic", "seed": 4, "synthetic": True},
        "specimen": grain,
        "simulation": {"simulator": "import"},
        "design": {"budget": 60},
        "measurements": {"file": str(file), "modulus_kind": "indentation_modulus"},
        "knowledge": {
            "quantity": "bulk_modulus",
            "mean": sum(COPPER[i] for i in (0, 1, 1)) / 3,
            "sd": 3,
        },
    }
    return bi.Problem.from_keywords(
        "test",
        **{name: {**asked.get(name, {}), **groups.get(name, {})} for name in {**asked, **groups}},
    )


def infer(folder, surrogate, rows):
    known = {"bulk_modulus": (137, 3)}
    result = bi.extract(
        folder / "grains.csv",
        symmetry="cubic",
        surrogate=surrogate,
        modulus_kind="indentation_modulus",
        knowledge=known,
        technique="exact",
        samples=2000,
    )
    return bi.summary(result)


@pytest.mark.long
@pytest.mark.filterwarnings("ignore")
def test_the_surrogate_is_accurate_where_the_posterior_is(tmp_path):
    rows = table()
    surrogate = bi.build(problem_of(tmp_path, rows), tmp_path / "out", simulate=specimen)
    document = json.loads((tmp_path / "out" / "build.json").read_text())
    assert document["stopped"] == "the surrogate is accurate at the posterior"
    assert document["simulations"] < 40
    last = document["focus"][-1]
    assert (
        max(last["surrogate_share"].values()) <= 0.1
        and last["rms_z"] <= 1.5
        and not last["truncated"]
    )
    found = infer(tmp_path, surrogate, rows)
    assert found["usable"], found["reasons"]
    assert max(budget["surrogate"] for budget in found["error_budget"].values()) <= 0.15
    for (name, one), true in zip(found["parameters"].items(), COPPER, strict=True):
        assert abs(one["mean"] - true) < 3 * one["sd"], name


@pytest.mark.long
@pytest.mark.filterwarnings("ignore")
def test_two_first_domains_give_one_posterior(tmp_path):
    """One does not hold the crystal; its surrogate must be widened."""
    rows, found = table(), []
    for name, domain in (
        ("wide", {}),
        ("narrow", {"log_anisotropy_max": 0.4, "poisson_min": 0.2, "poisson_max": 0.36}),
    ):
        surrogate = bi.build(
            problem_of(tmp_path / name, rows, domain=domain),
            tmp_path / name / "out",
            simulate=specimen,
        )
        found.append(infer(tmp_path / name, surrogate, rows))
        assert found[-1]["usable"], found[-1]["reasons"]
    for name, one in found[0]["parameters"].items():
        other = found[1]["parameters"][name]
        shares = sum(document["error_budget"][name]["surrogate"] for document in found)
        # Chains of four thousand samples differ by some hundredths of an sd, too.
        assert abs(one["mean"] - other["mean"]) <= (2 * np.sqrt(shares) + 0.1) * one["sd"], name


@pytest.mark.long
@pytest.mark.filterwarnings("ignore")
def test_a_constant_that_is_known_does_not_keep_the_loop_from_ending(tmp_path):
    problem = problem_of(
        tmp_path,
        table(),
        prior={"c_min": [10, COPPER[1], 10], "c_max": [900, COPPER[1], 500]},
        design={"budget": 40},
    )
    bi.build(problem, tmp_path / "out", simulate=specimen)
    document = json.loads((tmp_path / "out" / "build.json").read_text())
    assert document["stopped"] == "the surrogate is accurate at the posterior"
    # Of what rounding leaves of its variance.
    assert document["focus"][-1]["surrogate_share"]["C12"] < 0.01


@pytest.mark.long
@pytest.mark.filterwarnings("ignore")
def test_an_interrupted_loop_goes_on_as_if_it_were_not(tmp_path):
    """Stopped over the domain, inside a round, and between two."""
    rows, calls = table(), []

    def counted(stiffness, euler_deg):
        calls.append(1)
        if len(calls) in stops:
            raise KeyboardInterrupt
        return specimen(stiffness, euler_deg)

    documents = []
    for name, stops in (("whole", ()), ("broken", (6, 18, 24))):
        calls.clear()
        problem = problem_of(tmp_path / name, rows, execution={"workers": 1})
        for _ in range(len(stops)):
            with pytest.raises(KeyboardInterrupt):
                bi.build(problem, tmp_path / name / "out", simulate=counted)
        surrogate = bi.build(problem, tmp_path / name / "out", simulate=counted)
        documents.append(
            (
                json.loads((tmp_path / name / "out" / "build.json").read_text()),
                surrogate.coefficients,
            )
        )
        # Nothing is simulated twice.
        assert len(calls) == documents[-1][0]["simulations"] + len(stops)
    assert documents[0][0]["focus"] == documents[1][0]["focus"]
    assert documents[0][0]["history"] == documents[1][0]["history"]
    assert np.array_equal(documents[0][1], documents[1][1])


@pytest.mark.filterwarnings("ignore")
def test_without_measurements_or_with_the_papers_model_the_domain_is_simulated(tmp_path):
    rows = table()
    alone = problem_of(
        tmp_path, rows, design={"budget": 16}, measurements={"file": None, "modulus_kind": None}
    )
    stated = problem_of(tmp_path, rows, design={"budget": 16, "focus": "domain"})
    for i, problem in enumerate((alone, stated)):
        bi.build(problem, tmp_path / str(i), simulate=specimen)
        assert "focus" not in json.loads((tmp_path / str(i) / "build.json").read_text())


@pytest.mark.filterwarnings("ignore")
def test_what_the_budget_left_is_a_warning(tmp_path):
    with issues("surrogate_error") as told:
        bi.build(
            problem_of(tmp_path, table(noise=0.002), design={"budget": 15}),
            tmp_path / "out",
            simulate=specimen,
        )
    for found in of_code(told, "surrogate_error"):
        assert found["subject"] in ("C11", "C12", "C44") and found["numbers"]["percent"] > 10
        assert (found["numbers"]["allowed"], found["numbers"]["budget"]) == pytest.approx((10, 15))
