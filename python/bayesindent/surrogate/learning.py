"""What a design has learnt: its simulations, the posterior of the coefficients, and the history of its errors."""

import numpy as np

from ..surrogate.basis import Basis
from ..surrogate.learner import Learner

__all__ = ["FIRST_SD", "Learning", "left_out"]

#: alpha and beta until they are learnt, by prior and coordinates: sd of a coefficient of weight 1 and of the noise, in units of y.
FIRST_SD = {
    ("zero", "box"): (100.0, 1.0),
    ("zero", "dimensionless"): (1.0, 0.01),
    ("theory", "box"): (30.0, 0.5),
    ("theory", "dimensionless"): (0.1, 0.003),
}

#: Points of an informative prior before alpha and beta are first learnt from the data.
MIN_POINTS = 8

#: Points over which the error of the next points is averaged.
WINDOW = 20


class Learning:
    """The regression of one build over the simulations so far.

    initial, budget, batch, refit: of &design; alpha and beta are learnt after the first points and then every `refit`.
    """

    def __init__(self, basis: Basis, prior: str, *, initial: int, budget: int, batch: int, refit: int):
        self.basis, self.prior = basis, prior
        self.budget, self.batch, self.every = budget, batch, refit
        #: As few points as the basis needs, and those before alpha and beta are learnt.
        self.least = basis.n_terms if prior == "zero" else MIN_POINTS
        self.first = min(max(initial or self.least, 2), budget)
        self.learner = Learner(basis, prior)
        self.last_mean = self.learner.values("mean")
        self.learner.fit(*(sd**-2 for sd in FIRST_SD[prior, basis.coordinates]))
        self.points, self.next_errors, self.history = [], [], []

    @property
    def n(self) -> int:
        """Simulations so far."""
        return len(self.points)

    @property
    def data(self) -> dict[str, np.ndarray]:
        """Constants (n, k) in GPa, angles (n, 3) in degrees and moduli (n,) in GPa of the simulations so far."""
        return dict(zip(("constants", "euler_deg", "modulus_gpa"), map(np.array, zip(*self.points, strict=True)), strict=True))

    def batch_end(self) -> int:
        """The number of points at which the batch that is under way ends."""
        if self.n < self.first:
            return self.first
        return min(self.first + self.batch * ((self.n - self.first) // self.batch + 1), self.budget)

    def learn(self, constants, euler_deg, modulus, *, chosen: bool) -> None:
        """Take observations in; if they were chosen by the design, the covariance has them already."""
        if not len(modulus):
            return
        if self.n:
            self.next_errors += np.abs(self.learner.predict(constants, euler_deg) - modulus).tolist()
        self.learner.add(constants, euler_deg, modulus, chosen=chosen)
        self.points += zip(np.asarray(constants).tolist(), np.asarray(euler_deg).tolist(), np.asarray(modulus).tolist(), strict=True)

    def close_batch(self, exactly: bool = False) -> None:
        """At the end of a batch: the posterior, with new alpha and beta when it is time."""
        before = self.history[-1]["simulations"] if self.history else 0
        due = self.n >= self.first and (before < self.first or self.n - before >= self.every or self.n >= self.budget)
        if due and self.n > before:
            self.refit()
        else:
            self.learner.update(exactly)
        self.last_mean = self.learner.values("mean")

    def refit(self) -> None:
        """alpha and beta of largest evidence, and an entry of the history; its angle is that to the coefficients of the batch before."""
        self.learner.fit()
        mean, previous = self.learner.values("mean"), self.last_mean
        crystals = np.unique(self.data["constants"], axis=0, return_inverse=True)[1].ravel()
        norm = float(np.linalg.norm(mean))
        cosine = mean @ previous / max(norm * np.linalg.norm(previous), 1e-300)
        self.history.append(
            {
                "simulations": self.n,
                "loocv_gpa": left_out(self.learner, self.data, np.arange(self.n)),
                "leave_crystal_out_gpa": left_out(self.learner, self.data, crystals),
                "next_gpa": float(np.mean(self.next_errors[-WINDOW:])) if self.next_errors else None,
                **self.learner.precisions(),
                "norm": norm,
                "angle_deg": float(np.degrees(np.arccos(np.clip(cosine, -1, 1)))),
            }
        )


def left_out(learner: Learner, data: dict, groups) -> float:
    """Mean absolute error in GPa of each simulation with its whole group left out."""
    return float(np.mean(np.abs(learner.leave_out(groups)[0] - data["modulus_gpa"])))
