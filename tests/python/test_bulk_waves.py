"""Speeds of bulk waves among the measurements: closed forms, and the Christoffel matrix in
NumPy.
"""

import json
import warnings
from types import SimpleNamespace

import numpy as np
import pytest

import bayesindent as bi
from bayesindent.crystal.elasticity import stiffness_rows
from bayesindent.report.results import Results
from support.densities import Posterior
from support.step_2_cases import crystal
from support.stroh import acoustic, bunge, tensor

DENSITY = 5000.0
#: Of a speed, m/s: the log-likelihood then shows differences of 1e-5 m/s.
SD = 1e-3


def differences(folder, symmetry, constants, rows):
    """Of each row of angles, direction (None: along the normal), wave and its rho v^2 (GPa) the
    difference of the speed from the program's in `SD`, by the likelihood alone.
    """
    found = []
    for number, (angles, along, wave, modulus) in enumerate(rows):
        page = folder / f"{number}.csv"
        cells = [
            *angles,
            "" if along is None else along,
            wave,
            repr(float(np.sqrt(1e9 * modulus / DENSITY))),
            SD,
        ]
        page.write_text(
            "phi1_deg,Phi_deg,phi2_deg,propagation_deg,wave,velocity_m_s,sd_m_s\n"
            + ",".join(map(str, cells))
            + "\n"
        )
        posterior = Posterior.of(
            None,
            velocities=page,
            symmetry=symmetry,
            surrogate=bi.Surrogate.load("halfspace"),
            density_kg_m3=DENSITY,
        )
        likelihood = posterior.evaluate([constants])[1][0]
        found.append(np.sqrt(max(0.0, -2 * (likelihood + np.log(SD * np.sqrt(2 * np.pi))))))
    return found


A, B, C = 168.4, 121.4, 75.4
#: Angles whose normal is [111], and directions in the surface of (001).
DIAGONAL, FLAT = (0.0, np.degrees(np.arccos(1 / np.sqrt(3))), 45.0), (0.0, 0.0, 0.0)
CUBIC = [
    (FLAT, 0.0, "longitudinal", A),
    (FLAT, 90.0, "shear_fast", C),
    (FLAT, None, "shear_slow", C),
    (FLAT, None, "longitudinal", A),
    (FLAT, 45.0, "longitudinal", (A + B) / 2 + C),
    (FLAT, 225.0, "shear_fast", C),
    (FLAT, -45.0, "shear_slow", (A - B) / 2),
    (DIAGONAL, None, "longitudinal", (A + 2 * B + 4 * C) / 3),
    (DIAGONAL, None, "shear_slow", (A - B + C) / 3),
]
HEXAGONAL = [
    (FLAT, None, "longitudinal", 180.7),
    (FLAT, None, "shear_fast", 46.7),
    (FLAT, 30.0, "longitudinal", 162.4),
    (FLAT, 70.0, "shear_fast", 46.7),
    (FLAT, -70.0, "shear_slow", (162.4 - 92.0) / 2),
    ((0.0, 90.0, 0.0), 90.0, "longitudinal", 180.7),
]


@pytest.mark.parametrize(
    ("symmetry", "constants", "rows"),
    [("cubic", [A, B, C], CUBIC), ("hexagonal", [162.4, 92.0, 46.7, 180.7, 69.0], HEXAGONAL)],
)
def test_closed_forms(tmp_path, symmetry, constants, rows):
    """Along [100], [110] and [111] of a cubic crystal; along c and in the basal plane of a
    hexagonal one.
    """
    assert max(differences(tmp_path, symmetry, constants, rows)) * SD < 1e-3


@pytest.mark.parametrize("name", ["rutile", "calcite", "aragonite", "diopside", "albite"])
def test_christoffel(tmp_path, name):
    """Every wave in two directions of a crystal of every other class, in the surface and along its
    normal.
    """
    symmetry, constants = crystal(name)
    t = tensor(stiffness_rows(symmetry, [constants])[0])
    rows = []
    for angles, along in (((20.0, 40.0, 70.0), 35.0), ((100.0, 75.0, 10.0), None)):
        g = bunge(angles)
        m = (
            g[:, 2]
            if along is None
            else np.cos(np.radians(along)) * g[:, 0] + np.sin(np.radians(along)) * g[:, 1]
        )
        values = np.linalg.eigvalsh(acoustic(t, m, m))
        rows += [
            (angles, along, wave, value)
            for wave, value in zip(
                ("shear_slow", "shear_fast", "longitudinal"), values, strict=True
            )
        ]
    assert max(differences(tmp_path, symmetry, constants, rows)) * SD < 1e-3


@pytest.mark.long
def test_bulk_waves_alone_give_a_cubic_crystal(tmp_path):
    """Pulse echo along [100] and [110]: constants by the closed forms, none left out, each named in
    the document.
    """
    rows = [CUBIC[0], CUBIC[1], CUBIC[4], CUBIC[6]]
    lines = [
        f"0,0,0,{along},{wave},{np.sqrt(1e9 * modulus / DENSITY)},10"
        for _, along, wave, modulus in rows
    ]
    (tmp_path / "bulk.csv").write_text(
        "phi1,Phi,phi2,propagation_deg,wave,velocity_m_s,sd_m_s\n"
        + "\n".join([*lines, f"0,0,0,,longitudinal,{np.sqrt(1e9 * A / DENSITY)},10"])
    )
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", bi.BayesindentWarning)
        result = bi.extract(
            None,
            "cubic",
            velocities=tmp_path / "bulk.csv",
            density_kg_m3=DENSITY,
            samples=1500,
            burn_in=2000,
            chains=2,
        )
        page = bi.report(result, tmp_path / "report.html").read_text(encoding="utf-8")
    document = bi.summary(result)
    assert "The wave velocity in m/s" in page
    assert "differ; no modulus was measured." in page and "the measured grains" not in page
    assert document["velocities_left_out"] == 0
    assert [(item["wave"], item["propagation_deg"]) for item in document["predicted"]] == [
        ("longitudinal", 0.0),
        ("shear_fast", 90.0),
        ("longitudinal", 45.0),
        ("shear_slow", -45.0),
        ("longitudinal", 0.0),
    ]
    assert document["predicted"][-1]["inclination_deg"] == 90
    # Slopes of the speeds, m/s per GPa, over their sd.
    slopes = np.array([[1, 0, 0], [0, 0, 1], [0.5, 0.5, 1], [0.5, -0.5, 0], [1, 0, 0]])
    moduli = np.array([row[3] for row in rows] + [A])
    scaled = slopes * (0.5 * np.sqrt(1e9 / DENSITY / moduli) / 10)[:, None]
    sd = np.sqrt(np.diag(np.linalg.inv(scaled.T @ scaled)))
    for item, truth, expected in zip(document["parameters"].values(), (A, B, C), sd, strict=True):
        assert item["mean"] == pytest.approx(truth, abs=0.15 * expected)
        assert item["sd"] == pytest.approx(expected, rel=0.1)


@pytest.mark.parametrize(
    ("row", "words"),
    [
        (
            "0,0,0,10,love,3000,10",
            "line 2, column wave: love is no wave; allowed rayleigh, "
            "longitudinal, shear_slow, shear_fast",
        ),
        ("0,0,0,,rayleigh,3000,10", "line 2, column wave: rayleigh: propagation_deg is missing"),
    ],
)
def test_waves_that_are_none(tmp_path, row, words):
    (tmp_path / "bulk.csv").write_text(
        f"phi1,Phi,phi2,propagation_deg,wave,velocity_m_s,sd_m_s\n{row}\n"
    )
    with pytest.raises(bi.InputError, match=words):
        bi.extract(None, "cubic", velocities=tmp_path / "bulk.csv", density_kg_m3=DENSITY)


@pytest.mark.parametrize(
    ("rows", "expected"),
    [
        ([{}], "Rayleigh velocity"),
        ([{}, {"wave": "longitudinal", "inclination_deg": 90}], "wave velocity"),
    ],
)
def test_the_report_calls_only_surface_waves_rayleigh(rows, expected):
    waves = ({"propagation_deg": 0.0} | row for row in rows)
    document = {"predicted": [{"mean": 130.0}, *waves]}
    facts = {"settings": "", "summary": json.dumps(document)}
    results = Results(SimpleNamespace(posterior=SimpleNamespace(attrs=facts)))
    assert results.speed == expected
