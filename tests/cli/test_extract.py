"""What both programs say of Step 2 on the screen."""

import csv
import json
import re
import subprocess

import pytest

from bayesindent.common.diagnostics import labelled
from support.programs import BATCH
from support.tree import SOURCE

CASE = f"""&problem symmetry = 'cubic' /
&measurements
  file = '{SOURCE / "inputs" / "data" / "fe3si.csv"}'
  modulus_kind = 'indentation_modulus', technique = 'exact'
/
&prior c_min = 50, 40, 15, c_max = 250, 150, 150, anisotropy_cap = 7.2 /
&knowledge quantity = 'bulk_modulus', mean = KNOWN, sd = 3.3 /
&sampler samples = 1000, burn_in = 1500, chains = 2 /
"""
PRIOR = [
    "measured: indentation_modulus of 11 grains, technique exact",
    "uniform in the constants over stable crystals, anisotropy index (Eq. 14) up to 7.2",
    "bounds in GPa: C11 50.0 .. 250.0, C12 40.0 .. 150.0, C44 15.0 .. 150.0",
    "known: bulk_modulus = 165.0 ± 3.3 GPa",
]


def test_prior_and_order(bayesindent, tmp_path):
    (tmp_path / "a.nml").write_text(CASE.replace("KNOWN", "165"))
    done = bayesindent("extract", "a.nml")
    assert done.returncode == 0, done.stderr
    lines = [line.strip() for line in done.stdout.splitlines()]
    begin = lines.index("Measurements, prior and surrogate:") + 1
    assert lines[begin : begin + 4] == PRIOR
    assert re.fullmatch(
        r"surrogate: the exact theory of the half-space, harmonics to degree \d+, .* % of its sd",
        lines[begin + 4],
    )
    rows = [line.split() for line in lines if re.match(r"C\d\d ", line)]
    document = json.loads((tmp_path / "runs" / "a" / "summary.json").read_text())
    assert document["usable"]
    assert list(document["parameters"]) == [row[0] for row in rows] == ["C11", "C12", "C44"]
    assert next(line for line in lines if line.startswith("constant")).split() == [
        "constant",
        "mean",
        "sd",
        "95",
        "%",
        "measured",
        "known",
        "prior",
        "verdict",
    ]
    for row, item in zip(rows, document["parameters"].values(), strict=True):
        assert list(map(int, row[6:9])) == [round(100 * share) for share in item["share"].values()]
        assert "_".join(row[9:]) == item["verdict"]
    # The table is last, and a terminal of 80 columns has room for it.
    assert [line[:3] for line in lines[-3:]] == ["C11", "C12", "C44"]
    assert max(map(len, done.stdout.split("Elastic constants (GPa)")[1].splitlines())) <= 80
    done = subprocess.run(
        [BATCH, "a.nml", "--output", "b"], cwd=tmp_path, capture_output=True, text=True, check=True
    )
    assert set(PRIOR) <= set(done.stdout.splitlines())


@pytest.mark.long
def test_contradiction_is_a_warning_of_both_programs(bayesindent, tmp_path):
    (tmp_path / "a.nml").write_text(CASE.replace("KNOWN", "300"))
    batch = subprocess.run(
        [BATCH, "a.nml", "--output", "b"], cwd=tmp_path, capture_output=True, text=True, check=False
    )
    done = bayesindent("extract", "a.nml")
    document = json.loads((tmp_path / "b" / "summary.json").read_text())
    unusable = [each for each in document["warnings"] if each["severity"] == "unusable"]
    found = unusable[0]
    # The knowledge may be wrong, or the bounds; both are named.
    assert found["code"] == "other_model"
    assert found["subject"].startswith(
        "bulk_modulus = 300.0 of another crystal; or crystals beyond"
    )
    # The bounds alone keep the bulk modulus below (250 + 2 150)/3 = 183 GPa.
    assert document["prior"]["conflict_sd"] > (300 - 184) / 3.3 - 1
    messages = [line for line in batch.stderr.splitlines() if not line.endswith(" s left")]
    for one, first in ((done, done.stdout), (batch, "\n".join(messages))):
        assert one.returncode == 3, one.stderr
        assert first.lower().startswith(labelled(found).lower()), one.stderr


@pytest.mark.parametrize("unit", ["degrees", "radians"])
def test_angles(bayesindent, tmp_path, unit):
    rows = list(
        csv.DictReader(
            line
            for line in (SOURCE / "inputs" / "data" / "fe3si.csv").open()
            if not line.startswith("#")
        )
    )
    if unit == "radians":
        for row in rows:
            row |= {
                name: str(float(row[name]) * 3.141592653589793 / 180)
                for name in ("phi1_deg", "Phi_deg", "phi2_deg")
            }
    with (tmp_path / "grains.csv").open("w", newline="") as file:
        writer = csv.DictWriter(file, rows[0])
        writer.writeheader()
        writer.writerows(rows)
    text = (
        "&problem symmetry = 'cubic' /\n"
        "&measurements file = 'grains.csv', modulus_kind = 'indentation_modulus', ANGLES /\n"
    )
    (tmp_path / "stated.nml").write_text(text.replace("ANGLES", f"angles = '{unit}'"))
    (tmp_path / "unstated.nml").write_text(text.replace(", ANGLES", ""))
    assert bayesindent("run", "stated.nml", "--check").returncode == 0
    done = bayesindent("run", "unstated.nml", "--check")
    assert done.returncode == (2 if unit == "radians" else 0)
    assert ("angles = 'radians'" in done.stderr) == (unit == "radians")
