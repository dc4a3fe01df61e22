"""Which grain to measure next: what one more modulus, over all orientations, is expected to add to a posterior."""

from os import PathLike

import numpy as np

from ..core import warn_of
from ..surrogate.surrogate import Surrogate
from .extract import extract, loaded
from .measurements import problem_of
from .posterior import Posterior

__all__ = ["next_grain"]


def next_grain(measurements, *, surrogate: Surrogate | str | PathLike = "halfspace", result=None, **settings) -> dict:
    """Orientations worth measuring next, ranked, each given those above it.

    `measurements`, `surrogate` and `settings` are those of `extract`, whose `result` may be given, and the variables of `&next`: `target`: 'all' (gain: information on
    the constants in nats), a quantity of the vocabulary of `&knowledge`, or a product of powers, of which the logarithm is to be known
    (gain: the share of the variance that is expected to go); `sd_gpa`: of the next measurement, 0: the median of those made; `count`.
    """
    surrogate = loaded(surrogate)
    problem = problem_of("bi.next_grain", surrogate, measurements, **settings)
    if result is None:
        result = extract(measurements, surrogate=surrogate, **settings)
    draws = np.stack([values.values.ravel() for values in result.posterior.data_vars.values()], axis=1)
    document = Posterior(problem, surrogate).suggest(problem, draws)
    warn_of(document)
    return document
