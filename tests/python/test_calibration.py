"""Simulation-based calibration in short: the cases of `bench calibration` but the longest.

Where all is right the ranks of truths among draws of their posteriors are uniform, and so their
normal scores are standard normal (Cook, Gelman and Rubin, J. Comput. Graph. Stat. 15, 675, 2006). A
few data sets tell a wrong place by the mean of these, a wrong width by their sum of squares.
"""

import numpy as np
import pytest
from scipy import stats

from benchmarks.bench_calibration import CASES, Study
from benchmarks.bench_studies import holm

#: Data sets of a case, by crystal: those of more constants take longer.
DATA_SETS = {"copper": 10, "Zn": 10, "quartz": 6, "rutile": 6, "forsterite": 4}


#: Ten seconds and more a data set.
LONGEST = ("correction, orthorhombic",)


def least_p(name, change=None, times=1, **settings):
    """The least p-value after Holm's correction of a case, of which `change` may alter the data and
    `settings` the posterior.

    `times` as many data sets as usual.
    """
    study = Study(name, 3)
    study.settings |= settings
    if change:
        exact = study.measure
        study.measure = lambda truth: change(*exact(truth))
    # With the default prior the weighted ranks come first.
    sets = range(times * DATA_SETS[CASES[name][0]])
    ranks = [
        study.ranks(threads=1, seed=k + 1, samples=1000, chains=1)[: len(study.labels)]
        for k in sets
    ]
    p_values = {}
    for label, scores in zip(study.labels, stats.norm.ppf(ranks).T, strict=True):
        width = stats.chi2(len(scores)).cdf((scores**2).sum())
        p_values[label, "place"] = 2 * stats.norm.sf(abs(scores.sum()) / np.sqrt(len(scores)))
        p_values[label, "width"] = 2 * min(width, 1 - width)
    return min(holm(p_values).values())


#: Of `./bayesindent test`; the others are long.
SHORT = ("cubic", "laboratory, cubic")


@pytest.mark.parametrize(
    "name",
    [
        pytest.param(name, marks=[] if name in SHORT else pytest.mark.long)
        for name in CASES
        if name not in LONGEST
    ],
)
def test_ranks_are_uniform(name):
    assert least_p(name) > 1e-3


@pytest.mark.long
def test_errors_three_times_as_large_as_stated_are_found():
    assert (
        least_p("cubic", lambda table, drawn: (table | {"sd_gpa": table["sd_gpa"] / 3}, drawn))
        < 1e-3
    )


@pytest.mark.long
def test_a_correction_that_is_taken_for_exact_is_found():
    assert least_p("correction, cubic", times=3, surrogate_variance="none") < 1e-3
