"""Every file of inputs/ is right, and what is short runs."""

import csv
import json

import pytest

from bayesindent.common.diagnostics import labelled
from support.tree import REFERENCE, SOURCE

INPUTS = sorted(SOURCE.glob("inputs/*.nml")) + sorted(SOURCE.glob("inputs/case_studies/*.nml"))
ROWS = REFERENCE / "halfspace_moduli.csv"


@pytest.mark.parametrize("file", INPUTS, ids=lambda file: file.stem)
def test_check(bayesindent, file, tmp_path):
    done = bayesindent("run", file, "--check", "--json")
    assert done.returncode == 0, done.stderr
    document = json.loads(done.stdout)
    assert document["stages"]
    assert document["warnings"] == []
    assert list(tmp_path.iterdir()) == [], "a check writes nothing"


def test_theory_of_every_reference_row(bayesindent, tmp_path):
    (tmp_path / "all.nml").write_text(
        f"&problem\n symmetry = 'cubic'\n/\n&crystals\n points = '{ROWS}'\n/\n"
    )
    done = bayesindent("theory", "all.nml", "--json")
    assert done.returncode == 0, done.stderr
    rows = list(csv.DictReader(ROWS.open()))
    results = json.loads(done.stdout)["results"]
    assert len(results) == len(rows)
    for result, row in zip(results, rows, strict=True):
        # The reference is the same integral, converged: only rounding is between them.
        assert result["indentation_modulus_gpa"] == pytest.approx(
            float(row["M_elliptic"]), rel=1e-8
        )
        assert result["constants"]["C11"] == float(row["C11"])
    files = {path.name for path in (tmp_path / "runs" / "all").iterdir()}
    assert files == {".lock", "inputs.json", "resolved.nml", "run.log", "theory.csv", "theory.json"}


def test_theory_carries_columns_and_gives_three_moduli(bayesindent, tmp_path):
    bayesindent("theory", SOURCE / "inputs" / "zinc.nml", "--output", tmp_path / "here")
    row = next(csv.DictReader((tmp_path / "here" / "theory.csv").open()))
    modulus = float(row["indentation_modulus_gpa"])
    assert float(row["C13"]) == 50.3
    assert float(row["effective_modulus_gpa"]) == pytest.approx(
        1 / (1 / modulus + (1 - 0.07**2) / 1140), rel=1e-8
    )
    assert float(row["sample_modulus_gpa"]) == pytest.approx((1 - 0.3**2) * modulus, rel=1e-8)


SURROGATES = {
    "nowhere.txt": (
        "'nowhere.txt': there is no such surrogate; run build first, or state a file in the "
        "output folder or beside the namelist, halfspace, block"
    ),
    "hexagonal": (
        "'hexagonal': there is no such surrogate; run build first, or state a file in the "
        "output folder or beside the namelist, halfspace, block"
    ),
}


@pytest.mark.parametrize("file", SURROGATES)
def test_check_looks_at_the_surrogate(bayesindent, tmp_path, file):
    (tmp_path / "SURROGATE.nml").write_text(
        "&problem\n symmetry = 'cubic'\n/\n"
        f"&surrogate\n file = '{file}'\n/\n"
        f"&measurements\n file = '{SOURCE / 'inputs' / 'data' / 'fe3si.csv'}'\n modulus_kind = "
        "'indentation_modulus'\n/\n"
    )
    done = bayesindent("run", "SURROGATE.nml", "--check", "--json")
    assert (done.returncode, done.stdout, done.stderr) == (
        2,
        "",
        f"SURROGATE.nml: &surrogate file: {SURROGATES[file]}\n",
    )


def test_predictions_outside_the_domain_are_told_of(bayesindent, tmp_path):
    (tmp_path / "points.csv").write_text(
        "C11,C12,C44,phi1_deg,Phi_deg,phi2_deg\n225,135,118,0,0,0\n225,220,3,0,45,0\n"
    )
    done = bayesindent(
        "predict", "--surrogate", "block", "--symmetry", "cubic", "--points", "points.csv", "--json"
    )
    (warning,) = json.loads(done.stdout)["warnings"]
    assert warning["code"] == "outside_domain"
    assert warning["subject"] == "points.csv: 1 of 2 rows are outside the surrogate's domain: 2"
    assert (done.returncode, done.stderr.splitlines()[0]) == (0, labelled(warning))
