"""Surface waves: their speeds against Stroh's eigenvalue problem and closed forms, and what Step 2
makes of measured ones.

Modules: wave_grains.f90.
"""

import warnings

import dynesty
import numpy as np
import pytest
from scipy import stats

import bayesindent as bi
from bayesindent.crystal.elasticity import rayleigh_modes, stiffness_rows
from support.csv_tables import column
from support.densities import Posterior
from support.diagnostics import issues, of_code
from support.reference_theory import FieldTheory
from support.reference_theory import stiffness as stiffness_of
from support.step_2_cases import crystal
from support.stroh import Waves, rayleigh, slowest_bulk

#: Speeds are then roots of rho v^2 in GPa.
UNIT = 1e9

#: kg/m3.
DENSITY = 4000.0


def directions(n, seed):
    rng = np.random.default_rng(seed)
    angles = np.column_stack(
        [
            rng.uniform(0, 360, n),
            np.degrees(np.arccos(rng.uniform(-1, 1, n))),
            rng.uniform(0, 360, n),
        ]
    )
    return angles, rng.uniform(0, 180, n)


@pytest.mark.parametrize(
    "name", ["copper", "Zn", "rutile", "calcite", "aragonite", "diopside", "albite"]
)
def test_speed_and_displacement_of_every_class(name):
    """By Stroh's eigenvalues; where the root is within 2e-6 of the limiting speed squared,
    bisection meets the limit instead.
    """
    symmetry, constants = crystal(name)
    c = stiffness_rows(symmetry, [constants])[0]
    angles, along = directions(12, 3)
    speed, bulk, share = rayleigh_modes(c, angles, along, UNIT)
    expected = np.array([rayleigh(c, *row) for row in zip(angles, along, strict=True)])
    there = np.isfinite(expected[:, 0])
    assert there.sum() >= 9
    assert speed[there] ** 2 == pytest.approx(expected[there, 0], rel=1e-6)
    assert share[there] == pytest.approx(expected[there, 1], abs=1e-3)
    assert bulk**2 == pytest.approx(
        [slowest_bulk(c, *row) for row in zip(angles, along, strict=True)], rel=1e-7
    )


def test_silicon_and_the_density():
    silicon = bi.stiffness("cubic", 165.7, 63.9, 79.6)
    assert bi.rayleigh_velocity(silicon, [0, 0, 0], [0.0, 90.0], 2330.0) == pytest.approx(
        4919, abs=3
    )
    assert bi.rayleigh_velocity(silicon, [0, 0, 0], 0.0, [2330.0, 4 * 2330.0]) @ [
        1,
        -2,
    ] == pytest.approx(0, abs=1e-9)


def test_copper_where_the_branch_follows_the_bulk_wave():
    """On (001), more than 25 degrees from [100], the wave is close to a shear wave that moves along
    the surface.
    """
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


@pytest.mark.parametrize(
    ("settings", "said"),
    [
        ({}, "density_kg_m3: the variable is missing; &measurements velocities needs it"),
        ({"density_kg_m3": 8960.0, "orientations": "unknown"}, "cannot be combined with veloc"),
    ],
)
def test_speeds_in_a_table_of_python_need_what_those_of_a_file_need(settings, said):
    table = {
        "euler_deg": [[0, 0, 0]],
        "propagation_deg": [0],
        "velocity_m_s": [2000],
        "sd_m_s": [10],
    }
    with pytest.raises(bi.InputError, match=said):
        bi.extract(None, "cubic", velocities=table, **settings)


def test_shapes_that_do_not_fit_are_refused():
    with pytest.raises(bi.InputError, match="do not broadcast"):
        bi.rayleigh_velocity(np.eye(6), np.zeros((2, 3)), np.zeros(3), 1.0)
    with pytest.raises(
        bi.InputError,
        match=r"angles \(\) and propagation_deg \(2,\) and density_kg_m3 \(3,\) do not broadcast",
    ):
        bi.rayleigh_velocity(np.eye(6), np.zeros(3), np.zeros(2), np.ones(3))
    with pytest.raises(bi.InputError, match="positive definite|stable"):
        bi.rayleigh_velocity(-np.eye(6), [0, 0, 0], 0.0, 1.0)


# Step 2


def speeds_of(c, angles, along, density):
    """Speeds in m/s by Stroh's eigenvalues, and which are those of detected waves by the rule of
    the documentation.
    """
    found = np.array([rayleigh(c, *row) for row in zip(angles, along, strict=True)])
    bulk = np.array([slowest_bulk(c, *row) for row in zip(angles, along, strict=True)])
    return np.sqrt(1e9 * found[:, 0] / density), (found[:, 0] < 0.97**2 * bulk) & (
        found[:, 1] > 0.2
    )


def measured(name, n, density, seed, noise=1.0):
    """Synthetic moduli at 2 % and speeds of detected waves at 0.5 % of n grains each."""
    symmetry, constants = crystal(name)
    c, rng = stiffness_rows(symmetry, [constants])[0], np.random.default_rng(seed)
    angles, along = directions(4 * n, seed)
    speed, detected = speeds_of(c, angles, along, density)
    kept = np.flatnonzero(detected)[:n]
    moduli = bi.halfspace_modulus(c, angles[:n])
    table = {
        "euler_deg": angles[:n],
        "indentation_modulus_gpa": moduli * (1 + noise * 0.02 * rng.normal(size=n)),
        "sd_gpa": 0.02 * moduli,
    }
    waves = {
        "euler_deg": angles[kept],
        "propagation_deg": along[kept],
        "sd_m_s": 0.005 * speed[kept],
    }
    return (
        symmetry,
        constants,
        table,
        waves
        | {"rayleigh_velocity_m_s": speed[kept] * (1 + noise * 0.005 * rng.normal(size=len(kept)))},
    )


@pytest.mark.parametrize("name", ["copper", "Ti", "quartz"])
def test_the_density_is_that_of_stroh(name):
    """Normal errors of moduli and speeds, with a calibration factor of each and the density that
    all speeds share.
    """
    symmetry, constants, table, waves = measured(name, 6, 5000.0, 3)
    errors = {
        "calibration_sd": 0.03,
        "velocity_calibration_sd": 0.01,
        "density_kg_m3": 5000.0,
        "density_sd_kg_m3": 100.0,
    }
    posterior = Posterior.of(
        table,
        velocities=waves,
        symmetry=symmetry,
        surrogate=bi.Surrogate.load("halfspace"),
        **errors,
    )
    points = constants * (1 + 0.02 * np.random.default_rng(2).standard_normal((4, len(constants))))
    likelihood = posterior.evaluate(points)[1]
    sds = np.concatenate([table["sd_gpa"], waves["sd_m_s"]])
    for point, found in zip(points, likelihood, strict=True):
        c = stiffness_rows(symmetry, [point])[0]
        speed, _ = speeds_of(c, waves["euler_deg"], waves["propagation_deg"], 5000.0)
        modulus = posterior.moduli(point, table["euler_deg"])[0][0]
        common = np.zeros((3, 12))
        common[0, :6], common[1, 6:], common[2, 6:] = 0.03 * modulus, 0.01 * speed, 0.01 * speed
        data = np.concatenate([table["indentation_modulus_gpa"], waves["rayleigh_velocity_m_s"]])
        expected = stats.multivariate_normal(
            np.concatenate([modulus, speed]), np.diag(sds**2) + common.T @ common
        ).logpdf(data)
        assert found == pytest.approx(expected, abs=2e-4)


def test_speeds_alone_have_a_density():
    symmetry, constants, _, waves = measured("copper", 6, 8960.0, 4)
    posterior = Posterior.of(
        None,
        velocities=waves,
        symmetry=symmetry,
        surrogate=bi.Surrogate.load("halfspace"),
        density_kg_m3=8960.0,
    )
    speed, _ = speeds_of(
        stiffness_rows(symmetry, [constants])[0],
        waves["euler_deg"],
        waves["propagation_deg"],
        8960.0,
    )
    expected = stats.norm(speed, waves["sd_m_s"]).logpdf(waves["rayleigh_velocity_m_s"]).sum()
    assert posterior.evaluate([constants])[1] == pytest.approx(expected, abs=1e-4)


@pytest.mark.parametrize(
    ("name", "needed"), [("copper", [0.45, 0.45, 0.6]), ("Ti", [0.3, 0.3, 0.5, 0.5, 0.6])]
)
@pytest.mark.long
def test_both_know_what_neither_knows(name, needed):
    """sds of moduli and speeds together, over those of either alone; the truth is within three sds;
    a false speed of an undetected wave is left out.
    """
    symmetry, constants, table, waves = measured(name, 20, 5000.0, 5)
    asked = {"symmetry": symmetry, "density_kg_m3": 5000.0, "samples": 1500, "technique": "exact"}
    both, moduli = (bi.summary(quiet(table, velocities=given, **asked)) for given in (waves, None))
    sd, alone = (np.array(column(found["parameters"].values(), "sd")) for found in (both, moduli))
    assert (sd < needed * alone).all()
    mean = np.array([item["mean"] for item in both["parameters"].values()])
    assert np.abs((mean - constants) / sd).max() < 3
    assert both["error_budget"]["C11"]["velocities"] > 0.05
    assert moduli["error_budget"]["C11"]["velocities"] == 0
    assert len(both["predicted"]) + both["velocities_left_out"] == 40


def quiet(*arguments, **keywords):
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", bi.BayesindentWarning)
        return bi.extract(*arguments, **keywords)


@pytest.mark.long
def test_waves_that_are_not_detected_are_left_out():
    """Copper on (001): of what a pseudo-surface wave gave at 35 degrees from [100], much faster
    than the surface wave, nothing is used.
    """
    symmetry, constants, table, waves = measured("copper", 12, 8960.0, 6)
    false = {
        "euler_deg": np.zeros((2, 3)),
        "propagation_deg": [35.0, 40.0],
        "sd_m_s": [10.0, 10.0],
        "rayleigh_velocity_m_s": [2200.0, 2250.0],
    }
    with issues("velocities_left_out") as told:
        result = bi.extract(
            table,
            symmetry,
            velocities={key: np.concatenate([waves[key], false[key]]) for key in waves},
            density_kg_m3=8960.0,
            samples=500,
            technique="exact",
        )
    document = bi.summary(result)
    assert document["velocities_left_out"] >= 2
    (found,) = of_code(told, "velocities_left_out")
    assert found["numbers"] == {"left_out": document["velocities_left_out"], "velocities": 14}
    assert not any(item.get("propagation_deg") in (35.0, 40.0) for item in document["predicted"])
    for item, truth in zip(document["parameters"].values(), constants, strict=True):
        assert abs(item["mean"] - truth) < 3 * item["sd"]


def theories(symmetry, waves, angles):
    """Moduli and speeds of crystals (n, k) by NumPy alone."""
    along = Waves(waves["euler_deg"], waves["propagation_deg"])
    moduli = FieldTheory(symmetry, angles, 14, 120, points=32, angles=32, newton=6, precision=float)
    return lambda x: (
        moduli.moduli(x),
        np.array([np.sqrt(1e9 * along(c) / DENSITY) for c in stiffness_of(symmetry, x)]),
    )


@pytest.mark.long
@pytest.mark.parametrize(("name", "n"), [("Ti", 12), ("quartz", 16)])
def test_posteriors_by_importance_sampling(name, n):
    """Moduli and speeds of titanium and quartz between bounds, with an error of the density: by
    theories in NumPy, which share nothing with the package, at points of a wide Student's t,
    weighted.
    """
    symmetry, constants, table, waves = measured(name, n, DENSITY, 11)
    symmetry = {"-3m": "trigonal"}.get(symmetry, symmetry)
    width = np.array([40.0, 40, 15, 40, 40] if name == "Ti" else [15.0, 15, 15, 10, 15, 8])
    bounds = {
        key: (x - w, x + w)
        for key, x, w in zip(bi.constants(symmetry), constants, width, strict=True)
    }
    asked = {
        "symmetry": symmetry,
        "bounds": bounds,
        "velocities": waves,
        "density_kg_m3": DENSITY,
        "density_sd_kg_m3": 20.0,
    }
    posterior = Posterior.of(table, surrogate=bi.Surrogate.load("halfspace"), **asked)
    draws = posterior.sample(
        method="ensemble", samples=4000, burn_in=4000, chains=2, threads=2, seed=5
    )[0].reshape(-1, len(constants))
    proposal = stats.multivariate_t(draws.mean(axis=0), 1.3 * np.cov(draws.T), df=6, seed=3)
    x = proposal.rvs(6000)
    x = x[(np.abs(x - constants) < width).all(axis=1)]
    x = x[np.linalg.eigvalsh(stiffness_of(symmetry, x))[:, 0] > 0]
    moduli, speeds = theories(symmetry, waves, table["euler_deg"])(x)
    logs = -proposal.logpdf(x) - 0.5 * (
        ((moduli - table["indentation_modulus_gpa"]) / table["sd_gpa"]) ** 2
    ).sum(axis=1)
    for k, speed in enumerate(speeds):
        shared = 0.5 * 20.0 / DENSITY * speed
        logs[k] += stats.multivariate_normal(
            speed, np.diag(waves["sd_m_s"] ** 2) + np.outer(shared, shared)
        ).logpdf(waves["rayleigh_velocity_m_s"])
    weights = np.exp(logs - logs.max())
    weights /= weights.sum()
    assert 1 / (weights**2).sum() > 1000
    mean = weights @ x
    sd = np.sqrt(weights @ (x - mean) ** 2)
    assert np.abs((draws.mean(axis=0) - mean) / sd).max() < 0.15
    assert draws.std(axis=0) == pytest.approx(sd, rel=0.1)


@pytest.mark.long
def test_the_posterior_is_that_of_an_independent_sampler():
    """Six speeds and six moduli of copper between bounds, by Stroh's eigenvalues and nested
    sampling.
    """
    symmetry, constants, table, waves = measured("copper", 6, 8960.0, 8)
    width = np.array([40.0, 40.0, 15.0])
    bounds = {
        name: (x - w, x + w)
        for name, x, w in zip(bi.constants(symmetry), constants, width, strict=True)
    }
    result = quiet(
        table,
        symmetry,
        velocities=waves,
        density_kg_m3=8960.0,
        bounds=bounds,
        samples=5000,
        technique="exact",
    )
    document = bi.summary(result)
    assert document["velocities_left_out"] == 0
    along = Waves(waves["euler_deg"], waves["propagation_deg"])

    def log_likelihood(x):
        c = stiffness_rows(symmetry, [x])[0]
        if np.linalg.eigvalsh(c)[0] <= 0:
            return -1e100
        moduli, speeds = (
            bi.halfspace_modulus(c, table["euler_deg"]),
            np.sqrt(1e9 * along(c) / 8960.0),
        )
        first = (moduli - table["indentation_modulus_gpa"]) / table["sd_gpa"]
        return (
            -0.5 * (first**2).sum()
            - 0.5 * (((speeds - waves["rayleigh_velocity_m_s"]) / waves["sd_m_s"]) ** 2).sum()
        )

    sampler = dynesty.NestedSampler(
        log_likelihood,
        lambda u: constants + width * (2 * u - 1),
        3,
        nlive=150,
        rstate=np.random.default_rng(1),
    )
    sampler.run_nested(print_progress=False, dlogz=0.05)
    draws = sampler.results.samples_equal(rstate=np.random.default_rng(2))
    for j, item in enumerate(document["parameters"].values()):
        assert abs(item["mean"] - draws[:, j].mean()) < 0.15 * draws[:, j].std()
        assert item["sd"] == pytest.approx(draws[:, j].std(), rel=0.1)
