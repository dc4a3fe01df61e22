"""Surface waves by Stroh's eigenvalue problem, in numpy alone."""

import numpy as np

__all__ = ["Waves", "bunge", "rayleigh", "slowest_bulk", "tensor"]

VOIGT = np.array([[0, 5, 4], [5, 1, 3], [4, 3, 2]])


def tensor(c):
    """C_ijkl of a stiffness (6, 6)."""
    return c[VOIGT[:, :, None, None], VOIGT[None, None, :, :]]


def bunge(euler_deg):
    """The rotation from sample to crystal axes."""

    def turn(angle, i, j):
        g = np.eye(3)
        g[[i, j], [i, j]], g[i, j], g[j, i] = np.cos(angle), np.sin(angle), -np.sin(angle)
        return g

    phi1, phi, phi2 = np.radians(euler_deg)
    return turn(phi2, 0, 1) @ turn(phi, 1, 2) @ turn(phi1, 0, 1)


def directions(euler_deg, propagation_deg):
    """Of propagation, and the normal, in crystal axes."""
    g, angle = bunge(euler_deg), np.radians(propagation_deg)
    return np.cos(angle) * g[:, 0] + np.sin(angle) * g[:, 1], g[:, 2]


def acoustic(t, a, b):
    return np.einsum("k,kijl,l->ij", a, t, b)


def slowest_bulk(c, euler_deg, propagation_deg):
    """rho v^2 of the slowest bulk wave along the direction, GPa."""
    m, _ = directions(euler_deg, propagation_deg)
    return np.linalg.eigvalsh(acoustic(tensor(c), m, m))[0]


def limiting(t, m, n):
    """Least rho v^2 at which a bulk wave runs along the surface, by angles and golden sections,
    GPa.
    """

    def value(phi):
        a = np.cos(phi) * m + np.sin(phi) * n
        return np.linalg.eigvalsh(acoustic(t, a, a))[0] / np.cos(phi) ** 2

    angles = np.linspace(-1.5, 1.5, 301)
    values = [value(phi) for phi in angles]
    least = np.inf
    for k in range(1, 300):
        if values[k] > min(values[k - 1], values[k + 1]):
            continue
        low, high, golden = angles[k - 1], angles[k + 1], (np.sqrt(5) - 1) / 2
        for _ in range(60):
            a, b = high - golden * (high - low), low + golden * (high - low)
            low, high = (low, b) if value(a) < value(b) else (a, high)
        least = min(least, value(low))
    return least


def impedance(t, m, n, modulus):
    """-i B A^-1 of the three partial waves that decay with the depth; None above the limiting
    speed.
    """
    q, r, s = (
        acoustic(t, m, m) - modulus * np.eye(3),
        acoustic(t, m, n),
        np.linalg.inv(acoustic(t, n, n)),
    )
    p, waves = np.linalg.eig(np.block([[-s @ r.T, s], [r @ s @ r.T - q, -r @ s]]))
    decaying = p.imag > 1e-9
    if decaying.sum() != 3:
        return None
    z = -1j * waves[3:, decaying] @ np.linalg.inv(waves[:3, decaying])
    return (z + z.conj().T) / 2


def rayleigh(c, euler_deg, propagation_deg):
    """rho v^2 (GPa) where the least eigenvalue of the impedance is zero, by bisection, and the
    normal share of the mode; NaN: there is none.
    """
    t, (m, n) = tensor(np.asarray(c)), directions(euler_deg, propagation_deg)
    sign = np.sign(np.trace(impedance(t, m, n, 0.0)).real)
    low, high = 0.0, limiting(t, m, n) * (1 - 1e-8)

    def least(modulus):
        z = impedance(t, m, n, modulus)
        return (
            (-np.inf, None)
            if z is None
            else (lambda found: (found[0][0], found[1][:, 0]))(np.linalg.eigh(sign * z))
        )

    if least(high)[0] > 0:
        return np.nan, np.nan
    for _ in range(55):
        middle = (low + high) / 2
        low, high = (low, middle) if least(middle)[0] < 0 else (middle, high)
    return low, abs(least(low)[1] @ n) ** 2


class Waves:
    """rho v^2 (GPa) of detected waves of many directions of a crystal at once, by the Illinois rule
    on the determinant of the impedance.
    """

    def __init__(self, euler_deg, propagation_deg):
        self.m, self.n = np.swapaxes(
            [directions(*row) for row in zip(euler_deg, propagation_deg, strict=True)], 0, 1
        )

    def __call__(self, c):
        t = tensor(c)
        q, r, s = (
            np.einsum("dk,kijl,dl->dij", a, t, b)
            for a, b in ((self.m, self.m), (self.m, self.n), (self.n, self.n))
        )
        inverse, top = np.linalg.inv(s), np.linalg.eigvalsh(q)[:, 0]
        across = inverse @ np.swapaxes(r, 1, 2)

        def determinant(modulus):
            """-1 above the limiting speed."""
            third = r @ across - q + modulus[:, None, None] * np.eye(3)
            p, waves = np.linalg.eig(
                np.block([[-across, inverse], [third, -np.swapaxes(across, 1, 2)]])
            )
            order = np.argsort(-p.imag, axis=1)[:, :3]
            waves = np.take_along_axis(waves, order[:, None, :], axis=2)
            z = -1j * waves[:, 3:] @ np.linalg.inv(waves[:, :3])
            decays = np.take_along_axis(p.imag, order, axis=1).min(axis=1) > 1e-9
            return np.where(decays, np.linalg.det(z).real, np.nan)

        low, high = np.zeros(len(top)), top.copy()
        start = determinant(low)
        below, above = np.ones(len(top)), -np.ones(len(top))
        for step in range(16):
            middle = (
                (low * above - high * below) / (above - below) if step > 3 else (low + 2 * high) / 3
            )
            found = determinant(middle) / start
            found = np.where(np.isnan(found), -1.0, found)
            up = found > 0
            above = np.where(up, np.where(low > 0, above / 2, above), found)
            below = np.where(up, found, np.where(high < top, below / 2, below))
            low, high = np.where(up, middle, low), np.where(up, high, middle)
        return (low * above - high * below) / (above - below)
