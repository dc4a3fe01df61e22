"""Directions that a crystal class tells apart, as Python sees them."""

import numpy as np
import pytest

import bayesindent as bi
from bayesindent.crystal.directions import (
    euler_of,
    indentation_direction,
    representative,
    spread_of_directions,
)


def test_lattice_of_the_standard_triangle():
    """Sixteenths of the corners 001, 101, 111, in this order of their shares."""
    corners = np.array([[0, 0, 1], [1, 0, 1] / np.sqrt(2), [1, 1, 1] / np.sqrt(3)])
    expected = np.array([(i, j, 16 - i - j) for i in range(17) for j in range(17 - i)]) @ corners
    expected /= np.linalg.norm(expected, axis=1, keepdims=True)
    assert spread_of_directions("m-3m") == pytest.approx(expected, abs=1e-15)


def test_lattice_of_an_arc():
    assert euler_of(spread_of_directions("hexagonal"))[:, 1] == pytest.approx(
        np.arange(0, 91, 2), abs=1e-6
    )


def test_angles_and_directions():
    angles = np.array([[0.0, 40.0, 100.0], [0.0, 170.0, 300.0]])
    assert euler_of(indentation_direction(angles)) == pytest.approx(angles)


def test_spread_covers_the_standard_triangle():
    x = spread_of_directions("cubic", 9)
    assert np.all(x[:, 2] >= x[:, 0] - 1e-12) and np.all(x[:, 0] >= x[:, 1] - 1e-12)
    assert np.degrees(np.arccos((x @ x.T - 2 * np.eye(9)).max())) > 9
    assert euler_of(spread_of_directions("hexagonal", 4))[:, 1] == pytest.approx([0, 30, 60, 90])


@pytest.mark.parametrize(
    "symmetry", ["cubic", "4/m", "-3m", "-3", "mmm", "2/m", "-1", "hexagonal", "isotropic"]
)
def test_equivalent_directions_have_one_modulus(symmetry):
    rng = np.random.default_rng(3)
    directions = rng.normal(size=(4, 3))
    directions /= np.linalg.norm(directions, axis=1, keepdims=True)
    values = {
        name: 150 + 8 * i if name[1] == name[2] and int(name[1]) < 4 else 3 * i
        for i, name in enumerate(bi.constants(symmetry))
    }
    values |= {name: 40 + 5 * i for i, name in enumerate(values) if name in ("C44", "C55", "C66")}
    crystal = bi.stiffness(symmetry, **values)
    images = representative(symmetry, directions)
    assert bi.halfspace_modulus(crystal, euler_of(images)) == pytest.approx(
        bi.halfspace_modulus(crystal, euler_of(directions)), rel=1e-8
    )
