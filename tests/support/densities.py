"""The density that Step 2 samples, point by point: the operations of the core, for tests and
benchmarks.
"""

import json

import numpy as np
from numpy.typing import ArrayLike

from bayesindent.crystal.elasticity import class_name, constant_names
from bayesindent.inference.measurements import problem_of
from bayesindent.settings.problem import Problem
from bayesindent.surrogate.surrogate import Surrogate
from support.testing_core import Held, inside

__all__ = ["DENSITY", "EXTRACTION", "PRIOR", "Posterior"]

#: What the core makes from a problem and a surrogate.
DENSITY, PRIOR, EXTRACTION = "density", "prior", "extract"


class Posterior(Held):
    """The density of the constants, and of the logarithm of a factor on the sds where that is
    inferred, that a problem asks for.

    `what`: `DENSITY`; `PRIOR`, which leaves the data out; `EXTRACTION`, all of Step 2.
    """

    kind = "posterior"

    def __init__(self, problem: Problem, surrogate: Surrogate, what: str = DENSITY):
        self.problem, self.surrogate = problem, surrogate
        self.symmetry = class_name(problem.settings.problem.symmetry)
        self.names = constant_names(self.symmetry)
        if what == EXTRACTION:
            self.values = surrogate._call(what, problem=problem.handle)
            return
        # Copies of both in the core of the tests.
        (make, asked), (load, content) = problem.__reduce__(), surrogate.__reduce__()
        with inside():
            twins = make(*asked), load(*content)
            self.values = twins[1]._call(what, problem=twins[0].handle)
            del twins
        self._hold(self.values["handle"])

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

    def sample(
        self, *, method: str, samples: int, burn_in: int, chains: int, threads: int, seed: int
    ):
        """Chains: parameters (chains, samples, dimension), log densities (chains, samples),
        acceptance (chains,).
        """
        found = self._call(
            "sample",
            method=method,
            samples=samples,
            burn_in=burn_in,
            chains=chains,
            threads=threads,
            seed=seed,
        )
        return found["draws"], found["log_density"], found["acceptance"]

    def evaluate(self, x: ArrayLike) -> tuple[np.ndarray, np.ndarray]:
        """Log density and log likelihood at points (n, dimension); -inf outside the support."""
        density, likelihood = self._call("evaluate", points=np.atleast_2d(x))["values"]
        return density, likelihood

    def read_theory(self, x: ArrayLike) -> None:
        """Read the theory from now on as finely as Step 2 does near draws (n, dimension)."""
        self._call("read_theory", points=np.atleast_2d(x), threads=1)

    def moduli(
        self, x: ArrayLike, euler_deg: ArrayLike, seed: int = 0
    ) -> tuple[np.ndarray, np.ndarray]:
        """Indentation moduli (m, n) in GPa of n grains at points x (m, dimension), the surrogate's
        error drawn given the data, and one plus the calibration error of each group (m, groups),
        drawn likewise.
        """
        found = self._call(
            "moduli", points=np.atleast_2d(x), euler_deg=np.atleast_2d(euler_deg), seed=seed
        )
        return found["values"], found["factor"]

    def suggest(self, problem: Problem, draws: ArrayLike) -> dict:
        """The document of `next` for the problem's `&next`, from draws (n, dimension) of the
        posterior.
        """
        return json.loads(
            self.surrogate._call("next", problem=problem.handle, points=np.atleast_2d(draws))[
                "text"
            ]
        )
