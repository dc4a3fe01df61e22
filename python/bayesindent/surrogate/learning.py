"""What a design has learnt: its simulations, the posterior of the coefficients, and the history of its errors."""

import numpy as np

from ..surrogate.domain import Domain
from ..surrogate.surrogate import Basis, Design, Surrogate, new_design, sd_factor

__all__ = ["FIRST_SD", "Learning"]

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

    def __init__(self, basis: Basis, domain: Domain, prior: str, *, initial: int, budget: int, batch: int, refit: int):
        self.basis, self.domain, self.prior = basis, domain, prior
        self.budget, self.batch, self.every = budget, batch, refit
        #: As few points as the basis needs, and those before alpha and beta are learnt.
        self.least = basis.n_terms if prior == "zero" else MIN_POINTS
        self.first = min(max(initial or self.least, 2), budget)
        self.design = new_design(basis, domain, prior)
        sd_prior, sd_noise = FIRST_SD[prior, basis.coordinates]
        self.evidence = None
        self.last_mean = self.design.mean()
        self.alpha, self.beta, _ = self.design.fit(sd_prior**-2, sd_noise**-2)
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
        terms, scale = self.basis.terms(constants, euler_deg)
        y = self.basis.to_y(modulus, scale)
        if self.n:
            self.next_errors += np.abs(self.basis.to_modulus(self.design.mean() @ terms, scale) - modulus).tolist()
        if chosen:
            self.design.add(terms, y)
        else:
            for column, value in zip(terms.T, y, strict=True):
                self.design.update(column, value)
        self.points += zip(np.asarray(constants).tolist(), np.asarray(euler_deg).tolist(), np.asarray(modulus).tolist(), strict=True)

    def close_batch(self, exactly: bool = False) -> None:
        """At the end of a batch: the posterior, with new alpha and beta when it is time."""
        before = self.history[-1]["simulations"] if self.history else 0
        due = self.n >= self.first and (before < self.first or self.n - before >= self.every or self.n >= self.budget)
        if due and self.n > before:
            self.refit()
        else:
            self.design.settle(exactly)
        self.last_mean = self.design.mean()

    def refit(self) -> None:
        """alpha and beta of largest evidence, and an entry of the history; its angle is that to the coefficients of the batch before."""
        self.alpha, self.beta, self.evidence = self.design.fit()
        errors, mean, previous = self.errors(), self.design.mean(), self.last_mean
        norm = float(np.linalg.norm(mean))
        cosine = mean @ previous / max(norm * np.linalg.norm(previous), 1e-300)
        self.history.append(
            {
                "simulations": self.n,
                "loocv_gpa": errors["loocv_gpa"],
                "leave_crystal_out_gpa": errors["leave_crystal_out_gpa"],
                "next_gpa": float(np.mean(self.next_errors[-WINDOW:])) if self.next_errors else None,
                "alpha": self.alpha,
                "beta": self.beta,
                "log_evidence": self.evidence,
                "norm": norm,
                "angle_deg": float(np.degrees(np.arccos(np.clip(cosine, -1, 1)))),
            }
        )

    def errors(self) -> dict:
        """Leave-one-out and leave-one-crystal-out errors in GPa, and z-scores of the latter."""
        data = self.data
        crystals = np.unique(data["constants"], axis=0, return_inverse=True)[1].ravel()
        loocv, _ = left_out(self.basis, self.design, data, np.arange(self.n))
        loco, z = left_out(self.basis, self.design, data, crystals)
        return {"loocv_gpa": loocv, "leave_crystal_out_gpa": loco, "z": z}

    def surrogate(self, **provenance) -> Surrogate:
        """The surrogate of what was learnt."""
        return Surrogate(
            self.basis,
            self.design.mean(),
            self.design.covariance(),
            anisotropy_cap=self.domain.anisotropy_cap,
            alpha=self.alpha,
            beta=self.beta,
            sd_inflation=sd_factor(self.basis, self.domain, self.prior, self.design, self.errors()["z"]),
            data=self.data,
            provenance={"prior": self.prior, "c_min": list(self.domain.c_min), "c_max": list(self.domain.c_max), **provenance},
        )


def left_out(basis: Basis, design: Design, data: dict, groups) -> tuple[float, np.ndarray]:
    """Mean absolute error in GPa of each simulation with its whole group left out, and the z-scores."""
    _, scale = basis.terms(data["constants"], data["euler_deg"])
    residual, sd = design.leave_out(groups)
    y = basis.to_y(data["modulus_gpa"], scale)
    return float(np.mean(np.abs(basis.to_modulus(y - residual, scale) - data["modulus_gpa"]))), residual / sd
