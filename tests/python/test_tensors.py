"""Stiffnesses in JSON, as Materials Project and pymatgen write them, and calculated ones against
measurements.

Modules: tensor_comparison.f90, tensor_stage.f90.
"""

import itertools
import json
import re

import numpy as np
import pytest

import bayesindent as bi
from bayesindent.lab.tensors import known_stiffness, matrix_of_json
from bayesindent.program.cli import main
from bayesindent.settings.problem import Problem
from support.tree import SOURCE

VOIGT = np.array(
    [
        [168.4, 121.4, 121.4, 0, 0, 0],
        [121.4, 168.4, 121.4, 0, 0, 0],
        [121.4, 121.4, 168.4, 0, 0, 0],
        [0, 0, 0, 75.4, 0, 0],
        [0, 0, 0, 0, 75.4, 0],
        [0, 0, 0, 0, 0, 75.4],
    ]
)
INDEX = {(0, 0): 0, (1, 1): 1, (2, 2): 2, (1, 2): 3, (0, 2): 4, (0, 1): 5}
FULL = np.zeros((3, 3, 3, 3))
for i, j, k, m in itertools.product(range(3), repeat=4):
    FULL[i, j, k, m] = VOIGT[INDEX[tuple(sorted((i, j)))], INDEX[tuple(sorted((k, m)))]]
#: The forms of documents. Axes of the raw tensor of Materials Project are not those of IEEE.
FORMS = {
    "Materials Project": {
        "material_id": "mp-30",
        "elastic_tensor": {"raw": (2 * VOIGT).tolist(), "ieee_format": VOIGT.tolist()},
    },
    "Materials Project before 2022": [
        {"elasticity": {"elastic_tensor": VOIGT.tolist(), "K_VRH": 1}}
    ],
    "pymatgen": {"@class": "ElasticTensor", "input_array": FULL.tolist()},
    "pymatgen in Voigt's order": {"input_array": VOIGT.tolist(), "voigt": True},
}


@pytest.mark.parametrize("form", FORMS)
def test_a_document_is_the_known_stiffness(tmp_path, form):
    path = tmp_path / "copper.json"
    path.write_text(json.dumps(FORMS[form]))
    assert np.array_equal(np.array(matrix_of_json(path).split(), float).reshape(6, 6), VOIGT)
    table = SOURCE / "inputs" / "data" / "fe3si.csv"
    groups = {
        "problem": {"symmetry": "cubic"},
        "measurements": {"file": table, "modulus_kind": "indentation_modulus"},
        "knowledge": {"stiffness_file": path, "stiffness_relative_sd": 0.05},
    }
    stated = Problem.from_keywords("f", **groups)
    plain = tmp_path / "copper.txt"
    np.savetxt(plain, VOIGT)
    groups["knowledge"]["stiffness_file"] = plain
    assert stated.measurements is not None
    assert "stiffness_relative_sd" in stated.resolved and Problem.from_keywords("f", **groups)
    groups["knowledge"] = {"stiffness_file": path}
    with pytest.raises(bi.InputError, match=r"copper.json: a matrix needs stiffness_relative_sd"):
        Problem.from_keywords("f", **groups)


def test_texts_with_comments_blank_lines_and_zeros(tmp_path):
    """A triangle of copper, of which a class with a constant of 0 is stated: its sd is that of a
    twentieth of the largest one.
    """
    path = tmp_path / "copper.txt"
    rows = (" ".join(map(str, row[: i + 1])) for i, row in enumerate(VOIGT))
    path.write_text("# copper, GPa\n\n" + "\n".join(rows) + "\n")
    table = known_stiffness(path, "4/m", 0.05)
    assert table["C16"][0] == 0.0
    sds = np.sqrt(np.diag(np.array([table[name][1:] for name in list(table)[1:]], float)))
    names = list(table)[1:]
    assert sds[names.index("C16")] == pytest.approx(0.05 * 0.05 * 168.4)
    assert sds[names.index("C44")] == pytest.approx(0.05 * 75.4)


@pytest.mark.parametrize(
    ("content", "said"),
    [
        ("{}", "no stiffness is in it; allowed the keys ieee_format"),
        ('{"elastic_tensor": [[1, 2], [3, 4]]}', "6 x 6 or 3 x 3 x 3 x 3"),
        ('{"elastic_tensor": "none"}', "is no document with a stiffness of numbers"),
        ("{", "is no document with a stiffness of numbers"),
        ("[" * 100_000, "is no document with a stiffness of numbers"),
    ],
)
def test_other_documents_are_refused(tmp_path, content, said):
    (tmp_path / "a.json").write_text(content)
    with pytest.raises(bi.InputError, match=said):
        matrix_of_json(tmp_path / "a.json")


CONSTANTS = np.array([168.4, 121.4, 75.4])


def matrix(path, constants):
    """A file with the stiffness of a cubic crystal."""
    np.savetxt(path, bi.stiffness("cubic", **dict(zip(("C11", "C12", "C44"), constants))))
    return path


def compared(folder, rng, tensor, sd, technique="exact", **options):
    """The document of `tensor` for 20 grains of copper with noise of 2 %."""
    angles = np.column_stack(
        [
            rng.uniform(0, 360, 20),
            np.degrees(np.arccos(rng.uniform(-1, 1, 20))),
            rng.uniform(0, 360, 20),
        ]
    )
    moduli = bi.halfspace_modulus(VOIGT, angles)
    rows = np.column_stack([angles, moduli * (1 + 0.02 * rng.normal(size=20)), 0.02 * moduli])
    header = "phi1_deg,Phi_deg,phi2_deg,indentation_modulus_gpa,sd_gpa"
    np.savetxt(folder / "grains.csv", rows, delimiter=",", header=header, comments="")
    (folder / "grains.nml").write_text(
        "&problem symmetry = 'cubic' /\n"
        f"&measurements file = 'grains.csv', technique = '{technique}' /\n"
    )
    tensor = matrix(folder / "tensor.txt", tensor)
    options = {"relative_sd": sd, "output": folder / "out"} | options
    return bi.tensor(folder / "grains.nml", tensor, **options)


def linear_chi_square(folder, constants, sd):
    """Chi-square of the measurements about the tensor, with its covariance by differences."""
    rows = np.loadtxt(folder / "grains.csv", delimiter=",", skiprows=1)

    def moduli(c):
        return bi.halfspace_modulus(bi.stiffness("cubic", *c), rows[:, :3])

    steps = 0.01 * np.eye(3)
    slopes = np.array([moduli(constants + h) - moduli(constants - h) for h in steps]).T / 0.02
    covariance = np.diag(rows[:, 4] ** 2) + (slopes * (sd * constants) ** 2) @ slopes.T
    residuals = rows[:, 3] - moduli(constants)
    return residuals @ np.linalg.solve(covariance, residuals)


def test_a_tensor_is_held_against_the_measurements(tmp_path, capsys):
    right = compared(tmp_path, np.random.default_rng(1), CONSTANTS, 0.01)
    expected = linear_chi_square(tmp_path, CONSTANTS, 0.01)
    assert right["chi_square"] == pytest.approx(expected, rel=0.01)
    assert right["predictive_p"] > 0.05 and right["log_odds"] > 3 and right["freedom"] == 20
    # Nothing is known of the tensor's deviations but the noise: chi-square is that of theory.
    exact = compared(tmp_path, np.random.default_rng(1), CONSTANTS, 1e-5)
    deviations = [grain["deviation"] for grain in exact["predicted"]]
    assert exact["chi_square"] == pytest.approx(np.square(deviations).sum(), rel=0.01)
    wrong = compared(tmp_path, np.random.default_rng(1), CONSTANTS * [1, 1, 1.25], 0.003)
    assert wrong["predictive_p"] < 1e-6 and wrong["log_odds"] < -10
    assert wrong["suggestions"][0]["gain"] > 10 * right["suggestions"][0]["gain"]
    with pytest.raises(bi.InputError, match=r"are 6.0\d* times the measured ones; .*10 kBar = 1"):
        compared(tmp_path, np.random.default_rng(1), 6 * CONSTANTS, 0.01)
    with pytest.raises(bi.InputError, match="C11 is 1684.0 GPa, above that of diamond.*kBar"):
        compared(tmp_path, np.random.default_rng(1), 10 * CONSTANTS, 0.01)
    words = ["tensor", tmp_path / "grains.nml", tmp_path / "tensor.txt", "--relative-sd", "0.01"]
    matrix(tmp_path / "tensor.txt", CONSTANTS)
    assert main([*map(str, words), "--output", str(tmp_path / "out")]) == 0
    shown = capsys.readouterr().out
    assert re.search(r"p of the tensor: 0\.\d{4} \(chi-square [\d.]+ for 20\)", shown)
    assert "Largest deviation: (" in shown and "Face that would refute it soonest" in shown


def test_other_knowledge_stays(tmp_path):
    rng = np.random.default_rng(2)
    found = compared(tmp_path, rng, CONSTANTS, 0.01)
    text = (tmp_path / "grains.nml").read_text()
    known = "&knowledge quantity = 'bulk_modulus', mean = 150, sd = 1 /"
    (tmp_path / "grains.nml").write_text(text + known)
    tensor = tmp_path / "tensor.txt"
    other = bi.tensor(tmp_path / "grains.nml", tensor, relative_sd=0.01, output=tmp_path / "known")
    assert other["freedom"] == found["freedom"] + 1
    # The bulk modulus of the tensor is 137 GPa.
    assert other["chi_square"] > found["chi_square"] + 20


@pytest.mark.long
def test_a_right_tensor_is_accepted_and_a_wrong_one_refuted(tmp_path):
    # By `linear_chi_square` the seeds 7 to 10 accept 0.93, 0.945, 0.96 and 0.965.
    rng = np.random.default_rng(8)
    accepted, refuted = [], []
    for _ in range(200):
        stated = CONSTANTS * (1 + 0.01 * rng.normal(size=3))
        right = compared(tmp_path, rng, stated, 0.01)
        expected = linear_chi_square(tmp_path, stated, 0.01)
        assert right["chi_square"] == pytest.approx(expected, rel=0.03, abs=0.1)
        accepted.append(right["predictive_p"] > 0.05)
        wrong = compared(tmp_path, rng, stated * [1, 1, 1.1], 0.01)
        refuted.append(wrong["predictive_p"] < 0.05)
    assert abs(np.mean(accepted) - 0.95) < 0.03, np.mean(accepted)
    # The power that docs/verification/inference.md states, with three standard errors.
    assert abs(np.mean(refuted) - 0.36) < 0.1, np.mean(refuted)
