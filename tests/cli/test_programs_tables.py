"""Tables that only one of the programs reads."""

import json
import subprocess

import pytest

from support.programs import BATCH
from support.tree import SOURCE

CASE = (
    "&problem symmetry = 'cubic' /\n"
    "&measurements file = 'grains.xlsx' /\n"
    "&sampler samples = 3000, burn_in = 1000, chains = 2 /\n"
)


@pytest.mark.long
def test_a_spreadsheet_from_a_namelist(bayesindent, tmp_path):
    openpyxl = pytest.importorskip("openpyxl")
    rows = [
        line.split(",")
        for line in (SOURCE / "inputs" / "data" / "fe3si.csv").read_text().splitlines()
        if not line.startswith("#")
    ]
    made = openpyxl.Workbook()
    made.active.append([*rows[0][:3], "Er", "error"])
    for row in rows[1:]:
        made.active.append([float(cell) for cell in row])
    made.save(tmp_path / "grains.xlsx")
    (tmp_path / "a.nml").write_text(CASE)
    done = bayesindent("extract", "a.nml", "--json")
    assert done.returncode == 0, done.stderr
    assert [row["measured"] for row in json.loads(done.stdout)["predicted"]] == [
        float(row[3]) for row in rows[1:]
    ]
    assert (
        "modulus_kind = 'effective_modulus'"
        in (tmp_path / "runs" / "a" / "resolved.nml").read_text()
    )
    refused = subprocess.run(
        [BATCH, "a.nml"], cwd=tmp_path, capture_output=True, text=True, check=False
    )
    said = (
        "a.nml: &measurements file: grains.xlsx: a spreadsheet is read by bayesindent, not by "
        "bayesindent-batch; save its sheet as CSV\n"
    )
    assert (refused.returncode, refused.stderr) == (2, said)


def test_columns_by_the_namelist_in_the_batch_program(tmp_path):
    (tmp_path / "grains.csv").write_text(
        "angle 1,angle 2,angle 3,steepness,its error\n1,2,3,200,4\n9,30,7,210,4\n20,50,31,220,4\n"
    )
    said = (
        "'phi1_deg = angle 1', 'Phi_deg = angle 2', 'phi2_deg = angle 3', "
        "'effective_modulus_gpa = steepness', 'sd_gpa = its error'"
    )

    def check(columns):
        text = (
            "&problem symmetry = 'cubic' /\n"
            f"&measurements file = 'grains.csv', columns = {columns} /\n"
        )
        (tmp_path / "a.nml").write_text(text)
        return subprocess.run(
            [BATCH, "a.nml", "--check"], cwd=tmp_path, capture_output=True, text=True, check=False
        )

    assert check(said).returncode == 0, check(said).stderr
    refused = check(said.replace("angle 3", "angel 3"))
    assert (
        refused.returncode == 2
        and "the table has no column angel 3, did you mean angle 3?" in refused.stderr
    )


def test_the_batch_program_reads_no_maps(tmp_path):
    (tmp_path / "grains.csv").write_text("x_um,y_um,Er,sd\n1,2,200,4\n")
    (tmp_path / "a.nml").write_text(
        "&problem symmetry = 'cubic' /\n&measurements file = 'grains.csv', ebsd = 'map.ang' /\n"
    )
    refused = subprocess.run(
        [BATCH, "a.nml"], cwd=tmp_path, capture_output=True, text=True, check=False
    )
    said = (
        "a.nml: &measurements ebsd: map.ang: an orientation map is read by bayesindent, not by "
        "bayesindent-batch, which needs the orientations"
    )
    assert (refused.returncode, refused.stderr) == (2, f"{said} as columns\n")
    # Positions are needed.
    (tmp_path / "grains.csv").write_text("x_um,Er,sd\n1,200,4\n")
    refused = subprocess.run(
        [BATCH, "a.nml"], cwd=tmp_path, capture_output=True, text=True, check=False
    )
    assert refused.stderr == (
        "a.nml: &measurements file: grains.csv: the column y_um is missing; the columns are "
        "x_um, Er, sd\n"
    )
