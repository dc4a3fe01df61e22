"""The next measurement may be the speed of a surface wave: gains against quadrature over speeds by
Stroh's eigenvalues.
"""

import numpy as np
import pytest

import bayesindent as bi
from bayesindent.crystal.elasticity import stiffness_rows
from bayesindent.inference.measurements import problem_of
from support.densities import Posterior
from support.step_2_cases import KIND
from support.stroh import Waves, bunge, rayleigh, slowest_bulk

TITANIUM = np.array([162.4, 92.0, 46.7, 180.7, 69.0])
DENSITY = 4506.0
#: Of moduli and speeds that were measured, and of the next ones.
SDS = {"sd_gpa": 3.0, "velocity_sd_m_s": 15.0}
GRAINS = np.array([[0.0, 10, 20], [30, 50, 70], [200, 80, 10], [90, 90, 0]])
#: Of the speeds that were measured, of which none is left out as a pseudo-surface wave, as all of
#: the first grain would be: orientations, and directions of propagation.
MEASURED, ALONG = GRAINS[1:], np.array([70.0, 140.0, 30.0])


def moduli_table():
    moduli = bi.halfspace_modulus(bi.stiffness("hexagonal", *TITANIUM), GRAINS)
    return {
        "grain": ["A", "B", "C", "D"],
        "euler_deg": GRAINS,
        "indentation_modulus_gpa": moduli,
        "sd_gpa": 0.02 * moduli,
    }


def speeds_table():
    speed = bi.rayleigh_velocity(bi.stiffness("hexagonal", *TITANIUM), MEASURED, ALONG, DENSITY)
    return {
        "euler_deg": MEASURED,
        "propagation_deg": ALONG,
        "rayleigh_velocity_m_s": speed,
        "sd_m_s": 0.005 * speed,
    }


def draws(n=2000):
    """Of some posterior of titanium."""
    rng = np.random.default_rng(4)
    return TITANIUM + rng.normal(size=(n, 5)) @ np.diag([6.0, 7, 1.5, 6, 6]) @ np.array(
        np.eye(5) + 0.5 * np.eye(5, k=1)
    )


def suggest(x, table=None, velocities=None, **settings):
    """The document of `next` from given draws."""
    surrogate = bi.Surrogate.load("halfspace")
    asked = {
        "symmetry": "hexagonal",
        "density_kg_m3": DENSITY,
        "velocities": velocities,
        **KIND,
        **SDS,
        **settings,
    }
    if table is None:
        asked.pop("modulus_kind")
    problem = problem_of("bi.next_grain", surrogate, table, **asked)
    return Posterior(problem, surrogate).suggest(problem, x)


def candidates(document, speeds):
    return [item for item in document["candidates"] if ("propagation_deg" in item) == speeds]


def stroh_speeds(x, angles, along):
    """Of crystals, (draw, direction), m/s."""
    waves = Waves(angles, along)
    return np.array([np.sqrt(1e9 * waves(c) / DENSITY) for c in stiffness_rows("hexagonal", x)])


def gain_by_quadrature(mean, variance):
    """Information of a value that is normal about `mean` with `variance` at each draw, nats."""
    v = np.linspace(
        (mean - 6 * np.sqrt(variance)).min(), (mean + 6 * np.sqrt(variance)).max(), 1200
    )
    p = np.mean(
        np.exp(-0.5 * (v[:, None] - mean) ** 2 / variance) / np.sqrt(2 * np.pi * variance), axis=1
    )
    p = np.maximum(p, 1e-300)
    return -np.trapezoid(p * np.log(p), v) - 0.5 * np.mean(np.log(2 * np.pi * np.e * variance))


@pytest.mark.parametrize("target", ["all", "C33"])
def test_gains_of_speeds_and_moduli_by_their_definition(target):
    """Own errors alone, from 100 draws."""
    x = draws(100)
    found = suggest(x, moduli_table(), velocity_cost=1.0, target=target, count=1)
    speeds, moduli = (candidates(found, kind) for kind in (True, False))
    chosen = speeds[::7]
    by_stroh = stroh_speeds(
        x, [item["euler_deg"] for item in chosen], [item["propagation_deg"] for item in chosen]
    )
    by_theory = bi.halfspace_modulus(
        stiffness_rows("hexagonal", x)[:, None],
        np.array([item["euler_deg"] for item in moduli[::15]]),
    )
    for items, values, sd in ((chosen, by_stroh, 15.0), (moduli[::15], by_theory, 3.0)):
        for item, mean in zip(items, values.T, strict=True):
            expected = gain_by_quadrature(mean, np.full(100, sd**2))
            if target != "all":
                v = np.linspace(mean.min() - 7 * sd, mean.max() + 7 * sd, 1500)
                weights = np.exp(-0.5 * ((v[:, None] - mean) / sd) ** 2) / (
                    sd * np.sqrt(2 * np.pi) * 100
                )
                p, first, second = (weights @ x[:, 3] ** power for power in (0, 1, 2))
                expected = (
                    1 - np.trapezoid(second - first**2 / np.maximum(p, 1e-300), v) / x[:, 3].var()
                )
            assert item["gain"] == pytest.approx(expected, abs=3e-3)


ERRORS = {"calibration_sd": 0.03, "velocity_calibration_sd": 0.004, "density_sd_kg_m3": 40.0}


@pytest.mark.long
@pytest.mark.parametrize("measured", ["both", "moduli", "speeds"])
def test_shared_errors_of_speeds_are_what_the_data_leave_of_them(measured):
    """Calibration of each kind, and the density: given draw and data they are normal, by linear
    algebra; where a kind was not measured, as they were stated.
    """
    x = draws(1000)
    table, velocities = (
        given if measured in ("both", kind) else None
        for kind, given in (("moduli", moduli_table()), ("speeds", speeds_table()))
    )
    # Of crystals near titanium.
    near = {
        name: (0.9 * value, 1.1 * value)
        for name, value in zip(("C11", "C12", "C44", "C33", "C13"), TITANIUM, strict=True)
    }
    found = suggest(x, table, velocities, velocity_cost=1.0, count=1, bounds=near, **ERRORS)
    # Columns: errors of the calibration of moduli, of speeds, of the density.
    of_moduli, of_speeds = np.array([0.03, 0, 0]), np.array([0, 0.004, -0.5 * 40.0 / DENSITY])
    data, sds, model, relative = [], [], [], []
    if table:
        data, sds, relative = (
            list(table["indentation_modulus_gpa"]),
            list(table["sd_gpa"]),
            4 * [of_moduli],
        )
        model.append(bi.halfspace_modulus(stiffness_rows("hexagonal", x)[:, None], GRAINS))
    if velocities:
        data, sds = (
            data + list(velocities["rayleigh_velocity_m_s"]),
            sds + list(velocities["sd_m_s"]),
        )
        relative = relative + 3 * [of_speeds]
        model.append(stroh_speeds(x, MEASURED, ALONG))
    model = np.concatenate(model, axis=1)
    u = np.array(relative) * model[:, :, None] / np.array(sds)[:, None]
    covariance = np.linalg.inv(np.eye(3) + np.swapaxes(u, 1, 2) @ u)
    b = np.einsum("dij,dnj,dn->di", covariance, u, (data - model) / sds)
    speeds, moduli = candidates(found, True)[::9], candidates(found, False)[::25]
    by_stroh = stroh_speeds(
        x, [item["euler_deg"] for item in speeds], [item["propagation_deg"] for item in speeds]
    )
    by_theory = bi.halfspace_modulus(
        stiffness_rows("hexagonal", x)[:, None], np.array([item["euler_deg"] for item in moduli])
    )
    for items, values, sd, errors in (
        (speeds, by_stroh, 15.0, of_speeds),
        (moduli, by_theory, 3.0, of_moduli),
    ):
        for item, mean in zip(items, values.T, strict=True):
            variance = sd**2 + np.einsum("i,dij,j->d", errors, covariance, errors) * mean**2
            assert item["gain"] == pytest.approx(
                gain_by_quadrature(mean * (1 + b @ errors), variance), abs=0.02
            )


def test_a_speed_that_extract_leaves_out_changes_nothing():
    """That of the first grain is a pseudo-surface wave, and a wrong value of it would move the
    errors that speeds share.
    """
    near = {
        name: (0.9 * value, 1.1 * value)
        for name, value in zip(("C11", "C12", "C44", "C33", "C13"), TITANIUM, strict=True)
    }
    right = speeds_table()
    more = {
        name: np.concatenate([[wrong], right[name]])
        for name, wrong in zip(right, (GRAINS[0], 20.0, 2600.0, 10.0), strict=True)
    }
    gains = []
    for speeds in (right, more):
        found = suggest(
            draws(60), moduli_table(), speeds, velocity_cost=1.0, count=1, bounds=near, **ERRORS
        )
        gains.append([item["gain"] for item in found["candidates"]])
    assert gains[0] == pytest.approx(gains[1], rel=1e-9)


def test_the_choice_is_by_gain_over_cost():
    x = draws(500)
    kinds = []
    for cost in (0.01, 100.0):
        found = suggest(x, moduli_table(), velocity_cost=cost, count=2)
        best = max(
            found["candidates"],
            key=lambda item: item["gain"] / (cost if "propagation_deg" in item else 1.0),
        )
        assert {name: found["suggestions"][0].get(name) for name in best} == best
        kinds.append("propagation_deg" in found["suggestions"][0])
        assert (found["velocity_cost"], found["velocity_sd_m_s"]) == (cost, 15.0)
    assert kinds == [True, False]


def test_a_speed_is_of_a_measured_grain_in_crystal_axes():
    """Its normal and its direction of propagation; grains of a list in place of those that were
    measured.
    """
    x = draws(200)
    item = suggest(x, moduli_table(), velocity_cost=1e-3, count=1, lattice=[2.951, 4.684])[
        "suggestions"
    ][0]
    g, angle = bunge(item["euler_deg"]), np.radians(item["propagation_deg"])
    assert item["euler_deg"] == list(GRAINS["ABCD".index(item["grain"])])
    assert item["direction"] == pytest.approx(g[:, 2], abs=1e-12)
    assert item["along"] == pytest.approx(
        np.cos(angle) * g[:, 0] + np.sin(angle) * g[:, 1], abs=1e-12
    )
    assert {"uvw", "along_uvw"} <= set(item)


def test_waves_that_are_not_detected_are_no_candidates(tmp_path):
    """Copper on (001) and another grain: by the rule of docs/waves.md at the crystals of the draws,
    by Stroh's eigenvalues.
    """
    x = np.array([168.4, 121.4, 75.4]) + np.random.default_rng(1).normal(size=(20, 3))
    (tmp_path / "own.csv").write_text("grain,phi1,Phi,phi2\nflat,0,0,0\ntilted,20,35,50\n")
    table = {
        "euler_deg": GRAINS,
        "indentation_modulus_gpa": [130.0, 140, 150, 140],
        "sd_gpa": [3.0, 3, 3, 3],
    }
    found = suggest(
        x,
        table,
        symmetry="cubic",
        density_kg_m3=8960.0,
        velocity_cost=1.0,
        candidates=str(tmp_path / "own.csv"),
        count=1,
    )
    assert [item["grain"] for item in candidates(found, False)] == ["flat", "tilted"]
    expected = []
    for name, angles in (("flat", [0, 0, 0]), ("tilted", [20, 35, 50])):
        for along in np.arange(0, 180, 15.0):
            c = stiffness_rows("cubic", x[::5])
            modes = [rayleigh(one, angles, along) for one in c]
            weak = [
                not (mode[0] < 0.97**2 * slowest_bulk(one, angles, along) and mode[1] > 0.2)
                for one, mode in zip(c, modes, strict=True)
            ]
            if np.mean(weak) <= 0.05:
                expected.append((name, along))
    assert [
        (item["grain"], item["propagation_deg"]) for item in candidates(found, True)
    ] == expected
    assert 4 < len(expected) < 24 and ("flat", 45.0) not in expected and ("flat", 0.0) in expected


@pytest.mark.parametrize(
    ("settings", "words"),
    [
        (
            {"density_kg_m3": None},
            "density_kg_m3: the variable is missing; .*velocity_cost needs it",
        ),
        (
            {"velocity_sd_m_s": 0.0},
            "velocity_sd_m_s: the variable is missing; it is the sd of the next speed, and no "
            "speeds were measured",
        ),
        ({"velocity_cost": 0.0}, "velocity_cost: 0.* out of range; allowed above 0 to 1e6"),
        ({"candidates": "u,v,w\n1,0,0\n"}, "velocity_cost: the grains have directions alone"),
        (
            {"candidates": "phi1,Phi,phi2\n" + "".join(f"{i},20,30\n" for i in range(201))},
            "velocity_cost: 201 grains; allowed up to 200",
        ),
    ],
)
def test_what_is_no_candidate_is_refused(tmp_path, settings, words):
    if "candidates" in settings:
        (tmp_path / "own.csv").write_text(settings["candidates"])
        settings = settings | {"candidates": str(tmp_path / "own.csv"), "symmetry": "cubic"}
    x = np.array([168.4, 121.4, 75.4]) + np.zeros((20, 3))
    settings = {
        name: value
        for name, value in (
            {"symmetry": "cubic", "velocity_cost": 1.0, "density_kg_m3": 8960.0} | settings
        ).items()
        if value is not None
    }
    table = {
        "euler_deg": GRAINS,
        "indentation_modulus_gpa": [130.0, 140, 150, 140],
        "sd_gpa": [3.0, 3, 3, 3],
    }
    surrogate = bi.Surrogate.load("halfspace")
    with pytest.raises(bi.InputError, match=words):
        problem = problem_of("bi.next_grain", surrogate, table, **KIND | SDS | settings)
        Posterior(problem, surrogate).suggest(problem, x)
