"""The paper's regression (Eq. 1-11) in NumPy, with any width of the prior for each term, and the
choice of simulations by variance. It is independent of the core's, which it is tested against.
"""

from dataclasses import dataclass
from itertools import product

import numpy as np
from scipy.optimize import minimize_scalar

__all__ = ["Fit", "Terms", "choose", "fit", "harmonics"]

#: Smallest sd of the noise, GPa, as in the core.
LEAST_NOISE = 0.05

#: Width of a term whose coefficient is hardly penalised, relative to the others.
FREE = 100.0


@dataclass(frozen=True)
class Terms:
    """Terms (n, p) of crystals, and the polynomial degrees (p, constants) of each term."""

    values: np.ndarray
    degrees: np.ndarray
    is_mean: np.ndarray

    @classmethod
    def of(
        cls,
        symmetry: str,
        coordinates: np.ndarray,
        direction: np.ndarray,
        degree: int,
        bandlimit: int,
    ) -> "Terms":
        """Harmonics times products of Legendre polynomials, all orthonormal, for coordinates (n, k)
        in -1 .. 1 and the directions (n, 3) of the indenter in crystal axes.
        """
        k = coordinates.shape[1]
        polynomials = np.stack(
            [
                np.sqrt(2 * q + 1) * np.polynomial.Legendre.basis(q)(coordinates)
                for q in range(degree + 1)
            ]
        )
        indices = np.array(list(product(range(degree + 1), repeat=k)))
        products = np.ones((len(coordinates), len(indices)))
        for j in range(k):
            products *= polynomials[indices[:, j], :, j].T
        angular = harmonics(symmetry, direction, bandlimit)
        values = products[:, :, None] * angular[:, None, :]
        many = angular.shape[1]
        degrees = np.repeat(indices, many, axis=0)
        first = np.tile(np.arange(many) == 0, len(indices))
        return cls(
            values.reshape(len(coordinates), -1), degrees, first & (degrees.sum(axis=1) == 0)
        )

    def width(self, mean_is_free: bool, normalised: bool, decay: float) -> np.ndarray:
        """The prior's sd of each coefficient, relative: Eq. 6 has 1 for all.

        `normalised`: whether the polynomials are; else each factor has the norm 1/sqrt(2q + 1).
        `decay`: ratio of the sds of one total degree and of the one before, from degree 1 on.
        """
        width = np.ones(len(self.degrees))
        if not normalised:
            width /= np.sqrt(2 * self.degrees + 1).prod(axis=1)
        width *= decay ** np.maximum(0, self.degrees.sum(axis=1) - 1)
        if mean_is_free:
            width[self.is_mean] = FREE
        return width


def harmonics(symmetry: str, direction: np.ndarray, bandlimit: int) -> np.ndarray:
    """Orthonormal surface harmonics (n, m) of a class at unit vectors (n, 3): by Gram-Schmidt on
    polynomials that the cubic group leaves as they are, or Legendre polynomials of the declination.
    """
    if symmetry == "hexagonal":
        return np.stack(
            [
                np.sqrt(2 * l_ + 1) * np.polynomial.Legendre.basis(l_)(direction[:, 2])
                for l_ in range(0, bandlimit + 1, 2)
            ],
            axis=1,
        )
    # A quadrature that is exact to degree 2 x 20.
    z, weight = np.polynomial.legendre.leggauss(24)
    turn = 2 * np.pi * np.arange(48) / 48
    flat = np.sqrt(1 - z**2)
    nodes = np.stack(
        [
            np.outer(flat, np.cos(turn)).ravel(),
            np.outer(flat, np.sin(turn)).ravel(),
            np.repeat(z, len(turn)),
        ],
        axis=1,
    )
    root = np.sqrt(np.repeat(weight, len(turn)) / (2 * len(turn)))
    _, upper = np.linalg.qr(root[:, None] * invariants(nodes, bandlimit))
    upper *= np.sign(np.diag(upper))[:, None]
    return np.linalg.solve(upper.T, invariants(direction, bandlimit).T).T


def invariants(vectors: np.ndarray, bandlimit: int) -> np.ndarray:
    """Products of x^4 + y^4 + z^4 and (x y z)^2 to a degree, (n, m), by increasing degree."""
    four, six = (vectors**4).sum(axis=1), (vectors**2).prod(axis=1)
    powers = [
        (4 * i + 6 * j, i, j)
        for i in range(bandlimit // 4 + 1)
        for j in range(bandlimit // 6 + 1)
        if 4 * i + 6 * j <= bandlimit
    ]
    return np.stack([four**i * six**j for _, i, j in sorted(powers)], axis=1)


@dataclass(frozen=True)
class Fit:
    """A regression of largest evidence: coefficients (p,), ln evidence, precisions of prior and
    noise, and the errors (n,) of leaving out each point.
    """

    coefficients: np.ndarray
    log_evidence: float
    alpha: float
    beta: float
    left_out: np.ndarray

    @property
    def loocv(self) -> float:
        """Mean absolute error of leaving one out."""
        return float(np.abs(self.left_out).mean())


def fit(terms: np.ndarray, y: np.ndarray, width: np.ndarray | float = 1.0) -> Fit:
    """Maximise the evidence (Eq. 8, 9) of the terms (n, p) and moduli y (n,) with a prior whose sd
    is width/sqrt(alpha); Eq. 7 at its maximum.
    """
    x = terms * width
    n, p = x.shape
    values, vectors = np.linalg.eigh(x @ x.T if n <= p else x.T @ x)
    values = np.maximum(values, 0.0)
    if n <= p:
        along, shape = vectors.T @ y, vectors
        squares, rest = along**2, 0.0
    else:
        values[values <= p * np.finfo(float).eps * values[-1]] = 0.0
        inverse = np.divide(1.0, np.sqrt(values), out=np.zeros(p), where=values > 0)
        shape = x @ vectors * inverse
        along = shape.T @ y
        squares, rest = along**2, ((y - shape @ along) ** 2).sum()

    def beta_of(ratio: float) -> float:
        mean = ((squares / (1 + values / ratio)).sum() + rest) / n
        return 1 / max(mean, LEAST_NOISE**2)

    def evidence(log_ratio: float) -> float:
        ratio = np.exp(log_ratio)
        beta, scaled = beta_of(ratio), 1 + values / ratio
        quadratic = beta * ((squares / scaled).sum() + rest)
        return -0.5 * (n * np.log(2 * np.pi / beta) + np.log(scaled).sum() + quadratic)

    ends = np.log(values.max()) + np.log([1e-15, 1e5])
    grid = np.linspace(*ends, 240)
    best = int(np.argmax([evidence(value) for value in grid]))
    found = minimize_scalar(
        lambda value: -evidence(value),
        bounds=(grid[max(0, best - 1)], grid[min(239, best + 1)]),
        method="bounded",
        options={"xatol": 1e-9},
    )
    ratio = float(np.exp(found.x))
    beta = beta_of(ratio)
    share = values / (values + ratio)
    residual = y - shape @ (share * along)
    left_out = residual / (1 - shape**2 @ share)
    if n <= p:
        whitened = x.T @ (vectors @ (along / (values + ratio)))
    else:
        whitened = vectors @ (np.sqrt(values) * along / (values + ratio))
    return Fit(whitened * width, -float(found.fun), ratio * beta, beta, left_out)


def choose(
    terms: np.ndarray,
    y: np.ndarray,
    initial: np.ndarray,
    budget: int,
    refit: int,
    width: np.ndarray | float = 1.0,
) -> np.ndarray:
    """Rows of the pool (N, p) in the order in which the paper's sequence takes them: `initial`,
    then the row of largest predictive variance, alpha and beta maximised every `refit` points.
    """
    pool, chosen = terms * width, list(map(int, initial))
    while len(chosen) < budget:
        known = fit(terms[chosen], y[chosen], width)
        x = pool[chosen]
        precision = known.beta * (x.T @ x)
        precision[np.diag_indices_from(precision)] += known.alpha
        covariance = np.linalg.inv(precision)
        variance = np.einsum("ij,ij->i", pool @ covariance, pool)
        variance[chosen] = -np.inf
        for _ in range(min(refit, budget - len(chosen))):
            row = int(np.argmax(variance))
            change = covariance @ pool[row]
            change /= np.sqrt(1 / known.beta + pool[row] @ change)
            covariance -= np.outer(change, change)
            variance -= (pool @ change) ** 2
            variance[row] = -np.inf
            chosen.append(row)
    return np.array(chosen)
