"""An isotropic layer bonded to an isotropic half-space under a paraboloid, to the first order in
contact radius over thickness.

Under a contact much smaller than the layer is thick, what the substrate adds to the displacement is
uniform: P times the displacement at the foot of a unit force that the layered half-space adds to
the half-space of the layer alone. That is an integral over the wavenumbers of the surface
compliance, which comes from the equations of elasticity layer by layer (transfer matrices).
"""

from functools import cache

import numpy as np
from scipy.integrate import quad
from scipy.linalg import expm, schur
from scipy.optimize import brentq

__all__ = ["LayeredContact", "compliance", "random_pairs", "thick_layer"]


def random_pairs(count: int, seed: int = 1) -> list[tuple[float, float, float, float]]:
    """Films: Young's modulus over the substrate's (1/6 to 6), both Poisson's ratios (0.1 to 0.45),
    thickness in contact radii (0.5 to 12).
    """
    rng = np.random.default_rng(seed)
    low, high = (-np.log(6), 0.1, 0.1, np.log(0.5)), (np.log(6), 0.45, 0.45, np.log(12))
    return [
        (np.exp(a), b, c, np.exp(d)) for a, b, c, d in rng.uniform(low, high, (count, 4)).tolist()
    ]


def transfer(young, nu) -> np.ndarray:
    """d/d(kz) of (U, W, tau/k, sigma/k) for displacements U J1(kr), W J0(kr); GPa."""
    shear = young / (2 * (1 + nu))
    lame = 2 * shear * nu / (1 - 2 * nu)
    normal = lame + 2 * shear
    across = normal - lame**2 / normal
    return np.array(
        [
            [0, 1, 1 / shear, 0],
            [-lame / normal, 0, 0, 1 / normal],
            [across, 0, 0, lame / normal],
            [0, 0, -1, 0],
        ]
    )


@cache
def decaying(young, nu) -> np.ndarray:
    """Two states (U, W, tau/k, sigma/k) that vanish at depth."""
    return schur(transfer(young, nu), sort="rhp")[1][:, :2]


def compliance(wave: float, layer, substrate) -> float:
    """W under a unit normal traction of wavenumber k on a layer of thickness 1, times k; `wave` is
    k.
    """
    states = expm(wave * transfer(*layer)) @ decaying(*substrate)
    return float(states[1] @ np.linalg.solve(states[2:], [0.0, 1.0]))


def thick_layer(
    layer, substrate, thickness_um: float, contact_radius_um: float, radius_um: float
) -> tuple[float, float]:
    """Depth (um) and force (mN) at a contact radius; `layer` and `substrate` are (Young's modulus
    in GPa, Poisson's ratio).
    """
    modulus = layer[0] / (1 - layer[1] ** 2)
    # The half-space has 2/modulus at every wavenumber; beyond kt = 9 so has the layer, to 1e-6.
    added = quad(
        lambda wave: compliance(wave, layer, substrate) - 2 / modulus, 0, 9, epsrel=1e-6, limit=200
    )[0]
    force = 4 / 3 * modulus * contact_radius_um**3 / radius_um
    return contact_radius_um**2 / radius_um + force * added / (2 * np.pi * thickness_um), force


class LayeredContact:
    """The exact contact of a rigid, frictionless paraboloid with a layer bonded to a half-space.

    Pressures are the Hankel transform of cosine transforms of chi on (0, a), which vanish outside
    the contact. What remains is a Fredholm equation of the second kind, pi/2 chi(x) + int_0^a
    chi(t) G(x, t) dt = M/2 (h - x^2/R), with G the cosine transform of what the substrate adds to
    the compliance. It is solved at Gauss' points; finite pressure at the edge, chi(a) = 0, gives
    the depth.
    """

    #: Beyond this wavenumber times thickness the compliance is that of the layer, to 1e-7; Gauss'
    #: points of wavenumbers and of radii.
    farthest, waves, points = 12.0, 240, 48

    def __init__(self, layer, substrate, thickness_um: float, radius_um: float = 16.0):
        self.modulus, self.radius = layer[0] / (1 - layer[1] ** 2), radius_um
        nodes, weights = np.polynomial.legendre.leggauss(self.waves)
        scaled = 0.5 * self.farthest * (nodes + 1)
        added = (
            0.5 * self.modulus * np.array([compliance(wave, layer, substrate) for wave in scaled])
            - 1
        )
        self.wave, self.weight = (
            scaled / thickness_um,
            0.5 * self.farthest / thickness_um * weights * added,
        )

    def at(self, contact_radius_um: float) -> tuple[float, float, float]:
        """Depth (um), force (mN) and dP/dh (mN/um) at a contact radius."""
        nodes, weights = np.polynomial.legendre.leggauss(self.points)
        x = np.append(0.5 * contact_radius_um * (nodes + 1), contact_radius_um)
        weights = np.append(0.5 * contact_radius_um * weights, 0.0)
        cosines = np.cos(np.outer(self.wave, x))
        matrix = (
            0.5 * np.pi * np.eye(len(x)) + (cosines * self.weight[:, None]).T @ cosines * weights
        )
        flat, curved = np.linalg.solve(
            matrix, 0.5 * self.modulus * np.stack([np.ones_like(x), x**2 / self.radius], axis=1)
        ).T
        depth = curved[-1] / flat[-1]
        return depth, 2 * np.pi * weights @ (depth * flat - curved), 2 * np.pi * weights @ flat

    def curve(self, depth_um) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Contact radius (um), force (mN) and dP/dh (mN/um) at depths."""
        radius = np.array(
            [
                brentq(
                    lambda a, h=h: self.at(a)[0] - h,
                    0.2 * (h * self.radius) ** 0.5,
                    3 * (h * self.radius) ** 0.5,
                )
                for h in depth_um
            ]
        )
        found = np.array([self.at(a) for a in radius])
        return radius, found[:, 1], found[:, 2]

    def modulus_of_curve(self, depth_um) -> float:
        """M by least squares of P against h^1.5 through the origin, over the depths whose contact
        radius spans five elements.
        """
        depth = np.asarray(depth_um)
        depth = depth[
            (depth * self.radius) ** 0.5 >= (1 - 1e-9) * 5 / 9.5 * (depth[-1] * self.radius) ** 0.5
        ]
        return 0.75 / self.radius**0.5 * (self.curve(depth)[1] @ depth**1.5) / (depth**3).sum()
