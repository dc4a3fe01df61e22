"""Threads may ask for crystals at the same time.

Modules: core.py, core.f90.
"""

import sys
from concurrent.futures import ThreadPoolExecutor

import numpy as np
import pytest

from bayesindent.crystal.elasticity import stiffness_rows


@pytest.mark.long
def test_crystals_from_several_threads_at_once():
    interval = sys.getswitchinterval()
    sys.setswitchinterval(1e-6)
    cases = [("cubic", np.array([168.0, 121.0, 75.0])), ("monoclinic", np.arange(1.0, 14.0))]
    expected = [stiffness_rows(symmetry, [constants])[0] for symmetry, constants in cases]
    try:
        with ThreadPoolExecutor(4) as pool:
            found = list(
                pool.map(
                    lambda i: stiffness_rows(cases[i % 2][0], [cases[i % 2][1]])[0], range(4000)
                )
            )
    finally:
        sys.setswitchinterval(interval)
    for i, matrix in enumerate(found):
        assert matrix == pytest.approx(expected[i % 2], abs=0)
