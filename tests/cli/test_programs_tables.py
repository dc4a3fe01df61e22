"""Tables that only one of the programs reads."""

import json
import subprocess

import pytest

import bayesindent as bi
from bayesindent.settings.problem import Problem
from bayesindent.stages.results_folder import read_posterior
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
        "a.nml: &measurements file: grains.xlsx: is a spreadsheet, or its columns are stated; the "
        "batch program reads canonical tables: run 'bayesindent table grains.xlsx --output DIR' "
        "and name DIR/table.csv\n"
    )
    assert (refused.returncode, refused.stderr) == (2, said)


FOREIGN = {
    "a header of a laboratory": "phi1_deg,Phi_deg,phi2_deg,Er (GPa),sd_gpa\n1,2,3,200,4\n",
    "a further column": (
        "phi1_deg,Phi_deg,phi2_deg,effective_modulus_gpa,sd_gpa,Er (GPa)\n1,2,3,200,4,5\n"
    ),
}


@pytest.mark.parametrize("name", FOREIGN)
@pytest.mark.parametrize("options", [[], ["--check"]], ids=["run", "check"])
def test_the_batch_program_reads_canonical_tables_alone(tmp_path, name, options):
    (tmp_path / "T.csv").write_text(FOREIGN[name])
    (tmp_path / "a.nml").write_text(
        "&problem symmetry = 'cubic' /\n&measurements file = 'T.csv' /\n"
    )
    refused = subprocess.run(
        [BATCH, "a.nml", *options], cwd=tmp_path, capture_output=True, text=True, check=False
    )
    said = (
        "a.nml: &measurements file: T.csv has the column 'Er (GPa)'; the batch program reads "
        "canonical tables: run 'bayesindent table T.csv --output DIR' and name DIR/table.csv\n"
    )
    assert (refused.returncode, refused.stderr) == (2, said)


def test_the_batch_program_reads_degrees(tmp_path):
    """Else table.csv, whose mark means degrees, would have radians."""
    (tmp_path / "T.csv").write_text(
        "phi1_deg,Phi_deg,phi2_deg,effective_modulus_gpa,sd_gpa\n1,2,3,200,4\n2,1,3,210,4\n"
    )
    (tmp_path / "a.nml").write_text(
        "&problem symmetry = 'cubic' /\n&measurements file = 'T.csv', angles = 'radians' /\n"
    )
    refused = subprocess.run(
        [BATCH, "a.nml"], cwd=tmp_path, capture_output=True, text=True, check=False
    )
    said = "a.nml: &measurements file: T.csv has angles in radians; the batch program reads "
    assert refused.returncode == 2 and refused.stderr.startswith(said)


SPEEDS = (
    "phi1{},Phi,phi2,propagation_deg,velocity{},sd{}\n10,20,30,0,3000,10\n40,50,60,20,3100,10\n"
)
UNITS = {
    "radians": (" (rad)", "", "", "column phi1 (rad) is in radians"),
    "km/s": ("", " (km/s)", "", "column velocity (km/s): the unit km/s is not read"),
    "per cent": ("", " (m/s)", " (%)", "column sd (%): the unit % is not read"),
}


@pytest.mark.parametrize("name", UNITS)
def test_units_of_speeds_are_those_that_are_read(tmp_path, name):
    *units, words = UNITS[name]
    (tmp_path / "v.csv").write_text(SPEEDS.format(*units))
    (tmp_path / "a.nml").write_text(
        "&problem symmetry = 'cubic', density_kg_m3 = 8900 /\n"
        "&measurements velocities = 'v.csv' /\n"
    )
    refused = subprocess.run(
        [BATCH, "a.nml", "--check"], cwd=tmp_path, capture_output=True, text=True, check=False
    )
    assert refused.returncode == 2 and words in refused.stderr, refused.stderr


def test_semicolons_are_read_by_python_alone(tmp_path):
    """Speeds between semicolons keep their lines and values; the batch program needs commas."""
    text = "# speeds\n\n" + SPEEDS.format("", "", "").replace(",", ";")
    (tmp_path / "v.csv").write_text(text.replace("3000", "3000,5"))
    (tmp_path / "a.nml").write_text(
        "&problem symmetry = 'cubic', density_kg_m3 = 8900 /\n"
        "&measurements velocities = 'v.csv' /\n"
    )
    points = Problem(tmp_path / "a.nml", "extract").measurements
    assert points.modulus_gpa.tolist() == [3000.5, 3100]
    refused = subprocess.run(
        [BATCH, "a.nml", "--check"], cwd=tmp_path, capture_output=True, text=True, check=False
    )
    said = "a.nml: &measurements velocities: line 4: 2 cells where the header has 1; commas must "
    assert refused.returncode == 2 and refused.stderr.startswith(said), refused.stderr
    (tmp_path / "v.csv").write_text(text.replace("3000", "fast"))
    with pytest.raises(bi.InputError, match="line 4, column velocity: 'fast' is not a number"):
        Problem(tmp_path / "a.nml", "extract")


#: Tables of laboratories, and the moduli and sds that they have.
LABORATORY = {
    "semicolons and decimal commas": (
        "phi1;Phi;phi2;Er (GPa);StDev (GPa)\n10,5;20;30;210,5;4,5\n40;50;60;220,1;4,25\n"
        "70;80;15;198;5\n",
        "",
    ),
    "a title, statistics and a gap": (
        "Copper\ngrain,phi1,Phi,phi2,Er (GPa),sd\na,10.5,20,30,210.5,4.5\nb,40,50,60,220.1,4.25\n"
        "c,70,80,15,198,5\nd,1,2,3,,\nMean,,,,209.5,\n",
        "",
    ),
    "repeated tests without sds": (
        "grain,phi1,Phi,phi2,Er (GPa)\na,10.5,20,30,210.5\na,10.5,20,30,206\nb,40,50,60,220\n"
        "b,40,50,60,223\nc,70,80,15,198\n",
        "",
    ),
    "radians": (
        "phi1,Phi,phi2,M,sd\n0.1,0.2,0.3,210.5,4.5\n0.4,0.5,0.6,220,4\n0.7,0.8,0.9,198,5\n",
        ", angles = 'radians'",
    ),
    "depths, groups and an uncertain zero": (
        "phi1,Phi,phi2,M,sd,depth (nm),zero_sd_nm,group\n10.5,20,30,210.5,4.5,95,1,x\n"
        "40,50,60,220,4,90,1,y\n70,80,15,198,5,99,,x\n",
        "",
    ),
}


@pytest.mark.parametrize("name", LABORATORY)
def test_a_path_a_table_of_python_and_the_batch_program_agree(bayesindent, tmp_path, name):
    """By a path, as a table of Python, and in the batch program by the folder of the results."""
    content, stated = LABORATORY[name]
    (tmp_path / "T.csv").write_text(content)
    (tmp_path / "a.nml").write_text(
        f"&problem symmetry = 'cubic' /\n&measurements file = 'T.csv'{stated} /\n"
        "&sampler samples = 200, burn_in = 200, chains = 2 /\n"
    )
    done = bayesindent("extract", "a.nml", "--output", "out", "--json")
    assert done.returncode in (0, 3), done.stderr
    batch = subprocess.run(
        [BATCH, tmp_path / "out" / "resolved.nml", "--stage", "extract", "--output", "batch"],
        cwd=tmp_path,
        capture_output=True,
        text=True,
        check=False,
    )
    assert batch.returncode == done.returncode, batch.stderr
    draws = [read_posterior(tmp_path / folder)["draws"].tolist() for folder in ("out", "batch")]
    assert draws[0] == draws[1]
    tables = [(tmp_path / folder / "table.csv").read_text() for folder in ("out", "batch")]
    assert tables[0] == tables[1] and tables[0].startswith("# Canonical table of bayesindent")
    by_path = Problem(tmp_path / "a.nml", "extract").measurements
    mark = ";" if ";" in content else ","
    names, *rows = [line.split(mark) for line in content.splitlines() if mark in line]
    columns = dict(zip(names, zip(*rows, strict=True), strict=True))
    angles = {"angles": "radians"} if stated else {}
    of_python = Problem.from_keywords(
        "f", {"measurements": columns}, problem={"symmetry": "cubic"}, measurements=angles
    ).measurements
    assert of_python.names == by_path.names
    for column in ("euler_deg", "modulus_gpa", "sd_gpa"):
        assert getattr(of_python, column).tolist() == getattr(by_path, column).tolist()


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


@pytest.mark.parametrize(
    ("wrong", "first"),
    [
        ("&crystals points = 'C.csv' /\n&measurements file = 'T.csv' /\n", "&measurements file"),
        ("&crystals points = 'C.csv' /\n&sampler chains = 0 /\n", "&sampler chains"),
        ("&measurements file = 'T.csv', sample_nu = 0.9 /\n", "&measurements sample_nu"),
        (
            "&measurements file = 'T.csv', shared_errors = 'C.csv' /\n",
            "&measurements file: T.csv: ",
        ),
        ("&measurements file = 'T.csv', shared_errors = 'none.csv' /\n", "&measurements file: T.c"),
        (
            "&measurements file = 'G.csv', shared_errors = 'S.csv' /\n&next candidates = 'T' /\n",
            "&measurements file: G.csv: shared_errors: S.csv: 1 rows for 2",
        ),
    ],
)
def test_of_two_errors_both_programs_report_the_same_one(bayesindent, tmp_path, wrong, first):
    (tmp_path / "T.csv").write_text("phi1_deg,Phi_deg,phi2_deg,sample_modulus_gpa\n1,2,3,200\n")
    (tmp_path / "C.csv").write_text("C11,C12,C44,phi1_deg,Phi_deg,phi2_deg\n1,2,3,0,0,0\n")
    (tmp_path / "S.csv").write_text("grain,shared_1\na,0.02\n")
    rows = "phi1_deg,Phi_deg,phi2_deg,effective_modulus_gpa,sd_gpa\n1,2,3,200,2\n4,50,6,210,2\n"
    (tmp_path / "G.csv").write_text(rows)
    (tmp_path / "a.nml").write_text(f"&problem symmetry = 'cubic' /\n{wrong}")
    batch = subprocess.run(
        [BATCH, "a.nml", "--check"], cwd=tmp_path, capture_output=True, text=True, check=False
    )
    python = bayesindent("run", "a.nml", "--check")
    assert batch.returncode == python.returncode == 2
    assert batch.stderr.startswith(f"a.nml: {first}")
    # Python may add how a column is stated, which the batch program does not read.
    assert python.stderr.startswith(batch.stderr.strip())
