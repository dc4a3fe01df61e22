"""The posterior of the elastic constants, in the core."""

import json

import numpy as np

from ..core import NativeObject, check, native
from ..crystal.elasticity import class_name, constant_names
from ..settings.problem import Problem
from .measurements import problem_of

__all__ = ["Posterior"]

#: What is made of a problem and a surrogate.
DENSITY, PRIOR, EXTRACTION = 0, 1, 2


class Posterior(NativeObject):
    """The density of the constants, and of the logarithm of a factor on the sds where that is inferred, that a problem asks for.

    `what`: `DENSITY`; `PRIOR`, which leaves the data out; `EXTRACTION`, all of Step 2: chains of both and what is said of them.
    """

    def __init__(self, problem: Problem, surrogate, what: int = DENSITY):
        self.problem, self.surrogate, self.what = problem, surrogate, what
        self.symmetry = class_name(problem.settings.problem.symmetry)
        self.names = constant_names(self.symmetry)
        handle, counts, status, message = native.posterior_new(problem.handle, surrogate.handle, what)
        check(status, message)
        self.dimension, self.grains, self.groups = counts.tolist()
        self._hold(handle)

    @classmethod
    def of(cls, measurements, *, surrogate, what: int = DENSITY, **settings) -> "Posterior":
        """The posterior that `bi.extract` samples with these arguments."""
        return cls(problem_of("Posterior", surrogate, measurements, **settings), surrogate, what)

    def __repr__(self) -> str:
        return f"<Posterior of {', '.join(self.names)} of a {self.symmetry} crystal from {self.grains} grains, with {self.surrogate!r}>"

    def __reduce__(self):
        return type(self), (self.problem, self.surrogate, self.what)

    def values(self, label: str) -> np.ndarray:
        """Numbers of the core by their label: see fortran/pipeline/posterior_objects.f90; the axes in its order."""
        sizes, status, message = native.posterior_sizes(self._handle, label)
        check(status, message)
        sizes = [size for size in sizes if size > 0]
        values, status, message = native.posterior_values(self._handle, label, int(np.prod(sizes)))
        check(status, message)
        return values.reshape(sizes, order="F")

    def document(self, label: str) -> dict:
        """A document: 'extract' or 'next'."""
        _, length, status, message = native.posterior_document(self._handle, label, 0)
        check(status, message)
        text, _, status, message = native.posterior_document(self._handle, label, length)
        check(status, message)
        return json.loads(text)

    def sample(self, *, method: str, samples: int, burn_in: int, chains: int, threads: int, seed: int):
        """Chains: parameters (chains, samples, dimension), log densities (chains, samples), acceptance (chains,)."""
        check(*native.posterior_sample(self._handle, method, burn_in, samples, chains, threads, seed))
        return np.ascontiguousarray(self.values("draws").T), np.ascontiguousarray(self.values("log_density").T), self.values("acceptance")

    def evaluate(self, x) -> tuple[np.ndarray, np.ndarray]:
        """Log density and log likelihood at points (n, dimension); -inf outside the support."""
        points = np.asfortranarray(np.atleast_2d(x).T)
        density, likelihood, inside, status, message = native.posterior_evaluate(self._handle, points)
        check(status, message)
        outside = inside == 0
        density[outside] = likelihood[outside] = -np.inf
        return density, likelihood

    def moduli(self, x, euler_deg, seed: int = 0) -> tuple[np.ndarray, np.ndarray]:
        """Indentation moduli (m, n) in GPa of n grains at points x (m, dimension), the surrogate's error drawn given the data, and one
        plus the calibration error of each group (m, groups), drawn likewise."""
        angles = np.asfortranarray(np.radians(np.atleast_2d(euler_deg)).T)
        values, status = native.posterior_moduli(self._handle, self.groups, np.asfortranarray(np.atleast_2d(x).T), angles, seed)
        check(status, "the moduli of these grains cannot be computed")
        return values[: angles.shape[1]].T, values[angles.shape[1] :].T

    def suggest(self, problem: Problem, draws) -> dict:
        """The document of `next` for the problem's `&next`, from draws (n, dimension) of the posterior."""
        check(*native.posterior_next(problem.handle, self._handle, np.asfortranarray(np.atleast_2d(draws).T)))
        return self.document("next")
