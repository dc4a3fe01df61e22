"""Prior and density of the reference posteriors: flat in the constants, in coordinates of log K."""

import numpy as np
from reference_theory import FieldTheory, orthonormal_space

PRIOR = {"poisson_min": 0.05, "poisson_max": 0.48, "log_anisotropy_max": 2.5, "young_factor": 3.0, "assumed_nu": 0.3}


class LogPosterior:
    """Log density of coordinates x (walkers, k) of log K in an orthonormal basis of the class, flat prior on the constants."""

    def __init__(self, symmetry: str, theory: FieldTheory, modulus: np.ndarray, sd: np.ndarray):
        self.theory, self.modulus, self.sd = theory, modulus, sd
        self.basis, self.to_constants = orthonormal_space(symmetry)
        self.every = self.basis.shape == (21, 6, 6)  # all symmetric matrices
        young = (1 - PRIOR["assumed_nu"] ** 2) * modulus.mean()
        self.young = young / PRIOR["young_factor"], young * PRIOR["young_factor"]

    def coordinates(self, constants: np.ndarray) -> np.ndarray:
        """Coordinates (walkers, k) of constants of stable crystals."""
        k = np.linalg.solve(self.to_constants, constants.T).T
        values, vectors = np.linalg.eigh(np.einsum("wk,kij->wij", k, self.basis))
        return np.einsum("wij,wj,wkj,aik->wa", vectors, np.log(values), vectors, self.basis, optimize=True)

    def crystals(self, x: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Constants (walkers, k) and the log prior (walkers,): the log Jacobian |dc/dx| up to a constant, -inf outside."""
        count, k = x.shape
        log_k = (x @ self.basis.reshape(k, 36)).reshape(count, 6, 6)
        values, vectors = np.linalg.eigh(log_k)
        grown = np.exp(values)
        stiff = (vectors * grown[:, None, :]) @ np.swapaxes(vectors, 1, 2)
        constants = stiff.reshape(count, 36) @ self.basis.reshape(k, 36).T @ self.to_constants.T
        inside = self.admissible(log_k, values, vectors)
        log_prior = np.full(count, -np.inf)
        log_prior[inside] = self.log_jacobian(values[inside], vectors[inside])
        return constants, log_prior

    def admissible(self, log_k: np.ndarray, values: np.ndarray, vectors: np.ndarray) -> np.ndarray:
        """Which crystals the prior admits; all of them are stable, since K is an exponential."""
        volumetric = (vectors[:, 0] + vectors[:, 1] + vectors[:, 2]) ** 2 / 3  # squares of the components along (1, 1, 1, 0, 0, 0) / root 3
        uku, usu = (volumetric * np.exp(values)).sum(1), (volumetric * np.exp(-values)).sum(1)
        bulk = (uku / 3 + 1 / (3 * usu)) / 2
        shear = ((np.exp(values).sum(1) - uku) / 10 + 2.5 / (np.exp(-values).sum(1) - usu)) / 2
        young, poisson = 9 * bulk * shear / (3 * bulk + shear), (3 * bulk - 2 * shear) / (6 * bulk + 2 * shear)
        spherical = (volumetric * values).sum(1)
        deviatoric = values.sum(1) - spherical
        squares = (log_k**2).sum((1, 2)) - spherical**2 - deviatoric**2 / 5
        return (
            (squares <= PRIOR["log_anisotropy_max"] ** 2)
            & (poisson >= PRIOR["poisson_min"]) & (poisson <= PRIOR["poisson_max"])
            & (young >= self.young[0]) & (young <= self.young[1])
        )  # fmt: skip

    def log_jacobian(self, values: np.ndarray, vectors: np.ndarray) -> np.ndarray:
        """Log determinant of the derivative of exp at log K, restricted to the class: divided differences in the eigenvectors' frame."""
        mean, half = (values[:, :, None] + values[:, None, :]) / 2, (values[:, :, None] - values[:, None, :]) / 2
        small = np.abs(half) < 1e-4
        safe = np.where(small, 1, half)
        quotient = np.where(small, 1 + half * half / 6, np.sinh(safe) / safe)
        log_difference = mean + np.log(quotient)
        if self.every:
            upper = np.triu_indices(6)
            return log_difference[:, upper[0], upper[1]].sum(1)
        turned = np.swapaxes(vectors, 1, 2)[:, None] @ self.basis @ vectors[:, None]
        turned = (turned * np.exp(log_difference / 2)[:, None]).reshape(len(values), len(self.basis), 36)
        return np.linalg.slogdet(turned @ np.swapaxes(turned, 1, 2))[1]

    def log_likelihood(self, constants: np.ndarray) -> np.ndarray:
        """Normal with the sds of the data, without its constant."""
        return -0.5 * (((self.theory.moduli(constants) - self.modulus) / self.sd) ** 2).sum(1)

    def __call__(self, x: np.ndarray) -> np.ndarray:
        constants, result = self.crystals(x)
        inside = np.isfinite(result)
        if inside.any():
            with np.errstate(all="ignore"):
                likelihood = self.log_likelihood(constants[inside])
            result[inside] += np.where(np.isfinite(likelihood), likelihood, -np.inf)
        return result


def plainly_admissible(k: np.ndarray, young_range: tuple[float, float]) -> bool:
    """The prior's limits of one Kelvin matrix, term by term."""
    values, vectors = np.linalg.eigh(k)
    if values.min() <= 0:
        return False
    s = np.linalg.inv(k)
    voigt_k, voigt_g = k[:3, :3].sum() / 9, (3 * np.trace(k[:3, :3]) - k[:3, :3].sum() + 3 * np.trace(k[3:, 3:])) / 30
    reuss_k, reuss_g = 1 / s[:3, :3].sum(), 15 / (6 * np.trace(s[:3, :3]) - 2 * s[:3, :3].sum() + 6 * np.trace(s[3:, 3:]))
    bulk, shear = (voigt_k + reuss_k) / 2, (voigt_g + reuss_g) / 2
    young, poisson = 9 * bulk * shear / (3 * bulk + shear), (3 * bulk - 2 * shear) / (2 * (3 * bulk + shear))
    log_k = vectors @ np.diag(np.log(values)) @ vectors.T
    spherical = np.zeros((6, 6))
    spherical[:3, :3] = 1 / 3
    deviatoric = np.eye(6) - spherical
    rest = log_k - (log_k * spherical).sum() * spherical - (log_k * deviatoric).sum() / 5 * deviatoric
    within = PRIOR["poisson_min"] <= poisson <= PRIOR["poisson_max"] and young_range[0] <= young <= young_range[1]
    return bool(within and np.linalg.norm(rest) <= PRIOR["log_anisotropy_max"])
