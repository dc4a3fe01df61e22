"""The next grain among those that the user has."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import bayesindent as bi
from support.diagnostics import codes
from support.step_2_cases import KIND
from support.tree import SOURCE

DATA = SOURCE / "inputs" / "data" / "fe3si.csv"
SETTINGS = {
    "symmetry": "cubic",
    "samples": 500,
    "burn_in": 2000,
    "chains": 2,
    "knowledge": {"bulk_modulus": (165, 3)},
    **KIND,
}


@pytest.fixture(scope="module")
def result():
    return bi.extract(DATA, **SETTINGS)


def suggest(result, tmp_path, text, **settings):
    (tmp_path / "ebsd.csv").write_text(text)
    return bi.next_grain(
        DATA, result=result, candidates=tmp_path / "ebsd.csv", **SETTINGS | settings
    )


def test_all_grains_are_ranked_by_name(result, tmp_path):
    """Each once, however near another; the first is the one of largest gain."""
    rows = {
        "G7": (0, 3, 0),
        "G1": (0, 44, 1),
        "twin of G1": (90, 44.5, 1),
        "far": (10, 54.7356, 45),
    }
    text = "grain;phi1;PHI;phi2;area\n" + "".join(
        f"{name};{a};{b};{c};12\n" for name, (a, b, c) in rows.items()
    )
    found = suggest(result, tmp_path, text, count=9)
    assert sorted(item["grain"] for item in found["suggestions"]) == sorted(rows)
    assert [item["grain"] for item in found["candidates"]] == list(rows)
    gains = {item["grain"]: item["gain"] for item in found["candidates"]}
    assert found["suggestions"][0]["grain"] == max(gains, key=gains.get)
    assert {item["grain"]: item["euler_deg"] for item in found["suggestions"]} == {
        name: list(angles) for name, angles in rows.items()
    }
    assert found["unit"] == "nats"
    assert "few_apart" not in codes(found["warnings"])


@pytest.mark.long
def test_the_gain_of_a_grain_is_that_of_its_direction(result, tmp_path):
    """As by the lattice of all directions, which has these corners."""
    everywhere = bi.next_grain(DATA, result=result, **SETTINGS)["candidates"]
    own = suggest(result, tmp_path, "u,v,w\n0,0,1\n1,1,1\n")
    for item, direction in zip(
        own["candidates"], ([0, 0, 1], np.ones(3) / np.sqrt(3)), strict=True
    ):
        apart = []
        for other in everywhere:
            _, phi, phi2 = np.radians(other["euler_deg"])
            apart.append(
                abs(
                    np.dot(
                        direction,
                        [np.sin(phi2) * np.sin(phi), np.cos(phi2) * np.sin(phi), np.cos(phi)],
                    )
                )
            )
        nearest = int(np.argmax(apart))
        assert apart[nearest] > np.cos(np.radians(0.1))
        # The shared errors are drawn anew at each candidate: the gains agree as far as the draws
        # resolve them.
        assert item["gain"] == pytest.approx(everywhere[nearest]["gain"], rel=0.05)
    assert [item["grain"] for item in own["candidates"]] == ["1", "2"]
    assert {item["uvw"] for item in own["suggestions"]} == {"[0 0 1]", "[1 1 1]"}


@pytest.mark.long
def test_indices_need_a_cell(tmp_path):
    table = {
        "phi1": [0.0, 10, 20, 30],
        "Phi": [0.0, 30, 60, 90],
        "phi2": [0.0, 10, 20, 30],
        "Er": [125.0, 120, 118, 115],
        "sd": 4 * [3.0],
    }
    settings = {"symmetry": "hexagonal", "samples": 200, "burn_in": 1000, "chains": 1}
    settings |= {"result": bi.extract(table, **settings), "count": 1}
    assert "uvw" not in bi.next_grain(table, **settings)["suggestions"][0]
    (tmp_path / "own.csv").write_text("u,v,t,w\n1,1,-2,3\n")
    found = bi.next_grain(
        table, lattice=[2.951, 4.684], candidates=tmp_path / "own.csv", **settings
    )["suggestions"][0]
    assert found["uvw"] == "[1 1 1]"
    assert found["direction"][2] == pytest.approx(4.684 / np.hypot(2.951, 4.684), rel=1e-9)


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("phi1,Phi\n1,2\n", "candidates: .*ebsd.*: the column phi2_deg is missing"),
        ("u,v,w\n0,0,0\n", "line 2, column u: 0 and all other indices are 0"),
        (
            "phi1,Phi,phi2\n0.5,0.2,1.5\n2.5,0.7,1.5\n5.5,0.2,1.5\n",
            "ebsd.*: no angle is above 2 pi, so these look like radians",
        ),
        ("u,v,w\n" + 2001 * "1,1,1\n", "2001 grains; allowed up to 2000"),
    ],
    # Names of folders follow from these, and long ones are cut in messages.
    ids=["column", "zero", "radians", "many"],
)
def test_refusals(tmp_path, text, words):
    with pytest.raises(bi.InputError, match=words):
        suggest(None, tmp_path, text)


def test_the_region_of_like_gains(result):
    """Of the first suggestion: the farthest direction that is nearer than any that gains less than
    90 % of it, in a cubic crystal.
    """
    found = bi.next_grain(DATA, result=result, **SETTINGS)
    best, gains = found["suggestions"][0], np.array([item["gain"] for item in found["candidates"]])
    rotations = Rotation.from_euler(
        "ZXZ", [item["euler_deg"] for item in found["candidates"]], degrees=True
    ).inv()
    cosines = np.abs(
        Rotation.create_group("O").apply(best["direction"]) @ rotations.apply([0, 0, 1]).T
    ).max(axis=0)
    angles = np.degrees(np.arccos(np.minimum(cosines, 1)))
    less = gains < 0.9 * best["gain"]
    assert less.any() and best["within_deg"] == pytest.approx(
        angles[angles < angles[less].min()].max(), abs=1e-4
    )
