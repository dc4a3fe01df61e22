"""The density that Step 2 samples, point by point: the operations of the core, for tests and
benchmarks.
"""

from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from bayesindent.crystal.elasticity import class_name, constant_names
from bayesindent.inference.measurements import problem_of
from bayesindent.settings.problem import Problem
from bayesindent.step_2 import Analysis
from bayesindent.surrogate.surrogate import Surrogate
from support.testing_core import Held, inside

__all__ = ["DENSITY", "EXTRACTION", "PRIOR", "Posterior"]

#: What the core makes from a problem and a surrogate.
DENSITY, PRIOR, EXTRACTION = "density", "prior", "extract"


class _Problem(Held):
    """A problem in the core of the tests."""

    kind = "problem"

    def __init__(self, problem: Problem):
        self._hold(problem.__dict__.pop("_handle"))


class _Density(Held):
    """The posterior of an analysis in the core of the tests, point by point."""

    kind = "analysis"

    def __init__(self, problem: Problem, surrogate: Surrogate):
        made_of: list[Any] = [problem.__reduce__(), surrogate.__reduce__()]
        with inside():
            inner, model = (make(*arguments) for make, arguments in made_of)
            handle = model._call("analysis", problem=inner.handle)["handle"]
            # The core's analysis refers to the problem.
            self._problem = _Problem(inner)
            del inner, model
        self._hold(handle)

    def prepare(self, prior_only: bool = False) -> dict:
        """Set up the posterior without sampling it, or the prior alone, and return the numbers of
        `grains` and of their `groups`, the names of the `nuisances`, whether their priors
        `are_normal` or uniform, and `values`, the means and sds or the bounds of these.
        """
        return self._call("prepare", prior_only=prior_only)

    def log_density(self, points: ArrayLike) -> tuple[np.ndarray, np.ndarray]:
        """Log density and log likelihood (n,) at points (n, parameters); -inf outside the support.
        The parameters are the constants in GPa, and the logarithm of the factor on the sds where
        that is inferred.
        """
        density, likelihood = self._call("evaluate", points=np.atleast_2d(points))["values"]
        return density, likelihood

    def sample(self, method: str = "ensemble", **run: int) -> tuple[np.ndarray, ...]:
        """Chains by another `&sampler method`, with samples, burn_in, chains, threads and seed:
        parameters (chains, samples, parameters), log densities (chains, samples), acceptance
        (chains,).
        """
        found = self._call("sample", method=method, **run)
        return found["draws"], found["log_density"], found["acceptance"]

    def diagnose(self) -> dict:
        """Other models of the measurements without chains: `rivals` ('group: explanation', the best
        first), their `log_odds`; `log_z` of the stated model; `p` and `factor` of the misfit, and
        `order_odds` of any order of the orientations.
        """
        found = self._call("diagnose")
        return found | {"rivals": found["rivals"].splitlines()}

    def moduli(
        self, points: ArrayLike, euler_deg: ArrayLike, seed: int = 0
    ) -> tuple[np.ndarray, np.ndarray]:
        """Indentation moduli (m, n) in GPa of n grains at points (m, parameters), the surrogate's
        error drawn given the data, and one plus the calibration error of each group (m, groups),
        drawn likewise.
        """
        points, euler_deg = np.atleast_2d(points), np.atleast_2d(euler_deg)
        found = self._call("moduli", points=points, euler_deg=euler_deg, seed=seed)
        return found["values"], found["factor"]

    def read_theory(self, points: ArrayLike) -> None:
        """Read the theory from now on as finely as Step 2 does near points (n, parameters)."""
        self._call("read_theory", points=np.atleast_2d(points), threads=1)


class Posterior:
    """The density of the constants, and of the logarithm of a factor on the sds where that is
    inferred, that a problem asks for.

    `what`: `DENSITY`; `PRIOR`, which leaves the data out; `EXTRACTION`, all of Step 2.
    """

    def __init__(self, problem: Problem, surrogate: Surrogate, what: str = DENSITY):
        self.problem, self.surrogate = problem, surrogate
        self.symmetry = class_name(problem.settings.problem.symmetry)
        self.names = constant_names(self.symmetry)
        if what == EXTRACTION:
            self.values = Analysis(problem, surrogate)._call("infer")
            return
        self.analysis = _Density(problem, surrogate)
        self.values = self.analysis.prepare(what == PRIOR)
        self.evaluate, self.moduli = self.analysis.log_density, self.analysis.moduli
        self.sample, self.read_theory = self.analysis.sample, self.analysis.read_theory
        self.diagnose = self.analysis.diagnose

    @classmethod
    def of(
        cls, measurements, *, surrogate: Surrogate, what: str = DENSITY, **settings
    ) -> "Posterior":
        """The posterior that `bi.extract` samples with these arguments; the measurements are exact
        unless `settings` state a technique.
        """
        settings = {"technique": "exact"} | settings
        return cls(problem_of("Posterior", surrogate, measurements, **settings), surrogate, what)

    @property
    def groups(self) -> int:
        """The number of groups of grains that share an error."""
        return self.values["groups"]

    def suggest(self, problem: Problem, draws: ArrayLike) -> dict:
        """The document of `next` for the problem's `&next`, from draws (n, dimension) of the
        posterior.
        """
        return Analysis(problem, self.surrogate).document("next", points=np.atleast_2d(draws))
