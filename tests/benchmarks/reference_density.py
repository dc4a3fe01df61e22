"""Prior and density of the reference posteriors, in coordinates of log K."""

import math

import numpy as np
from scipy import stats
from scipy.linalg import logm

from support.reference_theory import FieldTheory, orthonormal_space

#: The default prior as documented: contrast log(3K/2G), anisotropic coordinates, scale tr log K/6.
PRIOR = {
    "contrast_mean": 1.07,
    "contrast_sd": 0.6,
    "anisotropy_dof": 3,
    "anisotropy_scale": 0.6,
    "scale_factor_of_one_sd": 5.0,
    "assumed_nu": 0.3,
}


class LogPosterior:
    """Log density of coordinates x (walkers, k) of log K in an orthonormal basis of the class."""

    def __init__(self, symmetry: str, theory: FieldTheory, modulus: np.ndarray, sd: np.ndarray):
        self.theory, self.modulus, self.sd = theory, modulus, sd
        self.basis, self.to_constants = orthonormal_space(symmetry)
        # Unit vectors of the isotropic part in these coordinates: log 3K along the one, root 5 log
        # 2G along the other.
        dilatation = np.zeros((6, 6))
        dilatation[:3, :3] = 1 / 3
        self.axes = np.array(
            [
                (self.basis * part).sum((1, 2))
                for part in (dilatation, (np.eye(6) - dilatation) / np.sqrt(5))
            ]
        )
        k = len(self.basis) - 2
        self.anisotropy = stats.multivariate_t(
            shape=PRIOR["anisotropy_scale"] ** 2 / k * np.eye(k), df=PRIOR["anisotropy_dof"]
        )
        nu = PRIOR["assumed_nu"]
        young = (1 - nu**2) * modulus.mean()
        self.middle = (np.log(young / (1 - 2 * nu)) + 5 * np.log(young / (1 + nu))) / 6

    def coordinates(self, constants: np.ndarray) -> np.ndarray:
        """Coordinates (walkers, k) of constants of stable crystals."""
        k = np.linalg.solve(self.to_constants, constants.T).T
        values, vectors = np.linalg.eigh(np.einsum("wk,kij->wij", k, self.basis))
        return np.einsum(
            "wij,wj,wkj,aik->wa", vectors, np.log(values), vectors, self.basis, optimize=True
        )

    def crystals(self, x: np.ndarray) -> np.ndarray:
        """Constants (walkers, k) of coordinates."""
        count, k = x.shape
        values, vectors = np.linalg.eigh((x @ self.basis.reshape(k, 36)).reshape(count, 6, 6))
        stiff = (vectors * np.exp(values)[:, None, :]) @ np.swapaxes(vectors, 1, 2)
        return stiff.reshape(count, 36) @ self.basis.reshape(k, 36).T @ self.to_constants.T

    def log_prior(self, x: np.ndarray) -> np.ndarray:
        """Log density (walkers,) of coordinates; it is stated in log K, so that there is no
        Jacobian.
        """
        isotropic = x @ self.axes.T
        log_3k, log_2g = isotropic[:, 0], isotropic[:, 1] / np.sqrt(5)
        density = stats.norm(PRIOR["contrast_mean"], PRIOR["contrast_sd"]).logpdf(log_3k - log_2g)
        density += stats.norm(self.middle, np.log(PRIOR["scale_factor_of_one_sd"])).logpdf(
            (log_3k + 5 * log_2g) / 6
        )
        # This one depends on the distance alone.
        distance = np.sqrt(((x - isotropic @ self.axes) ** 2).sum(1))
        return density + self.anisotropy.logpdf(np.outer(distance, np.eye(1, x.shape[1] - 2)))

    def draw_prior(self, rng: np.random.Generator, count: int = 1) -> np.ndarray:
        """Coordinates (count, k) drawn from the prior."""
        contrast = rng.normal(PRIOR["contrast_mean"], PRIOR["contrast_sd"], count)
        scale = rng.normal(self.middle, np.log(PRIOR["scale_factor_of_one_sd"]), count)
        isotropic = np.column_stack([scale + 5 / 6 * contrast, np.sqrt(5) * (scale - contrast / 6)])
        rest = np.linalg.svd(self.axes)[2][2:]
        return (
            isotropic @ self.axes
            + np.atleast_2d(self.anisotropy.rvs(count, random_state=rng)).reshape(count, -1) @ rest
        )

    def log_likelihood(self, constants: np.ndarray) -> np.ndarray:
        """Normal with the sds of the data, without its constant."""
        return -0.5 * (((self.theory.moduli(constants) - self.modulus) / self.sd) ** 2).sum(1)

    def __call__(self, x: np.ndarray) -> np.ndarray:
        with np.errstate(all="ignore"):
            likelihood = self.log_likelihood(self.crystals(x))
        return self.log_prior(x) + np.where(np.isfinite(likelihood), likelihood, -np.inf)


def plain_log_prior(k: np.ndarray, constants: int, mean_modulus: float) -> float:
    """The default prior's log density at one Kelvin matrix, term by term from its documentation."""
    log_k = logm(k)
    log_3k = log_k[:3, :3].sum() / 3
    log_2g = (np.trace(log_k) - log_3k) / 5
    isotropic = log_2g * np.eye(6)
    isotropic[:3, :3] += (log_3k - log_2g) / 3
    distance, free = np.linalg.norm(log_k - isotropic), constants - 2
    young = (1 - 0.3**2) * mean_modulus
    solid = (math.log(young / 0.4) + 5 * math.log(young / 1.3)) / 6
    normal = -0.5 * (
        ((log_3k - log_2g - 1.07) / 0.6) ** 2 + ((np.trace(log_k) / 6 - solid) / math.log(5)) ** 2
    )
    normal -= math.log(2 * math.pi * 0.6 * math.log(5))
    student = (
        math.lgamma((3 + free) / 2)
        - math.lgamma(1.5)
        - free / 2 * math.log(3 * math.pi * 0.36 / free)
    )
    return normal + student - (3 + free) / 2 * math.log1p(distance**2 * free / (3 * 0.36))
