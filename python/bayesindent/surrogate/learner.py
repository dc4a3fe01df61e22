"""What learns a surrogate: the core's posterior of the coefficients, and the choice of the next candidates, under a handle."""

import json

import numpy as np

from ..core import NativeObject, check, native
from ..surrogate.basis import Basis, columns
from ..surrogate.surrogate import Surrogate

__all__ = ["Learner"]


class Learner(NativeObject):
    """Evidence regression over a basis, and the choice of the next candidates by variance. Crystals are constants (n, k) in GPa."""

    kind = "learner"

    def __init__(self, basis: Basis):
        self.basis = basis
        handle, status, message = native.learner_new(basis.handle)
        check(status, message)
        self._hold(handle)

    def set_candidates(self, constants, euler_deg, variance_of: str = "imse") -> None:
        """Crystals (n, k) at angles (n, 3) in degrees, all of them available, and the rule of the choice, see &design."""
        check(*native.learner_candidates(self._handle, variance_of, *self._columns(constants, euler_deg)))

    def exclude(self, numbers) -> None:
        """These candidates may not be chosen any more."""
        check(*native.learner_exclude(self._handle, np.asarray(numbers, dtype=np.intc)))

    def add(self, constants, euler_deg, modulus_gpa, *, chosen: bool = False) -> None:
        """Learn moduli (n,) in GPa. If the choice asked for them the posterior follows with `fit` or `update`; else it is updated here."""
        if len(modulus_gpa):
            check(*native.learner_add(self._handle, *self._columns(constants, euler_deg), modulus_gpa, int(chosen)))

    def fit(self, alpha: float = 0.0, beta: float = 0.0) -> None:
        """Posterior from all simulations at alpha and beta in units of y (default: those of largest evidence)."""
        check(*native.learner_fit(self._handle, alpha, beta))

    def evidence(self, alpha, beta) -> np.ndarray:
        """Log evidence of the simulations at pairs of alpha and beta (n,)."""
        values, status, message = native.learner_evidence(self._handle, alpha, beta)
        check(status, message)
        return values

    def choose(self, count: int, threads: int = 1) -> tuple[np.ndarray, np.ndarray]:
        """Numbers (count,) of the next candidates, and the variance of y at each when it was chosen."""
        chosen, variance, status, message = native.learner_choose(self._handle, count, threads)
        check(status, message)
        return chosen, variance

    def update(self, exactly: bool = False) -> None:
        """The posterior mean once the moduli of all choices were added; `exactly` if one of them failed."""
        check(*native.learner_update(self._handle, int(exactly)))

    def predict(self, constants, euler_deg) -> np.ndarray:
        """Moduli (n,) in GPa by the posterior mean."""
        modulus, status, message = native.learner_predict(self._handle, *self._columns(constants, euler_deg))
        check(status, message)
        return modulus

    def leave_out(self, groups) -> tuple[np.ndarray, np.ndarray]:
        """Modulus (GPa) of each simulation with its whole group left out, and the error of y over its sd."""
        modulus, z, status, message = native.learner_leave_out(self._handle, np.asarray(groups, dtype=np.intc))
        check(status, message)
        return modulus, z

    def precisions(self) -> dict[str, float]:
        """alpha, beta, fall, and log_evidence of the last `fit`, in units of y."""
        return self._document()

    def values(self, name: str) -> np.ndarray:
        """'mean' or 'prior_width' of the coefficients (n_terms,)."""
        return self._array(name, self.basis.n_terms)

    def covariance(self) -> np.ndarray:
        """Posterior covariance (n_terms, n_terms) of the coefficients."""
        n = self.basis.n_terms
        return self._array("covariance", n * n).reshape(n, n)

    def variances(self, n_candidates: int) -> np.ndarray:
        """Variance of y at each candidate, noise not included."""
        return self._array("variances", n_candidates)

    def surrogate(self, **provenance) -> Surrogate:
        """The surrogate of what was learnt."""
        handle, status, message = native.learner_surrogate(self._handle, json.dumps(provenance, indent=1))
        check(status, message)
        return Surrogate.of(handle)

    def _columns(self, constants, euler_deg) -> tuple[np.ndarray, np.ndarray]:
        return columns(constants, euler_deg, self.basis.symmetry)
