"""Data that cannot be what they seem: questioned or refused before anything is computed, by
`--check` too.
"""

import subprocess

import pytest

import bayesindent as bi
from bayesindent.common.diagnostics import labelled
from support.programs import BATCH

HEADER = "grain,phi1_deg,Phi_deg,phi2_deg,effective_modulus_gpa,sd_gpa\n"
ROWS = [
    "a,1,2,3,200,4",
    "b,9,30,7,210,4",
    "c,20,50,31,220,4",
    "d,33,41,3,213.5,4",
    "e,75,88,12,190,4",
]


@pytest.fixture
def check(tmp_path):
    def of(rows, more=""):
        (tmp_path / "grains.csv").write_text(HEADER + "\n".join(rows) + "\n")
        (tmp_path / "a.nml").write_text(
            f"&problem symmetry = 'cubic' /\n&measurements file = 'grains.csv' /\n{more}"
        )
        done = subprocess.run(
            [BATCH, "a.nml", "--check"], cwd=tmp_path, capture_output=True, text=True, check=False
        )
        return done.returncode, done.stderr

    return of


def test_a_good_table_is_not_questioned(check):
    assert check(
        ROWS, "&knowledge quantity = 'compressibility[100]', mean = 2.4, sd = 0.1 /\n"
    ) == (0, "")


@pytest.mark.parametrize("times", [2, 4])
def test_rows_that_were_pasted_once_more(check, times):
    status, said = check(ROWS * times)
    assert status == 2
    assert (
        "grains.csv: lines 7 to 11 repeat lines 2 to 6 with the same angles, moduli and sds."
        in said
    )


def test_rounded_tests_of_one_grain_are_tests(check):
    """Four of the first grain and two of the next are equal to the last digit."""
    status, said = check([ROWS[0]] * 4 + [ROWS[1]] * 2 + ROWS[2:])
    assert status == 0 and "repeat lines" not in said


def test_each_row_pasted_four_times_without_a_column_of_grains(tmp_path):
    rows = [row.partition(",")[2] for row in ROWS for _ in range(4)]
    (tmp_path / "a.nml").write_text(
        "&problem symmetry = 'cubic' /\n&measurements file = 'grains.csv' /\n"
    )

    def check(rows):
        (tmp_path / "grains.csv").write_text(HEADER.partition(",")[2] + "\n".join(rows) + "\n")
        done = subprocess.run(
            [BATCH, "a.nml", "--check"], cwd=tmp_path, capture_output=True, text=True, check=False
        )
        return done.returncode, done.stderr

    for order in (rows, sorted(rows), rows[::3] + rows[1::3] + rows[2::3]):
        status, said = check(order)
        assert (status, said.count("\n")) == (2, 1)
        assert "each row is there 4 times with the same angles, modulus and sd" in said
    # Rounded tests of one grain are alike by chance.
    assert check(rows[:-1])[0] == 0


def test_sds_that_are_fractions(check, tmp_path, monkeypatch):
    status, said = check([row.removesuffix("4") + "0.02" for row in ROWS])
    assert status == 0
    monkeypatch.chdir(tmp_path)
    (found,) = bi.Problem("a.nml").warnings
    assert (found["code"], labelled(found)) == ("small_sds", said.strip())
    assert found["numbers"] == pytest.approx({"percent": 100 * 0.02 / 210, "usual_percent": 0.3})


def test_knowledge_in_another_unit(check):
    status, said = check(
        ROWS, "&knowledge quantity = 'compressibility[100]', mean = 3065, sd = 60 /\n"
    )
    assert (status, said.count("\n")) == (2, 1)
    assert (
        "&knowledge quantity: compressibility[100] = 3065.0 1/TPa is not that of a solid; "
        "allowed: -200.0 .. 1000.0 1/TPa" in said
    )


@pytest.mark.parametrize(("value", "status"), [(0.7, 2), (-1.2, 2), (0.35, 0)])
def test_a_poisson_ratio_lies_between_minus_one_and_a_half(check, value, status):
    found, said = check(
        ROWS, f"&knowledge quantity = 'polycrystal_poisson', mean = {value}, sd = 0.02 /\n"
    )
    assert found == status
    assert (
        f"polycrystal_poisson = {value} is not that of a solid; allowed: -1.0 .. 0.5." in said
    ) == (status == 2)
