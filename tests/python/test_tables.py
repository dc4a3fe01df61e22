"""Tables of measurements as people have them: each variant of one table is read right, or refused in a line that tells the mend."""

import numpy as np
import pytest

import bayesindent as bi
from bayesindent.settings.problem import read_measurements

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
