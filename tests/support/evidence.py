"""The evidence of a model with bounds on all constants by nested sampling, for tests and
benchmarks.
"""

import dynesty
import numpy as np

import bayesindent as bi
from support.densities import PRIOR, Posterior

THEORY = bi.Surrogate.load("halfspace")


def nested_log_z(table: dict, bounds: dict, points: int = 200, **settings) -> tuple[float, float]:
    """log Z and its standard error by dynesty with so many live points."""
    settings |= {"surrogate": THEORY, "bounds": bounds, "modulus_kind": "indentation_modulus"}
    posterior, prior = Posterior.of(table, **settings), Posterior.of(table, what=PRIOR, **settings)
    low, high = (np.array(ends, float) for ends in zip(*bounds.values(), strict=True))
    rng = np.random.default_rng(4)
    crystals = low + (high - low) * rng.random((20_000, low.size))
    stable = np.isfinite(prior.evaluate(crystals)[0])
    posterior.read_theory(crystals[stable][:100])
    sampler = dynesty.NestedSampler(
        lambda x: max(-1e30, posterior.evaluate(x)[1][0]),
        lambda u: low + (high - low) * u,
        low.size,
        nlive=points,
        rstate=rng,
    )
    sampler.run_nested(dlogz=0.1, print_progress=False)
    # The prior is uniform over the stable crystals within the bounds.
    return sampler.results.logz[-1] - np.log(stable.mean()), sampler.results.logzerr[-1]


def laplace_log_z(table: dict, bounds: dict, **settings) -> float:
    """log Z as the comparison of models has it."""
    settings |= {"surrogate": THEORY, "bounds": bounds, "modulus_kind": "indentation_modulus"}
    return Posterior.of(table, **settings).diagnose()["log_z"]
