"""Who decided what, limits that end the draws, and whether a result can be used.

Modules: posterior_diagnostics.f90.
"""

import numpy as np
import pytest

import bayesindent as bi
from bayesindent.crystal.elasticity import stiffness_rows
from support.diagnostics import codes
from support.step_2_cases import KIND, table_of
from support.tree import SOURCE

BOUNDS = {"C11": (150, 300), "C12": (80, 200), "C44": (60, 160)}


def stiffness_of(symmetry, constants):
    return stiffness_rows(symmetry, [constants])[0]


IRON = SOURCE / "inputs" / "data" / "fe3si.csv"


@pytest.mark.parametrize(
    ("knowledge", "measurements", "known"),
    [
        ({}, [0.110, 0.000, 0.790], [0, 0, 0]),
        ({"bulk_modulus": (165, 3)}, [0.886, 0.484, 0.994], [0.110, 0.513, 0.003]),
        ({"bulk_modulus": (165, 15)}, [0.254, 0.034, 0.929], [0.738, 0.949, 0.068]),
    ],
)
def test_shares_of_iron(knowledge, measurements, known):
    """The values are integrals over a grid of 48 x 48 x 48 crystals; from seed to seed a share of
    C12 has an sd of 0.012.
    """
    result = bi.extract(
        IRON, symmetry="cubic", bounds=BOUNDS, knowledge=knowledge, samples=20000, **KIND
    )
    shares = [parameter["share"] for parameter in bi.summary(result)["parameters"].values()]
    assert [share["measurements"] for share in shares] == pytest.approx(measurements, abs=0.03)
    assert [share["knowledge"] for share in shares] == pytest.approx(known, abs=0.03)
    for share in shares:
        assert sum(share.values()) == pytest.approx(1, abs=1e-9)
    offered = [
        row["name"] for row in bi.summary(result)["identifiability"] if row["kind"] == "knowledge"
    ]
    assert offered == ["bulk_modulus"] * (not knowledge) + ["polycrystal_young"]


def test_shares_are_those_of_the_normal_model():
    """Of a linear model with a normal prior: the weights of the posterior mean, by the textbook."""
    truth = np.array([168.4, 121.4, 75.4])
    rng = np.random.default_rng(5)
    euler = np.column_stack(
        [
            rng.uniform(0, 360, 30),
            np.degrees(np.arccos(rng.uniform(-1, 1, 30))),
            rng.uniform(0, 360, 30),
        ]
    )
    moduli = bi.halfspace_modulus(stiffness_of("cubic", truth), euler)
    sd = np.full(30, 0.002 * moduli.mean())
    knowledge = {"C11": (168.4, 1.0), "C12": (121.4, 1.0), "C44": (75.4, 1.0)}
    settings = {"symmetry": "cubic", "calibration_sd": 0.01, "knowledge": knowledge, **KIND}
    found = bi.summary(bi.extract(table_of(euler, moduli, sd), samples=10000, **settings))
    step = 0.01
    slopes = np.array(
        [
            (bi.halfspace_modulus(stiffness_of("cubic", truth + step * unit), euler) - moduli)
            / step
            for unit in np.eye(3)
        ]
    )
    noise, tip = np.diag(sd**2), 0.01**2 * np.outer(moduli, moduli)
    inverse = np.linalg.inv(noise + tip)
    covariance = np.linalg.inv(slopes @ inverse @ slopes.T + np.eye(3))
    weights = covariance @ slopes @ inverse
    for i, (name, parameter) in enumerate(found["parameters"].items()):
        parts = {
            "noise": weights[i] @ noise @ weights[i],
            "calibration": weights[i] @ tip @ weights[i],
        }
        for source, part in parts.items():
            assert found["error_budget"][name][source] == pytest.approx(
                part / covariance[i, i], abs=0.03
            )
        assert parameter["share"]["measurements"] == pytest.approx(
            sum(parts.values()) / covariance[i, i], abs=0.03
        )


@pytest.mark.long
@pytest.mark.parametrize(
    ("constants", "usable"),
    [((129.1, 109.7, 82.4), False), ((168.4, 121.4, 75.4), True)],
    ids=["beta-brass", "copper"],
)
def test_the_domain_of_a_surrogate_ends_a_posterior(constants, usable):
    """Beta-brass is outside of what the shipped block was trained on; copper is within."""
    bulk = (constants[0] + 2 * constants[1]) / 3
    rng = np.random.default_rng(3)
    euler = np.column_stack(
        [
            rng.uniform(0, 360, 16),
            np.degrees(np.arccos(rng.uniform(-1, 1, 16))),
            rng.uniform(0, 360, 16),
        ]
    )
    stiffness = stiffness_of("cubic", constants)
    moduli = 1.1 * bi.halfspace_modulus(stiffness, euler)
    if usable:
        moduli = bi.Surrogate.load("block").predict(np.tile(stiffness, (16, 1, 1)), euler)[0]
    table = table_of(euler, moduli, 0.02 * moduli)
    document = bi.summary(
        bi.extract(
            table,
            surrogate="block",
            symmetry="cubic",
            knowledge={"bulk_modulus": (bulk, 2)},
            samples=1000,
            **KIND,
        )
    )
    assert document["usable"] is usable
    assert ("outside_surrogate" in codes(document["warnings"])) is not usable
    if not usable:
        # What was right is not blamed.
        assert "knowledge_wrong" not in codes(document["warnings"])
        assert "truncated" not in codes(document["warnings"])


@pytest.mark.long
def test_graphite_on_the_half_space():
    """A log-anisotropy of 5: no limit that nobody stated ends its posterior.

    Nothing determines C11 and C12, whose sds are thousands of GPa. With the default burn-in some
    runs do not mix; three times as much is what their message advises.
    """
    c11, c12, c13, c33, c44 = 1060.0, 180.0, 15.0, 36.5, 4.5
    constants = [c11, c12, c44, c33, c13]
    rng = np.random.default_rng(8)
    euler = np.column_stack(
        [
            rng.uniform(0, 360, 16),
            np.degrees(np.arccos(rng.uniform(0, 1, 16))),
            rng.uniform(0, 360, 16),
        ]
    )
    moduli = bi.halfspace_modulus(stiffness_of("hexagonal", constants), euler)
    table = table_of(euler, moduli * (1 + 0.02 * rng.normal(size=16)), 0.02 * moduli)
    document = bi.summary(bi.extract(table, symmetry="hexagonal", burn_in=20000, **KIND))
    assert document["usable"]
    found = document["parameters"]["C44"]
    assert abs(found["mean"] - c44) < 3 * found["sd"]
    assert found["sd"] < 2
