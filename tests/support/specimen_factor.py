"""A made-up effect of a specimen on the modulus: the factor by which it differs from that of a
half-space.
"""

import numpy as np

__all__ = ["rotations", "specimen", "stresses"]


def specimen(stiffness, angles):
    """What a specimen with axial symmetry might add: a function of the stiffness in its frame,
    which is no polynomial of its logarithm.
    """
    stress = stresses(rotations(angles)[:, :, 2])
    strain = stress * [1, 1, 1, 2, 2, 2]
    c33 = np.einsum("ni,nij,nj->n", strain, stiffness, strain)
    s33 = np.einsum("ni,nij,nj->n", stress, np.linalg.inv(stiffness), stress)
    return 1.1 * (c33 * s33) ** 0.05


def rotations(angles):
    """Bunge's g: v_crystal = g v_sample."""
    (c1, c, c2), (s1, s, s2) = np.cos(np.radians(angles.T)), np.sin(np.radians(angles.T))
    rows = [
        [c1 * c2 - s1 * s2 * c, s1 * c2 + c1 * s2 * c, s2 * s],
        [-c1 * s2 - s1 * c2 * c, -s1 * s2 + c1 * c2 * c, c2 * s],
        [s1 * s, -c1 * s, c],
    ]
    return np.moveaxis(np.array(rows), -1, 0)


def stresses(n):
    """n n in Voigt's order."""
    x, y, z = n.T
    return np.stack([x * x, y * y, z * z, y * z, x * z, x * y], axis=1)
