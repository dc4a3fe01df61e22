"""Measurements in a spreadsheet: the same numbers and the same refusals as of a text."""

import datetime
import os
import sys
import zipfile

import numpy as np
import pytest

import bayesindent as bi
from support.measured_tables import read_measurements

openpyxl = pytest.importorskip("openpyxl")

HEADER = ["specimen", "Euler1", "Euler2", "Euler3", "Er (GPa)", "StDev (GPa)"]
ROWS = [("a", 10.5, 20.25, 30.125, 210.1, 1 / 3), ("b", 40, 50, 60, 220.5, 4.25)]


def book(path, rows=(HEADER, *ROWS), **sheets):
    """A file whose first sheet has these rows."""
    made = openpyxl.Workbook()
    for row in rows:
        made.active.append(row)
    for name, cells in sheets.items():
        sheet = made.create_sheet(name)
        for row in cells:
            sheet.append(row)
    made.save(path)
    return path


def test_numbers_to_the_last_digit(tmp_path):
    points = read_measurements(book(tmp_path / "a.xlsx"), "cubic")
    assert points.modulus_kind == "effective_modulus"
    assert np.array_equal(
        np.column_stack([points.euler_deg, points.modulus_gpa, points.sd_gpa]),
        [row[1:] for row in ROWS],
    )
    assert points.problem.table.cells[0].tolist() == ["a", "b"]


def test_what_sheets_have_beside_numbers(tmp_path):
    """Blank rows and columns, a row of units, dates, texts with line breaks and tabs, decimal
    commas as text.
    """
    rows = [
        [],
        [*HEADER, "measured on", None],
        [None, "deg", "deg", "deg", "GPa", "GPa"],
        [],
        ["a\n\tb", *ROWS[0][1:], datetime.date(2024, 5, 1)],
        ["b", "40,0", 50, 60, "220,5", 4.25],
        [None, None],
    ]
    points = read_measurements(book(tmp_path / "a.XLSX", rows), "cubic")
    assert np.array_equal(
        np.column_stack([points.euler_deg, points.modulus_gpa, points.sd_gpa]),
        [row[1:] for row in ROWS],
    )
    assert points.problem.table.cells[0].tolist() == ["a b", "b"]


FORMATS = [("0.0%", 0.02), ('0.0"%"', 2.0), (r"0.0\ \%", 2.0), ("0.0", 2.0)]


@pytest.mark.parametrize(
    ("header", "form", "value"),
    [(header, *form) for header in ("CV (%)", "sd (%)") for form in FORMATS]
    + [("StDev (GPa)", "0.0%", 0.02)],
)
def test_cells_that_are_shown_in_per_cent(tmp_path, header, form, value):
    path = book(tmp_path / "a.xlsx", [[*HEADER[:5], header], *([*row[:5], value] for row in ROWS)])
    file = openpyxl.load_workbook(path)
    for row in file.active.iter_rows(min_row=2, min_col=6):
        row[0].number_format = form
    file.save(path)
    assert read_measurements(path, "cubic").sd_gpa == pytest.approx([0.02 * 210.1, 0.02 * 220.5])


def test_sheets_by_name(tmp_path):
    path = book(tmp_path / "a.xlsx", [["a title"]], grains=(HEADER, *ROWS))
    assert len(read_measurements(path, "cubic", sheet="grains")) == 2
    with pytest.raises(
        bi.InputError, match="a.xlsx: there is no sheet 'Grains'; the sheets are Sheet, grains"
    ):
        read_measurements(path, "cubic", sheet="Grains")
    # The first one has no moduli.
    assert len(read_measurements(path, "cubic")) == 2


@pytest.mark.parametrize(
    ("rows", "words"),
    [
        (
            [HEADER, ROWS[0], ["b", 40, 50, 60, 220500, 4]],
            "line 3, column effective_modulus_gpa: 220500 GPa looks like MPa",
        ),
        (
            [[], HEADER, ROWS[0], ["b", 40, 50, 200, -5, 4]],
            "line 4, column effective_modulus_gpa: -5 GPa is no modulus",
        ),
        (
            [[*HEADER[:4], "modulus", "sd"], *ROWS],
            "the column modulus does not say which modulus was measured",
        ),
    ],
)
def test_refusals_name_the_row_of_the_sheet(tmp_path, rows, words):
    path = book(tmp_path / "a.xlsx", rows)
    with pytest.raises(bi.InputError, match=f"{path}: ({words})"):
        read_measurements(path, "cubic")


def test_what_is_no_spreadsheet(tmp_path, monkeypatch):
    path = tmp_path / "a.xlsx"
    with pytest.raises(bi.InputError, match="a.xlsx: the file does not exist"):
        read_measurements(path, "cubic")
    path.write_text("phi1_deg,Phi_deg\n")
    with pytest.raises(bi.InputError, match="a.xlsx: is no spreadsheet that can be read"):
        read_measurements(path, "cubic")
    # Under another name it is told what it is.
    book(path).rename(tmp_path / "a.csv")
    with pytest.raises(
        bi.InputError,
        match=(
            "a.csv: the file is a spreadsheet or another zip "
            r"archive \(.xlsx, .ods\), not text: save"
        ),
    ):
        read_measurements(tmp_path / "a.csv", "cubic")
    book(path)
    monkeypatch.setitem(sys.modules, "openpyxl", None)
    with pytest.raises(
        bi.InputError,
        match=r"needs openpyxl, which is not installed: \./bayesindent setup --with xlsx, or save",
    ):
        read_measurements(path, "cubic")


def test_a_blank_at_the_last_place_costs_nothing(tmp_path):
    """Sheets that claim to be as large as they may, and styled blanks at the end."""
    made = openpyxl.Workbook()
    for row in (HEADER, *ROWS):
        made.active.append(row)
    made.active["XFD1048576"].number_format = "0.0"
    made.save(tmp_path / "a.xlsx")
    points = read_measurements(tmp_path / "a.xlsx", "cubic")
    expected = read_measurements(book(tmp_path / "b.xlsx"), "cubic")
    assert points.modulus_gpa.tolist() == expected.modulus_gpa.tolist()


def test_an_archive_that_grows_is_refused_before_it_is_unpacked(tmp_path):
    path = book(tmp_path / "a.xlsx")
    with (
        zipfile.ZipFile(path, "a", zipfile.ZIP_DEFLATED) as archive,
        archive.open("xl/media/zeros", "w", force_zip64=True) as part,
    ):
        for _ in range(1001):
            part.write(bytes(1_000_000))
    assert path.stat().st_size < 5_000_000
    with pytest.raises(bi.InputError, match=r"a.xlsx: 10\d{8} bytes when unpacked; allowed up to"):
        read_measurements(path, "cubic")


@pytest.mark.parametrize("device", ["/dev/zero", "/dev/null", "pipe", "pipe.csv"])
def test_devices_and_pipes_are_no_tables(tmp_path, device, bayesindent, batch):
    if device.startswith("pipe"):
        os.mkfifo(tmp_path / device)
    (tmp_path / "a.nml").write_text(
        f"&problem symmetry = 'cubic' /\n&measurements file = '{device}' /\n"
    )
    for run in (bayesindent, batch):
        done = run("run", "a.nml") if run is bayesindent else run("a.nml")
        assert done.returncode == 2
        assert f"a.nml: &measurements file: {device}: a device or a pipe is no file" in done.stderr
