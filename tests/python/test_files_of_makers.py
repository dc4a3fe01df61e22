"""Moduli, Poisson's ratios and constants as the makers of instruments and tables write them: the
numbers that they mean, in both programs.

Modules: columns.py, canonical.py, reading.py, table_columns.f90, point_tables.f90,
stiffness_table.f90.
"""

import subprocess

import numpy as np
import pytest

import bayesindent as bi
from bayesindent.settings.problem import Problem, read_crystals
from support.diagnostics import notes
from support.measured_tables import read_measurements
from support.programs import BATCH

#: Plane strain moduli of three grains of copper, GPa.
MODULI = np.array([143.71, 145.51, 151.65])
ANGLES = ("30.83,64.49,80.25", "85.25,54.07,52.66", "288.46,42.45,42.42")
HEADER = "phi1,Phi,phi2,sd_gpa"


def page(header, moduli=MODULI, more=""):
    """A table with one modulus and further cells in each row."""
    rows = (f"{m},{a},2{more}" for m, a in zip(moduli, ANGLES))
    return "\n".join([f"{header.partition(';')[0]},{HEADER}{header.partition(';')[2]}", *rows])


def checked(folder, namelist):
    """The batch program's refusal of a namelist; '' if there is none."""
    (folder / "b.nml").write_text(namelist)
    done = subprocess.run(
        [BATCH, "b.nml", "--check"], cwd=folder, capture_output=True, text=True, check=False
    )
    assert (done.returncode == 0) == (not done.stderr), done.stderr
    return done.stderr


def test_the_ratio_of_the_file_is_used(tmp_path):
    """The moduli of a file with nu are M (1 - nu^2); so many files state one M."""
    for name, nu in (("Poissons Ratio", 0.18), ("ns", 0.35), ("Poisson's ratio [-]", 0.25)):
        text = page(f"Es (GPa);,{name}", (MODULI * (1 - nu**2)).round(9), f",{nu}")
        (tmp_path / "a.csv").write_text(text)
        points = read_measurements(tmp_path / "a.csv", "cubic")
        used = points.problem.settings.measurements.sample_nu
        assert used == nu and f"sample_nu = {nu}" in notes(points.problem.warnings)
        assert points.modulus_gpa / (1 - used**2) == pytest.approx(MODULI, rel=1e-9)
        assert read_measurements(tmp_path / "a.csv", "cubic", sample_nu=nu)
        with pytest.raises(bi.InputError, match=f"state sample_nu = 0.3 and {nu}; one value is"):
            read_measurements(tmp_path / "a.csv", "cubic", sample_nu=0.3)
    (tmp_path / "a.csv").write_text(text.replace(",0.25\n", ",0.2\n", 1))
    with pytest.raises(bi.InputError, match="state sample_nu = 0.2 and 0.25; one value is allowed"):
        read_measurements(tmp_path / "a.csv", "cubic")
    # A reduced modulus does not depend on it.
    (tmp_path / "a.csv").write_text(page("Er;,nu", more=",0.2").replace(",0.2\n", ",0.4\n", 1))
    assert read_measurements(tmp_path / "a.csv", "cubic").problem.settings.measurements.sample_nu
    (tmp_path / "a.csv").write_text(page("Es"))
    default = read_measurements(tmp_path / "a.csv", "cubic").problem.settings.measurements
    assert default.sample_nu == 0.3


def test_the_batch_program_uses_the_ratio_of_the_table(tmp_path):
    (tmp_path / "a.csv").write_text(page("Es;,nu", more=",0.18"))
    canonical = Problem.from_keywords(
        "f", problem={"symmetry": "cubic"}, measurements={"file": tmp_path / "a.csv"}
    )
    text = page("sample_modulus_gpa;,sample_nu", more=",0.18")
    text = text.replace("phi1,Phi,phi2", "phi1_deg,Phi_deg,phi2_deg")
    (tmp_path / "c.csv").write_text(text)
    namelist = "&problem symmetry = 'cubic' /\n&measurements file = 'c.csv'{} /\n"
    assert not checked(tmp_path, namelist.format(""))
    assert "sample_nu = 0.3 and 0.18" in checked(tmp_path, namelist.format(", sample_nu = 0.3"))
    # The canonical table has the ratio, and resolves to itself.
    own = Problem.from_keywords(
        "f", problem={"symmetry": "cubic"}, measurements={"file": tmp_path / "c.csv"}
    )
    assert "sample_nu = 0.18" in own.resolved and "sample_nu = 0.18" in canonical.resolved
    assert not own.warnings or "sample_nu" not in notes(own.warnings)


def test_the_ratio_of_another_sheet(tmp_path):
    openpyxl = pytest.importorskip("openpyxl")
    book = openpyxl.Workbook()
    for line in page("Modulus At Max Load [GPa]").splitlines():
        book.active.append([float(x) if x[0].isdigit() else x for x in line.split(",")])
    sheet = book.create_sheet("Required Inputs")
    for row in (["Test", "Poissons Ratio"], ["1", 0.18], ["2", 0.18]):
        sheet.append(row)
    book.save(tmp_path / "a.xlsx")
    for asked in ({}, {"sheet": "Sheet"}):
        points = read_measurements(tmp_path / "a.xlsx", "cubic", **asked)
        assert points.modulus_kind == "sample_modulus"
        assert points.problem.settings.measurements.sample_nu == 0.18


@pytest.mark.parametrize(
    ("header", "kind"),
    [
        ("Modulus At Max Load", "sample_modulus"),
        ("E Average Over Defined Range (GPa)", "sample_modulus"),
        ("Avg Modulus [100-200 nm]", "sample_modulus"),
        ("EIT [GPa]", "sample_modulus"),
        ("EIT/(1-vs^2) [GPa]", "indentation_modulus"),
        ("EIT/(1-νs²)", "indentation_modulus"),
        ("Er [GPa]", "effective_modulus"),
        ("EIT (O&P) [GPa]", "sample_modulus"),
        ("modulusRed_GPa", "effective_modulus"),
    ],
)
def test_kinds_of_modulus_by_the_names_of_makers(tmp_path, header, kind):
    (tmp_path / "a.csv").write_text(page(header))
    points = read_measurements(tmp_path / "a.csv", "cubic")
    assert points.modulus_kind == kind and points.modulus_gpa.tolist() == MODULI.tolist()


@pytest.mark.parametrize("header", ["E*", "E* [GPa]", "E", "Modulus", "Avg E"])
def test_a_name_of_several_kinds_is_asked_for(tmp_path, header):
    (tmp_path / "a.csv").write_text(page(header))
    with pytest.raises(bi.InputError, match="does not say which modulus was measured"):
        read_measurements(tmp_path / "a.csv", "cubic")


SDS = {"effective_modulus": [2.1, 2.2, 2.3], "sample_modulus": [3.1, 3.2, 3.3]}


def two_moduli(header):
    """Er and EIT, and sds of each of them, in columns of these headers."""
    names, columns = header.split(","), []
    for name in names:
        of_sample = "EIT" in name
        sds = SDS["sample_modulus" if of_sample else "effective_modulus"]
        columns.append(MODULI - 3 * of_sample if name in ("Er", "EIT") else sds)
    rows = (",".join(map(str, row)) for row in zip(*columns, strict=True))
    lines = [f"{angles},{row}" for angles, row in zip(ANGLES, rows, strict=True)]
    return "\n".join([f"phi1,Phi,phi2,{header}", *lines])


@pytest.mark.parametrize(
    "header", ["Er,Er sd,EIT,EIT sd", "Er,DEr,EIT,DEIT", "Er,EIT,sd Er,sd EIT"]
)
@pytest.mark.parametrize("kind", SDS)
def test_each_of_two_moduli_has_its_sd(tmp_path, header, kind):
    (tmp_path / "a.csv").write_text(two_moduli(header))
    points = read_measurements(tmp_path / "a.csv", "cubic", modulus_kind=kind)
    assert points.modulus_kind == kind and points.sd_gpa.tolist() == SDS[kind]
    with pytest.raises(bi.InputError, match="are moduli; state modulus_kind"):
        read_measurements(tmp_path / "a.csv", "cubic")


def test_columns_of_one_name_are_sds_of_what_is_before_them(tmp_path):
    rows = (f"{a},0.1,{m},2" for a, m in zip(ANGLES, MODULI, strict=True))
    (tmp_path / "a.csv").write_text("\n".join(["phi1,Phi,phi2,Std,Er,Std", *rows]))
    assert read_measurements(tmp_path / "a.csv", "cubic").sd_gpa.tolist() == [2, 2, 2]


@pytest.mark.parametrize(
    ("header", "words"),
    [
        ("Er,EIT,EIT sd", "the column sd_gpa is missing"),
        ("Er,EIT,StDev", "StDev follows EIT and may be of that"),
    ],
)
def test_the_sd_of_another_modulus_is_not_taken(tmp_path, header, words):
    (tmp_path / "a.csv").write_text(two_moduli(header))
    with pytest.raises(bi.InputError, match=words):
        read_measurements(tmp_path / "a.csv", "cubic", modulus_kind="effective_modulus")


def test_the_table_of_hysitron(tmp_path):
    """Its m is the exponent of the unloading, and its positions are in mm."""
    lines = [
        "Number of Data Points = 2",
        "File;hc(nm);Er(GPa);m;X(mm);Y(mm);phi1;Phi;phi2;sd",
        "grid_0000;120.170023;117.87;1.234245;-51.7;0.25;10;40;70;2",
        "grid_0001;106.766124;124.54;1.360224;-51.7;0.25;80;20;50;2",
    ]
    (tmp_path / "a.txt").write_text("\n".join(lines).replace(";", "\t"))
    points = read_measurements(tmp_path / "a.txt", "cubic")
    assert points.modulus_kind == "effective_modulus"
    assert points.modulus_gpa.tolist() == [117.87, 124.54]
    table = points.problem.table
    places = [float(table.cells[table.column(name)].iloc[0]) for name in ("x_um", "y_um")]
    assert places == [-51700, 250]


CRYSTALS = {
    "calcite": (
        "symmetry,C11,C12,C13,C14,C33,C44,C66,C24,C56",
        "trigonal,144,53.9,51.1,-20.5,84.0,33.5,45.1,20.5,-20.5",
        [144, 53.9, 51.1, -20.5, 84.0, 33.5],
    ),
    "magnesium": (
        "symmetry,C11,C12,C13,C33,C44,C66",
        "hexagonal,59.5,26.1,21.8,61.6,16.4,16.8",
        [59.5, 26.1, 16.4, 61.6, 21.8],
    ),
    "units": ("symmetry,C11 (GPa),C12 [GPa],C44_GPa", "cubic,168.4,121.4,75.4", None),
    "indices": ("symmetry,C_11,C21,C_44", "cubic,168.4,121.4,75.4", None),
}


def crystals(folder, header, row):
    (folder / "c.csv").write_text(f"{header},phi1_deg,Phi_deg,phi2_deg\n{row},10,40,70\n")
    return folder / "c.csv"


@pytest.mark.parametrize("name", CRYSTALS)
def test_published_constants(tmp_path, name):
    header, row, right = CRYSTALS[name]
    points = read_crystals(crystals(tmp_path, header, row), "cubic")
    assert list(points.constants[0].values()) == (right or [168.4, 121.4, 75.4])


@pytest.mark.parametrize(
    ("header", "row", "words"),
    [
        ("symmetry,C11 (MPa),C12,C44", "cubic,168400,121.4,75.4", "the unit mpa is not read"),
        ("symmetry,C11,C21,C_12,C44", "cubic,9,1,1,1", "C21 and C_12 are both C12"),
        (CRYSTALS["magnesium"][0], "hexagonal,59.5,26.1,21.8,61.6,16.4,17.1", "does not apply"),
        (
            "symmetry,C11,C12,C13,C14,C33,C44,C24",
            "-3m,144.0,53.9,51.1,-20.5,84.0,33.5,-20.5",
            "C24",
        ),
    ],
)
def test_constants_that_are_refused(tmp_path, header, row, words):
    with pytest.raises(bi.InputError, match=words):
        read_crystals(crystals(tmp_path, header, row), "cubic")


MATRIX = "168.4 121.4 121.4 0 0 0\n121.4 168.4 121.4 0 0 0\n121.4 121.4 168.4 0 0 0\n"
MATRIX += "0 0 0 75.4 0 0\n0 0 0 0 75.38 0\n0 0 0 0 0 75.4\n"
TRIANGLE = (
    "168.4 121.4 121.4 0 0 0\n  168.4 121.4 0 0 0\n    168.4 0 0 0\n 75.4 0 0\n 75.4 0\n 75.4"
)


def test_a_matrix_is_a_known_stiffness(tmp_path):
    """It is the table with the same means and with independent sds."""
    known = {"stiffness": ([168.4, 121.4, 75.4], np.diag((0.02 * np.r_[168.4, 121.4, 75.4]) ** 2))}
    (tmp_path / "a.csv").write_text(page("Er"))
    settings = {"symmetry": "cubic", "samples": 200, "burn_in": 200, "chains": 2}

    def found(knowledge):
        posterior = bi.extract(tmp_path / "a.csv", knowledge=knowledge, **settings).posterior
        return np.array([posterior[name] for name in ("C11", "C12", "C44")])

    right = found(known)
    path = tmp_path / "c.txt"
    bracketed = "[[" + "],\n[".join(MATRIX.replace(" ", ", ").strip().split("\n")) + "]]"
    lower = "168.4\n121.4 168.4\n121.4 121.4 168.4\n0 0 0 75.4\n0 0 0 0 75.4\n0 0 0 0 0 75.4\n"
    forms = MATRIX.replace(" ", ","), MATRIX.replace(" ", "\t"), TRIANGLE, bracketed, lower
    for text in (MATRIX, *forms, "| " + MATRIX.replace("\n", " |\n| ")[:-2]):
        path.write_text(text)
        got = found({"stiffness": path, "stiffness_relative_sd": 0.02})
        assert np.array_equal(got, right)
    for wrong, words in (
        (MATRIX.replace("\n121.4 ", "\n130 ", 1), "C21 is 130 GPa; by the symmetry .* 121.4 GPa"),
        (MATRIX.replace("75.4 0 0", "75.4 0 9").replace("0 0 75.4\n", "9 0 75.4\n"), "C46 is 9"),
        (MATRIX[:40], "numbers or words; a matrix has 36"),
        (MATRIX.replace("75.38", "nan"), "C55 is nan GPa"),
        ("row,C11\nmean,1\n", "for a table leave stiffness_relative_sd out"),
    ):
        path.write_text(wrong)
        with pytest.raises(bi.InputError, match=words):
            found({"stiffness": path, "stiffness_relative_sd": 0.02})
    text = page("effective_modulus_gpa").replace("phi1,Phi,phi2", "phi1_deg,Phi_deg,phi2_deg")
    (tmp_path / "a.csv").write_text(text)
    namelist = "&problem symmetry = '{}' /\n&measurements file = 'a.csv' /\n"
    namelist += "&knowledge stiffness_file = 'c.txt'{} /\n"
    sd = ", stiffness_relative_sd = 0.02"
    path.write_text(MATRIX)
    assert "a matrix is read by bayesindent" in checked(tmp_path, namelist.format("cubic", sd))
    assert "needs stiffness_relative_sd" in checked(tmp_path, namelist.format("cubic", ""))
