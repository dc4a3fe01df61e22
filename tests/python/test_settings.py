"""One settings layer: keywords and files give the same words."""

import copy
import dataclasses
import pickle
import re

import numpy as np
import pytest

import bayesindent as bi
from bayesindent.settings.problem import schema, stages
from support.diagnostics import notes
from support.paper_domains import DOMAIN
from support.tree import SOURCE

#: What is wrong with a group.
WRONG = {
    "word": (
        "specimen",
        {"geometry": "cube"},
        "&specimen geometry: 'cube' is not known; allowed 'halfspace', 'block'",
    ),
    "range": (
        "indenter",
        {"radius_um": -1.0},
        "&indenter radius_um: -1.0 is out of range; allowed 0.001 to 1e6 um",
    ),
    "integer": (
        "design",
        {"budget": 2.5},
        "&design budget: 2.5 is not an integer; allowed 1 to 1000000",
    ),
    "infinite": (
        "next",
        {"sd_gpa": float("inf")},
        "&next sd_gpa: inf is not a finite number; allowed 0 to 1000 GPa",
    ),
    "text": (
        "simulation",
        {"depths": "ten"},
        "&simulation depths: the text 'ten' stands where an integer is needed; allowed 1 to 1000",
    ),
    "number": (
        "sampler",
        {"method": 3},
        "&sampler method: 3 is not in quotes; a text is needed; allowed 'ensemble', 'scmh'",
    ),
    "name": (
        "specimen",
        {"geometri": "block"},
        "&specimen geometri: unknown variable, did you mean geometry?; allowed: geometry, "
        "estimator, width_um, ",
    ),
    "count": ("prior", {"c_min": [1, 2]}, "&prior c_min: 2 values; 3 are needed: C11, C12, C44"),
    "lists": (
        "knowledge",
        {"quantity": ["C11"], "mean": [200.0, 1.0], "sd": [2, 3]},
        "&knowledge quantity: the number of values is 1, that of mean is 2; each quantity",
    ),
    "twice": (
        "indenter",
        {"depth_um": 0.1, "contact_radius_um": 0.5},
        "&indenter depth_um: the last point is stated twice",
    ),
    "sphere": (
        "indenter",
        {"shape": "sphere", "depth_um": 16.0},
        "&indenter depth_um: 16.0 um is beyond the tip; allowed below its radius_um",
    ),
    "block": (
        "specimen",
        {"geometry": "block", "width_um": 1.5},
        "&specimen width_um: 1.5 um is too narrow for a contact radius of 0.5 um;",
    ),
    "crossed": (
        "prior",
        {"c_min": [9, 9, 9], "c_max": (8, 10, 10)},
        "&prior c_min: the lower bound of C11, 9.0 GPa, is not below the upper one, 8.0 GPa",
    ),
}


@pytest.mark.parametrize("case", WRONG)
def test_keywords_and_files_give_the_same_words(tmp_path, case):
    group, values, expected = WRONG[case]

    def spelled(value):
        return ", ".join(map(spelled, value)) if isinstance(value, list | tuple) else repr(value)

    lines = "\n".join(f"{name} = {spelled(value)}" for name, value in values.items())
    path = tmp_path / "a.nml"
    path.write_text(
        f"&problem symmetry = 'cubic' /\n{DOMAIN['cubic']}&design /\n".replace(f"&{group} /\n", "")
        + f"&{group}\n{lines}\n/\n"
    )
    with pytest.raises(bi.InputError) as file:
        bi.Problem(path, "build")
    with pytest.raises(bi.InputError) as keywords:
        bi.Problem.from_keywords("Something", problem={"symmetry": "cubic"}, **{group: values})
    assert str(keywords.value).startswith(f"Something: {expected}")
    assert str(file.value) == str(keywords.value).replace("Something", str(path))


@pytest.mark.parametrize("value", [object(), [], {}, 1j])
def test_values_that_no_file_could_have(value):
    with pytest.raises(bi.InputError, match="f: &specimen geometry: .* is neither number nor text"):
        bi.Problem.from_keywords("f", specimen={"geometry": value})


def test_keywords_are_resolved_as_files_are():
    problem = bi.Problem.from_keywords(
        "f",
        problem={"symmetry": "M-3m", "title": "it's"},
        simulation={"depths": np.int64(3), "refine": np.float64(0.5), "vtu": True},
        prior={"c_max": np.array([300.0, 200.0, 100.0])},
        knowledge={"quantity": ["C12", "C11"], "mean": [100, 200], "sd": [1, 2]},
    )
    settings = problem.settings
    assert (settings.problem.symmetry, settings.problem.title) == ("cubic", "it's")
    assert (settings.simulation.depths, settings.simulation.refine, settings.simulation.vtu) == (
        3,
        0.5,
        True,
    )
    assert (settings.prior.c_min, settings.prior.c_max.tolist()) == (None, [300.0, 200.0, 100.0])
    assert (settings.knowledge.quantity, settings.knowledge.sd.tolist()) == (
        ("C12", "C11"),
        [1.0, 2.0],
    )
    assert settings.design.budget == 40
    assert not settings.design.given
    # What is not given is the default.
    assert (
        bi.Problem.from_keywords("f", specimen={"geometry": None}).settings.specimen.geometry
        == "halfspace"
    )


MEASURED = {
    "phi1_deg": [0.0, 0.0],
    "Phi_deg": [10.0, 80.0],
    "phi2_deg": [20.0, 45.0],
    "Er": [200.0, 210.0],
    "sd_gpa": [4.0, 5.0],
}


def test_measurements_from_arrays():
    def problem(table, **measurements):
        return bi.Problem.from_keywords(
            "f", {"measurements": table}, problem={"symmetry": "cubic"}, measurements=measurements
        )

    made = problem(MEASURED)
    assert made.settings.measurements.modulus_kind == "effective_modulus"
    assert made.measurements.euler_deg.T.tolist() == list(MEASURED.values())[:3]
    assert (made.measurements.modulus_gpa.tolist(), made.measurements.sd_gpa.tolist()) == (
        MEASURED["Er"],
        MEASURED["sd_gpa"],
    )
    without = {name: values for name, values in MEASURED.items() if name != "sd_gpa"}
    assert problem(without, scale="inferred").measurements.sd_gpa is None
    single = {name: values[:1] for name, values in MEASURED.items()}
    assert problem(single).warnings[0]["code"] == "one_grain"
    gap = problem(MEASURED | {"Er": [200.0, np.nan]})
    assert len(gap.measurements) == 1 and "a value is missing: line 2" in notes(gap.warnings[:1])
    plain = {name.replace("Er", "modulus_gpa"): values for name, values in MEASURED.items()}
    for table, expected in (
        (
            MEASURED | {"Er": [200.0, 1e5]},
            "f: &measurements: line 2, column effective_modulus_gpa: 100000.0 GPa looks like MPa",
        ),
        (
            MEASURED | {"sd_gpa": [4.0, 0.0]},
            "f: &measurements: line 2, column sd_gpa: 0.0 GPa; a standard deviation is above 0",
        ),
        (without, "f: &measurements: the column sd_gpa is missing; it may be absent only with"),
        (
            plain,
            "f: &measurements: the column modulus_gpa does not say which modulus was measured, "
            "nor does modulus_kind; allowed 'inden",
        ),
    ):
        with pytest.raises(bi.InputError) as caught:
            problem(table)
        assert str(caught.value).startswith(expected)
    with pytest.raises(
        bi.InputError,
        match="modulus_kind = 'sample_modulus', but the moduli are those of the column Er;",
    ):
        problem(MEASURED, modulus_kind="sample_modulus")
    assert (
        problem(plain, modulus_kind="sample_modulus").settings.measurements.modulus_kind
        == "sample_modulus"
    )


def test_problems_are_made_anew(tmp_path):
    (tmp_path / "a.nml").write_text(
        f"&problem symmetry = 'cubic' /\n{DOMAIN['cubic']}&design budget = 7 /\n"
    )
    for problem in (
        bi.Problem(tmp_path / "a.nml", "build"),
        bi.Problem.from_keywords(
            "f",
            {"measurements": MEASURED},
            problem={"symmetry": "cubic"},
            measurements={},
            design={"budget": 7},
        ),
    ):
        for again in (
            copy.copy(problem),
            copy.deepcopy(problem),
            pickle.loads(pickle.dumps(problem)),
        ):
            assert again.settings.design.budget == 7
            assert again.resolved == problem.resolved
            assert again._handle != problem._handle


def test_stages_are_one_table():
    names = [stage.name for stage in stages()]
    assert names[0] == "run"
    others = {"simulate", "theory", "curves", "build", "plan", "extract", "next", "tensor"}
    assert others == set(names[1:])
    known = {variable.group for variable in schema()}
    assert all(set(stage.groups) <= known for stage in stages())


def test_the_next_grains_follow_from_the_constants(tmp_path):
    data = SOURCE / "inputs" / "data"
    (tmp_path / "a.nml").write_text(
        f"&problem symmetry = 'cubic' /\n&curves file = '{data}/copper_curves.csv'\n"
        f"tests = '{data}/copper_tests.csv', radius_um = 5 /\n&next count = 1 /\n"
        "&references name = 'quartz', young_gpa = 72, young_sd_gpa = 0.5, nu = 0.17 /\n"
    )
    assert bi.Problem(tmp_path / "a.nml").stages == ["curves", "extract", "next"]


def test_the_variables_are_those_of_the_page():
    sections = (SOURCE / "docs" / "namelists.md").read_text().split("\n## `&")[1:]
    rows = []
    for section in sections:
        heading, _, meaning, *lines = section.splitlines()
        for line in (line for line in lines if line.startswith("| `")):
            name, words, *more = line[2:-2].split(" | ")
            kind = re.sub("list of | for each constant|s$", "", words)
            shape = {"list": "list", "real for each constant": "constants"}.get(
                "list" if words.startswith("list of ") else words, "one"
            )
            rows.append((heading.strip("`"), meaning, name.strip("`"), kind, shape, *more))
    assert [dataclasses.astuple(variable) for variable in schema()] == rows
