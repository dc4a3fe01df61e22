"""Several tests of one grain: combined, and their scatter compared with what their sds say."""

import numpy as np
import pytest
from scipy import stats

import bayesindent as bi
from bayesindent.common.result_files import as_csv
from support.densities import Posterior
from support.diagnostics import codes, notes, of_code
from support.measured_tables import read_measurements
from support.tree import SOURCE

#: Three grains of four, two and one tests, not in order; phi1 does not matter to the indented
#: direction.
ROWS = [
    ("b", 10.0, 40.0, 30.0, 200.0, 4.0),
    ("a", 0.0, 10.0, 20.0, 210.0, 3.0),
    ("b", 80.0, 40.0, 30.0, 206.0, 2.0),
    ("b", 10.0, 41.0, 30.0, 203.0, 4.0),
    ("c", 5.0, 80.0, 45.0, 190.0, 5.0),
    ("a", 0.0, 10.0, 20.0, 204.0, 6.0),
    ("b", 10.0, 40.0, 30.0, 198.0, 3.0),
]
NAMES = ("grain", "phi1_deg", "Phi_deg", "phi2_deg", "indentation_modulus_gpa", "sd_gpa")


def table(rows=ROWS, **columns):
    return dict(zip(NAMES, zip(*rows, strict=True), strict=True)) | columns


def problem(table, symmetry="cubic", **asked):
    return bi.Problem.from_keywords(
        "f", {"measurements": table}, problem={"symmetry": symmetry}, measurements=asked
    )


def moments(name, rows=ROWS):
    """Weighted mean, its sd and chi-square about it."""
    values, sds = np.array([row[4:] for row in rows if row[0] == name]).T
    mean = np.average(values, weights=sds**-2.0)
    return mean, np.sum(sds**-2.0) ** -0.5, np.sum(((values - mean) / sds) ** 2)


def test_tests_of_a_grain_are_their_weighted_mean():
    found = problem(table()).measurements
    assert found.names == ["b", "a", "c"]
    expected = np.array([moments(name) for name in found.names])
    assert found.modulus_gpa == pytest.approx(expected[:, 0], rel=1e-14)
    assert found.sd_gpa == pytest.approx(expected[:, 1], rel=1e-14)
    assert found.euler_deg.tolist() == [[10, 40, 30], [0, 10, 20], [5, 80, 45]]
    assert len(found) == 3


def test_the_mean_is_sufficient():
    """With errors of their own the tests one by one and their mean say the same of the crystal, up
    to a constant.
    """
    # Each with the angles of the first row of its grain.
    angles = {row[0]: row[1:4] for row in reversed(ROWS)}
    rows = [(row[0], *angles[row[0]], *row[4:]) for row in ROWS]
    settings = {"symmetry": "cubic", "surrogate": bi.Surrogate.load("halfspace")}
    single = {name: values for name, values in table(rows).items() if name != "grain"}
    points = np.array([[220.0, 130.0, 110.0], [230.0, 140.0, 118.0], [210.0, 120.0, 100.0]])
    apart, together = (
        Posterior.of(data, **settings).evaluate(points)[1] for data in (single, table(rows))
    )
    assert apart - apart[0] == pytest.approx(together - together[0], abs=1e-9)


def test_groups_are_kept_apart():
    found = problem(table(group=["x", "x", "y", "x", "x", "x", "y"])).measurements
    assert found.names == ["b", "a", "b", "c"]
    assert found.sd_gpa[2] == pytest.approx((2.0**-2 + 3.0**-2) ** -0.5)


@pytest.mark.parametrize(("factor", "said"), [(1.0, None), (4.0, "more"), (0.02, "less")])
def test_scatter_is_compared_with_the_sds(factor, said):
    rng = np.random.default_rng(2)
    rows = [
        (name, 0.0, 9.0 * name, 20.0, 200.0 + factor * 3.0 * rng.normal(), 3.0)
        for name in range(10)
        for _ in range(4)
    ]
    chi_square = sum(moments(name, rows)[2] for name in range(10))
    warnings = of_code(problem(table(rows)).warnings, "tests_scatter_more", "tests_scatter_less")
    share = stats.chi2.sf(chi_square, 30)
    assert (said == "more") == (share < 0.01)
    assert (said == "less") == (share > 0.99)
    assert len(warnings) == (said is not None)
    if said:
        assert codes(warnings) == [f"tests_scatter_{said}"]
        assert warnings[0]["numbers"] == pytest.approx(
            {"factor": np.sqrt(chi_square / 30), "chi_square": chi_square, "freedom": 30}
        )


def test_a_grain_whose_tests_disagree_is_named():
    rows = [*ROWS, ("c", 5.0, 80.0, 45.0, 230.0, 5.0)]
    (found,) = of_code(problem(table(rows)).warnings, "tests_disagree")
    chi_square = moments("c", rows)[2]
    assert found["subject"].endswith(": grain c")
    assert found["numbers"] == pytest.approx(
        {"tests": 2, "factor": np.sqrt(chi_square), "chi_square": chi_square, "freedom": 1}
    )
    assert found["numbers"]["factor"] == pytest.approx(5.7, abs=0.05)


@pytest.mark.parametrize(
    ("value", "freedom"),
    [
        (0.001, 1),
        (3.84, 1),
        (2.0, 7),
        (7.0, 7),
        (9.1, 7),
        (30.0, 7),
        (80.0, 100),
        (130.0, 100),
        (1100.0, 1000),
    ],
)
def test_the_distribution_of_chi_square(value, freedom):
    """A verdict turns where scipy's probability does."""
    # Two values on both sides of 200 for each degree of freedom.
    half = np.sqrt(value / freedom / 2)
    rows = [
        (name, 0.0, 10.0, 20.0, 200.0 + sign * half, 1.0)
        for name in range(freedom)
        for sign in (-1, 1)
    ]
    found = codes(problem(table(rows), symmetry="isotropic").warnings)
    assert ("tests_scatter_more" in found) == (stats.chi2.sf(value, freedom) < 0.01)
    assert ("tests_scatter_less" in found) == (stats.chi2.sf(value, freedom) > 0.99)


@pytest.mark.parametrize(
    ("change", "words"),
    [
        (
            {"Phi_deg": [40.0, 10.0, 40.0, 47.0, 80.0, 10.0, 40.0]},
            "line 4, column grain: b is indented 7.0 degrees away from its direction on line 1;",
        ),
    ],
)
def test_refusals(change, words):
    with pytest.raises(bi.InputError, match="f: &measurements: ") as error:
        problem(table(**change))
    assert words in str(error.value)


def test_a_row_without_a_name_of_its_grain_is_left_out():
    found = problem(table(grain=["b", "a", "", "b", "c", "a", "b"]))
    assert found.measurements.names == ["b", "a", "c"]
    assert "1 of 7 rows left out, a value is missing: line 3" in notes(found.warnings[:1])


def test_tests_without_sds_are_averaged_in_a_table_of_python_too(tmp_path):
    columns = {name: values for name, values in table().items() if name != "sd_gpa"}
    path = tmp_path / "a.csv"
    path.write_text(as_csv(list(columns), zip(*columns.values(), strict=True)))
    own, of_file = problem(columns).measurements, read_measurements(path, "cubic")
    assert own.names == of_file.names == ["b", "a", "c"]
    assert own.modulus_gpa.tolist() == of_file.modulus_gpa.tolist()
    assert own.sd_gpa.tolist() == of_file.sd_gpa.tolist()


def test_equivalent_orientations_are_one():
    """A quarter turn about a cube's axis."""
    found = problem(table(phi2_deg=[30.0, 20.0, 120.0, 210.0, 45.0, 110.0, 300.0])).measurements
    assert found.names == ["b", "a", "c"]


@pytest.mark.long
def test_names_reach_the_document():
    result = bi.extract(
        table(),
        symmetry="cubic",
        samples=50,
        burn_in=200,
        chains=1,
        knowledge={"bulk_modulus": (165, 3)},
    )
    rows = bi.summary(result)["predicted"]
    assert [(row["grain"], row["tests"]) for row in rows] == [("b", 4), ("a", 2), ("c", 1)]
    assert rows[0]["chi_square_of_tests"] == pytest.approx(moments("b")[2], rel=1e-12)


def test_one_row_a_grain_stays_as_it_is(tmp_path):
    rows = [
        line
        for line in (SOURCE / "inputs" / "data" / "fe3si.csv").read_text().splitlines()
        if not line.startswith("#")
    ]
    (tmp_path / "a.csv").write_text(
        "\n".join([f"grain,{rows[0]}", *(f"{number},{row}" for number, row in enumerate(rows[1:]))])
    )
    asked = {"file": str(tmp_path / "a.csv"), "modulus_kind": "indentation_modulus"}
    named = bi.Problem.from_keywords("f", problem={"symmetry": "cubic"}, measurements=asked)
    assert named.measurements.names == [str(number) for number in range(len(rows) - 1)]
    assert named.warnings == []


def test_shared_errors_of_tests_are_their_weighted_mean():
    """As a table of grains that states the means has the same density; which test comes first does
    not matter.
    """
    rng = np.random.default_rng(3)
    shared = rng.uniform(0, 0.05, (len(ROWS), 2))
    names, sds = [row[0] for row in ROWS], np.array([row[5] for row in ROWS])
    mine = [np.array(names) == other for other in ("b", "a", "c")]
    means = np.array([np.average(shared[of], axis=0, weights=sds[of] ** -2.0) for of in mine])
    first = [ROWS[names.index(name)] for name in ("b", "a", "c")]
    grains = [(*row[:4], *moments(row[0])[:2]) for row in first]
    densities = []
    for rows, columns in ((ROWS, shared), (grains, means)):
        given = table(rows, shared_1=columns[:, 0], shared_2=columns[:, 1])
        found = Posterior.of(given, surrogate=bi.Surrogate.load("halfspace"), symmetry="cubic")
        densities.append(
            np.diff(
                found.evaluate(np.array([[210.0, 130, 100], [190, 140, 80], [230, 100, 60]]))[0]
            )
        )
    assert densities[0] == pytest.approx(densities[1], rel=1e-9)
