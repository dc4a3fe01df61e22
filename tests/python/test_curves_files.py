"""Step 0: files that are refused, and the files of instruments."""

import json
import re
import sys
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

import bayesindent as bi
from bayesindent.lab.instruments import read_file, tdm_settings
from support.diagnostics import issues
from support.synthetic_curves import KNOWN, NAMELIST, one_curve, table

QUARTZ_GPA = 69.64

GOOD = "test,grain,reference\na,g,\nq,,quartz\n"


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (
            ("tests", "a,g,", "a,,"),
            "tests: tests.csv: line 2: test a has none of grain and reference",
        ),
        (
            ("tests", "quartz", "steel"),
            "the tests have the reference steel, whose modulus is not stated; stated: quartz",
        ),
        (
            ("tests", "a,g,", "b,g,"),
            "curves.csv: line 2, column test: a is no test of the table of tests",
        ),
        (
            ("tests", "reference\na,g,\nq,,quartz", "reference,drift_nm_s\na,g,,7\nq,,quartz,"),
            "line 2, column drift_nm_s: 7 nm/s is no drift",
        ),
        (
            ("curves", "load_mn", "load_un"),
            "the column load_mn is missing; the columns are test, time_s, depth_nm, load_un",
        ),
        (
            ("load", 1e3, 0),
            "test a, line 2: the curve means a modulus of .* GPa .* Loads in mN and depths in "
            "nm are needed",
        ),
        (("time", -1, 0), "test a, line 3: the time runs backwards"),
        (("time", 0, 0), "test a: all times are equal, so no drift can be corrected"),
        (("curves", None, ""), "curves.csv: .*empty"),
        (
            ("curves", None, "test,time_s,depth_nm,load_mn\na,1,2,3\na,2,3,4\n"),
            "curves.csv: test q of the table of tests has no points",
        ),
        (("tests", "a,g,\n", "a,g,\na,g,\n"), "line 3: test a is there twice"),
        (("tests", "a,g,", "a,g,quartz"), "line 2: test a has both of grain and reference"),
        (("namelist", "nu = 0.17", ""), "&references nu: the variable is missing; name needs it"),
        (("namelist", "nu = 0.17", "nu = 0.17, 0.2"), "the number of values is 1, that of nu is 2"),
        (
            ("load", 1e-3, 0),
            "no test has an elastic part; test a: .*Loads in mN and depths in nm are needed",
        ),
        (
            ("curves", None, "test,time_s,depth_nm,load_mn\na,1,2\n"),
            "line 2: 3 cells where the header has 4",
        ),
        (("radius", 0.01, 0), "the curves of the reference quartz are those of another tip"),
    ],
)
def test_bad_input_is_one_line(bayesindent, tmp_path, change, message):
    rows = one_curve("a", 100.0) + one_curve("q", QUARTZ_GPA)
    what, old, new = change
    if what == "load":
        rows = [(*row[:3], row[3] * old) for row in rows]
    if what == "time":
        rows = [(row[0], row[1] * old, *row[2:]) for row in rows]
    text = "test,time_s,depth_nm,load_mn\n" + "".join(
        ",".join(map(str, row)) + "\n" for row in rows
    )
    if what == "curves":
        text = new if old is None else text.replace(old, new)
    (tmp_path / "curves.csv").write_text(text)
    (tmp_path / "tests.csv").write_text(GOOD.replace(old, new) if what == "tests" else GOOD)
    namelist = (
        NAMELIST.replace("radius_um = 5.0", "radius_um = 9.0") if what == "radius" else NAMELIST
    )
    if what == "namelist":
        namelist = namelist.replace(old, new)
    (tmp_path / "a.nml").write_text(
        namelist.replace("radius_sd_um = 0.5", "radius_sd_um = 0.1")
        if what == "radius"
        else namelist
    )
    done = bayesindent("curves", "a.nml")
    assert done.returncode == 2, done.stderr
    line = done.stderr.strip().splitlines()[-1]
    assert line.startswith("a.nml: &")
    assert re.search(message, line), line


def test_no_value_of_an_instrument_is_left_out():
    rows = one_curve("a", 100.0)
    rows.insert(50, ("a", rows[50][1], "1.79769313486232E+308", rows[50][3]))
    with issues("no_reference"):
        found = bi.curves(table(rows), {"test": ["a"], "grain": ["g"]}, radius_um=5.0, **KNOWN)
    assert found.document["tests"][0]["effective_modulus_gpa"] == pytest.approx(100.0, rel=2e-4)


def test_a_file_of_the_instrument(tmp_path):
    rows = one_curve("a", 100.0)
    lines = [
        "Wed Apr 16 10:34:41 2025",
        "",
        "",
        f"Number of Points = {len(rows)}",
        "",
        "Depth (nm)\tLoad (µN)\tTime (s)",
    ]
    lines += [f"{depth:.6f}\t{1e3 * load:.6f}\t{time:.6f}" for _, time, depth, load in rows]
    file = tmp_path / "a.txt"
    file.write_bytes("\r".join(lines).encode("latin-1"))
    with issues("no_reference"):
        found = bi.curves([file], {"test": ["a"], "grain": ["g"]}, radius_um=5.0, **KNOWN)
    assert found.document["tests"][0]["effective_modulus_gpa"] == pytest.approx(100.0, rel=2e-4)
    for encoding, sign in (("utf-8-sig", "µ"), ("utf-16", "μ"), ("utf-8", "u")):
        file.write_bytes("\r".join(lines).replace("µ", sign).encode(encoding))
        np.testing.assert_allclose(read_file(file)[0][1][2], [row[3] for row in rows], atol=1e-8)
    file.write_bytes("\r".join(lines[:-3]).encode("latin-1"))
    with pytest.raises(
        bi.InputError, match="197 points, where the file states 200; it is truncated"
    ):
        bi.curves([file], {"test": ["a"], "grain": ["g"]}, radius_um=5.0)
    (tmp_path / "a.tdm").write_text(
        '<d name="Current_Drift_Rate__nm___s__">-0.54</d><l name="Current_Drift_Correction">1</l>'
    )
    assert tdm_settings(tmp_path / "a.tdm") == {"drift_nm_s": -0.54, "drift_removed": True}
    (tmp_path / "a.tdm").write_text(
        '<d name="Current_Drift_Rate__nm___s__">-0.54</d><l name="Current_Drift_Correction">0</l>'
    )
    file.write_bytes("\r".join(lines).encode("latin-1"))
    with pytest.raises(
        bi.InputError,
        match="the drift of -0.54 nm/s is still in the depths; state drift_removed = .false.",
    ):
        bi.curves([file], {"test": ["a"], "grain": ["g"]}, radius_um=5.0)


def test_files_of_the_instrument_in_a_namelist(tmp_path, bayesindent, batch):
    """Two tests by name: the same as the library's, and what each program says otherwise."""
    (tmp_path / "raw").mkdir()
    for test, modulus in (("a", 100.0), ("b", 120.0)):
        rows = [
            f"{depth:.6f}\t{1e3 * load:.6f}\t{time:.6f}"
            for _, time, depth, load in one_curve(test, modulus)
        ]
        (tmp_path / "raw" / f"{test}.txt").write_bytes(
            "\r".join(["Depth (nm)\tLoad (µN)\tTime (s)", *rows]).encode("latin-1")
        )
    (tmp_path / "tests.csv").write_text("test,grain\na,g\nb,h\n")
    text = (
        "&problem symmetry = 'cubic' /\n"
        "&curves {} tests = 'tests.csv' radius_um = 5.0 radius_sd_um = 0.01 /\n"
    )

    def done(stated):
        (tmp_path / "a.nml").write_text(text.format(stated))
        return bayesindent("curves", "a.nml", "--output", "o", "--json")

    ended = done("files = 'raw/*.txt'")
    assert ended.returncode == 0, ended.stderr
    document = json.loads(ended.stdout)
    assert (
        "files of instruments are read by bayesindent, not by bayesindent-batch"
        in batch("--stage", "curves", "a.nml").stderr
    )
    with issues("no_reference"):
        files = [tmp_path / "raw" / f"{test}.txt" for test in "ab"]
        found = bi.curves(
            files, {"test": ["a", "b"], "grain": ["g", "h"]}, radius_um=5.0, radius_sd_um=0.01
        )
    assert [row["effective_modulus_gpa"] for row in document["grains"]] == pytest.approx(
        found.table["effective_modulus_gpa"], rel=1e-8
    )
    for stated, words in (
        ("files = 'raw/*.csv'", "a.nml: &curves files: raw/*.csv: there is no such file"),
        ("files = 'raw/c.txt'", "a.nml: &curves files: raw/c.txt: "),
        (
            "files = 'raw/a.txt' file = 'curves.csv'",
            "a.nml: &curves file: one of file, a CSV of curves, and files, those of an instrument",
        ),
        ("", "a.nml: &curves file: one of file"),
    ):
        ended = done(stated)
        assert ended.returncode == 2 and ended.stderr.count("\n") == 1 and words in ended.stderr, (
            ended.stderr
        )


def curve_of(rows):
    return tuple(np.array(column) for column in list(zip(*rows, strict=True))[1:])


def test_files_that_other_packages_read(monkeypatch, tmp_path):
    time, depth, load = curve_of(one_curve("a", 100.0))
    for name in ("a.hld", "b.xls"):
        (tmp_path / name).write_text("")

    class Indentation:
        """Two tests of a spreadsheet with continuous stiffness."""

        def __init__(self, _, **settings):
            self.testList, self.testName = ["Test 2"], "Test 1"
            self.method = SimpleNamespace(name="CSM")
            self.raw = SimpleNamespace(
                t=time, h=depth / 1e3, p=load, slope=0.5 + 0 * load, valid=load > -1
            )

        def nextTest(self):
            self.testName = self.testList.pop()
            return True

    nanodent = SimpleNamespace(
        load_experiment=lambda _: SimpleNamespace(
            trace={"time_s": time, "disp_nm": depth, "force_uN": 1e3 * load}
        )
    )
    nanodent.__spec__ = True
    for module, fake in (
        ("nanodent", nanodent),
        ("micromechanics", SimpleNamespace(__spec__=True)),
        ("micromechanics.indentation", SimpleNamespace(Indentation=Indentation)),
    ):
        monkeypatch.setitem(sys.modules, module, fake)
    [(name, curve)] = read_file(tmp_path / "a.hld")
    assert name == "a"
    np.testing.assert_allclose(curve, [time, depth, load], rtol=1e-12)
    tests = dict(read_file(tmp_path / "b.xls"))
    assert list(tests) == ["Test 1", "Test 2"]
    np.testing.assert_allclose(tests["Test 2"], [time, depth, load, 500 + 0 * load], rtol=1e-12)
    monkeypatch.setitem(sys.modules, "nanodent", None)
    with pytest.raises(
        bi.InputError, match="reading a .hld file needs nanodent, which is not installed"
    ):
        bi.curves([tmp_path / "a.hld"], {"test": ["a"], "grain": ["g"]}, radius_um=5.0)
    # An installed package that lacks one of its own is told as that.
    monkeypatch.delitem(sys.modules, "nanodent")
    monkeypatch.syspath_prepend(tmp_path)
    (tmp_path / "nanodent.py").write_text("import a_module_that_is_not_there\n")
    with pytest.raises(bi.InputError, match="cannot be imported .*'a_module_that_is_not_there'"):
        bi.curves([tmp_path / "a.hld"], {"test": ["a"], "grain": ["g"]}, radius_um=5.0)


def test_a_file_of_micro_materials(tmp_path):
    pytest.importorskip("micromechanics")
    time, depth, load = curve_of(one_curve("a", 100.0))
    np.savetxt(tmp_path / "a.txt", np.transpose([time, depth, load]))
    [(name, curve)] = read_file(tmp_path / "a.txt")
    assert name == "a"
    # The package leaves out the first point of such files, or none.
    n = len(curve[0])
    assert n >= len(time) - 1
    np.testing.assert_allclose(curve, [time[-n:], depth[-n:], load[-n:]], rtol=1e-9)


def test_a_spreadsheet_of_continuous_stiffness():
    """The two tests of the example that micromechanics ships: their points with a stiffness, as the
    columns of the sheets have them.
    """
    indentation = pytest.importorskip("micromechanics.indentation")
    pandas = pytest.importorskip("pandas")
    file = Path(indentation.__file__).parent / "data" / "Example.xls"
    tests = dict(read_file(file))
    assert sorted(tests) == ["Test 001", "Test 002"]
    words = ("Time On", "Displacement Into", "Load On", "Harmonic Contact Stiffness")
    for name, curve in tests.items():
        sheet = pandas.read_excel(file, sheet_name=name)
        columns = []
        for word in words:
            name_of_column = next(column for column in sheet if column.startswith(word))
            columns.append(pandas.to_numeric(sheet[name_of_column], errors="coerce").to_numpy())
        rows = np.column_stack(columns)[np.isfinite(columns).all(axis=0)]
        at = np.searchsorted(rows[:, 0], curve[0])
        assert len(at) > 1000 and np.all(np.diff(curve[0]) > 0)
        np.testing.assert_allclose(rows[at], np.transpose(curve), rtol=1e-6)
