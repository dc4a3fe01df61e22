"""The library as a notebook's user types it: keywords that help lists, names that others know,
results in memory.

Modules: interface.py.
"""

import inspect
import pickle
import re
import warnings

import arviz as az
import numpy as np
import pytest

import bayesindent as bi
from bayesindent.settings.problem import schema
from support.theory_cases import theory_surrogate
from support.tree import SOURCE

IRON = SOURCE / "inputs" / "data" / "fe3si.csv"
FEW = {"samples": 300, "burn_in": 300, "chains": 2, "technique": "exact"}
KNOWN = {"bulk_modulus": (165, 3)}
COPPER = (168.4, 121.4, 75.4)


def quietly(function, *arguments, **keywords):
    """What a function gives, whatever it warns of."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        return function(*arguments, **keywords)


@pytest.fixture(scope="module")
def result():
    return quietly(bi.extract, IRON, "bcc", knowledge=KNOWN, seed=3, **FEW)


def draws(found):
    return np.stack([found.posterior[name].values for name in ("C11", "C12", "C44")])


@pytest.mark.parametrize(
    ("function", "groups"),
    [
        (bi.extract, ("indenter", "measurements", "prior", "sampler")),
        (bi.next_grain, ("next", "measurements")),
        (bi.plan, ("plan", "measurements", "prior", "sampler")),
        (bi.Indentation.__init__, ("specimen", "indenter", "simulation")),
        (bi.Surrogate.fit, ("surrogate",)),
    ],
)
def test_help_lists_every_variable_with_its_default(function, groups):
    """The defaults are those of the reference page; of a name in several groups those of the
    first.
    """
    page: dict[str, str] = {}
    sections = {
        part.partition("`")[0]: part
        for part in (SOURCE / "docs" / "namelists.md").read_text().split("\n## `&")[1:]
    }
    for group in reversed(groups):
        page |= re.findall(
            r"^\| `(\w+)` \| [^|]* \| [^|]* \| ([^|]*) \|", sections[group], flags=re.M
        )
    parameters = inspect.signature(function).parameters
    assert not any(parameter.kind is parameter.VAR_KEYWORD for parameter in parameters.values())
    replaced = {
        "file",
        "c_min",
        "c_max",
        "simulator",
        "vtu",
        "inp",
        "scan",
        "constants",
        "draws",
        "grains",
        "noise",
    }
    listed = [
        variable.name
        for variable in schema()
        if variable.group in groups and variable.name not in replaced
    ]
    assert len(listed) > 3
    for name in listed:
        assert re.search(rf"^{name} : .*\n    \w", function.__doc__, flags=re.M), name
        default, stated = parameters[name].default, page[name].strip()
        shown = (
            f".{default}.".lower()
            if isinstance(default, bool)
            else "unset"
            if default is None
            else str(default)
        )
        assert shown == stated, name


def test_numbers_of_numpy_and_the_symmetry_by_keyword(result):
    # Numbers of numpy, and arrays of one, are numbers.
    arrays = {name: (np.array(mean), np.float64(sd)) for name, (mean, sd) in KNOWN.items()}
    again = quietly(
        bi.extract,
        IRON,
        symmetry="cubic",
        knowledge=arrays,
        seed=np.array(3),
        **FEW,
    )
    assert (draws(again) == draws(result)).all()
    other = quietly(bi.extract, IRON, "cubic", knowledge=KNOWN, seed=4, **FEW)
    assert (draws(other) != draws(result)).any()


@pytest.mark.parametrize(
    ("keywords", "words"),
    [
        (
            {"sample": 3},
            "bi.extract: keyword 'sample' is unknown, did you mean "
            "'samples'?; help(bi.extract) lists all",
        ),
        ({"samples": 3}, "bi.extract: samples: 3 is out of range; allowed 10 to "),
        (
            {"likelihood": "cauchy"},
            "bi.extract: likelihood: 'cauchy' is not known; allowed 'normal', 'student'",
        ),
        (
            {"bounds": {"C11": (300, 200)}},
            "bi.extract: bounds: the lower bound of C11, 300.0 "
            "GPa, is not below the upper one, 200",
        ),
        ({"bounds": {"C11": 300}}, "bi.extract: bounds: C11: 300; allowed (low, high)"),
        (
            {"knowledge": {"bulk_modulus": 165}},
            "bi.extract: knowledge: bulk_modulus: 165; allowed (mean, sd)",
        ),
        ({"knowledge": {"bulk": (165, 3)}}, "bi.extract: knowledge: 'bulk' is unknown"),
        (
            {"samples": "many"},
            "bi.extract: samples: the text 'many' stands where an integer is needed",
        ),
    ],
)
def test_errors_are_in_pythons_words(keywords, words):
    with pytest.raises(bi.InputError) as error:
        bi.extract(IRON, "cubic", **keywords)
    assert str(error.value).startswith(words) and "&" not in str(error.value)


@pytest.mark.parametrize(
    ("refused", "code", "place"),
    [
        (
            lambda: bi.extract(IRON, "cubic", samples=3),
            "bad_input",
            ("bi.extract", "sampler", "samples"),
        ),
        (
            lambda: bi.extract(IRON, "cubic", bounds={"C11": 3}),
            "bad_input",
            ("bi.extract", "prior", ""),
        ),
        (lambda: bi.Problem("a.nml"), "bad_input", ("a.nml", "sampler", "samples")),
        (lambda: bi.Problem("b.nml"), "bad_input", ("b.nml", "measurements", "file")),
        (lambda: bi.Problem("c.nml"), "bad_input", ("c.nml", "measurements", "velocities")),
        (lambda: bi.Problem("d.nml"), "bad_input", ("d.nml", "", "")),
        (lambda: bi.Surrogate.load("b.csv"), "bad_input", ("b.csv", "", "")),
        (lambda: bi.quantities("cubic", COPPER, names=["C99"]), "bad_input", ("", "", "")),
    ],
)
def test_errors_say_where_the_input_is(tmp_path, monkeypatch, refused, code, place):
    """As data, beside a message that holds none of it; the text is composed of them. A table that
    a variable names begins the message.
    """
    monkeypatch.chdir(tmp_path)
    head = "&problem symmetry = 'cubic', density_kg_m3 = 8900 /\n"
    (tmp_path / "a.nml").write_text(f"{head}&sampler samples = 3 /\n")
    (tmp_path / "b.nml").write_text(f"{head}&measurements file = 'b.csv' /\n")
    (tmp_path / "b.csv").write_text("phi1_deg,Phi_deg,phi2_deg,modulus_gpa\n1,2,3,x\n")
    (tmp_path / "c.nml").write_text(f"{head}&measurements velocities = 'b.csv' /\n")
    (tmp_path / "d.nml").write_text("")
    with pytest.raises(bi.InputError) as caught:
        refused()
    error = pickle.loads(pickle.dumps(caught.value))
    assert (error.code, (error.file, error.group, error.variable)) == (code, place)
    assert str(error) == str(caught.value) and not set(place) & set(error.message.split(": "))
    assert str(error).startswith(place[0]) and str(error).endswith(error.message)
    assert error.message.startswith("b.csv: ") == (place[0] == "b.nml")


def test_a_result_keeps_its_surrogate_in_memory(tmp_path):
    """An object of the user's own, which has no name to find it by; a file of the result does not
    have it.
    """
    own = theory_surrogate("cubic", 1, 4, points=200)
    result = quietly(
        bi.extract, IRON, "cubic", surrogate=own, knowledge=KNOWN, **FEW | {"samples": 50}
    )
    best = quietly(bi.next_grain, result, count=1)["suggestions"]
    again = pickle.loads(pickle.dumps(result.copy()))
    assert quietly(bi.next_grain, again, count=1)["suggestions"] == best
    assert best != quietly(bi.next_grain, result, surrogate="halfspace", count=1)["suggestions"]
    assert bi.plot_orientations(result).axes
    with pytest.raises(bi.InputError, match="^bi.next_grain: target: 'C99' is unknown"):
        bi.next_grain(result, target="C99")
    result.to_netcdf(str(tmp_path / "r.nc"))
    stored = az.from_netcdf(str(tmp_path / "r.nc"))
    with pytest.raises(
        bi.InputError,
        match="a result from a file does not have its surrogate; state it with surrogate=",
    ):
        bi.next_grain(stored)
    assert quietly(bi.next_grain, stored, surrogate=own, count=1)["suggestions"] == best
    with pytest.raises(bi.InputError, match="nowhere: there is no such folder of results"):
        bi.report("nowhere")


def test_warnings_name_the_callers_line_and_no_group():
    with pytest.warns(bi.BayesindentWarning) as told:
        bi.extract(
            IRON, "cubic", bounds={"C11": (150, 300), "C12": (80, 200), "C44": (60, 160)}, **FEW
        )
    assert {item.filename for item in told} == {__file__}
    assert not any("&" in str(item.message) for item in told)
    (found,) = [
        item.message for item in told if item.message.diagnostic["code"] == "not_determined"
    ]
    assert str(found).endswith(found.diagnostic["remedy"])


def test_constants_by_position_and_quantities_of_a_stiffness():
    c = bi.stiffness("cubic", *COPPER)
    expected = np.diag([COPPER[0]] * 3 + [COPPER[2]] * 3)
    expected[:3, :3] += COPPER[1] * (1 - np.eye(3))
    assert c == pytest.approx(expected)
    c11, c12, c44 = COPPER
    found = bi.quantities(c)
    assert found["bulk_modulus"] == pytest.approx((c11 + 2 * c12) / 3)
    # Young's modulus along [100] of a cubic crystal, in closed form.
    assert found["young[100]"] == pytest.approx((c11 - c12) * (c11 + 2 * c12) / (c11 + c12))
    assert (found["C11"], found["C66"]) == pytest.approx((c11, c44))
    assert bi.quantities("cubic", COPPER)["bulk_modulus"] == pytest.approx(found["bulk_modulus"])
    with pytest.raises(
        bi.InputError, match="a cubic crystal takes the constants C11, C12, C44, not 2 values"
    ):
        bi.stiffness("cubic", 168.4, 121.4)


def test_basal_directions_of_hexagonal_crystals():
    """Miller-Bravais directions: [0001] is along c, and a1 = [2-1-10] is along x, 30 degrees from
    [10-10].
    """
    zinc = bi.stiffness("hcp", C11=161.1, C12=34.2, C44=38.3, C33=61.1, C13=50.3)
    found = bi.quantities(
        zinc, names=["compressibility[0001]", "compressibility[001]", "young[2-1-10]", "young[100]"]
    )
    assert (
        found["compressibility[0001]"]
        == found["compressibility[001]"]
        != found["young[100]"]
        == pytest.approx(found["young[2-1-10]"])
    )
    quartz = bi.stiffness("trigonal", 86.8, 7.0, 11.9, -18.0, 105.8, 58.2)
    turned = bi.quantities(
        quartz,
        names=["young[10-10]", "young[0.8660254037844386 0.5 0]", "young[01-10]", "young[0 1 0]"],
    )
    assert turned["young[10-10]"] == pytest.approx(turned["young[0.8660254037844386 0.5 0]"])
    assert turned["young[01-10]"] == pytest.approx(turned["young[0 1 0]"])
    for name in ("young[1101]", "young[1111]"):
        with pytest.raises(bi.InputError, match="is unknown"):
            bi.quantities(zinc, names=[name])


def test_orientations_of_orix():
    """orix turns vectors of the sample into those of the crystal: the modulus is that of the
    direction that z becomes.
    """
    quaternion, vector = pytest.importorskip("orix.quaternion"), pytest.importorskip("orix.vector")
    angles = np.array([[10.0, 35.0, 50.0], [200.0, 70.0, 320.0], [0.0, 15.0, 30.0]])
    turned = quaternion.Orientation.from_euler(angles, degrees=True)
    along = (turned * vector.Vector3d.zvector()).data
    by_direction = np.degrees([(0, np.arccos(z), np.arctan2(x, y)) for x, y, z in along])
    c = bi.stiffness("cubic", *COPPER)
    assert bi.halfspace_modulus(c, turned) == pytest.approx(
        bi.halfspace_modulus(c, by_direction), rel=1e-9
    )
    table = {
        "orientation": turned,
        "indentation_modulus_gpa": bi.halfspace_modulus(c, angles),
        "sd_gpa": [2.0, 2.0, 2.0],
    }
    found = quietly(bi.extract, table, "cubic", **FEW)
    assert found.constant_data["euler_deg"].values % 360 == pytest.approx(angles)


@pytest.mark.long
def test_results_in_memory(result, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    known = {"knowledge": KNOWN, "seed": 3} | FEW
    assert quietly(bi.next_grain, result, count=2) == quietly(
        bi.next_grain, IRON, "cubic", result=result, count=2, **known
    )
    page = bi.report(result)
    assert page.resolve() == tmp_path / "report.html"
    text = page.read_text()
    for name, item in bi.summary(result)["parameters"].items():
        assert f"<td>{name}</td><td>{item['mean']:.1f}</td><td>{item['sd']:.1f}</td>" in text
    other = quietly(bi.extract, IRON, "cubic", bounds={"C44": (60, 100)}, seed=3, **FEW)
    compared = quietly(bi.compare, result, other)
    assert [row["run"] for row in compared["constants"][:2]] == ["result 1", "result 2"]
    assert compared["models"] and not compared["warnings"]
    first, second = (draws(found).mean(axis=(1, 2)) for found in (result, other))
    means = [row["mean_gpa"] for row in compared["constants"]]
    assert np.subtract(means[1::2], means[::2]) == pytest.approx(second - first, abs=1e-6)
    # What a file of ArviZ keeps is enough.
    import arviz

    result.to_netcdf("kept.nc")
    again = arviz.from_netcdf("kept.nc")
    assert quietly(bi.next_grain, again, count=2) == quietly(bi.next_grain, result, count=2)


def test_a_figure_shows_the_measurements_and_all_pairs(result):
    part = bi.plot_grains(result)
    shown = {
        round(float(x), 6)
        for axes in part.axes
        for line in axes.lines
        for x in (*line.get_xdata(), *line.get_ydata())
    }
    measured = result.observed_data["modulus"].values
    assert {round(float(value), 6) for value in measured} <= shown
    # Three constants: three pairs and three histograms, each panel with all draws behind it.
    pairs = bi.plot_pairs(result)
    assert sum(bool(axes.lines or axes.collections or axes.patches) for axes in pairs.axes) >= 6
