"""Every public name has an example in its docstring, which runs and prints what it says.

Modules: interface.py.
"""

import doctest
import inspect
import json
import shutil
import warnings

import matplotlib as mpl
import numpy as np
import pytest

import bayesindent as bi
from support.tree import SOURCE

OPTIONS = doctest.NORMALIZE_WHITESPACE | doctest.ELLIPSIS
PUBLIC = sorted(set(bi.__all__))
NAMELISTS = {
    "grains.nml": """\
&problem symmetry = 'cubic', synthetic = .true. /
&measurements file = 'grains.csv' /
&knowledge quantity = 'bulk_modulus', mean = 137, sd = 3 /
&next count = 1 /
&sampler samples = 300, burn_in = 500, chains = 2 /
""",
    "crystals.nml": """\
&problem symmetry = 'cubic', synthetic = .true. /
&simulation refine = 0.6, extrapolate = .false. /
&crystals points = 'crystals.csv' /
""",
    "build.nml": """\
&problem symmetry = 'cubic', synthetic = .true. /
&simulation simulator = 'import' /
&design budget = 12 /
""",
    "map.nml": """\
&problem symmetry = 'cubic', synthetic = .true. /
&measurements file = 'map_indents.csv', ebsd = 'map.ctf' /
""",
}
INDENTS = """\
x_um,y_um,indentation_modulus_gpa,sd_gpa
20,30,140,2
60,40,150,2
"""
CRYSTALS = """\
C11,C12,C44,phi1_deg,Phi_deg,phi2_deg
168.4,121.4,75.4,0,0,0
"""


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """A folder with synthetic grains of copper, a namelist of them, and a table of crystals."""
    folder = tmp_path_factory.mktemp("examples")
    rng = np.random.default_rng(1)
    angles = np.column_stack(
        [rng.uniform(0, 360, 10), np.degrees(np.arccos(rng.uniform(-1, 1, 10))), np.zeros(10)]
    )
    moduli = bi.halfspace_modulus(bi.stiffness("cubic", 168.4, 121.4, 75.4), angles)
    rows = np.column_stack([angles, moduli * (1 + 0.01 * rng.normal(size=10)), 0.01 * moduli])
    header = "phi1_deg,Phi_deg,phi2_deg,indentation_modulus_gpa,sd_gpa"
    np.savetxt(folder / "grains.csv", rows, "%.4f", ",", header=header, comments="")
    (folder / "crystals.csv").write_text(CRYSTALS)
    stiffness = bi.stiffness("cubic", 168.4, 121.4, 75.4).tolist()
    (folder / "copper.json").write_text(json.dumps({"ieee_format": stiffness}))
    (folder / "map_indents.csv").write_text(INDENTS)
    for name, text in NAMELISTS.items():
        (folder / name).write_text(text)
    for name in ("curves.csv", "tests.csv", "map.ctf"):
        shutil.copy(SOURCE / "inputs" / "data" / f"copper_{name}", folder / name)
    return folder


@pytest.fixture(scope="module")
def result(folder):
    settings = {"knowledge": {"bulk_modulus": (137, 3)}, "technique": "exact", "samples": 300}
    return bi.extract(folder / "grains.csv", "cubic", **settings)


@pytest.mark.parametrize("name", PUBLIC)
def test_the_example_prints_what_it_says(name, folder, result, monkeypatch):
    public = getattr(bi, name)
    monkeypatch.chdir(folder)
    text = inspect.getdoc(public) or ""
    example = doctest.DocTestParser().get_doctest(text, {"bi": bi, "result": result}, name, None, 0)
    assert example.examples, f"bi.{name} has no example"
    with warnings.catch_warnings(), mpl.rc_context({"backend": "agg"}):
        warnings.simplefilter("ignore")
        told = []
        doctest.DocTestRunner(optionflags=OPTIONS).run(example, out=told.append)
    assert not told, "".join(told)
