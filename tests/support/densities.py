"""The density that Step 2 samples, point by point: the operations of the core, for tests and
benchmarks.
"""

import numpy as np
from numpy.typing import ArrayLike

from bayesindent.crystal.elasticity import class_name, constant_names
from bayesindent.inference.analysis import Analysis
from bayesindent.inference.measurements import problem_of
from bayesindent.settings.problem import Problem
from bayesindent.surrogate.surrogate import Surrogate

__all__ = ["DENSITY", "EXTRACTION", "PRIOR", "Posterior"]

#: What the core makes from a problem and a surrogate.
DENSITY, PRIOR, EXTRACTION = "density", "prior", "extract"


class Posterior:
    """The density of the constants, and of the logarithm of a factor on the sds where that is
    inferred, that a problem asks for.

    `what`: `DENSITY`; `PRIOR`, which leaves the data out; `EXTRACTION`, all of Step 2.
    """

    def __init__(self, problem: Problem, surrogate: Surrogate, what: str = DENSITY):
        self.problem, self.surrogate = problem, surrogate
        self.symmetry = class_name(problem.settings.problem.symmetry)
        self.names = constant_names(self.symmetry)
        self.analysis = Analysis(problem, surrogate)
        if what == EXTRACTION:
            self.values = self.analysis._call("infer")
        else:
            self.values = self.analysis.prepare(what == PRIOR)
        self.evaluate, self.moduli = self.analysis.log_density, self.analysis.moduli
        self.sample = self.analysis.sample

    @classmethod
    def of(
        cls, measurements, *, surrogate: Surrogate, what: str = DENSITY, **settings
    ) -> "Posterior":
        """The posterior that `bi.extract` samples with these arguments."""
        return cls(problem_of("Posterior", surrogate, measurements, **settings), surrogate, what)

    @property
    def groups(self) -> int:
        """The number of groups of grains that share an error."""
        return self.values["groups"]

    def read_theory(self, x: ArrayLike) -> None:
        """Read the theory from now on as finely as Step 2 does near draws (n, dimension)."""
        self.analysis._call("read_theory", points=np.atleast_2d(x), threads=1)

    def suggest(self, problem: Problem, draws: ArrayLike) -> dict:
        """The document of `next` for the problem's `&next`, from draws (n, dimension) of the
        posterior.
        """
        return Analysis(problem, self.surrogate).document("next", points=np.atleast_2d(draws))
