"""The correction that comes with the package: a piece of it is made again."""

import numpy as np
import pytest

import bayesindent as bi

BLOCK = bi.Surrogate.load("block")


def test_its_provenance_says_how_it_was_made():
    assert "geometry = 'block'" in BLOCK.provenance["namelist"]
    assert BLOCK.provenance["simulations"] == len(BLOCK.data["modulus_gpa"]) == 60
    assert BLOCK.basis.model == "correction" and BLOCK.symmetry == "triclinic"


def test_its_coefficients_follow_from_its_simulations():
    again = bi.Surrogate.fit(**BLOCK.data)
    np.testing.assert_allclose(again.coefficients, BLOCK.coefficients, atol=1e-6)
    np.testing.assert_allclose(again.covariance, BLOCK.covariance, atol=1e-8)


@pytest.mark.long
@pytest.mark.parametrize("number", [3, 47])
def test_its_simulations_are_those_of_the_block(number):
    data = {name: values[number] for name, values in BLOCK.data.items()}
    crystal = bi.stiffness(
        "triclinic", **dict(zip(bi.constants("triclinic"), data["constants"], strict=True))
    )
    modulus = (
        bi.Indentation(geometry="block").run(crystal, data["euler_deg"]).indentation_modulus_gpa
    )
    assert modulus == pytest.approx(data["modulus_gpa"], rel=1e-5)


CRYSTALS = {
    "copper": bi.stiffness("cubic", C11=168.4, C12=121.4, C44=75.4),
    "titanium": bi.stiffness("hexagonal", C11=162, C12=92, C44=47, C33=180, C13=69),
    "quartz": bi.stiffness("trigonal", C11=86.6, C12=6.7, C13=12.6, C14=-17.8, C33=106.1, C44=57.8),
}


@pytest.mark.long_where("titanium", "quartz")
@pytest.mark.parametrize("name", CRYSTALS)
def test_crystals_that_it_has_not_seen(name):
    angles = [[20, 35, 50], [110, 70, 15]]
    mean, sd = BLOCK.predict(np.array(2 * [CRYSTALS[name]]), angles)
    found = bi.Indentation(geometry="block").run_many(
        np.array(2 * [CRYSTALS[name]]), angles, workers=2
    )
    simulated = np.array([result.indentation_modulus_gpa for result in found])
    theory = bi.halfspace_modulus(CRYSTALS[name], angles)
    assert np.all(np.abs(mean - simulated) <= 4 * sd)
    assert np.all(np.abs(mean - simulated) <= 0.03 * np.abs(theory - simulated))
    assert not BLOCK.outside([CRYSTALS[name]]).any()
