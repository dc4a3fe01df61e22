"""Stiffnesses in JSON, as Materials Project and pymatgen write them."""

import itertools
import json

import numpy as np
import pytest

import bayesindent as bi
from bayesindent.lab.tensors import matrix_of_json
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
