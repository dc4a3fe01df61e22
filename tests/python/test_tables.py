"""Tables of measurements as people have them: each variant of one table is read right, or refused in a line that tells the mend."""

import csv

import numpy as np
import pytest

import bayesindent as bi
from bayesindent.settings.problem import read_crystals, read_measurements

ROWS = [(10.5, 20.25, 30.125, 210.5, 4.5), (40.0, 50.0, 60.0, 220.1, 4.25)]
HEADER = ["phi1_deg", "Phi_deg", "phi2_deg", "modulus_gpa", "sd_gpa"]


def page(delimiter=",", header=HEADER, decimal=".", end="\n", rows=ROWS):
    lines = [delimiter.join(header), *(delimiter.join(repr(value).replace(".", decimal) for value in row) for row in rows)]
    return end.join(lines) + end


READ = {
    "commas": page(),
    "semicolons": page(";"),
    "tabs": page("\t"),
    "decimal commas, semicolons": page(";", decimal=","),
    "decimal commas, tabs": page("\t", decimal=","),
    "blanks around": page(" ; "),
    "CRLF": page(end="\r\n"),
    "byte order mark": "\ufeff" + page(";", decimal=","),
    "comments": "# made by hand; with semicolons; and more\n" + page(),
    "rows of empty cells": page() + ",,,,\n\n\n",
    "empty rows between": page().replace("\n", "\n,,,,\n", 1),
    "trailing delimiters": page().replace("\n", ",\n"),
    "trailing delimiters of rows": page(";").replace("4.5\n", "4.5;;\n"),
    "quotes": page().replace("210.5", '"210.5"'),
    "quoted header with a comma": page(";", header=['"phi1_deg"', "Phi_deg", "phi2_deg", "modulus_gpa", "sd_gpa"]),
    "other case": page(header=["PHI1_DEG", "PHI_DEG", "PHI2_DEG", "Modulus_GPa", "SD_GPa"]),
    "short names": page(header=["phi1", "PHI", "phi2", "modulus", "sd"]),
    "Euler": page(header=["Euler1", "Euler2", "Euler3", "Modulus (GPa)", "StDev (GPa)"]),
    "units in brackets": page(header=["phi1 [deg]", "Phi [deg]", "phi2 [deg]", "modulus [GPa]", "std [GPa]"]),
    "degree signs": page(header=["phi1 (°)", "Phi (°)", "phi2 (°)", "modulus (GPa)", "standard deviation (GPa)"]),
    "another column": page(";", header=[*HEADER, "remark"], rows=[(*row, 1.0) for row in ROWS]),
}

REFUSED = {
    "decimal commas among commas": (page(decimal=","), "line 2: 10 cells where the header has 5"),
    "MPa": (page(header=[*HEADER[:3], "modulus (MPa)", "sd_gpa"]), ": column modulus (MPa): the unit mpa is not read; allowed gpa"),
    "MPa without a word": (page(rows=[(*row[:3], 1000 * row[3], row[4]) for row in ROWS]), "210500.0 GPa looks like MPa"),
    "no sd": (page(header=HEADER[:4], rows=[row[:4] for row in ROWS]), "the column sd_gpa is missing"),
    "thousands": (page(";", decimal=",").replace("210,5", "1.210,5"), "'1.210,5' is not a number"),
    "an unknown name": (page(header=["alpha", *HEADER[1:]]), "the column phi1_deg is missing; the columns are alpha"),
    "a word for a number": (page().replace("210.5", "n/a"), "line 2, column modulus_gpa: 'n/a' is not a number"),
    "no header": (page().split("\n", 1)[1], "line 1: numbers where the header row with the names of the columns must be"),
    "a cell too many": (page().replace("4.5\n", "4.5,7\n"), "line 2: 6 cells where the header has 5"),
}


@pytest.mark.parametrize("name", READ)
def test_variants_that_are_read(tmp_path, name):
    path = tmp_path / "a.csv"
    path.write_text(READ[name], encoding="utf-8", newline="")
    points = read_measurements(path)
    assert np.array_equal(np.column_stack([points.euler_deg, points.modulus_gpa, points.sd_gpa]), ROWS)


@pytest.mark.parametrize("name", REFUSED)
def test_variants_that_are_refused(tmp_path, name):
    path = tmp_path / "a.csv"
    text, words = REFUSED[name]
    path.write_text(text, encoding="utf-8", newline="")
    with pytest.raises(bi.InputError) as error:
        read_measurements(path)
    assert words in str(error.value) and str(error.value).startswith(str(path)) and "\n" not in str(error.value)


def test_every_spelling_of_a_number_is_read_to_the_last_bit(tmp_path):
    rng = np.random.default_rng(5)
    spellings = [f"{value:.{digits}f}" for digits in range(20) for value in rng.uniform(-360, 360, 40)]
    spellings += [f"{value:.{digits}e}" for digits in range(20) for value in rng.uniform(-360, 360, 20) * 10.0 ** rng.integers(-320, 1, 20)]
    spellings += [repr(value) for value in rng.uniform(-360, 360, 200).tolist()]
    spellings += [
        "+12.5",
        "-0",
        "0",
        ".5",
        "5.",
        "-.25e1",
        "1e2",
        "1E+02",
        "0.1d1",
        "3D-2",
        "00012.50",
        "0." + 30 * "3",
        25 * "0" + "7." + 25 * "0",
    ]
    # In the middle of two neighbours, and beside.
    spellings += ["9007199254740993e-14", "90.07199254740993", "0.90071992547409921e2", "1.7976931348623157e-300", "4.9e-324", "1e-400"]
    path = tmp_path / "a.csv"
    rows = [f"{spelling},20,30,200,4" for spelling in spellings]
    path.write_text("\n".join(["phi1_deg,Phi_deg,phi2_deg,modulus_gpa,sd_gpa", *rows]))
    expected = [float(spelling.lower().replace("d", "e")) for spelling in spellings]
    found = read_measurements(path).euler_deg[:, 0].tolist()
    assert [(spelling, value) for spelling, value in zip(spellings, found, strict=True)] == list(zip(spellings, expected, strict=True))


def test_a_table_is_written_with_its_own_columns_and_ten_digits(tmp_path):
    path, written = tmp_path / "a.csv", tmp_path / "b.csv"
    notes = ["plain", 'a "b", c', " blank first", "", "#no comment", "two\nlines", "é"]
    with open(path, "w", newline="", encoding="utf-8") as file:
        writer = csv.writer(file, quoting=csv.QUOTE_ALL)
        writer.writerow(["note, too", "C11", "C12", "C44", "old", "phi1_deg", "Phi_deg", "phi2_deg"])
        writer.writerows([note, "168.40", "121.4", "75.4", "1", "10", "20", "030"] for note in 100 * notes)
    points, rng = read_crystals(path, "cubic"), np.random.default_rng(6)
    values = rng.choice([-1, 1], 700) * 10.0 ** rng.uniform(-7, 9, 700)
    values[:20] = [0, 1, 0.1, 100, 1e-4, 9.99999999949, 9.9999999995, 9.99999999951, 999999999.96, 0.5, 123456.7890625, 1e-5, np.nan, np.inf,
                   0.00012345678905, 2**-13, 1234567890.5, 12345678.905, 1 / 3, 2 / 3]  # fmt: skip
    points.write(written, {"old": values, "new": np.arange(700.0)})
    header, *rows = csv.reader(written.open(encoding="utf-8", newline=""))
    assert header == ["note, too", "C11", "C12", "C44", "phi1_deg", "Phi_deg", "phi2_deg", "old", "new"]
    assert [row[:7] for row in rows] == [[note, "168.40", "121.4", "75.4", "10", "20", "030"] for note in 100 * notes]
    assert [row[7] for row in rows] == [f"{value:.10g}" if np.isfinite(value) else "" for value in values]
    assert [row[8] for row in rows] == [str(i) for i in range(700)]
