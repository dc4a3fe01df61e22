"""Tables of measurements as people have them: each variant of one table is read right, or refused
in a line that tells the mend.
"""

import csv
import re

import numpy as np
import pytest

import bayesindent as bi
from bayesindent.settings.problem import read_crystals
from bayesindent.surrogate.surrogate import places
from support.diagnostics import codes, notes
from support.measured_tables import read_measurements
from support.tree import SOURCE
from support.words import words

ROWS = [(10.5, 20.25, 30.125, 210.5, 4.5), (40.0, 50.0, 60.0, 220.1, 4.25)]
HEADER = ["phi1_deg", "Phi_deg", "phi2_deg", "indentation_modulus_gpa", "sd_gpa"]
RADIANS = [
    (*np.radians(row[:3]).tolist(), *row[3:]) for row in (*ROWS, (70.0, 80.0, 90.0, 230.0, 5.0))
]
CHOICES = "allowed 'indentation_modulus', 'effective_modulus', 'sample_modulus'"
KINDS = tuple(words("measurements", "modulus_kind"))


def page(delimiter=",", header=HEADER, decimal=".", end="\n", rows=ROWS):
    def cells(row):
        return delimiter.join(repr(value).replace(".", decimal) for value in row)

    return end.join([delimiter.join(header), *map(cells, rows)]) + end


def named(*names):
    """The table with other names of its last columns."""
    return page(header=[*HEADER[: 5 - len(names)], *names])


#: The text, and the kind of modulus that it is read as.
READ = {
    "commas": page(),
    "semicolons": page(";"),
    "tabs": page("\t"),
    "decimal commas, cells between semicolons": page(";", decimal=","),
    "decimal commas, cells between tabs": page("\t", decimal=","),
    "blanks around the cells": page(" ; "),
    "lines that end as on Windows (CRLF)": page(end="\r\n"),
    "a byte order mark (Excel's UTF-8)": "\ufeff" + page(";", decimal=","),
    "comments after #": "# made by hand; with semicolons; and more\n" + page(),
    "rows of empty cells at the end": page() + ",,,,\n\n\n",
    "rows of empty cells between": page().replace("\n", "\n,,,,\n", 1),
    "trailing commas": page().replace("\n", ",\n"),
    "trailing semicolons of rows alone": page(";").replace("4.5\n", "4.5;;\n"),
    "a row of units": page().replace("\n", "\ndeg,deg,deg,GPa,GPa\n", 1),
    "a row of units in brackets, some empty": page(
        ";", header=["phi1", "Phi", "phi2", "Er", "sd"]
    ).replace("\n", "\n;;;[GPa];[GPa]\n", 1),
    "numbers in quotes": page().replace("210.5", '"210.5"'),
    "names in quotes": page(";", header=['"phi1_deg"', "Phi_deg", "phi2_deg", "Er", "sd_gpa"]),
    "names in other case": page(
        header=["PHI1_DEG", "PHI_DEG", "PHI2_DEG", "Indentation_Modulus_GPa", "SD_GPa"]
    ),
    "phi1, PHI, phi2": page(header=["phi1", "PHI", "phi2", "Er", "sd"]),
    "Greek letters": page(header=["φ1", "Φ", "φ2", "Er", "sd"]),
    "Euler1, Euler2, Euler3": page(
        header=["Euler1", "Euler2", "Euler3", "reduced modulus (GPa)", "StDev (GPa)"]
    ),
    "units in square brackets": page(
        header=["phi1 [deg]", "Phi [deg]", "phi2 [deg]", "E_r [GPa]", "std [GPa]"]
    ),
    "units in round brackets, ° for degrees": page(
        header=["phi1 (°)", "Phi (°)", "phi2 (°)", "E_IT (GPa)", "standard deviation (GPa)"]
    ),
    "units after a slash": page(
        header=["phi1 / deg", "Phi / deg", "phi2 / deg", "E_r / GPa", "sd / GPa"]
    ),
    "units as last word": page(
        header=["euler1_deg", "euler2_deg", "euler3_deg", "er_gpa", "std_gpa"]
    ),
    "Er and error": named("Er", "error"),
    "reduced modulus and uncertainty": named("Reduced modulus (GPa)", "Uncertainty (GPa)"),
    "effective_modulus_gpa": named("effective_modulus_gpa", "sd_gpa"),
    "sample_modulus_gpa and a standard error": named("sample_modulus_gpa", "standard error"),
    "columns in another order": page(header=HEADER[::-1], rows=[row[::-1] for row in ROWS]),
    "further columns": page(";", header=[*HEADER, "remark"], rows=[(*row, 1.0) for row in ROWS]),
}

#: The text, the variables of &measurements beside the file, and what the line of the refusal
#: contains.
REFUSED = {
    "decimal commas among commas": (
        page(decimal=","),
        {},
        "10 cells where the header has 5; if commas are decimal, separate the cells by semicolons",
    ),
    "decimal commas in quotes, cells between commas": (
        page().replace("210.5", '"210,5"'),
        {},
        "'210,5' is not a number; decimal commas are read where "
        "semicolons or tabs separate the cells",
    ),
    "MPa in the header": (
        named("Er (MPa)", "sd_gpa"),
        {},
        "column Er (MPa): the unit mpa is not read; allowed gpa",
    ),
    "MPa in a row of units": (
        page().replace("\n", "\ndeg,deg,deg,MPa,MPa\n", 1),
        {},
        "the unit mpa is not read; allowed gpa",
    ),
    "MPa without a word": (
        page(rows=[(*row[:3], 1000 * row[3], row[4]) for row in ROWS]),
        {},
        "210500.0 GPa looks like MPa",
    ),
    "radians": (
        page(rows=RADIANS),
        {},
        "these look like radians, and degrees are needed; if "
        "they are radians say angles = 'radians'",
    ),
    "radians in the header": (
        page(header=["phi1 (rad)", "Phi (rad)", "phi2 (rad)", "Er", "sd"]),
        {},
        "is in radians; degrees are needed",
    ),
    "a modulus of no kind": (
        named("modulus_gpa", "sd_gpa"),
        {},
        f"does not say which modulus was measured, nor does modulus_kind; {CHOICES}",
    ),
    "E alone": (
        named("E (GPa)", "sd"),
        {},
        "the column E (GPa) does not say which modulus was measured",
    ),
    "two kinds of modulus": (
        page(header=[*HEADER[:3], "Er", "E_IT", "sd_gpa"], rows=[(*row, 4.0) for row in ROWS]),
        {},
        "the columns Er and E_IT are moduli; state modulus_kind to take one",
    ),
    "Er where the namelist says indentation_modulus": (
        named("Er", "sd"),
        {"modulus_kind": "indentation_modulus"},
        "but the moduli are those of the column Er; leave modulus_kind out",
    ),
    "two columns for the sd": (
        page(header=[*HEADER[:4], "std", "error"], rows=[(*row, 4.0) for row in ROWS]),
        {},
        "std and error are both sd_gpa",
    ),
    "no sd": (
        page(header=HEADER[:4], rows=[row[:4] for row in ROWS]),
        {},
        "the column sd_gpa is missing; it may be absent only with scale",
    ),
    "a name misspelt": (named("Er", "sdt_gpa"), {}, "sdt_gpa: did you mean sd_gpa?"),
    "an angle misspelt": (
        page(header=["ph1_deg", *HEADER[1:]]),
        {},
        "ph1_deg: did you mean phi1_deg?",
    ),
    "dots for thousands": (
        page(";", decimal=",").replace("210,5", "1.210,5"),
        {},
        "'1.210,5' is not a number",
    ),
    "`1,234` where most numbers have points": (
        page("\t").replace("210.5", "1,234"),
        {},
        "1,234 can be read in two ways",
    ),
    "`kbar` below Er": (
        page().replace("\n", "\n,deg,deg,kbar,kbar\n", 1),
        {},
        "the unit kbar is not read",
    ),
    "no header": (
        page().split("\n", 1)[1],
        {},
        "line 1: numbers where the header row with the names of the columns must be",
    ),
    "a cell too many": (
        page().replace("4.5\n", "4.5,7\n"),
        {},
        "line 2: 6 cells where the header has 5",
    ),
}
KIND_OF = {"Er": 1, "E_r": 1, "er_gpa": 1, "educed": 1, "effective": 1, "E_IT": 2, "sample": 2}


@pytest.mark.parametrize("name", READ)
def test_variants_that_are_read(tmp_path, name):
    path = tmp_path / "a.csv"
    path.write_text(READ[name], encoding="utf-8", newline="")
    points = read_measurements(path, "cubic")
    assert np.array_equal(
        np.column_stack([points.euler_deg, points.modulus_gpa, points.sd_gpa]), ROWS
    )
    header = next(line for line in READ[name].splitlines() if not line.startswith("#"))
    kinds = {KINDS[number] for word, number in KIND_OF.items() if word in header} or {KINDS[0]}
    assert {points.modulus_kind} == kinds
    # What the namelist says beside the header is the same, or is refused.
    assert (
        read_measurements(path, "cubic", modulus_kind=points.modulus_kind).modulus_kind
        == points.modulus_kind
    )
    for other in set(KINDS) - kinds:
        with pytest.raises(
            bi.InputError, match=f"modulus_kind = '{other}', but the moduli are those of the column"
        ):
            read_measurements(path, "cubic", modulus_kind=other)


@pytest.mark.parametrize("kind", KINDS)
def test_any_observable_has_a_column(tmp_path, kind):
    """The column of any kind of modulus is its name and the unit. A laboratory may write both in
    its own way, or state the kind in place of the name.
    """
    path = tmp_path / "a.csv"
    for header, stated in (
        (f"{kind}_gpa", {}),
        (kind.replace("_", " ").title() + " (GPa)", {}),
        ("modulus_gpa", {"modulus_kind": kind}),
    ):
        path.write_text(f"phi1_deg,Phi_deg,phi2_deg,{header},sd_gpa\n1,2,3,150.5,2\n")
        points = read_measurements(path, "cubic", **stated)
        assert (points.modulus_kind, points.modulus_gpa.tolist()) == (kind, [150.5]), header


@pytest.mark.parametrize("name", REFUSED)
def test_variants_that_are_refused(tmp_path, name):
    path = tmp_path / "a.csv"
    text, asked, words = REFUSED[name]
    path.write_bytes(text if isinstance(text, bytes) else text.encode())
    with pytest.raises(bi.InputError) as error:
        read_measurements(path, "cubic", **asked)
    assert (
        words in str(error.value)
        and str(error.value).startswith(str(path))
        and "\n" not in str(error.value)
    )


def test_a_refusal_is_mended_as_it_says(tmp_path):
    def read(text, **asked):
        (tmp_path / "a.csv").write_text(text)
        points = read_measurements(tmp_path / "a.csv", "cubic", **asked)
        return points.modulus_kind, np.column_stack([points.euler_deg, points.modulus_gpa])

    for kind in KINDS:
        found, table = read(REFUSED["a modulus of no kind"][0], modulus_kind=kind)
        assert found == kind and np.array_equal(table, [row[:4] for row in ROWS])
    for kind, column in (("effective_modulus", 3), ("sample_modulus", 4)):
        found, table = read(REFUSED["two kinds of modulus"][0], modulus_kind=kind)
        assert found == kind and table[:, 3].tolist() == [row[column] for row in ROWS]
    _, table = read(REFUSED["radians"][0], angles="radians")
    assert table[:2] == pytest.approx(np.array(ROWS)[:, :4], rel=1e-12)


#: Headers that say nothing, and two that would say something else.
OWN = ["a = b", "Kipp", "c", "Er", "MU", "std"]
NAMED = {
    "phi1_deg": "a = b",
    "PHI_deg": "kipp",
    "phi2_deg": "c",
    "modulus_gpa": "Er",
    "sd_gpa": "MU",
    "grain": "std",
}


def own_table(path, header=OWN):
    path.write_text(
        page(";", header=header, rows=[(*row, number) for number, row in enumerate(ROWS, 7)])
    )
    return path


@pytest.mark.parametrize(
    "columns",
    [NAMED, [f" {name}={header} " for name, header in NAMED.items()]],
    ids=["mapping", "texts"],
)
def test_columns_are_what_the_user_says(tmp_path, columns):
    points = read_measurements(
        own_table(tmp_path / "a.csv"), "cubic", columns=columns, modulus_kind="sample_modulus"
    )
    assert np.array_equal(
        np.column_stack([points.euler_deg, points.modulus_gpa, points.sd_gpa]), ROWS
    )
    assert (points.modulus_kind, points.names) == ("sample_modulus", ["7", "8"])
    assert points.problem.table.names == OWN


def test_columns_of_a_namelist_and_of_a_table_in_python(tmp_path):
    own_table(tmp_path / "a.csv")
    (tmp_path / "out").mkdir()
    said = ", ".join(f"'{name} = {header}'" for name, header in NAMED.items())
    (tmp_path / "a.nml").write_text(
        "&problem symmetry = 'cubic' /\n"
        f"&measurements file = 'a.csv', columns = {said}, modulus_kind = 'sample_modulus' /\n"
    )
    problem = bi.Problem(tmp_path / "a.nml", "extract")
    table = dict(zip(OWN, zip(*[(*row, 1.0) for row in ROWS], strict=True), strict=True))
    of_python = bi.Problem.from_keywords(
        "f",
        {"measurements": table | {"std": ["7", "8"]}},
        problem={"symmetry": "cubic"},
        measurements={"columns": NAMED, "modulus_kind": "sample_modulus"},
    )
    for points in (problem.measurements, of_python.measurements):
        assert np.array_equal(
            np.column_stack([points.euler_deg, points.modulus_gpa, points.sd_gpa]), ROWS
        ) and points.names == ["7", "8"]
    # What is kept of the run says the same again, of the canonical table.
    problem._call("begin_results", groups="measurements", **places(tmp_path / "out", tmp_path))
    again = bi.Problem(tmp_path / "out" / "resolved.nml", "extract")
    assert again.settings.measurements.columns is None
    assert np.array_equal(again.measurements.sd_gpa, problem.measurements.sd_gpa)


def test_a_stated_column_goes_before_and_keeps_its_unit(tmp_path):
    two = page(header=[*HEADER[:3], "Er", "std", "error"], rows=[(*row, 1.5) for row in ROWS])
    (tmp_path / "a.csv").write_text(two)
    with pytest.raises(bi.InputError, match="std and error are both sd_gpa"):
        read_measurements(tmp_path / "a.csv", "cubic")
    assert read_measurements(
        tmp_path / "a.csv", "cubic", columns={"sd_gpa": "error"}
    ).sd_gpa.tolist() == [1.5, 1.5]
    # Er is no effective modulus where the user says what it is.
    said = {"sample_modulus_gpa": "Er", "sd_gpa": "std"}
    assert (
        read_measurements(tmp_path / "a.csv", "cubic", columns=said).modulus_kind
        == "sample_modulus"
    )
    # Words in brackets that are no unit may stand in a header that the user names, and brackets
    # before the unit in any.
    (tmp_path / "a.csv").write_text(named("E (raw)", "u(E) (GPa)"))
    raw = read_measurements(
        tmp_path / "a.csv",
        "cubic",
        columns={"effective_modulus_gpa": "E (raw)", "sd_gpa": "u(E) (GPa)"},
    )
    assert raw.modulus_gpa.tolist() == [row[3] for row in ROWS] and raw.sd_gpa.tolist() == [
        row[4] for row in ROWS
    ]
    (tmp_path / "a.csv").write_text(named("M (GPa)", "error (%)"))
    shares = read_measurements(tmp_path / "a.csv", "cubic", columns={"sd_gpa": "error (%)"})
    assert shares.sd_gpa == pytest.approx([row[4] / 100 * row[3] for row in ROWS])
    (tmp_path / "a.csv").write_text(page())
    with pytest.raises(
        bi.InputError, match="column sd_gpa: the unit gpa is not read; this column has none"
    ):
        read_measurements(
            tmp_path / "a.csv", "cubic", columns={"grain": "sd_gpa"}, scale="inferred"
        )
    (tmp_path / "a.csv").write_text(named("steepness (MPa)", "sd"))
    with pytest.raises(
        bi.InputError, match=r"column steepness \(MPa\): the unit mpa is not read; allowed gpa"
    ):
        read_measurements(
            tmp_path / "a.csv", "cubic", columns={"effective_modulus_gpa": "steepness (MPa)"}
        )


@pytest.mark.parametrize(
    ("said", "words"),
    [
        (
            ["Er"],
            "columns: 'Er': a name, = and the header of its column are needed, such as "
            "'modulus_gpa = E (raw)'",
        ),
        (["sd_gpa = "], "columns: 'sd_gpa =': a name, = and the header"),
        (
            ["sdgpa = MU"],
            "columns: 'sdgpa = MU': no column sdgpa is read, did you mean sd_gpa?; allowed "
            "phi1_deg, Phi_deg, ",
        ),
        (
            ["sd_gpa = Kip"],
            "columns: 'sd_gpa = Kip': the table has no column Kip, did you mean Kipp?; the "
            "columns are a = b, Kipp, c, ",
        ),
        (
            ["sd_gpa = Er", "sd_gpa = MU"],
            "columns: 'sd_gpa = MU': the name or the column is there twice",
        ),
        (
            ["sd_gpa = MU", "grain = MU"],
            "columns: 'grain = MU': the name or the column is there twice",
        ),
    ],
)
def test_stated_columns_that_are_refused(tmp_path, said, words):
    path = own_table(tmp_path / "a.csv")
    with pytest.raises(bi.InputError) as error:
        read_measurements(path, "cubic", columns=said)
    assert str(error.value).startswith(f"{path}: &measurements file: {path}: {words}")


def test_columns_that_nobody_reads_but_are_near_to_known_ones_are_told_of():
    table = dict(
        zip(
            [*HEADER, "orientaton_sd_deg", "remark"],
            np.array([(*row, 1.0, 2.0) for row in ROWS]).T,
            strict=True,
        )
    )
    problem = bi.Problem.from_keywords(
        "f", {"measurements": table}, problem={"symmetry": "isotropic"}, measurements={}
    )
    assert codes(problem.warnings) == ["table_changed"]
    assert notes(problem.warnings) == (
        "the table: the column orientaton_sd_deg is not read, did you mean orientation_sd_deg?"
    )


def test_an_uncertain_zero_of_the_depth():
    """1.5 zero/depth of the modulus, in quadrature, for each test before tests of a grain are
    combined; the column before the variable.
    """
    depth, zero = np.array([50.0, 100.0]), np.array([3.0, 4.0])
    table = dict(zip(HEADER, np.array(ROWS).T, strict=True)) | {"depth_nm": depth}
    modulus, sd = table["indentation_modulus_gpa"], table["sd_gpa"]

    def sds(table):
        problem = bi.Problem.from_keywords(
            "f",
            {"measurements": table},
            problem={"symmetry": "cubic"},
            measurements={"zero_sd_nm": 2.0},
        )
        return problem.measurements.sd_gpa

    assert sds(table) == pytest.approx(np.hypot(sd, 1.5 * 2.0 / depth * modulus), rel=1e-12)
    assert sds(table | {"zero_sd_nm": zero}) == pytest.approx(
        np.hypot(sd, 1.5 * zero / depth * modulus), rel=1e-12
    )
    one = table | {
        "grain": ["a", "a"],
        "phi1_deg": [1.0, 1.0],
        "Phi_deg": [2.0, 2.0],
        "phi2_deg": [3.0, 3.0],
    }
    assert sds(one) == pytest.approx(
        [np.sum(1 / (sd**2 + (3.0 / depth * modulus) ** 2)) ** -0.5], rel=1e-12
    )
    del table["depth_nm"]
    with pytest.raises(
        bi.InputError,
        match=(
            "line 1: zero_sd_nm = 2.0 nm needs the depth of the "
            r"test \(column depth_um\)"
        ),
    ):
        sds(table)


def test_the_list_in_the_documentation_is_this_one():
    text = (SOURCE / "docs" / "verification" / "tables.md").read_text()
    rows = dict(re.findall(r"^\| (.+?) \| (read|refused: .+?) \|$", text, flags=re.MULTILINE))
    assert {name for name, outcome in rows.items() if outcome == "read"} == set(READ)
    assert {name: outcome for name, outcome in rows.items() if outcome != "read"} == {
        name: f"refused: {words}" for name, (_, _, words) in REFUSED.items()
    }


def test_every_spelling_of_a_number_is_read_to_the_last_bit(tmp_path):
    rng = np.random.default_rng(5)
    spellings = [
        f"{value:.{digits}f}" for digits in range(20) for value in rng.uniform(-360, 360, 40)
    ]
    spellings += [
        f"{value:.{digits}e}"
        for digits in range(20)
        for value in rng.uniform(-360, 360, 20) * 10.0 ** rng.integers(-320, 1, 20)
    ]
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
    spellings += [
        "9007199254740993e-14",
        "90.07199254740993",
        "0.90071992547409921e2",
        "1.7976931348623157e-300",
        "4.9e-324",
        "1e-400",
    ]
    path = tmp_path / "a.csv"
    rows = [f"{spelling},20,30,200,4" for spelling in spellings]
    path.write_text("\n".join([",".join(HEADER), *rows]))
    expected = [float(spelling.lower().replace("d", "e")) for spelling in spellings]
    found = read_measurements(path, "cubic").euler_deg[:, 0].tolist()
    assert [(spelling, value) for spelling, value in zip(spellings, found, strict=True)] == list(
        zip(spellings, expected, strict=True)
    )


def test_a_table_is_written_with_its_own_columns_and_ten_digits(tmp_path):
    path, written = tmp_path / "a.csv", tmp_path / "b.csv"
    notes = ["plain", 'a "b", c', " blank first", "", "#no comment", "two\nlines", "é"]
    with open(path, "w", newline="", encoding="utf-8") as file:
        writer = csv.writer(file, quoting=csv.QUOTE_ALL)
        writer.writerow(
            ["note, too", "C11", "C12", "C44", "old", "phi1_deg", "Phi_deg", "phi2_deg"]
        )
        writer.writerows(
            [note, "168.40", "121.4", "75.4", "1", "10", "20", "030"] for note in 100 * notes
        )
    points, rng = read_crystals(path, "cubic"), np.random.default_rng(6)
    values = rng.choice([-1, 1], 700) * 10.0 ** rng.uniform(-7, 9, 700)
    values[:20] = [
        0,
        1,
        0.1,
        100,
        1e-4,
        9.99999999949,
        9.9999999995,
        9.99999999951,
        999999999.96,
        0.5,
        123456.7890625,
        1e-5,
        np.nan,
        np.inf,
        0.00012345678905,
        2**-13,
        1234567890.5,
        12345678.905,
        1 / 3,
        2 / 3,
    ]
    points.write(written, {"old": values, "new": np.arange(700.0)})
    header, *rows = csv.reader(written.open(encoding="utf-8", newline=""))
    assert header == [
        "note, too",
        "C11",
        "C12",
        "C44",
        "phi1_deg",
        "Phi_deg",
        "phi2_deg",
        "old",
        "new",
    ]
    assert [row[:7] for row in rows] == [
        [note, "168.40", "121.4", "75.4", "10", "20", "030"] for note in 100 * notes
    ]
    assert [row[7] for row in rows] == [
        f"{value:.10g}" if np.isfinite(value) else "" for value in values
    ]
    assert [row[8] for row in rows] == [str(i) for i in range(700)]
