"""Tables as instruments and people write them: the numbers of the plain table, or a refusal with
line, column and remedy.

Modules: cells.py, cleaning.py, header.py, means.py, reading.py, table.py.
"""

import json
import re
import subprocess
import sys

import numpy as np
import pytest

import bayesindent as bi
from bayesindent.common.result_files import as_csv
from bayesindent.program.cli import main
from bayesindent.settings.problem import Problem
from support.diagnostics import codes, notes
from support.measured_tables import read_measurements

#: Grain, Bunge's angles, modulus, sd: what each of the tables says.
ROWS = [
    ("g1", 10.5, 20.25, 30.125, 210.5, 4.5),
    ("g2", 40.0, 50.0, 60.0, 220.1, 4.25),
    ("g3", 70.0, 80.0, 15.0, 198.0, 5.0),
]
NAMES = ["grain", "phi1_deg", "Phi_deg", "phi2_deg", "Er (GPa)", "sd (GPa)"]


def lines(rows=ROWS, names=NAMES, mark=","):
    return [mark.join(map(str, row)) for row in (names, *rows)]


def text(*args, **more):
    return "\n".join(lines(*args, **more)) + "\n"


def changed(column, function, **more):
    """The table with a function of one of its columns as the text of its cells."""
    rows = [list(row) for row in ROWS]
    for row in rows:
        row[column] = function(row[column])
    return text(rows, **more)


PLAIN = lines()
#: The text, and what a warning says; '' where the table counts as plain.
READ = {
    "plain": (text(), ""),
    "metadata above the header": (
        "Operator: J. Doe\nDate,2025-03-01\nTemperature (C),23.5\n\n" + text(),
        "the header is on line 5",
    ),
    "a title above": ("Er of copper\n" + text(), "the header is on line 2"),
    "metadata above, semicolons and decimal commas": (
        "Probe;TI 990\nArea;24,5\n" + text(mark=";").replace(".", ","),
        "the header is on line 3",
    ),
    "metadata above, tabs": ("Probe\tTI 990\n" + text(mark="\t"), "the header is on line 2"),
    "metadata and a row of units": (
        "Probe: diamond\n" + "\n".join([PLAIN[0], ",deg,deg,deg,GPa,GPa", *PLAIN[1:]]),
        "the header is on line 2",
    ),
    "a mean at the end": (text() + "Mean,,,,209.5,4.6\n", "statistics of the table: line 5"),
    "Mean, Std. Dev., % COV": (
        text() + "Mean,,,,209.5,\nStd. Dev.,,,,11.1,\n% COV,,,,5.3,\n",
        "statistics of the table: lines 5, 6, 7",
    ),
    "Average and Standard deviation": (
        text() + "\nAverage,,,,209.5,\nStandard deviation,,,,11.1,\n",
        "lines 6, 7",
    ),
    "min and max": (text() + "Min,,,,198,\nMAX,,,,220.1,\n", "lines 5, 6"),
    "an incomplete row": (
        text() + "g4,1,2,3,,\n",
        "1 of 4 rows left out, a value is missing: line 5",
    ),
    "n/a for a modulus": (text() + "g4,1,2,3,n/a,4\n", "a value is missing: line 5"),
    "a dash for an angle": (
        "\n".join([*PLAIN[:2], "g0,-,2,3,200,4", *PLAIN[2:]]),
        "a value is missing: line 3",
    ),
    "#DIV/0! for an sd": (text() + "g4,1,2,3,200,#DIV/0!\n", "a value is missing: line 5"),
    "an empty sd": (text() + "g4,1,2,3,200,\n", "a value is missing: line 5"),
    "1.797e308 is no value": (text() + "g4,1,2,3,1.797e308,4\n", "a value is missing: line 5"),
    "degree signs in cells": (changed(2, lambda value: f"{value}°"), None),
    "GPa in cells": (changed(4, lambda value: f"{value} GPa"), None),
    "units without a blank": (changed(4, lambda value: f"{value}GPa"), None),
    "an sd after ±": (
        text([(*row[:4], f"{row[4]} ± {row[5]}") for row in ROWS], NAMES[:5]),
        "what follows ± is its sd",
    ),
    "an sd after +/-": (
        text([(*row[:4], f"{row[4]}+/-{row[5]}") for row in ROWS], NAMES[:5]),
        "what follows ± is its sd",
    ),
    "± and the unit": (
        text([(*row[:4], f"{row[4]} ± {row[5]} GPa") for row in ROWS], NAMES[:5]),
        "what follows ± is its sd",
    ),
    "± with decimal commas": (
        text([(*row[:4], f"{row[4]} ± {row[5]}") for row in ROWS], NAMES[:5], ";").replace(
            ".", ","
        ),
        "±",
    ),
    "per cent in cells": (
        changed(5, lambda value: value).replace("4.5\n", "2.137767220902613 %\n"),
        None,
    ),
    "per cent in the header": (
        text([(*row[:5], 100 * row[5] / row[4]) for row in ROWS], [*NAMES[:5], "sd (%)"]),
        "per cent of the modulus",
    ),
    "UTF-16 with its mark": (text(mark="\t").encode("utf-16"), "read as UTF-16"),
    "UTF-16, big-endian": (b"\xfe\xff" + text(mark="\t").encode("utf-16-be"), "read as UTF-16"),
    "Windows-1252": (
        text(names=["grain", "phi1 (°)", "Phi (°)", "phi2 (°)", "Er (GPa)", "sd (GPa)"]).encode(
            "cp1252"
        ),
        "Windows-1252",
    ),
    "a remark in Windows-1252": (
        text([(*row, "Körnung") for row in ROWS], [*NAMES, "remark"]).encode("cp1252"),
        "Windows-1252",
    ),
    "Ereduced": (text(names=[*NAMES[:4], "Ereduced [GPa]", "sd"]), ""),
    "E_reduced": (text(names=[*NAMES[:4], "E_reduced", "sd"]), ""),
    "Reduced Modulus StdDev [GPa]": (
        text(names=[*NAMES[:4], "Reduced Modulus [GPa]", "Reduced Modulus StdDev [GPa]"]),
        "",
    ),
    "Er std": (text(names=[*NAMES[:4], "Er", "Er std"]), ""),
    "er_sd_gpa": (text(names=[*NAMES[:4], "er_gpa", "er_sd_gpa"]), ""),
    "a depth (nm)": (text([(*row, 95.0) for row in ROWS], [*NAMES, "depth (nm)"]), ""),
    "a depth (µm)": (text([(*row, 0.095) for row in ROWS], [*NAMES, "depth (µm)"]), ""),
    "spellings of a grain": (
        text([("G 1", *ROWS[0][1:]), ("g2", *ROWS[1][1:]), ("G3", *ROWS[2][1:])]),
        "",
    ),
    "Mean Er": (text(names=[*NAMES[:4], "Mean Er (GPa)", "sd"]), None),
    "a wide header over names": (
        "\n".join(
            [
                "grain,Euler angles,,,Reduced modulus,",
                ",phi1,Phi,phi2,Mean (GPa),SD (GPa)",
                *PLAIN[1:],
            ]
        ),
        "together are the header",
    ),
    "a footer": (text() + "Measured by J. Doe\n", "1 of 4 rows left out, a remark: line 5"),
    "rows of empty cells between": (text().replace("\n", "\n,,,,,\n", 2), ""),
    "no-break blanks and other signs": (
        text(
            [(row[0], f"\u2212{360 - row[1]}", *row[2:]) for row in ROWS],
            ["grain", "φ₁\u00a0(°)", "Φ\u00a0(°)", "φ₂\u00a0(°)", "Eᵣ\u00a0(GPa)", "sd"],
        ),
        None,
    ),
    "no-break blanks around numbers": (changed(4, lambda value: f"\u00a0{value}\u202f"), None),
    "another phi and a raised circle": (
        text(
            [(row[0], f"{row[1]}º", *row[2:]) for row in ROWS],
            ["grain", "ϕ1", "Φ", "ϕ2", "Er", "sd"],
        ),
        None,
    ),
    "old lines": (text().replace("\n", "\r"), None),
    "a byte order mark above a title": (
        b"\xef\xbb\xbf" + ("Cu\n" + text()).encode(),
        "the header is on line 2",
    ),
    "sep=;": ("sep=;\n" + text(mark=";").replace(".", ","), "the header is on line 2"),
    "blanks between cells": (
        text(names=["grain", "phi1", "Phi", "phi2", "Er", "sd"], mark=" "),
        None,
    ),
    "aligned columns": (text(mark="    "), None),
    "blanks and decimal commas": (
        text(names=["grain", "phi1", "Phi", "phi2", "Er", "sd"], mark="  ").replace(".", ","),
        None,
    ),
    "a header after #": ("# " + text(), None),
    "bars": (text(mark="|"), None),
    "Markdown": (
        "\n".join(
            f"| {line.replace(',', ' | ')} |"
            for line in [PLAIN[0], ",".join(6 * ["---"]), *PLAIN[1:]]
        ),
        "line 2",
    ),
    "a line of dashes": (
        "\n".join([PLAIN[0], ",".join(6 * ["-----"]), *PLAIN[1:]]),
        "a value is missing: line 2",
    ),
    "the header once more": (
        "\n".join([*PLAIN[:3], PLAIN[0], PLAIN[3]]),
        "the header once more: line 4",
    ),
    "units that are not all known": (
        "\n".join(["grain,phi1,Phi,phi2,Er,sd", "[#],deg,deg,deg,GPa,GPa", *PLAIN[1:]]),
        None,
    ),
    "a row of units with per cent": (
        "\n".join(
            [
                "grain,phi1,Phi,phi2,Er,sd",
                ",deg,deg,deg,GPa,%",
                *(",".join(map(str, (*row[:5], 100 * row[5] / row[4]))) for row in ROWS),
            ]
        ),
        "per cent of the modulus",
    ),
    "CV (%)": (
        text([(*row[:5], 100 * row[5] / row[4]) for row in ROWS], [*NAMES[:5], "CV (%)"]),
        "per cent of the modulus",
    ),
    "rel. sd (%)": (
        text([(*row[:5], 100 * row[5] / row[4]) for row in ROWS], [*NAMES[:5], "rel. sd (%)"]),
        "per cent of the modulus",
    ),
    "sd_percent": (
        text([(*row[:5], 100 * row[5] / row[4]) for row in ROWS], [*NAMES[:5], "sd_percent"]),
        "per cent of the modulus",
    ),
    "an sd in per cent after ±": (
        text([(*row[:4], f"{row[4]} ± {100 * row[5] / row[4]} %") for row in ROWS], NAMES[:5]),
        "what follows ± is its sd",
    ),
    "± and the unit twice": (
        text([(*row[:4], f"{row[4]} GPa ± {row[5]} GPa") for row in ROWS], NAMES[:5]),
        "what follows ± is its sd",
    ),
    "± in brackets": (
        text([(*row[:4], f"({row[4]} ± {row[5]}) GPa") for row in ROWS], NAMES[:5]),
        "what follows ± is its sd",
    ),
    "a column ±": (text(names=[*NAMES[:5], "±"]), ""),
    "Std. Error and N": (
        text([(*row, 9) for row in ROWS], [*NAMES[:5], "Std. Error (GPa)", "N"]),
        "",
    ),
    "a bracket before the last word": (text(names=[*NAMES[:4], "Er (GPa)", "Er (GPa) sd"]), ""),
    "moduli and hardness under wide headers": (
        "\n".join(
            [
                "grain,Euler,,,Er (GPa),,H (GPa),",
                ",phi1,Phi,phi2,mean,sd,mean,sd",
                *(f"{line},2.3,0.1" for line in PLAIN[1:]),
            ]
        ),
        "together are the header",
    ),
    "Euler over 1, 2, 3": (
        "\n".join(["grain,Euler,,,Er (GPa),", ",1,2,3,mean,sd", *PLAIN[1:]]),
        "together are the header",
    ),
    "Euler angle 1": (
        text(names=["grain", "Euler angle 1", "Euler angle 2", "Euler angle 3", "Er", "sd"]),
        "",
    ),
    "means in German": (
        text() + "Mittelwert,40.1,50.1,35,209.5,4.6\n",
        "statistics of the table: line 5",
    ),
    "means in French": (
        text() + "Moyenne,40.1,50.1,35,209.5,4.6\n",
        "statistics of the table: line 5",
    ),
    "Minimum and Mean (n = 3)": (
        text() + "Minimum,1,2,3,198,4\nMean (n = 3),1,2,3,209.5,4\n",
        "statistics of the table: lines 5, 6",
    ),
    "all grains": (
        text() + "All grains,40.1,50.1,35,209.5,4.6\n",
        "statistics of the table: line 5",
    ),
    "the mean first": (
        "\n".join([PLAIN[0], "Mean,40,50,35,209.5,4.6", *PLAIN[1:]]),
        "statistics of the table: line 2",
    ),
    "grains named by letters": (
        text([(name, *row[1:]) for name, row in zip("SNM", ROWS)]),
        "line 3: N is taken for a grain, not for a statistic",
    ),
    "grains 1-1 and 11": (
        text([(name, *row[1:]) for name, row in zip(("1-1", "11", "1 1"), ROWS)]),
        "",
    ),
    "three kinds of dress at once": (
        (
            "Sample: Cu\n"
            + text([(*row[:4], f"{row[4]} ± {row[5]}") for row in ROWS], NAMES[:5])
            + "Mean,,,,209.5\n"
        ).encode("cp1252"),
        "±",
    ),
}


@pytest.mark.parametrize("name", READ)
def test_a_laboratorys_table_is_the_plain_one(tmp_path, name):
    content, words = READ[name]
    path = tmp_path / "a.csv"
    path.write_bytes(content if isinstance(content, bytes) else content.encode())
    points = read_measurements(path, "cubic")
    assert points.modulus_kind == "effective_modulus"
    found = np.column_stack([points.euler_deg % 360, points.modulus_gpa, points.sd_gpa])
    assert found == pytest.approx(np.array([row[1:] for row in ROWS]), rel=1e-12)
    told = notes(points.problem.warnings)
    if words:
        assert words in told
    if words == "":
        assert not points.problem.warnings


DIRECTIONS = {
    "[uvw] with blanks": ["[1 0 2]", "[1 1 1]", "[0 0 1]"],
    "[uvw] without": ["[102]", "[111]", "[001]"],
    "<uvw>": ["<102>", "<111>", "<001>"],
    "a minus": ["[1 0 -2]", "[-1 1 1]", "[0 0 -1]"],
    "a minus without blanks": ["[10-2]", "[-111]", "[00-1]"],
    "a bar": ["[102\u0304]", "[1\u030511]", "[001\u0304]"],
    "commas": ["[1,0,2]", "[1,1,1]", "[0,0,1]"],
}


@pytest.mark.parametrize("name", DIRECTIONS)
@pytest.mark.parametrize("plane", [False, True])
def test_indices_in_one_column(tmp_path, name, plane):
    """In a cubic crystal direction and plane normal are one."""
    cells = [
        cell.translate(str.maketrans("[]<>", "(){}")) if plane else cell
        for cell in DIRECTIONS[name]
    ]
    path = tmp_path / "a.csv"
    path.write_text(
        "orientation;Er;sd\n" + "".join(f"{cell};200;4\n" for cell in cells), encoding="utf-8"
    )
    points = read_measurements(path, "cubic")
    sign = -1.0 if "bar" in name or "minus" in name else 1.0
    expected = np.array([[1, 0, 2 * sign], [sign, 1, 1], [0, 0, sign]])
    assert directions_of(points) == pytest.approx(
        expected / np.linalg.norm(expected, axis=1, keepdims=True), abs=1e-12
    )


def test_four_indices(tmp_path):
    path = tmp_path / "a.csv"
    path.write_text("plane;Er;sd\n(0001);200;4\n(11-20);190;4\n(10-10);190;4\n")
    crystal = {"symmetry": "hexagonal", "lattice": [2.951, 4.684]}
    points = Problem.from_keywords("a", problem=crystal, measurements={"file": path}).measurements
    assert directions_of(points)[:, 2] == pytest.approx([1, 0, 0], abs=1e-12)


def directions_of(points):
    """The sample's z in crystal axes, from Bunge's angles."""
    phi, phi2 = np.radians(points.euler_deg[:, 1]), np.radians(points.euler_deg[:, 2])
    return np.column_stack([np.sin(phi2) * np.sin(phi), np.cos(phi2) * np.sin(phi), np.cos(phi)])


TESTS = {"g1": [205.0, 211.0, 208.0], "g2": [220.0, 216.0], "g3": [198.0]}


def test_repeats_without_sds_are_means_with_a_pooled_error(tmp_path):
    """By hand: the variance within grains is (18 + 8)/(2 + 1)."""
    path = tmp_path / "a.csv"
    rows = [(name, *row[1:4], value) for name, row in zip(TESTS, ROWS) for value in TESTS[name]]
    path.write_text(text(rows, NAMES[:5]))
    points = read_measurements(path, "cubic")
    pooled = np.sqrt(26 / 3)
    assert points.modulus_gpa == pytest.approx([208, 218, 198]) and points.sd_gpa == pytest.approx(
        pooled / np.sqrt([3, 2, 1])
    )
    assert (
        "6 tests of 3 grains became means with standard errors; the sd of a test is 2.94 GPa"
        in notes(points.problem.warnings[:1])
    )


def test_many_repeats_have_their_own_error(tmp_path):
    values = {"a": np.linspace(190, 210, 12), "b": np.array([250.0, 252.0])}
    path = tmp_path / "a.csv"
    path.write_text(
        text(
            [
                (name, *ROWS[k][1:4], value)
                for k, name in enumerate(values)
                for value in values[name]
            ],
            NAMES[:5],
        )
    )
    points = read_measurements(path, "cubic")
    pooled = np.sqrt((11 * values["a"].var(ddof=1) + 2.0) / 12)
    assert points.sd_gpa == pytest.approx(
        [values["a"].std(ddof=1) / np.sqrt(12), pooled / np.sqrt(2)]
    )


#: Six grains with angles of their own.
SIX = [
    ("A", 10, 20, 30, 210.5, 4.5),
    ("B", 40, 50, 60, 220.1, 4.25),
    ("N", 70, 80, 15, 198.0, 5.0),
    ("M", 15, 35, 75, 205.5, 4.0),
    ("Min A", 100, 60, 25, 215.0, 4.5),
    ("Max", 130, 45, 10, 202.5, 4.25),
]


def columns_of(rows, names=NAMES):
    return dict(zip(names, zip(*rows, strict=True), strict=True))


def of_python(rows, names=NAMES):
    return Problem.from_keywords(
        "f", {"measurements": columns_of(rows, names)}, problem={"symmetry": "cubic"}
    ).measurements


def test_complete_rows_of_statistics_are_no_grains(tmp_path):
    """Six grains with complete rows named Mean and Max, as a file and as a table of Python."""
    grains = [(f"g{number}", *row[1:]) for number, row in enumerate(SIX)]
    values = np.array([row[1:] for row in grains])
    rows = [*grains, ("Mean", *values.mean(axis=0).round(2)), ("Max", *values.max(axis=0))]
    (tmp_path / "a.csv").write_text(text(rows))
    for points in (read_measurements(tmp_path / "a.csv", "cubic"), of_python(rows)):
        assert points.names == [row[0] for row in grains]
        assert "2 of 8 rows left out, statistics of the table" in notes(points.problem.warnings[:1])


def test_grains_may_be_named_as_statistics(tmp_path):
    (tmp_path / "a.csv").write_text(text(SIX))
    for points in (read_measurements(tmp_path / "a.csv", "cubic"), of_python(SIX)):
        assert points.names == [row[0] for row in SIX]
        assert "Max is taken for a grain, not for a statistic" in notes(points.problem.warnings)


def test_a_grain_is_compared_with_the_statistic_of_its_name(tmp_path):
    """The modulus of the grain Max is the mean of the others, not their largest."""
    mean = np.mean([row[4] for row in SIX[:2]])
    rows = [*SIX[:2], ("Max", 130, 45, 10, mean, 4.25)]
    (tmp_path / "a.csv").write_text(text(rows))
    assert read_measurements(tmp_path / "a.csv", "cubic").names == ["A", "B", "Max"]
    (tmp_path / "a.csv").write_text(text([*rows[:2], ("Mean", *rows[2][1:])]))
    assert read_measurements(tmp_path / "a.csv", "cubic").names == ["A", "B"]


def test_times_and_rows_of_a_clock_or_a_wafer_are_not_read(tmp_path):
    rows = [(*row, f"12:3{k}", f"A{k}") for k, row in enumerate(ROWS)]
    (tmp_path / "a.csv").write_text(text(rows, [*NAMES, "Time", "row"]))
    points = read_measurements(tmp_path / "a.csv", "cubic")
    assert points.sd_gpa.tolist() == [row[5] for row in ROWS]


def test_below_a_blank_row_are_statistics(tmp_path):
    rows = text([*SIX[:4], ("Max", 1, 2, 3, 300.0, 4.0)]).replace("Max", "\nMax")
    (tmp_path / "a.csv").write_text(rows)
    assert read_measurements(tmp_path / "a.csv", "cubic").names == ["A", "B", "N", "M"]


#: Spellings of a standard deviation of tests, and of an error of their mean.
DEVIATIONS = [
    *("sd", "SD (GPa)", "sd [GPa]", "std_gpa", "Std (GPa)", "std / GPa", "StDev", "StDev (GPa)"),
    *("Std. Dev. (GPa)", "St.Dev", "stddev_gpa", "Standard deviation", "standard_deviation_gpa"),
    *("Er sd (GPa)", "er_std_gpa", "sigma", "Std Er (GPa)", "StdDev EIT [GPa]"),
]
ERRORS = [
    *("sd_gpa", "Std. Error (GPa)", "standard error", "SEM", "se (GPa)", "error", "Err. (GPa)", "±")
]


@pytest.mark.parametrize("header", [*DEVIATIONS, *ERRORS])
def test_sds_beside_n_have_one_rule(tmp_path, header):
    names = [*NAMES[:5], header, "n"]
    rows = [(*row, 9) for row in ROWS]
    (tmp_path / "a.csv").write_text(text(rows, names))
    divisor = 3.0 if header in DEVIATIONS else 1.0
    for points in (read_measurements(tmp_path / "a.csv", "cubic"), of_python(rows, names)):
        assert points.sd_gpa == pytest.approx([row[5] / divisor for row in ROWS], rel=1e-15)


@pytest.mark.parametrize("name", ["NA", "None", "nan", "007", "1e5", "TRUE", "1,5", "n/a"])
def test_grains_keep_their_names(tmp_path, name):
    rows = [(name, *ROWS[0][1:]), *ROWS[1:]]
    (tmp_path / "a.csv").write_text(as_csv(NAMES, rows))
    for points in (read_measurements(tmp_path / "a.csv", "cubic"), of_python(rows)):
        assert points.names == [name, "g2", "g3"]


def test_headers_are_compared_as_they_stand_in_the_file(tmp_path):
    """Names of NanoSuite: a mean whose plain name is another column, and a name with a mean."""
    rows = [(row[0], "", row[4], *row[1:4], row[5]) for row in ROWS]
    names = ["Test", "E", "Avg E", "phi1", "Phi", "phi2", "sd_gpa"]
    (tmp_path / "a.csv").write_text(text(rows, names))
    points = read_measurements(tmp_path / "a.csv", "cubic", columns={"sample_modulus_gpa": "Avg E"})
    assert points.modulus_kind == "sample_modulus"
    assert points.modulus_gpa.tolist() == [row[4] for row in ROWS]
    names[2] = "Avg Modulus [100-200 nm]"
    (tmp_path / "a.csv").write_text(text(rows, names))
    points = read_measurements(
        tmp_path / "a.csv", "cubic", columns={"sample_modulus_gpa": names[2]}
    )
    assert points.modulus_gpa.tolist() == [row[4] for row in ROWS]


def test_a_refusal_proposes_no_kind_of_modulus(tmp_path):
    (tmp_path / "a.csv").write_text(text(names=[*NAMES[:4], "Modulus At Noon", "sd_gpa"]))
    with pytest.raises(bi.InputError, match="find out which modulus the instrument reports"):
        read_measurements(tmp_path / "a.csv", "cubic")


def test_old_excel_is_named(tmp_path):
    (tmp_path / "a.xls").write_bytes(bytes.fromhex("d0cf11e0a1b11ae1") + bytes(600))
    with pytest.raises(bi.InputError, match="is an old Excel file; save it as .xlsx"):
        read_measurements(tmp_path / "a.xls", "cubic")


def test_pandas_is_imported_with_the_first_table():
    code = (
        "import sys, bayesindent as bi\n"
        "from bayesindent.program.cli import main\n"
        "try:\n    main(['--help'])\nexcept SystemExit:\n    pass\n"
        "assert 'pandas' not in sys.modules\n"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr


def test_a_standard_deviation_of_n_tests(tmp_path):
    path = tmp_path / "a.csv"
    path.write_text(
        text([(*row, 9) for row in ROWS], [*NAMES[:5], "Standard deviation (GPa)", "N"])
    )
    points = read_measurements(path, "cubic")
    assert points.sd_gpa == pytest.approx(
        [row[5] / 3 for row in ROWS]
    ) and "the standard error of the mean" in notes(points.problem.warnings[:1])
    assert points.problem.table.words(3)[1].endswith("N as number of tests")
    path.write_text(text([(*row, 9) for row in ROWS], [*NAMES[:5], "Standard error (GPa)", "N"]))
    assert read_measurements(path, "cubic").sd_gpa == pytest.approx([row[5] for row in ROWS])


def test_a_column_that_numbers_the_rows_is_no_number_of_tests(tmp_path):
    path = tmp_path / "a.csv"
    path.write_text(
        text(
            [(*row, number) for number, row in enumerate(ROWS, 1)],
            [*NAMES[:5], "Standard deviation (GPa)", "N"],
        )
    )
    points = read_measurements(path, "cubic")
    assert points.sd_gpa == pytest.approx(
        [row[5] for row in ROWS]
    ) and "column N: numbers the rows" in notes(points.problem.warnings[:1])


@pytest.mark.parametrize("header", ["CV (%)", "sd (%)", "Er sd (%)"])
@pytest.mark.parametrize("cell", ["2 %", "2%", "2"])
def test_shares_with_their_sign_below_a_header_of_shares(tmp_path, header, cell):
    path = tmp_path / "a.csv"
    path.write_text(text([(*row[:5], cell) for row in ROWS], [*NAMES[:5], header]))
    found = read_measurements(path, "cubic")
    assert found.sd_gpa == pytest.approx([0.02 * row[4] for row in ROWS])


@pytest.mark.parametrize(
    ("header", "cell", "expected"),
    [("contact radius (nm)", "250", 0.25), ("grain_radius_nm", "8000", 8)],
)
def test_units_of_sizes(tmp_path, header, cell, expected):
    path = tmp_path / "a.csv"
    path.write_text(text([(*row, cell) for row in ROWS], [*NAMES, header]))
    table = read_measurements(path, "cubic").problem.table
    j = table.column("contact_radius_um", "grain_radius_um")
    assert [float(value) for value in table.cells[j]] == [expected] * len(ROWS)


@pytest.mark.parametrize(
    "units", [",Deg.,Deg.,Deg.,GPa,GPa", ",deg,deg,deg,GPa,± GPa", ",deg,deg,deg,GPa,1 sigma"]
)
def test_other_words_in_a_row_of_units_are_no_units(tmp_path, units):
    path = tmp_path / "a.csv"
    path.write_text("\n".join([PLAIN[0], units, *PLAIN[1:]]))
    assert read_measurements(path, "cubic").modulus_gpa.tolist() == [row[4] for row in ROWS]


def test_marks_count_where_numbers_are_read(tmp_path):
    """Not in names, in columns that are not read, and above the header."""
    path = tmp_path / "a.csv"
    rows = [(f"1,{k}01", *row[1:], "12,345") for k, row in enumerate(ROWS)]
    table = text(rows, [*NAMES, "Stiffness (N/m)"], mark="\t")
    path.write_text("Software\t1.234\tFirmware\t2,345\n" + table)
    assert read_measurements(path, "cubic").modulus_gpa.tolist() == [row[4] for row in ROWS]


@pytest.mark.parametrize("header", ["Contact radius", "Grain radius (px)"])
def test_sizes_without_a_unit_are_not_read(tmp_path, header):
    path = tmp_path / "a.csv"
    path.write_text(text([(*row, 250) for row in ROWS], [*NAMES, header]))
    table = read_measurements(path, "cubic").problem.table
    assert table.column("contact_radius_um", "grain_radius_um") < 0


@pytest.mark.parametrize("header", ["X (px)", "Time (min)"])
def test_columns_that_are_not_needed_may_have_other_units(tmp_path, header):
    path = tmp_path / "a.csv"
    path.write_text(text([(*row, k) for k, row in enumerate(ROWS)], [*NAMES, header]))
    found = read_measurements(path, "cubic")
    assert f"the column {header} is not read: its unit is" in notes(found.problem.warnings)
    assert found.modulus_gpa.tolist() == [row[4] for row in ROWS]


@pytest.mark.parametrize("name", ["# indents", "Number of indentations", "N (tests)", "n_tests"])
def test_names_of_the_number_of_tests(tmp_path, name):
    path = tmp_path / "a.csv"
    path.write_text(
        text([(*row[:5], 3 * row[5], "9.0") for row in ROWS], [*NAMES[:5], "Std. Dev. (GPa)", name])
    )
    assert read_measurements(path, "cubic").sd_gpa == pytest.approx([row[5] for row in ROWS])


def test_spellings_of_one_grain(tmp_path):
    path = tmp_path / "a.csv"
    path.write_text(
        text(
            [
                ("G1", *ROWS[0][1:]),
                ("g1", *ROWS[0][1:4], 212.0, 4.5),
                ("G 1", *ROWS[0][1:4], 209.0, 4.5),
            ]
        )
    )
    points = read_measurements(path, "cubic")
    assert len(points) == 1 and points.names == ["G1"]
    assert "taken for one grain: g1 and G1, G 1 and G1" in notes(points.problem.warnings)


REFUSED = {
    "words for numbers, all at once": (
        text() + "g4,1,2,3,abc,4\ng5,1,x,3,200,4\n",
        "2 cells are no numbers: line 5, column Er (GPa): 'abc'; line 6, column Phi_deg: 'x'",
    ),
    "a modulus in no known column": (
        text(names=[*NAMES[:4], "value", "sd"]),
        "no column is a modulus",
    ),
    "E alone": (
        text(names=[*NAMES[:4], "E (GPa)", "sd"]),
        "does not say which modulus was measured",
    ),
    "no sds and no repeats": (
        text([row[:5] for row in ROWS], NAMES[:5]),
        "the column sd_gpa is missing",
    ),
    "three and four indices": (
        "d,Er,sd\n[1 0 2],200,4\n[1 1 -2 0],210,4\n[0 0 1],190,4\n",
        "three indices, or all of four",
    ),
    "directions and planes": (
        "d,Er,sd\n[1 0 2],200,4\n(1 1 2),210,4\n[0 0 1],190,4\n",
        "directions [..] or planes (..)",
    ),
    "depths in another unit": (
        text([(*row, "95 nm") for row in ROWS], [*NAMES, "depth_um"]),
        "line 2, column depth_um: the unit nm, where the column has um",
    ),
    "a unit of another quantity": (
        changed(4, lambda value: f"{value} nm"),
        "the unit nm, where the column has gpa",
    ),
    "a row of units with another one": (
        "\n".join([PLAIN[0], ",deg,deg,deg,kbar,kbar", *PLAIN[1:]]),
        "column Er (GPa): the unit kbar is not read; allowed gpa",
    ),
    "thousands with a comma": (
        text([(*row, "1,234") for row in ROWS], [*NAMES, "Depth (nm)"], mark="\t"),
        "line 2, column Depth (nm): 1,234 can be read in two ways, since most numbers have points",
    ),
    "thousands with a point": (
        text(mark=";").replace(".", ",").replace("210,5", "1.210"),
        "line 2, column Er (GPa): 1.210 can be read in two ways, since most numbers have commas",
    ),
    "a length for a modulus": (
        changed(4, lambda value: f"{value} um"),
        "the unit um, where the column has gpa",
    ),
    "a share with an sd of its own": (
        text([(*row[:5], "2 ± 1") for row in ROWS], [*NAMES[:5], "CV (%)"]),
        "the column sd_gpa is missing",
    ),
    "the sd of a load": (
        text(
            [(*row[:5], 2.3, row[5]) for row in ROWS],
            [*NAMES[:5], "Pmax (mN)", "Std. Dev."],
        ),
        "the column Std. Dev. follows Pmax (mN) and may be of that",
    ),
    "a cell too few": (text() + "g4,1,2,200,4\n", "line 5: 5 cells where the header has 6"),
    "a cell too many": (text() + "g4,1,2,3,200,4,7\n", "7 cells where the header has 6"),
    "megapascal": (text([(*row[:4], 1000 * row[4], row[5]) for row in ROWS]), "looks like MPa"),
    "MPa in cells": (changed(4, lambda value: f"{1000 * value} MPa"), "cells are no numbers"),
    "the sd of a hardness": (
        text(
            [(*row[:4], 2.3, 0.1, row[4]) for row in ROWS],
            [*NAMES[:4], "H (GPa)", "sd", "Er (GPa)"],
        ),
        "line 1: the column sd follows H (GPa) and may be of that; name it sd_gpa if",
    ),
    "a confidence interval": (
        text(names=[*NAMES[:5], "error (95%)"]),
        "column error (95%): the unit 95% is not read; allowed gpa",
    ),
    "a missing number of tests": (
        text(
            [(*row, number) for row, number in zip(ROWS, (9, "", 4))],
            [*NAMES[:5], "Std (GPa)", "N"],
        ),
        "column N, line 3: a number of tests is needed",
    ),
    "megapascal after ±": (
        text([(*row[:4], f"{1000 * row[4]} ± {1000 * row[5]} MPa") for row in ROWS], NAMES[:5]),
        "3 cells are no numbers: line 2, column Er (GPa)",
    ),
    "Euler angles in one column": (
        "grain;Euler angles;Er;sd\ng1;(10, 20, 30);200;4\ng2;(40, 50, 60);210;4\n",
        "column Euler angles: three angles in one cell, (10, 20, 30); a column for each is needed",
    ),
    "no header": (
        "\n".join(PLAIN[1:]),
        "line 1: numbers where the header row with the names of the columns must be",
    ),
    "no angles": (
        text([(row[0], *row[4:]) for row in ROWS], ["grain", "Er", "sd"]),
        "if no orientation is known state orientations = 'unknown'",
    ),
    "dots for thousands": (
        text(mark=";").replace("210.5", "1.210,5").replace("220.1", "1.220,1"),
        "cells are no numbers",
    ),
}


@pytest.mark.parametrize("name", REFUSED)
def test_refusals_name_line_and_remedy(tmp_path, name):
    path = tmp_path / "a.csv"
    path.write_text(REFUSED[name][0])
    with pytest.raises(bi.InputError, match=re.escape(REFUSED[name][1])) as error:
        read_measurements(path, "cubic")
    assert str(error.value).startswith(str(path)) and "\n" not in str(error.value)


def test_lines_of_the_core_are_those_of_the_file(tmp_path):
    path = tmp_path / "a.csv"
    path.write_text("a title\n" + text() + "Mean,,,,209.5,\ng4,1,200,3,200,4\n")
    with pytest.raises(bi.InputError, match="line 7, column Phi_deg: 200"):
        read_measurements(path, "cubic")


class TestSpreadsheets:
    openpyxl = pytest.importorskip("openpyxl")

    def book(self, path, **sheets):
        made = self.openpyxl.Workbook()
        made.remove(made.active)
        for name, rows in sheets.items():
            sheet = made.create_sheet(name)
            for row in rows:
                sheet.append(row)
        made.save(path)
        return path

    def test_the_sheet_with_moduli(self, tmp_path):
        path = self.book(
            tmp_path / "a.xlsx",
            notes=[["copper"], ["polished"]],
            data=[["made by", "J. Doe"], NAMES, *ROWS, ["Mean", None, None, None, 209.5]],
        )
        points = read_measurements(path, "cubic")
        assert points.modulus_gpa.tolist() == [row[4] for row in ROWS]

    def test_two_sheets_with_moduli(self, tmp_path):
        path = self.book(
            tmp_path / "a.xlsx", notes=[["copper"]], a=[NAMES, *ROWS], b=[NAMES, *ROWS]
        )
        with pytest.raises(
            bi.InputError, match="the sheets a, b have moduli; state sheet = 'a' or another"
        ):
            read_measurements(path, "cubic")
        assert len(read_measurements(path, "cubic", sheet="b")) == 3

    def test_formulas_without_a_value(self, tmp_path):
        path = self.book(tmp_path / "a.xlsx", data=[NAMES, *ROWS, ["g4", 1, 2, 3, "=E2+1", 4]])
        with pytest.raises(
            bi.InputError,
            match=(
                r"formulas without a stored value \(E5\): open it in "
                "a spreadsheet program and save it"
            ),
        ):
            read_measurements(path, "cubic")

    def test_merged_headers(self, tmp_path):
        rows = [
            ["grain", "Euler angles (deg)", None, None, "Reduced modulus", None],
            [None, "phi1", "Phi", "phi2", "Mean (GPa)", "Std. Dev. (GPa)"],
            *ROWS,
        ]
        points = read_measurements(self.book(tmp_path / "a.xlsx", data=rows), "cubic")
        assert points.sd_gpa.tolist() == [row[5] for row in ROWS] and points.euler_deg[
            :, 0
        ].tolist() == [row[1] for row in ROWS]


def test_the_command_shows_what_is_read(tmp_path, capsys):
    path = tmp_path / "a.csv"
    path.write_text(
        "Operator: J. Doe\n"
        + text([(*row, "x") for row in ROWS], [*NAMES, "remark"])
        + "Mean,,,,209.5,,\n"
    )
    assert main(["table", str(path), "--json"]) == 0
    document = json.loads(capsys.readouterr().out)
    read_as = {column["header"]: column["read_as"] for column in document["columns"]}
    assert read_as["Er (GPa)"] == "effective_modulus_gpa" and read_as["remark"] is None
    assert document["grains"] == 3 and document["left_out"] == {"6": "statistics of the table"}
    assert [row["modulus_gpa"] for row in document["results"]] == [row[4] for row in ROWS]
    assert main(["table", str(path)]) == 0
    said = capsys.readouterr()
    assert "left out: line 6 (statistics of the table)" in said.out
    # Of a class that nobody stated nothing is said.
    assert "few_directions" not in codes(document["warnings"])
    assert main(["table", str(path), "--symmetry", "hexagonal"]) == 0
    (tmp_path / "many.csv").write_text(
        "phi1,Phi,phi2,Er (GPa),sd (GPa)\n"
        + "".join(f"{i % 360},20,30,{100 + i / 10},2\n" for i in range(101))
    )
    capsys.readouterr()
    assert main(["table", str(tmp_path / "many.csv")]) == 0
    said = capsys.readouterr().out
    assert (
        "The first 100 of 101 grains, --json has all (degrees, GPa):" in said
        and "\n100 " in said
        and "\n101 " not in said
    )
    assert main(["table", str(tmp_path / "b.csv")]) == 2


def test_a_hundred_thousand_rows(tmp_path):
    """Tests of 200 grains: the means are those of numpy."""
    values = np.random.default_rng(3).normal(200, 5, (200, 500))
    angles = np.random.default_rng(4).uniform(1, 170, (200, 3))
    rows = [(f"g{k}", *angles[k], value) for k in range(200) for value in values[k]]
    path = tmp_path / "a.csv"
    path.write_text(text(rows, NAMES[:5]))
    points = read_measurements(path, "triclinic")
    assert points.modulus_gpa == pytest.approx(values.mean(axis=1), rel=1e-9)
    assert points.sd_gpa == pytest.approx(values.std(axis=1, ddof=1) / np.sqrt(500), rel=1e-9)
