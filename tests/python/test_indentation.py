"""Simulated indentations against the exact theory, their reproducibility, and what is refused."""

import numpy as np
import pytest

import bayesindent as bi

ZINC = bi.stiffness("hexagonal", C11=161.1, C12=34.2, C44=38.3, C33=61.1, C13=50.3)
COPPER = bi.stiffness("cubic", C11=168.4, C12=121.4, C44=75.4)


@pytest.fixture(scope="module")
def halfspace():
    return bi.Indentation()


@pytest.fixture(scope="module")
def coarse():
    return bi.Indentation(refine=0.6)


@pytest.mark.parametrize("declination", [0, 45, 90])
def test_zinc_meets_the_theory(halfspace, declination):
    angles = (0, declination, 0)
    result = halfspace.run(ZINC, angles)
    assert result.elements <= 20000
    assert result.indentation_modulus_gpa == pytest.approx(bi.halfspace_modulus(ZINC, angles), rel=5e-3)
    assert result.contact_residual <= 1e-10
    assert result.equilibrium_residual <= 1e-8


def test_modulus_is_the_least_squares_of_the_curve(halfspace):
    result = halfspace.run(COPPER, (200, 50, 25))
    used = np.sqrt(16 * result.depth_um) >= 4.99 * 0.5 / 9.5
    h, p = result.depth_um[used], result.force_mn[used]
    modulus = 3 / (4 * np.sqrt(16)) * (p * h**1.5).sum() / (h**3).sum()
    assert result.indentation_modulus_gpa == pytest.approx(modulus, rel=1e-12)
    assert np.sqrt(16 * result.depth_um) == pytest.approx(0.05 * np.arange(1, 11))


def test_modulus_does_not_depend_on_scale(coarse):
    other = bi.Indentation(refine=0.6, radius_um=1.0)
    a, b = coarse.run(ZINC, (0, 30, 0)), other.run(3.0 * ZINC, (0, 30, 0))
    assert b.indentation_modulus_gpa == pytest.approx(3 * a.indentation_modulus_gpa, rel=1e-9)


def test_same_bits_for_any_number_of_workers(coarse):
    matrices = [ZINC, COPPER, ZINC, COPPER, ZINC]
    angles = [(0, 10 * k, 5 * k) for k in range(5)]
    one = coarse.run_many(matrices, angles, workers=1)
    two = coarse.run_many(matrices, angles, workers=2)
    for a, b in zip(one, two, strict=True):
        assert a.indentation_modulus_gpa == b.indentation_modulus_gpa
        assert (a.force_mn == b.force_mn).all()


def test_failures_are_returned_in_place(coarse):
    unstable = bi.stiffness("cubic", C11=100, C12=120, C44=50)
    results = coarse.run_many([ZINC, unstable], [(0, 0, 0), (0, 0, 0)], workers=1, errors="return")
    assert results[0].indentation_modulus_gpa > 0
    assert isinstance(results[1], bi.InputError) and "unstable" in str(results[1])


def test_paper_mesh_is_the_papers():
    model = bi.Indentation(mesh="paper", refine=0.7)
    x = model.mesh_arrays().x
    assert x.min(axis=0) == pytest.approx([-4.8, -4.8, -4.8])
    assert x.max(axis=0) == pytest.approx([4.8, 4.8, 0.0])
    result = model.run(ZINC, (0, 0, 0))
    # Clamped 4.8 um below the contact, the block is stiffer than the half-space.
    assert 1.04 < result.indentation_modulus_gpa / bi.halfspace_modulus(ZINC, (0, 0, 0)) < 1.16
    assert result.equilibrium_residual <= 1e-8
    assert abs(bi.Indentation(mesh="paper").elements / 12610 - 1) < 0.05


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"mesh": "dome"}, "mesh: 'dome' is unknown"),
        ({"element": "c3d20"}, "element: 'c3d20' is unknown"),
        ({"integration": "reduced"}, "integration: 'reduced' is unknown"),
        ({"refine": 0.0}, "refine: 0.0 is out of range"),
        ({"refine": float("nan")}, "refine: NaN is out of range"),
        ({"depths": 0}, "depths: 0 is out of range"),
        ({"radius_um": -1.0}, "radius_um: -1.0 is out of range"),
        ({"mesh": "paper", "radius_um": 0.5}, "elements at the last depth"),
    ],
)
def test_what_cannot_be_meant_is_refused(options, message):
    with pytest.raises(bi.InputError, match=message):
        bi.Indentation(**options)


def test_orientation_that_is_not_finite_is_refused(coarse):
    with pytest.raises(bi.InputError, match="angle is not finite"):
        coarse.run(ZINC, (0, float("nan"), 0))


def test_arrays_that_do_not_fit_are_refused(coarse):
    with pytest.raises(bi.InputError, match="one crystal at a time"):
        coarse.run(ZINC[None], (0, 0, 0))
    with pytest.raises(bi.InputError, match="not symmetric"):
        coarse.run(ZINC + np.triu(np.ones((6, 6)), 1), (0, 0, 0))
    with pytest.raises(bi.InputError, match="2 crystals but 1 orientations"):
        coarse.run_many(np.array([ZINC, COPPER]), np.zeros((1, 3)))
