"""The quickstart through the library: the numbers of the namelist, with a simulation function of
the user's.
"""

import importlib.util
import json

import numpy as np
import pytest

import bayesindent as bi
from bayesindent.program.cli import main
from support.diagnostics import issues
from support.tree import SOURCE


@pytest.fixture
def driver():
    specification = importlib.util.spec_from_file_location(
        "drive_quickstart", SOURCE / "inputs" / "drive_quickstart.py"
    )
    module = importlib.util.module_from_spec(specification)
    specification.loader.exec_module(module)
    return module


@pytest.mark.long
def test_the_driver_gives_the_numbers_of_the_namelist(driver, tmp_path, capsys):
    """On a coarse mesh, with few simulations and short chains."""
    text = (SOURCE / "inputs" / "quickstart.nml").read_text()
    for old, new in (
        ("data/copper_grains.csv", str(SOURCE / "inputs" / "data" / "copper_grains.csv")),
        ("budget = 25", "budget = 8"),
        ("samples = 10000", "samples = 1000"),
        # A function of a user gives no derivatives.
        ("&design", "&surrogate derivatives = .false. /\n&simulation refine = 0.6 /\n&design"),
    ):
        assert old in text
        text = text.replace(old, new)
    (tmp_path / "quick.nml").write_text(text)
    assert main(["run", str(tmp_path / "quick.nml"), "--output", str(tmp_path / "run")]) == 0
    with issues("surrogate_error"):
        surrogate, posterior, suggestions = driver.main(
            tmp_path / "drive", driver.simulator(refine=0.6), budget=8, samples=1000
        )
    expected, found = (
        json.loads((tmp_path / "run" / "summary.json").read_text()),
        bi.summary(posterior),
    )
    assert found["parameters"] == expected["parameters"]
    assert suggestions == json.loads((tmp_path / "run" / "next.json").read_text())["suggestions"]
    built, kept = (
        json.loads((tmp_path / folder / "build.json").read_text()) for folder in ("run", "drive")
    )
    assert kept["history"] == built["history"]
    assert (
        'alt="Leave-one-out: the 8 simulations' in (tmp_path / "drive" / "report.html").read_text()
    )
    assert "of crystals of every class: 8 simulations" in repr(surrogate)
    # Again: nothing is simulated.
    again = bi.build(tmp_path / "quick.nml", tmp_path / "run")
    assert np.array_equal(again.coefficients, surrogate.coefficients)


def test_simulations_of_the_user(tmp_path):
    """Theory stands for them: called once a crystal, a failure is kept as one, and only 'import'
    admits them.
    """
    keywords = {
        "problem": {"symmetry": "cubic"},
        "design": {"budget": 12},
        "surrogate": {"degree": 1},
    }
    imported = bi.Problem.from_keywords("test", simulation={"simulator": "import"}, **keywords)
    calls = []

    def simulate(stiffness, euler_deg):
        calls.append(tuple(euler_deg))
        if len(calls) == 3:
            raise bi.BayesindentError("no licence")
        return 1.1 * bi.halfspace_modulus(stiffness, euler_deg)

    surrogate = bi.build(imported, tmp_path, simulate=simulate)
    document = json.loads((tmp_path / "build.json").read_text())
    assert len(calls) == document["new_simulations"] == document["simulations"] + document["failed"]
    assert document["failed"] == 1
    copper = bi.stiffness("cubic", C11=168.4, C12=121.4, C44=75.4)
    mean, _ = surrogate.predict(copper[None], [[0.0, 30.0, 10.0]])
    assert mean[0] == pytest.approx(1.1 * bi.halfspace_modulus(copper, [0.0, 30.0, 10.0]), rel=0.01)
    bi.build(imported, tmp_path, simulate=simulate)
    assert len(calls) == document["new_simulations"]
    for problem, function in (
        (imported, None),
        (bi.Problem.from_keywords("test", **keywords), simulate),
    ):
        with pytest.raises(bi.InputError, match="test: &simulation simulator: "):
            bi.build(problem, tmp_path / "other", simulate=function)


def test_objects_say_what_they_are():
    assert (
        repr(bi.Surrogate.load("halfspace"))
        == "<Surrogate of crystals of every class: the exact theory>"
    )
    problem = bi.Problem.from_keywords("mine", problem={"symmetry": "cubic"})
    assert repr(problem) == "<Problem mine: cubic; asks for nothing>"
    assert repr(bi.Indentation(refine=0.6)).startswith(
        "<Indentation of a halfspace by a paraboloid to depth 0.0156 um, contact radius 0.5 um: "
    )


def test_the_report_is_a_function_and_a_package(tmp_path):
    import bayesindent.report.formatting

    assert bayesindent.report.formatting.number(1.25, 1) == "1.2"
    assert bi.report(tmp_path) == tmp_path / "report.html"
    assert (tmp_path / "report.html").exists()
