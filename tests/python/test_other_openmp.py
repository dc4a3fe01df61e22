"""A process in which another library has threads of OpenMP too, by a libgomp of its own, computes
the same numbers.
"""

import subprocess
import sys

import pytest

from support.tree import SOURCE

pytestmark = pytest.mark.long

OURS = f"""
import bayesindent as bi
copper = bi.stiffness("cubic", C11=168.4, C12=121.4, C44=75.4)
model = bi.Indentation(geometry="block")
results = model.run_many([copper] * 2, [[0, 0, 0], [10, 40, 20]], workers=2)
bounds = {{"C11": (150, 300), "C12": (80, 200), "C44": (60, 160)}}
settings = {{"symmetry": "cubic", "modulus_kind": "indentation_modulus", "bounds": bounds}}
settings |= {{"samples": 200, "chains": 2, "seed": 1}}
posterior = bi.extract({str(SOURCE / "inputs" / "data" / "fe3si.csv")!r}, **settings).posterior
numbers = [result.indentation_modulus_gpa for result in results]
numbers += [posterior[name].values.sum() for name in ("C11", "C12", "C44")]
"""
THEIRS = """
import numpy
from sklearn.cluster import KMeans
points = numpy.random.default_rng(1).normal(size=(5000, 4))
KMeans(4, n_init=1, max_iter=5, random_state=0).fit(points)
"""


def test_same_numbers_beside_scikit_learn():
    pytest.importorskip("sklearn")
    assert printed(THEIRS + "import bayesindent\n" + THEIRS + OURS) == printed(OURS)


def printed(program):
    """The bits of the numbers."""
    show = "print(*[float(number).hex() for number in numbers])"
    done = subprocess.run(
        [sys.executable, "-W", "ignore", "-c", program + show],
        capture_output=True,
        text=True,
        check=True,
    )
    return done.stdout
