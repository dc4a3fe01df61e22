"""Grains of unknown orientation: the likelihood of a modulus is its mean over all directions of the
crystal.
"""

import json

import numpy as np
import pytest
from scipy import special, stats

import bayesindent as bi
from bayesindent.crystal.elasticity import constant_names, stiffness_rows
from bayesindent.program.cli import main
from benchmarks.bench_distribution import compare_glaucophane
from support.densities import Posterior

CRYSTALS = {
    "copper": ("cubic", (168.4, 121.4, 75.4)),
    "titanium": ("hexagonal", (162.4, 92.0, 46.7, 180.7, 69.0)),
    "quartz": ("trigonal", (86.8, 7.0, 11.9, -18.0, 105.8, 58.2)),
    "forsterite": ("orthorhombic", (328, 69, 69, 200, 73, 235, 66.7, 81.3, 80.9)),
}
#: Of the sector of azimuths, degrees, over which a modulus repeats itself or its mirror image.
SECTOR = {"cubic": 45, "hexagonal": 0, "trigonal": 180, "orthorhombic": 90}


def sphere(symmetry, n):
    """Angles of directions over the half sphere, or what symmetry leaves of it, with weights:
    Gauss' rule in the cosine, midpoints of azimuths.
    """
    x, weight = np.polynomial.legendre.leggauss(n)
    sector = SECTOR[symmetry]
    azimuth = (np.arange(m := max(1, sector * n // 45)) + 0.5) * sector / m
    declination = np.degrees(np.arccos((x + 1) / 2))
    angles = [[0.0, one, along] for one in declination for along in azimuth]
    return np.array(angles), np.repeat(weight / 2 / m, m)


def measured(name, n, relative, seed=0):
    """A table of moduli of random directions, without angles."""
    symmetry, constants = CRYSTALS[name]
    rng = np.random.default_rng(seed)
    angles = np.column_stack(
        [np.zeros(n), np.degrees(np.arccos(rng.uniform(-1, 1, n))), rng.uniform(0, 360, n)]
    )
    moduli = bi.halfspace_modulus(bi.stiffness(symmetry, *constants), angles) * (
        1 + relative * rng.normal(size=n)
    )
    return {
        "grain": [f"g{i}" for i in range(n)],
        "indentation_modulus_gpa": moduli.tolist(),
        "sd_gpa": [relative * moduli.mean()] * n,
    }


def log_likelihood(rows, weights, table, shared):
    """Over all directions, `rows` of moduli (crystal, direction), and errors that measurements
    share (measurement, node; log weights).
    """
    relative, log_weights = shared
    total = np.tile(log_weights, (len(rows), 1))
    for i, (modulus, sd) in enumerate(
        zip(table["indentation_modulus_gpa"], table["sd_gpa"], strict=True)
    ):
        # Each value of the shared errors once.
        factor, nodes = np.unique(1 + relative[i], return_inverse=True)
        e = (modulus / sd - rows[:, :, None] / sd * factor) / np.sqrt(2)
        np.square(e, out=e)
        np.exp(np.negative(e, out=e), out=e)
        mean = np.einsum("d,cdn->cn", weights, e)
        with np.errstate(divide="ignore"):
            total += np.log(mean / (sd * np.sqrt(2 * np.pi)))[:, nodes]
    return special.logsumexp(total, axis=1)


def even_nodes(columns, n):
    """Of independent errors (measurement, error) of sd 1: their sums at points of a grid, and log
    weights.
    """
    grid = np.linspace(-5, 5, n)
    z = np.array(np.meshgrid(*[grid] * columns.shape[1], indexing="ij")).reshape(
        columns.shape[1], -1
    )
    logs = stats.norm.logpdf(z).sum(axis=0)
    return columns @ z, logs - special.logsumexp(logs)


#: What measurements share: nothing, a calibration, one of each of two groups, or columns of which
#: one is nearly common.
SHARED = {
    "none": ({}, np.zeros((12, 1)), 1),
    "calibration": ({"calibration_sd": 0.03}, np.full((12, 1), 0.03), 61),
    "groups": ({"calibration_sd": 0.03}, 0.03 * np.repeat(np.eye(2), 6, axis=0), 35),
    "columns": ({}, np.column_stack([np.full(12, 0.02), np.linspace(-0.01, 0.01, 12)]), 35),
}


@pytest.mark.parametrize("name", CRYSTALS)
@pytest.mark.parametrize("shared", SHARED)
def test_the_likelihood_is_the_mean_over_all_directions(name, shared):
    """In many more directions, by moduli of the same harmonics: twelve grains, each to some
    thousandths.
    """
    symmetry, constants = CRYSTALS[name]
    asked, columns, nodes = SHARED[shared]
    table = measured(name, 12, 0.02)
    extra = {"group": [1] * 6 + [2] * 6} if shared == "groups" else {}
    if shared == "columns":
        extra = {f"shared_{k + 1}": column.tolist() for k, column in enumerate(columns.T)}
    posterior = Posterior.of(
        table | extra,
        symmetry=symmetry,
        surrogate=bi.Surrogate.load("halfspace"),
        orientations="unknown",
        **asked,
    )
    points = np.array(constants) * np.array([[0.98], [1.0], [1.02]])
    angles, weights = sphere(symmetry, 12 if symmetry == "trigonal" else 24)
    known = dict(zip(("phi1_deg", "Phi_deg", "phi2_deg"), angles[:12].T.tolist(), strict=True))
    reader = Posterior.of(
        table | known, symmetry=symmetry, surrogate=bi.Surrogate.load("halfspace")
    )
    rows = np.vstack([reader.moduli([point], angles)[0] for point in points])
    exact = log_likelihood(rows, weights, table, even_nodes(columns, nodes))
    assert posterior.evaluate(points)[1] == pytest.approx(exact, abs=0.03)


@pytest.mark.parametrize("rows", [7, 40])
def test_a_texture_takes_the_place_of_the_sphere(tmp_path, rows):
    """The likelihood is the mean over its orientations, also where there are fewer than grains:
    each to a hundredth.
    """
    rng = np.random.default_rng(rows)
    angles = np.column_stack(
        [rng.uniform(0, 360, rows), rng.uniform(0, 25, rows), rng.uniform(0, 360, rows)]
    )
    text = ["phi1_deg,Phi_deg,phi2_deg", *(",".join(map(str, row)) for row in angles)]
    (tmp_path / "texture.csv").write_text("\n".join(text) + "\n")
    table = measured("titanium", 12, 0.02)
    surrogate, symmetry = bi.Surrogate.load("halfspace"), "hexagonal"
    settings = {
        "orientations": "unknown",
        "texture": str(tmp_path / "texture.csv"),
        "calibration_sd": 0.03,
    }
    posterior = Posterior.of(table, symmetry=symmetry, surrogate=surrogate, **settings)
    points = np.array(CRYSTALS["titanium"][1]) * np.array([[0.98], [1.0], [1.02]])
    known = dict(zip(("phi1_deg", "Phi_deg", "phi2_deg"), np.zeros((3, 12)).tolist(), strict=True))
    reader = Posterior.of(table | known, symmetry=symmetry, surrogate=surrogate)
    moduli = np.vstack([reader.moduli([point], angles)[0] for point in points])
    exact = log_likelihood(
        moduli, np.full(rows, 1 / rows), table, even_nodes(np.full((12, 1), 0.03), 61)
    )
    assert posterior.evaluate(points)[1] == pytest.approx(exact, abs=0.12)
    del settings["texture"]
    assert (
        np.abs(
            Posterior.of(table, symmetry=symmetry, surrogate=surrogate, **settings).evaluate(
                points
            )[1]
            - exact
        ).min()
        > 1.0
    )


def test_another_texture_is_another_input(tmp_path, capsys):
    path = written(tmp_path, "texture = 'g.csv'")
    inputs = []
    for angle in (0, 45):
        (tmp_path / "g.csv").write_text(f"phi1_deg,Phi_deg,phi2_deg\n0,{angle},0\n0,30,10\n")
        assert main(["extract", str(path), "--output", str(tmp_path / "out")]) in (0, 3)
        inputs.append(
            json.loads((tmp_path / "out" / "summary.json").read_text())["inputs"]["measurements"]
        )
    assert inputs[0] != inputs[1]
    path.write_text(path.read_text().replace("orientations = 'unknown'", ""))
    assert main(["run", str(path), "--check", "--output", str(tmp_path / "out")]) == 2
    assert (
        "&measurements texture: is only for grains of unknown "
        "orientation; state orientations = 'unknown'" in capsys.readouterr().err
    )
    path.write_text(path.read_text().replace("texture = 'g.csv'", "crystal_axes = 'a*'"))
    assert main(["run", str(path), "--check", "--output", str(tmp_path / "out")]) == 2
    assert (
        "&measurements crystal_axes: is only for ebsd, an orientation map; remove it"
        in capsys.readouterr().err
    )


BOUNDS = {
    "copper": {"C11": (130, 210), "C12": (90, 160), "C44": (50, 100)},
    "titanium": {
        "C11": (130, 195),
        "C12": (70, 115),
        "C44": (30, 65),
        "C33": (140, 220),
        "C13": (50, 90),
    },
}


@pytest.mark.long
@pytest.mark.parametrize("name", BOUNDS)
@pytest.mark.parametrize("calibration", [0.0, 0.02])
def test_the_posterior_is_that_of_importance_sampling(name, calibration):
    """Uniform between bounds; points of a wide Student's t about the draws, by the exact theory and
    quadratures of this file.
    """
    symmetry, _ = CRYSTALS[name]
    table, bounds, names = measured(name, 20, 0.02, seed=3), BOUNDS[name], constant_names(symmetry)
    result = bi.extract(
        table,
        symmetry,
        bounds=bounds,
        orientations="unknown",
        calibration_sd=calibration,
        samples=4000,
        seed=4,
    )
    draws = np.stack([result.posterior[one].values.ravel() for one in names], axis=1)
    low, high = np.array([bounds[one] for one in names]).T
    rng = np.random.default_rng(1)
    # Uniform for a quarter: the posterior ends at bounds.
    proposal = stats.multivariate_t(draws.mean(axis=0), 1.2 * np.cov(draws.T), df=6, seed=2)
    n = {"copper": 1000, "titanium": 8000}[name]
    x = np.vstack([proposal.rvs(3 * n), rng.uniform(low, high, (n, len(names)))])
    x = x[np.all((x > low) & (x < high), axis=1)]
    x = x[np.linalg.eigvalsh(stiffness_rows(symmetry, x))[:, 0] > 0]
    angles, weights = sphere(symmetry, 16)
    rows = np.array([bi.halfspace_modulus(one, angles) for one in stiffness_rows(symmetry, x)])
    shared = even_nodes(np.full((20, 1), calibration), 25 if calibration else 1)
    logs = np.concatenate(
        [log_likelihood(part, weights, table, shared) for part in np.array_split(rows, 200)]
    )
    logs -= np.log(0.75 * proposal.pdf(x) + 0.25 / np.prod(high - low))
    p = np.exp(logs - logs.max())
    p /= p.sum()
    assert 1 / (p**2).sum() > 1000
    mean = p @ x
    sd = np.sqrt(p @ (x - mean) ** 2)
    assert np.abs((draws.mean(axis=0) - mean) / sd).max() < 0.1
    assert draws.std(axis=0) == pytest.approx(sd, rel=0.1)


def written(folder, extra="", table=None):
    """A namelist for a table of grains and moduli alone."""
    rows = table or measured("copper", 10, 0.02)
    (folder / "t.csv").write_text(
        "\n".join(
            [",".join(rows), *(",".join(map(str, row)) for row in zip(*rows.values(), strict=True))]
        )
    )
    bounds = "&prior c_min = 130, 90, 50 c_max = 210, 160, 100 /"
    sampler = "&sampler samples = 400 burn_in = 100 chains = 2 /"
    text = (
        "&problem symmetry = 'cubic' /\n"
        f"&measurements file = 't.csv' orientations = 'unknown' {extra} /\n{bounds}\n{sampler}\n"
    )
    (folder / "f.nml").write_text(text)
    return folder / "f.nml"


def test_a_table_without_angles_gives_constants_and_a_report(tmp_path, capsys, few_figures):
    path = written(tmp_path, "calibration_sd = 0.02", measured("copper", 5, 0.02))
    assert main(["run", str(path), "--output", str(tmp_path / "out")]) in (0, 3)
    assert "5 grains of unknown orientation" in capsys.readouterr().out
    document = json.loads((tmp_path / "out" / "summary.json").read_text())
    assert all("euler_deg" not in item for item in document["predicted"])
    # What would rest on orientations, or is not right without them, is absent.
    assert all(item["share"]["measurements"] is None for item in document["parameters"].values())
    assert document["checks"]["misfit"]["p"] is None and not document["diagnosis"]
    assert main(["report", str(tmp_path / "out")]) == 0
    page = (tmp_path / "out" / "report.html").read_text()
    assert "5 grains of unknown orientation" in page


@pytest.mark.parametrize(
    ("extra", "words"),
    [
        ("likelihood = 'student'", "likelihood"),
        ("misalignment_sd_deg = 1", "misalignment_sd_deg"),
        ("orientation_sd_deg = 1", "orientation_sd_deg"),
        ("ebsd = 'map.ang'", "ebsd"),
        ("velocities = 'v.csv'", "velocities"),
        ("scale = 'inferred'", "scale = 'inferred'"),
        ("/\n&next count = 2", "next, plan or tensor, which compare orientations"),
        (
            "/\n&plan grains = 5 noise = 0.02 constants = 168, 121, 75",
            "next, plan or tensor, which compare orientations",
        ),
    ],
)
def test_refusals(tmp_path, capsys, extra, words):
    path = written(tmp_path, extra)
    assert main(["run", str(path), "--check", "--output", str(tmp_path / "out")]) == 2
    said = capsys.readouterr().err
    assert (
        f"&measurements orientations: 'unknown' cannot be combined with {words}; remove one of them"
        in said
    )


def test_a_surrogates_covariance_is_refused(tmp_path, capsys):
    path = written(tmp_path)
    path.write_text(path.read_text() + "&surrogate file = 'block' /\n")
    assert main(["run", str(path), "--output", str(tmp_path / "out")]) == 2
    said = capsys.readouterr().err
    assert (
        "orientations = 'unknown' needs &sampler surrogate_variance = 'none'" in said
        and said.count("\n") == 1
    )


def test_too_many_errors_that_grains_share_are_refused(tmp_path, capsys):
    table = measured("copper", 12, 0.01) | {"group": [1, 2, 3] * 4}
    path = written(tmp_path, "calibration_sd = 0.2", table)
    assert main(["run", str(path), "--check", "--output", str(tmp_path / "out")]) == 2
    assert "points of integration" in capsys.readouterr().err


@pytest.mark.long
def test_moduli_of_glaucophane_are_distributed_as_its_constants_say():
    """Twelve measured moduli: as they are, and where all constants are a tenth larger, which they
    exclude.
    """
    p = [found[0] for _, _, found in compare_glaucophane(4000, (1.0, 1.1))]
    assert p[0] > 0.1 and p[1] < 0.02
