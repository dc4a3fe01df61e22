"""What indentation sees of real crystals, linearised about each: fifty grains at 2 % over the
sphere, log K known to 0.3 before.

The derivatives are finite differences of the exact theory along an orthonormal basis of the class's
Kelvin stiffnesses, by NumPy.
"""

import csv

import numpy as np
import pytest

import bayesindent as bi
from support.tree import REFERENCE

#: Combinations of the constants that are visible: as many as the class has harmonics of degree 4 or
#: less.
VISIBLE = {
    "isotropic": 1,
    "cubic": 2,
    "hexagonal": 3,
    "4/mmm": 4,
    "4/m": 5,
    "-3m": 4,
    "-3": 5,
    "mmm": 6,
    "2/m": 9,
    "-1": 15,
}
#: sds (GPa) before and after the tensor of linear compressibilities is known to 2 %, by a
#: calculation of others.
KNOWN = {
    ("copper", "C11"): (27.9, 2.2),
    ("Ti", "C11"): (26.6, 2.2),
    ("Ti", "C33"): (25.8, 5.0),
    ("beta-Sn", "C12"): (16.3, 1.2),
    ("quartz", "C12"): (13.9, 1.4),
    ("calcite", "C11"): (18.0, 2.7),
    ("forsterite", "C11"): (32.9, 12.1),
    ("forsterite", "C12"): (47.9, 6.7),
    ("albite", "C12"): (21.4, 2.9),
}
ROOTS = np.sqrt([1, 1, 1, 2, 2, 2])
KELVIN = np.outer(ROOTS, ROOTS)
STEP = 1e-4


def crystals():
    lines = (
        line
        for line in (REFERENCE / "crystals.csv").read_text().splitlines()
        if not line.startswith("#")
    )
    return {row["name"]: row for row in csv.DictReader(lines)}


def function_of(matrices, function):
    """A function of symmetric matrices (..., 6, 6)."""
    values, vectors = np.linalg.eigh(matrices)
    return (vectors * function(values)[..., None, :]) @ np.swapaxes(vectors, -1, -2)


def neighbours(row):
    """Crystals a step up and a step down along each coordinate of log K, (k, 6, 6) each."""
    names = bi.constants(row["symmetry"])
    one_each = [dict(zip(names, values, strict=True)) for values in np.eye(len(names))]
    units = [bi.stiffness(row["symmetry"], **constants) * KELVIN for constants in one_each]
    basis = np.linalg.qr(np.reshape(units, (len(names), 36)).T)[0].T.reshape(-1, 6, 6)
    centre = function_of(
        bi.stiffness(row["symmetry"], **{name: float(row[name] or 0) for name in names}) * KELVIN,
        np.log,
    )
    return tuple(function_of(centre + step * basis, np.exp) / KELVIN for step in (STEP, -STEP))


def compressibilities(stiffness):
    """S_ijkk in Voigt's order, (..., 6)."""
    return np.linalg.inv(stiffness)[..., :3].sum(axis=-1) * [1, 1, 1, 0.5, 0.5, 0.5]


def grains(seed):
    rng = np.random.default_rng(seed)
    return np.degrees(
        np.column_stack(
            [
                rng.uniform(0, 2 * np.pi, 50),
                np.arccos(rng.uniform(-1, 1, 50)),
                rng.uniform(0, 2 * np.pi, 50),
            ]
        )
    )


def information(up, down, seed):
    """Of fifty moduli at 2 % about log K."""
    log_moduli = [
        np.log(
            bi.halfspace_modulus(side[:, None], np.broadcast_to(grains(seed), (len(side), 50, 3)))
        )
        for side in (up, down)
    ]
    slope = (log_moduli[0] - log_moduli[1]) / (2 * STEP)
    return slope @ slope.T / 0.02**2


@pytest.mark.parametrize("name", crystals())
def test_as_many_combinations_are_visible_as_harmonics_to_degree_four(name):
    row = crystals()[name]
    up, down = neighbours(row)
    for seed in range(3):
        gain = 0.3**2 * np.linalg.eigvalsh(information(up, down, seed))
        assert np.sum(gain / (1 + gain) > 0.5) == VISIBLE[row["symmetry"]]


@pytest.mark.parametrize("name", sorted({name for name, _ in KNOWN}))
def test_compressibilities_close_what_indentation_leaves_open(name):
    row = crystals()[name]
    up, down = neighbours(row)
    middle = 0.5 * (compressibilities(up) + compressibilities(down)).mean(axis=0)
    slope = (compressibilities(up) - compressibilities(down)) / (2 * STEP)
    # To 2 % of each along the axes, and off the diagonal of their mean.
    sd = 0.02 * np.append(middle[:3], np.full(3, middle[:3].mean()))
    for seed in range(3):
        seen = np.eye(len(up)) / 0.3**2 + information(up, down, seed)
        for (crystal, constant), wanted in KNOWN.items():
            if crystal == name:
                gradient = ((up - down) / (2 * STEP))[:, int(constant[1]) - 1, int(constant[2]) - 1]
                found = [
                    np.sqrt(gradient @ np.linalg.solve(known, gradient))
                    for known in (seen, seen + slope / sd**2 @ slope.T)
                ]
                assert found == pytest.approx(wanted, rel=0.2)
