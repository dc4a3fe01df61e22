"""Derivatives of simulated moduli by the stiffness and the orientation of the crystal.

They are exact where all stiffnesses change alike. The forces of a simulation have single precision,
so differences are taken over changes of some per cent, against the derivatives at three points
(Simpson's rule).
"""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import bayesindent as bi

TITANIUM = bi.stiffness("hexagonal", C11=162.4, C12=92, C44=46.7, C33=180.7, C13=69)
#: Without any symmetry.
TRICLINIC = TITANIUM + np.diag([20.0, 5, 0, 10, 3, 0]) + 4 * np.eye(6)[::-1]
ANGLES = np.array([20.0, 33.0, 47.0])
SPECIMENS = {
    "block": {"geometry": "block", "refine": 0.7},
    "grain": {"geometry": "grain", "grain_radius_um": 2.5, "refine": 0.6},
    "two meshes": {"geometry": "halfspace", "refine": 0.6, "extrapolate": True},
}
#: Neighbours of a stiffness of their own.
MATRIX = {"geometry": "grain", "grain_radius_um": 2.5, "refine": 0.6, "matrix": "isotropic"}


@pytest.fixture(scope="module", params=SPECIMENS)
def model(request):
    return bi.Indentation(**SPECIMENS[request.param])


def simpson(at, differentiate, step):
    """Difference of moduli from -step to step, and the integral of their derivative."""
    results = [at(sign * step) for sign in (-1, 0, 1)]
    slopes = [differentiate(result) for result in results]
    moduli = [result.indentation_modulus_gpa for result in results]
    return moduli[2] - moduli[0], step / 3 * (slopes[0] + 4 * slopes[1] + slopes[2])


def test_the_modulus_is_homogeneous_of_degree_one(model):
    result = model.run(TRICLINIC, ANGLES)
    whole = np.sum(result.modulus_by_stiffness * TRICLINIC)
    assert whole == pytest.approx(result.indentation_modulus_gpa, rel=1e-12)


@pytest.mark.parametrize("seed", [1, 2])
def test_derivatives_by_stiffness_are_those_of_differences(model, seed):
    change = np.random.default_rng(seed).normal(size=(6, 6))
    change = 3.0 * (change + change.T) / np.linalg.norm(change + change.T)
    difference, integral = simpson(
        lambda step: model.run(TRICLINIC + step * change, ANGLES),
        lambda result: np.sum(result.modulus_by_stiffness * change),
        2.0,
    )
    assert abs(difference) > 0.1
    assert difference == pytest.approx(integral, abs=0.01)


def test_a_stiff_matrix_has_its_share():
    model = bi.Indentation(matrix_young_gpa=200.0, **MATRIX)
    difference, integral = simpson(
        lambda step: model.run((1 + step) * TRICLINIC, ANGLES),
        lambda result: np.sum(result.modulus_by_stiffness * TRICLINIC),
        0.05,
    )
    assert difference == pytest.approx(integral, rel=1e-3)
    result = model.run(TRICLINIC, ANGLES)
    assert integral / 0.1 < 0.95 * result.indentation_modulus_gpa


@pytest.mark.parametrize("axis", [0, 1, 2])
def test_derivatives_by_orientation_are_those_of_differences(model, axis):
    start = Rotation.from_euler("ZXZ", ANGLES, degrees=True)

    def turned(angle):
        turn = Rotation.from_rotvec(angle * np.eye(3)[axis])
        return model.run(TRICLINIC, (turn * start).as_euler("ZXZ", degrees=True))

    difference, integral = simpson(
        turned, lambda result: result.modulus_by_rotation_gpa[axis], np.radians(10)
    )
    assert difference == pytest.approx(integral, abs=0.04)


def test_other_estimators_have_no_derivatives():
    model = bi.Indentation(geometry="block", refine=0.7, estimator="stiffness_hertz")
    assert not model.run(TRICLINIC, ANGLES).modulus_by_stiffness.any()
