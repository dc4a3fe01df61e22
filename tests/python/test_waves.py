"""Surface waves: their speeds against Stroh's eigenvalue problem and closed forms, and what Step 2 makes of measured ones."""

import numpy as np
import pytest
from step_2_cases import crystal
from stroh import rayleigh, slowest_bulk

import bayesindent as bi
from bayesindent.crystal.elasticity import rayleigh_modes, stiffness_rows

#: Speeds are then roots of rho v^2 in GPa.
UNIT = 1e9


def directions(n, seed):
    rng = np.random.default_rng(seed)
    angles = np.column_stack([rng.uniform(0, 360, n), np.degrees(np.arccos(rng.uniform(-1, 1, n))), rng.uniform(0, 360, n)])
    return angles, rng.uniform(0, 180, n)


@pytest.mark.parametrize("name", ["copper", "Zn", "rutile", "calcite", "aragonite", "diopside", "albite"])
def test_speed_and_displacement_of_every_class(name):
    """By Stroh's eigenvalues; where the root is within 2e-6 of the limiting speed squared, bisection meets the limit instead."""
    symmetry, constants = crystal(name)
    c = stiffness_rows(symmetry, [constants])[0]
    angles, along = directions(12, 3)
    speed, bulk, share = rayleigh_modes(c, angles, along, UNIT)
    expected = np.array([rayleigh(c, *row) for row in zip(angles, along, strict=True)])
    there = np.isfinite(expected[:, 0])
    assert there.sum() >= 9
    assert speed[there] ** 2 == pytest.approx(expected[there, 0], rel=1e-6)
    assert share[there] == pytest.approx(expected[there, 1], abs=1e-3)
    assert bulk**2 == pytest.approx([slowest_bulk(c, *row) for row in zip(angles, along, strict=True)], rel=1e-7)


def test_silicon_and_the_density():
    silicon = bi.stiffness("cubic", 165.7, 63.9, 79.6)
    assert bi.rayleigh_velocity(silicon, [0, 0, 0], [0.0, 90.0], 2330.0) == pytest.approx(4919, abs=3)
    assert bi.rayleigh_velocity(silicon, [0, 0, 0], 0.0, [2330.0, 4 * 2330.0]) @ [1, -2] == pytest.approx(0, abs=1e-9)


def test_copper_where_the_branch_follows_the_bulk_wave():
    """On (001), more than 25 degrees from [100], the wave is close to a shear wave that moves along the surface."""
    c = stiffness_rows(*crystal("copper"))
    speed, bulk, share = rayleigh_modes(c, [0, 0, 0], [0.0, 10.0, 35.0, 45.0], 8960.0)
    assert (speed < bulk).all()
    assert (share[:2] > 0.5).all()
    assert (share[2:] < 0.1).all()
    assert (speed[2:] > 0.99 * bulk[2:]).all()


@pytest.mark.parametrize("density", [0.0, -1.0, np.nan])
def test_a_density_that_is_none_is_refused(density):
    with pytest.raises(bi.InputError, match="density"):
        bi.rayleigh_velocity(np.eye(6), [0, 0, 0], 0.0, density)


def test_shapes_that_do_not_fit_are_refused():
    with pytest.raises(bi.InputError, match="do not broadcast"):
        bi.rayleigh_velocity(np.eye(6), np.zeros((2, 3)), np.zeros(3), 1.0)
    with pytest.raises(bi.InputError, match="positive definite|stable"):
        bi.rayleigh_velocity(-np.eye(6), [0, 0, 0], 0.0, 1.0)
