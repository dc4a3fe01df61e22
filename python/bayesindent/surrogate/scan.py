"""Other truncations of the basis on the same simulations (Figs. 1 and 6)."""

from collections.abc import Callable

import numpy as np

from ..surrogate.basis import Basis
from ..surrogate.learner import Learner
from ..surrogate.learning import Learning, left_out

__all__ = ["scan_truncations"]

#: Numbers of simulations at which the error is computed.
COUNTS = 6


def scan_truncations(learning: Learning, pairs: list[tuple[int, int]], advance: Callable[[int], None]) -> list[dict]:
    """Evidence and leave-one-out errors of pairs of degree and bandlimit, as the number of simulations grows."""
    counts = np.unique(np.linspace(learning.first, learning.n, COUNTS).astype(int))
    result = []
    own = learning.basis
    for degree, bandlimit in pairs:
        basis = Basis(own.domain, own.coordinates, own.truncation, degree, bandlimit)
        result.append({"degree": degree, "bandlimit": bandlimit, "terms": basis.n_terms, **learnt(basis, learning, counts)})
        advance(1)
    return result


def learnt(basis: Basis, learning: Learning, counts) -> dict:
    """What another basis learns from the first simulations, by their number."""
    learner, before, errors = Learner(basis, learning.prior), 0, []
    for count in counts:
        learner.add(*(values[before:count] for values in learning.data.values()), chosen=True)
        learner.fit()
        errors.append(left_out(learner, {name: values[:count] for name, values in learning.data.items()}, np.arange(count)))
        before = count
    curve = {"simulations": counts.tolist(), "loocv_gpa": errors}
    return {**learner.precisions(), "loocv_gpa": errors[-1], "curve": curve}
