"""Public objects are copied and pickled without harm, and do not change once they are made."""

import copy
import inspect
import pickle

import numpy as np
import pytest

import bayesindent as bi
from bayesindent.core import NativeObject
from support.theory_cases import theory_surrogate
from support.tree import REFERENCE

CRYSTAL, ANGLES = (
    bi.stiffness("cubic", C11=168.4, C12=121.4, C44=75.4),
    np.array([10.0, 20.0, 30.0]),
)
COPIES = {
    "copy": copy.copy,
    "deepcopy": copy.deepcopy,
    "pickle": lambda thing: pickle.loads(pickle.dumps(thing)),
}


@pytest.fixture(scope="module")
def problem_file(tmp_path_factory):
    file = tmp_path_factory.mktemp("objects") / "a.nml"
    file.write_text("&problem symmetry = 'cubic' /\n&crystals points = 'a.csv' /\n")
    (file.parent / "a.csv").write_text(
        "C11,C12,C44,phi1_deg,Phi_deg,phi2_deg\n168.4,121.4,75.4,0,0,0\n"
    )
    return file


#: How each public class is made, and what must be the same of a copy.
MAKERS = {
    "Analysis": (
        lambda file: bi.analysis(
            REFERENCE / "cubic_fe3si.csv", "cubic", modulus_kind="indentation_modulus"
        ),
        lambda analysis: (analysis.problem.resolved, analysis.surrogate.symmetry),
    ),
    "Indentation": (
        lambda file: bi.Indentation(refine=0.7, depths=5),
        lambda indentation: (
            indentation.depths,
            indentation.run(CRYSTAL, ANGLES).indentation_modulus_gpa,
        ),
    ),
    "IndentationResult": (
        lambda file: bi.Indentation(refine=0.7, depths=5).run(CRYSTAL, ANGLES),
        lambda result: (result.indentation_modulus_gpa, result.depth_um.tolist()),
    ),
    "Problem": (
        lambda file: bi.Problem(file),
        lambda problem: (problem.resolved, problem.settings.problem.symmetry),
    ),
    "Surrogate": (
        lambda file: theory_surrogate("cubic", 1, 4, points=100),
        lambda surrogate: [
            values.tolist() for values in surrogate.predict(CRYSTAL[None], ANGLES[None])
        ],
    ),
    "BayesindentError": (lambda file: bi.BayesindentError("why"), str),
    "BayesindentWarning": (lambda file: bi.BayesindentWarning("why"), str),
    "InputError": (lambda file: bi.InputError("why"), str),
    "MachineError": (lambda file: bi.MachineError("why"), str),
}
CLASSES = [name for name in bi.__all__ if inspect.isclass(getattr(bi, name))]


@pytest.mark.parametrize("name", CLASSES)
@pytest.mark.parametrize("way", COPIES)
def test_copies_are_made_anew_or_refused(problem_file, name, way):
    make, result = MAKERS[name]
    thing = make(problem_file)
    assert type(thing) is getattr(bi, name)
    expected = result(thing)
    try:
        other = COPIES[way](thing)
    except TypeError as error:
        assert "cannot be copied or pickled" in str(error)
        return
    assert type(other) is type(thing)
    if isinstance(thing, NativeObject):
        assert other._handle != thing._handle
    del thing
    assert result(other) == expected


@pytest.mark.parametrize(
    "name", [name for name in CLASSES if not issubclass(getattr(bi, name), Exception)]
)
def test_public_objects_are_frozen(problem_file, name):
    thing = MAKERS[name][0](problem_file)
    names = [key for key in vars(thing) if not key.startswith("_")]
    assert names
    for key in [*names, "new"]:
        with pytest.raises(AttributeError):
            setattr(thing, key, 50)
        with pytest.raises(AttributeError):
            delattr(thing, key)


def test_a_freed_handle_is_refused(problem_file):
    from bayesindent.core import call

    problem = bi.Problem(problem_file)
    handle = problem._handle
    del problem
    with pytest.raises(bi.BayesindentError):
        call("problem.describe", handle)
