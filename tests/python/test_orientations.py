"""Orientations as directions and quaternions: the direction along the indenter, in the crystal axes
of the core.

Modules: measurement_checks.f90.
"""

import re

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import bayesindent as bi
from support.tree import SOURCE

#: Edges and angles of a cell of each class as &problem lattice has them, and all six.
CELLS = {
    "isotropic": ([], [1, 1, 1, 90, 90, 90]),
    "cubic": ([], [1, 1, 1, 90, 90, 90]),
    "hexagonal": ([2.951, 4.684], [2.951, 2.951, 4.684, 90, 90, 120]),
    "4/mmm": ([4.594, 2.959], [4.594, 4.594, 2.959, 90, 90, 90]),
    "4/m": ([5.2, 11.4], [5.2, 5.2, 11.4, 90, 90, 90]),
    "-3m": ([4.913, 5.405], [4.913, 4.913, 5.405, 90, 90, 120]),
    "-3": ([4.81, 16.0], [4.81, 4.81, 16.0, 90, 90, 120]),
    "mmm": ([4.754, 10.197, 5.981], [4.754, 10.197, 5.981, 90, 90, 90]),
    "2/m": ([9.746, 8.899, 5.251, 105.6], [9.746, 8.899, 5.251, 90, 105.6, 90]),
    "-1": ([8.14, 12.79, 7.16, 94.3, 116.6, 87.7], [8.14, 12.79, 7.16, 94.3, 116.6, 87.7]),
}
INDICES = np.array([[1, 0, 0], [0, 1, 0], [0, 0, 1], [1, 1, 0], [1, -1, 2], [-2, 1, 3], [1, 2, -1]])


def directions(columns, symmetry="cubic", lattice=None, **asked):
    """What the core reads as the indented direction, (n, 3): the third column of g."""
    n = len(next(iter(columns.values())))
    table = columns | {"Er": n * [200.0], "sd": n * [4.0]}
    problem = bi.Problem.from_keywords(
        "f",
        {"measurements": table},
        problem={"symmetry": symmetry, "lattice": lattice or None},
        measurements=asked,
    )
    _, phi, phi2 = np.radians(problem.measurements.euler_deg.T)
    return np.column_stack([np.sin(phi2) * np.sin(phi), np.cos(phi2) * np.sin(phi), np.cos(phi)])


def named(names, rows):
    return dict(zip(names, np.asarray(rows).T.tolist(), strict=True))


def metric(cell):
    """G of scalar products of the edges, from the textbook."""
    cosines = np.cos(np.radians(cell[3:]))
    return np.outer(cell[:3], cell[:3]) * np.array(
        [[1, cosines[2], cosines[1]], [cosines[2], 1, cosines[0]], [cosines[1], cosines[0], 1]]
    )


@pytest.mark.parametrize("symmetry", CELLS)
def test_angles_between_directions_and_planes_are_those_of_the_metric(symmetry):
    short, cell = CELLS[symmetry]
    g = metric(np.array(cell))
    along = directions(named("uvw", INDICES), symmetry, short)
    normal = directions(named("hkl", INDICES), symmetry, short)
    lengths, spacings = (
        np.sqrt(np.einsum("ni,ij,nj->n", INDICES, g, INDICES)),
        np.sqrt(np.einsum("ni,ij,nj->n", INDICES, np.linalg.inv(g), INDICES)),
    )
    assert along @ along.T == pytest.approx(
        INDICES @ g @ INDICES.T / np.outer(lengths, lengths), abs=1e-12
    )
    assert normal @ normal.T == pytest.approx(
        INDICES @ np.linalg.inv(g) @ INDICES.T / np.outer(spacings, spacings), abs=1e-12
    )
    assert along @ normal.T == pytest.approx(
        INDICES @ INDICES.T / np.outer(lengths, spacings), abs=1e-12
    )
    # z along c, y normal to (010), right-handed.
    assert along[2] == pytest.approx([0, 0, 1], abs=1e-12)
    assert normal[1] == pytest.approx([0, 1, 0], abs=1e-12)
    assert np.linalg.det(along[:3]) > 0


def test_the_twofold_axis_of_trigonal_crystals_is_a():
    """As the table of classes has it: x is along a."""
    assert directions(named("uvw", [[1, 0, 0]]), "-3m", [4.913, 5.405])[0] == pytest.approx(
        [1, 0, 0], abs=1e-12
    )


def test_four_indices():
    a, c = 2.951, 4.684
    along = directions(
        named("uvtw", [[1, 1, -2, 3], [2, -1, -1, 0], [1, 0, -1, 1], [0, 0, 0, 1]]),
        "hexagonal",
        [a, c],
    )
    # [11-23] is a1 + a2 + c, with |a1 + a2| = a.
    assert along[0, 2] == pytest.approx(c / np.hypot(a, c), abs=1e-12)
    assert along[1] == pytest.approx([1, 0, 0], abs=1e-12)
    normal = directions(
        named("hkil", [[1, 0, -1, 1], [1, 1, -2, 0], [0, 0, 0, 1]]), "hexagonal", [a, c]
    )
    assert normal[0, 2] == pytest.approx(1 / np.sqrt(1 + 4 / 3 * (c / a) ** 2), abs=1e-12)
    assert normal[1] == pytest.approx(
        directions(named("uvw", [[1, 1, 0]]), "hexagonal", [a, c])[0], abs=1e-12
    )


def test_quaternions_are_those_of_the_angles():
    """From sample to crystal axes, the scalar first."""
    rng = np.random.default_rng(1)
    euler = np.column_stack(
        [
            rng.uniform(0, 360, 20),
            np.degrees(np.arccos(rng.uniform(-1, 1, 20))),
            rng.uniform(0, 360, 20),
        ]
    )
    rotation = Rotation.from_euler("ZXZ", euler, degrees=True).inv()
    by_angles = directions(named(("phi1", "Phi", "phi2"), euler))
    assert by_angles == pytest.approx(rotation.apply([0, 0, 1]), abs=1e-12)
    q = np.roll(rotation.as_quat(), 1, axis=1)
    for factor in (1.0, -1.0, 0.999):
        assert directions(named(("q0", "q1", "q2", "q3"), factor * q)) == pytest.approx(
            by_angles, abs=1e-12
        )


def test_quaternions_are_those_of_orix():
    quaternion = pytest.importorskip("orix.quaternion")
    euler = np.array([[10.0, 35.0, 45.0], [200.0, 120.0, 300.0]])
    q = quaternion.Orientation.from_euler(np.radians(euler)).data
    assert directions(named(("q0", "q1", "q2", "q3"), q)) == pytest.approx(
        directions(named(("phi1", "Phi", "phi2"), euler)), abs=1e-12
    )


def test_the_modulus_is_that_of_the_direction():
    """Copper along [112], and titanium along [11-23], by the theory of one given with its
    angles.
    """
    copper = bi.stiffness("cubic", C11=168.4, C12=121.4, C44=75.4)
    points = bi.Problem.from_keywords(
        "f",
        {"measurements": named("uvw", [[1, 1, 2]]) | {"Er": [130.0], "sd": [2.0]}},
        problem={"symmetry": "cubic"},
        measurements={},
    ).measurements
    assert bi.halfspace_modulus(copper, points.euler_deg[0]) == pytest.approx(
        bi.halfspace_modulus(copper, [77.0, np.degrees(np.arccos(2 / np.sqrt(6))), 45.0]), rel=1e-9
    )


@pytest.mark.parametrize(
    ("columns", "symmetry", "lattice", "words"),
    [
        (
            named("uvw", [[1, 0, 1]]),
            "hexagonal",
            None,
            "u, v, w are indices of a hexagonal crystal, whose directions depend on its cell: "
            "&problem lattice = a, c",
        ),
        (
            named("hkl", [[1, 0, 1]]),
            "-1",
            [1, 2, 3],
            "the number of values is 3; a triclinic crystal needs 6: a, b, c, alpha, beta, gamma",
        ),
        (
            named("uvw", [[1, 0, 1]]),
            "cubic",
            [3.6],
            "the number of values is 1; a cubic crystal needs none",
        ),
        (named("uvw", [[1, 0, 1]]), "-1", [1, 1, 1, 30, 30, 100], "are no cell"),
        (
            named("uvw", [[1, 0, 1], [0, 0, 0]]),
            "cubic",
            None,
            "line 2, column u: 0 and all other indices are 0",
        ),
        (
            named("uvtw", [[1, 1, -1, 3]]),
            "hexagonal",
            [2.9, 4.7],
            "line 1, column t: -1: the first three of four indices have the sum 1.0, and 0",
        ),
        (
            named("uvtw", [[1, 1, -2, 3]]),
            "4/mmm",
            [2.9, 4.7],
            "four indices, which only cells with 120 degrees between a and b have",
        ),
        (
            named(("q0", "q1", "q2", "q3"), [[1.0, 0.2, 0, 0]]),
            "cubic",
            None,
            "line 1, column q0: 1 is of no unit quaternion",
        ),
        (
            named("uvwhkl", [[1, 0, 1, 1, 0, 1]]),
            "cubic",
            None,
            "orientations are stated twice, by u, v, w and by h, k, l",
        ),
        (
            named(("phi1", "Phi", "phi2", "u", "v", "w"), [[10, 0, 10, 1, 0, 1]]),
            "cubic",
            None,
            "orientations are stated twice, by angles and by u, v, ..",
        ),
        (
            named("uv", [[1, 0]]),
            "cubic",
            None,
            "the column phi1_deg is missing; the columns are u, v, Er, sd; instead of angles "
            "q0, q1, q2, q3, or u, v, w",
        ),
    ],
)
def test_refusals(columns, symmetry, lattice, words):
    # Whole numbers as integers.
    columns = {
        name: [int(v) if v == int(v) else v for v in values] for name, values in columns.items()
    }
    with pytest.raises(bi.InputError) as error:
        directions(columns, symmetry, lattice)
    assert words in str(error.value)


def test_directions_are_never_radians():
    """Small angles that follow from directions are not those of the file."""
    directions(named("uvw", [[0.01 * k, 0.02, 1] for k in range(1, 5)]))


def test_the_examples_in_the_documentation_are_one_direction_each():
    text = (SOURCE / "docs" / "measurements.md").read_text()
    found: dict[str, list] = {"cubic": [], "hexagonal": []}
    for symmetry, lattice, block in re.findall(
        r"<!-- (\w+)(?:, lattice = ([\d., ]+))? -->\n```\n(.*?)```", text, flags=re.DOTALL
    ):
        header, row = (line.split(",") for line in block.split())
        columns = {
            name: [float(cell)]
            for name, cell in zip(header, row, strict=True)
            if name not in ("effective_modulus_gpa", "sd_gpa")
        }
        cell = [float(value) for value in lattice.split(",")] if lattice else None
        found[symmetry].append(np.abs(directions(columns, symmetry, cell)[0]))
    assert len(found["cubic"]) == 4 and np.array(found["cubic"]) == pytest.approx(
        np.tile([1, 1, 2], (4, 1)) / np.sqrt(6), abs=1e-4
    )
    a, c = 2.951, 4.684
    tilt = [c / np.hypot(a, c)]
    assert len(found["hexagonal"]) == 3 and np.array(found["hexagonal"])[:, 2] == pytest.approx(
        3 * tilt, abs=1e-4
    )
