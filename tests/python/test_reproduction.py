"""The reproduction of the paper: its regression against the core's, its choice against the build's,
its page, and the command that a kill does not harm.
"""

import json
import os
import signal
import subprocess
import sys
import time
from dataclasses import replace

import numpy as np
import pytest

import bayesindent as bi
from bayesindent.surrogate.surrogate import Surrogate
from reproduction import arms, published, regression, studies
from reproduction.chapters import curvature, equivalent
from reproduction.overview import regression_checks
from reproduction.page import Page, in_html
from support.paper_domains import DOMAINS
from support.programs import HANGS_S
from support.tree import SOURCE


@pytest.fixture(scope="module")
def small(tmp_path_factory):
    """A cubic build by theory with 160 of 270 candidates, the others unseen: folder and pool."""
    folder = tmp_path_factory.mktemp("small")
    namelist = studies.namelist_of("cubic", 1, **studies.by_theory())
    design = {"n_candidates": 270, "initial": 60, "budget": 160, "validation": 110}
    namelist["design"].update(design)
    del namelist["surrogate"]["scan"]
    document = studies.build(namelist, folder)
    return folder, studies.Pool.of_build("cubic", folder, document, 60)


@pytest.mark.parametrize("symmetry", ["cubic", "hexagonal"])
def test_terms_are_orthonormal(symmetry):
    rng = np.random.default_rng(2)
    n, k = 100_000, len(DOMAINS[symmetry]["c_min"])
    coordinates = rng.uniform(-1, 1, (n, k))
    direction = rng.standard_normal((n, 3))
    direction /= np.linalg.norm(direction, axis=1)[:, None]
    terms = regression.Terms.of(symmetry, coordinates, direction, 1, 6)
    gram = terms.values.T @ terms.values / n
    assert gram == pytest.approx(np.eye(len(gram)), abs=0.06)
    many = {"cubic": 3 * 2**3, "hexagonal": 4 * 2**5}[symmetry]
    assert terms.values.shape[1] == many
    assert np.flatnonzero(terms.is_mean).tolist() == [0]


def test_cubic_harmonics_have_the_symmetry_and_the_number():
    direction = np.array([[0.1, 0.5, 0.86], [0.86, -0.1, 0.5]])
    values = regression.harmonics("cubic", direction, 12)
    assert values[0] == pytest.approx(values[1])
    assert values.shape[1] == 7


def test_widths_of_the_prior():
    terms = regression.Terms.of("cubic", np.zeros((1, 3)), np.array([[0.0, 0, 1]]), 2, 4)
    assert (terms.width(False, True, 1.0) == 1).all()
    assert terms.width(True, True, 1.0).max() == regression.FREE
    last = terms.width(False, False, 0.4)[-1]
    assert last == pytest.approx(5**-1.5 * 0.4**5)


def test_the_regression_is_the_cores(small):
    folder, pool = small
    surrogate = Surrogate.load(folder / "surrogate.txt")
    checks = regression_checks(pool, surrogate, 2, 10)
    assert max(checks.values()) < 1e-5
    document = json.loads((folder / "kept.json").read_text())["result"]
    terms = pool.terms(2, 10).values
    found = regression.fit(terms[:160], pool.modulus[:160])
    assert found.loocv == pytest.approx(document["loocv_gpa"], rel=1e-6)
    assert found.log_evidence == pytest.approx(document["log_evidence"], rel=1e-8)


def test_derivatives_serve_as_further_simulations(small, tmp_path):
    """By theory, with differences as derivatives."""
    _, pool = small
    assert pool.by_stiffness is None
    assert pool.unseen == 110
    stiffness, angles, step = (
        bi.stiffness("cubic", *pool.constants[:40].T),
        pool.euler_deg[:40],
        0.01,
    )
    slopes = []
    for i, j in zip(*np.triu_indices(6), strict=True):
        change = np.zeros((6, 6))
        change[i, j] = change[j, i] = step
        above, below = (bi.halfspace_modulus(stiffness + d, angles) for d in (change, -change))
        slopes.append((above - below) / (2 * step))
    known = replace(
        studies.Pool("cubic", pool.constants[:40], angles, pool.modulus[:40]),
        by_stiffness=np.array(slopes).T,
    )
    found = arms.derivatives(known, pool.last(pool.unseen), tmp_path)
    assert found["sizes"] == [40]
    assert found["judges"] == 110
    alone, both = (found["errors"][name][0]["mean"] for name in arms.TRAINED)
    assert both < 0.6 * alone


def test_leave_one_out_is_that_of_fits_without_the_point(small):
    pool = small[1]
    terms = pool.terms(2, 4)
    width = terms.width(True, False, 0.4)
    for n in (40, 120):
        x, y = terms.values[:n], pool.modulus[:n]
        found = regression.fit(x, y, width)
        for k in (0, n // 2):
            rest = np.delete(np.arange(n), k)
            prior = np.diag(found.alpha / width**2)
            precision = prior + found.beta * x[rest].T @ x[rest]
            without = np.linalg.solve(precision, found.beta * x[rest].T @ y[rest])
            assert found.left_out[k] == pytest.approx(y[k] - x[k] @ without, rel=1e-5)


def test_the_choice_is_that_of_the_build(small):
    pool = small[1]
    terms = pool.terms(2, 10).values
    chosen = regression.choose(terms, pool.modulus, np.arange(60), 160, 10)
    assert (chosen == np.arange(160)).mean() > 0.98


def test_a_prior_by_degree_is_what_the_program_has(small):
    """`prior_sd = 'degree'` has the widths of the page at the decay rate that it chose, and less
    error at degree 3 than Eq. 6.
    """
    pool = small[1]
    judges = arms.judges_by_theory("cubic", 500)
    matrices = bi.crystal.elasticity.stiffness_rows("cubic", judges.constants)
    errors = {}
    for prior_sd in ("degree", "equal"):
        surrogate = Surrogate.fit(
            pool.constants,
            pool.euler_deg,
            pool.modulus,
            symmetry="cubic",
            domain=DOMAINS["cubic"],
            model="paper",
            degree=3,
            bandlimit=8,
            prior_sd=prior_sd,
        )
        predicted = surrogate.predict(matrices, judges.euler_deg)[0]
        errors[prior_sd] = np.abs(predicted - judges.modulus).mean()
        decay = surrogate.fall if prior_sd == "degree" else 1.0
        terms = pool.terms(3, 8)
        found = regression.fit(
            terms.values, pool.modulus, terms.width(prior_sd == "degree", True, decay)
        )
        ours = judges.terms(3, 8).values @ found.coefficients
        assert predicted == pytest.approx(ours, abs=0.05)
    assert errors["degree"] < 0.7 * errors["equal"]


def test_a_surrogate_keeps_its_prior(tmp_path, small):
    pool = small[1]
    for prior_sd in ("degree", "equal"):
        surrogate = Surrogate.fit(
            pool.constants,
            pool.euler_deg,
            pool.modulus,
            symmetry="cubic",
            domain=DOMAINS["cubic"],
            model="paper",
            degree=1,
            bandlimit=4,
            prior_sd=prior_sd,
        )
        surrogate.save(tmp_path / "surrogate.txt")
        assert ("prior_sd" in (tmp_path / "surrogate.txt").read_text()) == (prior_sd == "degree")
        again = Surrogate.load(tmp_path / "surrogate.txt")
        assert again.basis.prior_sd == prior_sd
        groups = np.arange(len(pool.modulus))
        assert again.leave_out(groups)[1] == pytest.approx(surrogate.leave_out(groups)[1])


def test_arms_differ_in_their_points_alone(small):
    pool = small[1]
    rows = {arm: arms.rows_of(arm, pool, 100, 1) for arm in arms.ARMS}
    for arm, chosen in rows.items():
        assert len(np.unique(chosen)) == 100, arm
    assert (rows["sequence"] == np.arange(100)).all()
    assert (rows["start"][:60] == np.arange(60)).all()
    assert not (arms.rows_of("random", pool, 100, 2) == rows["random"]).all()


def test_independent_crystals_are_in_the_domain():
    for symmetry, domain in DOMAINS.items():
        constants, angles = studies.independent_crystals(symmetry, 300, 3)
        matrices = bi.crystal.elasticity.stiffness_rows(symmetry, constants)
        assert (bi.anisotropy_index(matrices) <= domain["anisotropy_cap"]).all()
        assert (constants >= domain["c_min"]).all() and (constants <= domain["c_max"]).all()
        assert angles[:, 1].min() >= 0
        assert angles[:, 1].max() <= (180 if symmetry == "cubic" else 90)


def test_numbers_of_the_paper_have_places():
    for study in published.STUDIES.values():
        named = set(study) - {"degree", "bandlimit", "earlier"}
        assert named <= set(published.PLACES)


def test_equivalent_number_of_simulations():
    assert equivalent([100, 200, 400], [4.0, 2.0, 1.0], 2.0) == "200"
    assert equivalent([100, 200, 400], [4.0, 2.0, 1.0], 8.0) == "at most 100"
    assert equivalent([100, 200, 400], [4.0, 2.0, 1.0], 0.5) == "more than 400"
    assert equivalent([100, 400], [4.0, 1.0], 2.0) == "200"


def test_curvature_of_a_curve():
    depth = np.linspace(0.1, 1, 5)
    assert curvature(depth.tolist(), (3 * depth**1.5).tolist()) == pytest.approx(0, abs=1e-10)


def test_results_are_kept_while_their_inputs_are(tmp_path):
    asked = []

    def compute():
        asked.append(1)
        return {"numbers": [1.0, 2.0]}

    for inputs in ([1], [1], [2]):
        assert studies.kept(tmp_path / "kept.json", inputs, compute) == {"numbers": [1.0, 2.0]}
    assert len(asked) == 2


def test_both_forms_of_a_page(tmp_path):
    page = Page("A title")
    page.heading("A part")
    page.text("Some **bold** text with `a < b` and [a link](other.md).")
    page.table("Numbers:", ["", "GPa"], [["one", 1.5]])
    page.write_html(tmp_path / "page.html")
    page.write_markdown(tmp_path / "page.md")
    assert "| one | 1.5 |" in (tmp_path / "page.md").read_text()
    text = (tmp_path / "page.html").read_text()
    assert "<td>1.5</td>" in text and "<code>a &lt; b</code>" in text
    assert in_html("[x](y.md)") == "x"


def reproduce(*arguments, **settings) -> subprocess.Popen:
    """The command in a process of its own."""
    paths = filter(None, [str(SOURCE / "tests"), os.environ.get("PYTHONPATH")])
    environment = os.environ | {"PYTHONPATH": os.pathsep.join(paths)}
    command = [sys.executable, "-m", "tools.reproduce", *map(str, arguments)]
    return subprocess.Popen(command, env=environment, text=True, **settings)


@pytest.mark.long
def test_a_kill_costs_nothing(tmp_path):
    """Killed while it simulates; the command again finishes, and once more computes nothing."""
    arguments = ("--plan", "tiny", "--output", tmp_path, "--workers", "1", "--json")
    first = reproduce(*arguments, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL)
    deadline = time.monotonic() + HANGS_S
    while not (tmp_path / "cubic" / "campaign.sqlite").exists():
        assert first.poll() is None and time.monotonic() < deadline
        time.sleep(0.05)
    first.send_signal(signal.SIGKILL)
    first.communicate()
    kept = {path: path.read_bytes() for path in (tmp_path / "block").glob("*.json")}
    assert kept
    numbers = []
    for _ in range(2):
        done = reproduce(*arguments, stdout=subprocess.PIPE, stderr=subprocess.PIPE)
        said, error = done.communicate(timeout=3 * HANGS_S)
        assert done.returncode == 0, error
        numbers.append(json.loads(said))
    assert {path: path.read_bytes() for path in kept} == kept
    assert numbers[0]["failed"] == 0
    assert numbers[0]["loocv_gpa"] == numbers[1]["loocv_gpa"]
    # Without computing it takes the time of the figures alone.
    assert numbers[1]["cpu_s"] - numbers[0]["cpu_s"] < 0.5 * numbers[0]["cpu_s"]
    page = (tmp_path / "report.html").read_text()
    for item in ("Eq. 14", "Fig. 5", "Table 1", "Why degree 3 fails", "synthetic"):
        assert item in page
