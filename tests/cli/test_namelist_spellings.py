"""Spellings that Fortran's own READ takes: they are read, or refused in one line. Modules:
namelist_file.f90.
"""

import json

import pytest

TABLE = "phi1_deg,Phi_deg,phi2_deg,indentation_modulus_gpa,sd_gpa\n0,0,0,200,4\n10,40,30,220,4\n"
CUBIC = "&problem symmetry = 'cubic'"
#: Namelists, and the values that they state.
READ = {
    "blanks after a choice": (f"{CUBIC[:-1]}  ' seed = 7 /", {"problem.seed": 7}),
    "Latin-1 in a comment": (f"{CUBIC} ! Gr\xf6\xdfe of 3\n seed = 7 /", {"problem.seed": 7}),
    "null value": (f"{CUBIC} seed = , synthetic = .true. /", {"problem.synthetic": True}),
    "short logical": (f"{CUBIC} synthetic = .t /", {"problem.synthetic": True}),
    "range": (
        f"{CUBIC} reference_gpa(1:3) = 225, 135, 118 /",
        {"problem.reference_gpa": [225, 135, 118]},
    ),
    "subscripts": (
        f"{CUBIC} reference_gpa(1) = 225 reference_gpa(2) = 135\n reference_gpa( 3 ) = 118 /",
        {"problem.reference_gpa": [225, 135, 118]},
    ),
    "text after the slash": (f"{CUBIC} seed = 7 / the specimen of May", {"problem.seed": 7}),
    "ends of lines of CR": (f"! a comment\r{CUBIC} seed = 7 /\r", {"problem.seed": 7}),
}
REFUSED = {
    "a comma after the name": f"&problem, {CUBIC[9:]} seed = 7 /",
    "dollar": "$problem symmetry = 'cubic' $end",
    "twice": f"{CUBIC} seed = 3 seed = 7 /",
    "semicolons": f"{CUBIC} reference_gpa = 225; 135; 118 /",
    "text before": f"Run of Tuesday\n{CUBIC} seed = 7 /",
    "setting after the slash": f"{CUBIC} / seed = 7",
    "path without quotes": f"{CUBIC} title = data/a.csv\n /",
    "subscript of the wrong order": f"{CUBIC} reference_gpa(2) = 135 reference_gpa(1) = 225 /",
    "subscript that is no number": f"{CUBIC} reference_gpa(a) = 135 /",
    "null value within a list": f"{CUBIC} reference_gpa = 225, , 118 /",
    "Latin-1 in a text": f"{CUBIC} title = 'Gr\xf6\xdfe' /",
}


@pytest.fixture
def written(tmp_path):
    (tmp_path / "base.csv").write_text(TABLE)

    def write(text):
        end = "\r" if "\r" in text else "\n"
        text += f"{end}&measurements file = 'base.csv' /{end}"
        (tmp_path / "a.nml").write_bytes(text.encode("latin-1"))

    return write


@pytest.mark.parametrize("name", READ)
def test_spellings_that_are_read(written, bayesindent, batch, name):
    text, values = READ[name]
    written(text)
    assert batch("a.nml", "--check").returncode == 0
    done = bayesindent("run", "a.nml", "--check", "--json")
    assert done.returncode == 0, done.stderr
    assert json.loads(done.stdout)["stages"] == ["extract"]
    from bayesindent.settings.problem import Problem

    settings = Problem("a.nml").settings
    for variable, value in values.items():
        group, item = variable.split(".")
        found = getattr(getattr(settings, group), item)
        assert (found.tolist() if hasattr(found, "tolist") else found) == value


@pytest.mark.parametrize("name", REFUSED)
def test_spellings_that_are_refused(written, bayesindent, batch, name):
    written(REFUSED[name])
    lines = [bayesindent("run", "a.nml", "--check").stderr, batch("a.nml", "--check").stderr]
    assert lines[0].startswith("a.nml: ") and lines[0].count("\n") == 1
    assert lines[0] == lines[1]
