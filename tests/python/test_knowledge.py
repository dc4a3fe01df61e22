"""What else is known of a crystal: its density, what contradicts it, and angles in radians."""

import pickle
from functools import cache

import numpy as np
import pytest
from scipy import optimize, stats

import bayesindent as bi
from bayesindent.crystal.elasticity import constant_names, stiffness_rows
from bayesindent.surrogate.surrogate import places
from support.csv_tables import numbers, read_rows
from support.densities import PRIOR, Posterior
from support.diagnostics import codes, of_code
from support.step_2_cases import KIND, default_prior, log_volume, table_of
from support.tree import REFERENCE, SOURCE

STIFFNESS = SOURCE / "inputs" / "data" / "titanium_dft.csv"
TITANIUM = SOURCE / "inputs" / "data" / "titanium.csv"
#: Of the sampler, where means and sds are enough.
SHORT = {"samples": 1000, "burn_in": 2000, "chains": 2, **KIND}
ANGLES = np.array([[0.0, 10.0, 0.0], [20.0, 50.0, 40.0], [10.0, 85.0, 5.0]])


def stiffness_of_file():
    """Means and covariance in the order of the class, by the standard library."""
    rows = {row["row"]: row for row in read_rows(STIFFNESS)}
    names = constant_names("hexagonal")
    mean, *covariance = numbers([rows[name] for name in ("mean", *names)], names)
    return mean, np.array(covariance)


def prior_of(knowledge, **settings):
    """The prior with this knowledge; the measurements only say about how stiff the crystal is."""
    table = table_of(ANGLES, np.full(3, 140.0), np.full(3, 3.0))
    return Posterior.of(
        table,
        surrogate=bi.Surrogate.load("halfspace"),
        symmetry="hexagonal",
        what=PRIOR,
        knowledge=knowledge,
        **KIND,
        **settings,
    )


def test_a_stiffness_with_its_covariance_is_one_normal_factor():
    mean, covariance = stiffness_of_file()
    points = mean + np.random.default_rng(1).normal(size=(50, 5)) * 3.0
    normal = stats.multivariate_normal(mean, covariance).logpdf(points) + default_prior(
        "hexagonal", points, 140.0
    )
    for value in (STIFFNESS, (mean, covariance)):
        found = prior_of({"stiffness": value}).evaluate(points)[0]
        assert found - found[0] == pytest.approx(normal - normal[0], rel=1e-8, abs=1e-8)
    # Beside it another source that knows one constant and a ratio.
    found = prior_of({"C44": (46.0, 2.0), "C33/C11": (1.1, 0.03), "stiffness": STIFFNESS}).evaluate(
        points
    )[0]
    normal += stats.norm(46.0, 2.0).logpdf(points[:, 2]) + stats.norm(1.1, 0.03).logpdf(
        points[:, 3] / points[:, 0]
    )
    assert found - found[0] == pytest.approx(normal - normal[0], rel=1e-8, abs=1e-8)


@pytest.mark.long
def test_where_data_say_nothing_the_posterior_is_what_is_known():
    """Times the default prior, whose weights draws of the normal distribution get."""
    mean, covariance = stiffness_of_file()
    # A product of two normals, by the usual update.
    other, sd = 46.0, 2.0
    gain = covariance[:, 2] / (covariance[2, 2] + sd**2)
    wanted, spread = mean + gain * (other - mean[2]), covariance - np.outer(gain, covariance[2])
    points = np.random.default_rng(2).multivariate_normal(wanted, spread, 200_000)
    points = points[np.linalg.eigvalsh(stiffness_rows("hexagonal", points)).min(axis=1) > 0]
    weights = default_prior("hexagonal", points, 140.0)
    weights = np.exp(weights - weights.max())
    assert weights.sum() ** 2 / (weights**2).sum() > 50_000
    wanted, spread = np.average(points, axis=0, weights=weights), np.cov(points.T, aweights=weights)
    table = table_of(ANGLES, np.full(3, 140.0), np.full(3, 2000.0))
    knowledge = {"stiffness": (mean, covariance), "C44": (other, sd)}
    result = bi.extract(
        table,
        symmetry="hexagonal",
        knowledge=knowledge,
        samples=5000,
        burn_in=2000,
        chains=2,
        **KIND,
    )
    draws = np.stack(
        [result.posterior[name].values.ravel() for name in constant_names("hexagonal")], axis=1
    )
    size = min(item["ess_bulk"] for item in bi.summary(result)["parameters"].values())
    assert size > 1000
    assert draws.mean(axis=0) == pytest.approx(wanted, abs=5 * np.sqrt(spread.max() / size))
    assert np.cov(draws.T) == pytest.approx(spread, abs=8 * spread.max() / np.sqrt(size))


def conflicts(result):
    """All conflicts by name, the one of all together, and what is told of them."""
    document = bi.summary(result)
    found = {item["name"]: item["conflict_sd"] for item in document["prior"]["knowledge"]}
    return (
        found,
        document["prior"]["conflict_sd"],
        of_code(
            document["warnings"],
            *("knowledge_wrong", "knowledge_contradicts", "knowledge_conflict"),
            *("other_model", "other_model_likely"),
        ),
    )


def test_the_conflict_of_two_sources_is_their_distance_in_sds():
    mean, covariance = stiffness_of_file()
    table = table_of(ANGLES, np.full(3, 140.0), np.full(3, 2000.0))
    # A source that disagrees with the file's C44 of 44 +- 3, where the data say nothing.
    distance = (62.0 - mean[2]) / np.hypot(2.0, np.sqrt(covariance[2, 2]))
    knowledge = {"stiffness": (mean, covariance), "C44": (62.0, 2.0)}
    one, together, told = conflicts(
        bi.extract(table, symmetry="hexagonal", knowledge=knowledge, **SHORT)
    )
    # The file's own constant is under the same name, and as far from all else.
    assert one["C44"] == pytest.approx(distance, rel=0.1)
    assert together == pytest.approx(stats.norm.isf(stats.chi2.sf(distance**2, 6)), abs=0.1)
    assert told
    assert all(found["subject"].startswith("C44 = ") for found in told)


@cache
def least_misfit(bulk):
    """The least -2 log density in log K of the reference moduli, with a bulk modulus that is known
    to 1 % or without one.
    """
    table = np.loadtxt(REFERENCE / "cubic_fe3si.csv", delimiter=",", skiprows=2)
    euler, measured, sd = table[:, :3], table[:, 3], table[:, 4]

    def misfit(logarithms):
        k, g, h = np.exp(logarithms)
        point = np.array([[k + 4 * g / 3, k - 2 * g / 3, h]])
        prior = float(
            (default_prior("cubic", point, measured.mean()) - log_volume("cubic", point))[0]
        )
        residuals = (bi.halfspace_modulus(stiffness_rows("cubic", point)[0], euler) - measured) / sd
        known = ((k - bulk) / (0.01 * bulk)) ** 2 if bulk else 0.0
        return sum(residuals**2) - 2 * prior + known

    starts = [
        np.log([k, g, h])
        for k in (60.0, 165.0, *([bulk] if bulk else []))
        for g, h in ((50.0, 110.0), (110.0, 200.0))
    ]
    # The differences are some tens.
    enough = {"xatol": 1e-3, "fatol": 1e-3}
    found = [
        optimize.minimize(misfit, start, method="Nelder-Mead", options=enough) for start in starts
    ]
    return min(each.fun for each in found)


@pytest.mark.xdist_group("bulk moduli")
@pytest.mark.parametrize("bulk", [16.5, 1650.0])
def test_a_bulk_modulus_that_no_crystal_with_such_moduli_has_is_told(bulk):
    """Moduli alone hardly say it, the default prior does: against the maxima of the density in log
    K with and without the knowledge.
    """
    least = least_misfit(None), least_misfit(bulk)
    result = bi.extract(
        str(REFERENCE / "cubic_fe3si.csv"),
        "cubic",
        knowledge={"bulk_modulus": (bulk, 0.01 * bulk)},
        **SHORT,
    )
    one, _, told = conflicts(result)
    assert one["bulk_modulus"] == pytest.approx(np.sqrt(least[1] - least[0]), rel=0.02)
    assert len(told) == 1


@pytest.mark.long
def test_knowledge_that_contradicts_measurements_is_told():
    settings = {"symmetry": "hexagonal", **SHORT}
    _, together, told = conflicts(
        bi.extract(TITANIUM, knowledge={"stiffness": STIFFNESS}, **settings)
    )
    assert together < 2
    assert told == []
    one, together, told = conflicts(
        bi.extract(
            TITANIUM, knowledge={"bulk_modulus": (108.7, 1.0), "C11": (100.0, 2.0)}, **settings
        )
    )
    assert min(one.values()) > 8
    assert together > 8
    assert told and {found["subject"].split(" = ")[0] for found in told} <= {
        "bulk_modulus",
        "C11",
        "stated knowledge of another crystal (leave out &knowledge)",
    }


def test_a_problem_with_a_stiffness_is_made_anew():
    mean, covariance = stiffness_of_file()
    one, other = (prior_of({"stiffness": (shift + mean, covariance)}).problem for shift in (0, 1))
    copy = pickle.loads(pickle.dumps(one))
    digests = [problem._call("inputs", **places("", ""))["text"] for problem in (one, copy, other)]
    assert digests[0] == digests[1] != digests[2]


@pytest.mark.parametrize(
    ("knowledge", "words"),
    [
        (
            {"stiffness": (np.ones(3), np.eye(3))},
            r"&knowledge stiffness_file: .*\(3,\) and \(3, 3\); allowed \(5,\) and \(5, 5\)",
        ),
        (
            {"stiffness": (np.full(5, np.nan), np.eye(5))},
            r"&knowledge stiffness_file: line 2, column C11: nan is not finite",
        ),
        (
            {"stiffness": SOURCE / "nowhere.csv"},
            r"&knowledge stiffness_file: .*nowhere.csv: .*does not exist",
        ),
        (
            {"bulk_modulus": (100, 1), "bulk_modulus^2": (10000, 200)},
            "'bulk_modulus.2' of a .* crystal is the same as 'bulk_modulus'",
        ),
        ({"C66": (35, 1), "C'": (35, 1)}, "'C'' of a hexagonal crystal is the same as 'C66'"),
        (
            {"young[100]": (100, 1), "young[1 0.5 0]": (100, 1)},
            "of a hexagonal crystal is the same as",
        ),
    ],
)
def test_refusals(knowledge, words):
    with pytest.raises(bi.InputError, match=words):
        prior_of(knowledge)


def test_what_differs_may_be_known_together():
    prior_of(
        {
            "bulk_modulus": (110, 5),
            "polycrystal_bulk": (110, 5),
            "compressibility[100]": (3, 1),
            "young[001]": (140, 5),
            "C33/C11": (1, 1),
        }
    )


def test_angles_in_radians():
    table = table_of(ANGLES, np.array([140.0, 135.0, 130.0]), np.full(3, 3.0))
    radians = table | {"euler_deg": np.radians(ANGLES)}
    settings = {"surrogate": bi.Surrogate.load("halfspace"), "symmetry": "hexagonal", **KIND}
    point = [[162.0, 92.0, 47.0, 180.0, 69.0]]
    wanted = Posterior.of(table, **settings).evaluate(point)
    found = Posterior.of(radians, angles="radians", **settings)
    assert np.array(found.evaluate(point)) == pytest.approx(np.array(wanted), rel=1e-9)
    assert found.problem.measurements.euler_deg == pytest.approx(ANGLES, abs=1e-12)
    assert found.problem.warnings == []
    with pytest.raises(bi.InputError, match="no angle is above 2 pi.*angles = 'radians'"):
        Posterior.of(radians, **settings)
    with pytest.raises(
        bi.InputError, match=r"column Phi_deg: 572.95\d+ degrees; allowed 0.0 to 180.0"
    ):
        Posterior.of(table, angles="radians", **settings)
    # Whole numbers of degrees near the axis, and two grains, are no proof.
    for angles in ([[0, 0, 0], [0, 3, 0], [0, 6, 0]], [[0.1, 0.2, 0.3], [1.0, 1.5, 2.0]]):
        few = table_of(
            np.array(angles, float), np.full(len(angles), 140.0), np.full(len(angles), 3.0)
        )
        assert "angles_like_radians" in codes(Posterior.of(few, **settings).problem.warnings)


@pytest.mark.parametrize(
    ("symmetry", "n_constants", "visible"),
    [
        ("isotropic", 2, 1),
        ("cubic", 3, 2),
        ("hexagonal", 5, 3),
        ("4/mmm", 6, 4),
        ("4/m", 7, 5),
        ("-3m", 6, 4),
        ("-3", 7, 5),
        ("mmm", 9, 6),
        ("2/m", 13, 9),
        ("-1", 21, 15),
    ],
)
def test_too_few_directions_are_told_with_what_is_visible(symmetry, n_constants, visible):
    rng = np.random.default_rng(5)

    def warnings(n):
        # Directions at random in a narrow part of the sphere, and each of them again, turned about
        # itself, which says nothing new.
        angles = np.column_stack(
            [np.zeros(n), 15.0 + 30.0 * np.arange(n) / max(1, n - 1), rng.uniform(60, 85, n)]
        )
        angles = np.concatenate([angles, angles + np.array([50.0, 0, 0])])
        table = table_of(angles, np.full(2 * n, 150.0), np.full(2 * n, 4.0))
        settings = {"surrogate": bi.Surrogate.load("halfspace"), "symmetry": symmetry, **KIND}
        return of_code(Posterior.of(table, **settings).problem.warnings, "few_directions")

    if visible > 2:
        numbers = {"directions": 2, "needed": visible, "constants": n_constants}
        assert [found["numbers"] for found in warnings(2)] == [numbers]
    assert warnings(max(2, min(visible, 6))) == [] or visible > 6


@pytest.mark.long
def test_equal_bounds_fix_a_constant():
    euler_deg = np.column_stack(
        [np.zeros(12), np.degrees(np.arccos(np.linspace(-0.95, 0.95, 12))), np.linspace(0, 330, 12)]
    )
    modulus = bi.halfspace_modulus(bi.stiffness("cubic", C11=168.4, C12=121.4, C44=75.4), euler_deg)
    table = {
        "euler_deg": euler_deg,
        "modulus_gpa": modulus + 2 * np.cos(np.arange(12)),
        "sd_gpa": np.full(12, 2.0),
    }
    box = {"C11": (50, 300), "C12": (20, 200), "C44": (20, 200)}
    # A chain now and then stays some hundred samples in the tail.
    settings = {
        "symmetry": "cubic",
        "modulus_kind": "indentation_modulus",
        "seed": 1,
        "samples": 20000,
    }
    fixed = bi.extract(table, bounds=box | {"C12": (121.4, 121.4)}, **settings).posterior
    known = bi.extract(table, bounds=box, knowledge={"C12": (121.4, 0.01)}, **settings).posterior
    np.testing.assert_allclose(fixed.C12, 121.4, atol=0.03)
    for name in ("C11", "C44"):
        sd = float(known[name].std())
        # 15 Monte Carlo errors or so, with some 6000 effective samples each.
        assert abs(float(fixed[name].mean() - known[name].mean())) < 0.2 * sd
        assert float(fixed[name].std()) == pytest.approx(sd, rel=0.15)
        # Eight runs have 5.84 to 6.01 GPa.
        assert sd < 7, "the free ridge would be much longer"
