"""An isotropic layer bonded to an isotropic half-space under a paraboloid, to the first order in contact radius over thickness.

Under a contact much smaller than the layer is thick, what the substrate adds to the displacement is uniform: P times the displacement at the
foot of a unit force that the layered half-space adds to the half-space of the layer alone. That is an integral over the
wavenumbers of the surface compliance, which comes from the equations of elasticity layer by layer (transfer matrices).
"""

import numpy as np
from scipy.integrate import quad
from scipy.linalg import expm, schur

__all__ = ["compliance", "thick_layer"]


def transfer(young, nu) -> np.ndarray:
    """d/d(kz) of (U, W, tau/k, sigma/k) for displacements U J1(kr), W J0(kr); GPa."""
    shear = young / (2 * (1 + nu))
    lame = 2 * shear * nu / (1 - 2 * nu)
    normal = lame + 2 * shear
    across = normal - lame**2 / normal
    return np.array([[0, 1, 1 / shear, 0], [-lame / normal, 0, 0, 1 / normal], [across, 0, 0, lame / normal], [0, 0, -1, 0]])


def compliance(wave: float, layer, substrate) -> float:
    """W under a unit normal traction of wavenumber k on a layer of thickness 1, times k; `wave` is k."""
    _, vectors, _ = schur(transfer(*substrate), sort="rhp")
    states = expm(wave * transfer(*layer)) @ vectors[:, :2]
    return float(states[1] @ np.linalg.solve(states[2:], [0.0, 1.0]))


def thick_layer(layer, substrate, thickness_um: float, contact_radius_um: float, radius_um: float) -> tuple[float, float]:
    """Depth (um) and force (mN) at a contact radius; `layer` and `substrate` are (Young's modulus in GPa, Poisson's ratio)."""
    modulus = layer[0] / (1 - layer[1] ** 2)
    # The half-space has 2/modulus at every wavenumber; beyond kt = 9 so has the layer, to 1e-6.
    added = quad(lambda wave: compliance(wave, layer, substrate) - 2 / modulus, 0, 9, epsrel=1e-6, limit=200)[0]
    force = 4 / 3 * modulus * contact_radius_um**3 / radius_um
    return contact_radius_um**2 / radius_um + force * added / (2 * np.pi * thickness_um), force
