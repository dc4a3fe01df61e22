"""Half-space theory in NumPy, from the formulas alone: it shares nothing with the package and
serves to make references for it.

Stiffnesses of the classes are written out by hand. Barnett's integral B(t) is a trapezoidal rule;
B^-1(t) is one even field of 3 x 3 matrices per crystal, which every grain reads along its own great
circle. `direct_modulus` takes it there by quadrature and minimises over Willis' ellipse by a
simplex. `FieldTheory` does many crystals of one class in the same grains at once: the field is
expanded in even polynomials on the sphere by least squares over nodes, which the rotations of the
class multiply, and Newton's method finds the ellipse.
"""

import itertools
import math

import numpy as np

ROOT2 = math.sqrt(2.0)

NAMES = {
    "isotropic": "C11 C12",
    "cubic": "C11 C12 C44",
    "hexagonal": "C11 C12 C44 C33 C13",
    "tetragonal": "C11 C12 C13 C33 C44 C66",
    "tetragonal 4/m": "C11 C12 C13 C33 C44 C66 C16",
    "trigonal": "C11 C12 C13 C14 C33 C44",
    "trigonal -3": "C11 C12 C13 C14 C33 C44 C15",
    "orthorhombic": "C11 C12 C13 C22 C23 C33 C44 C55 C66",
    "monoclinic": "C11 C12 C13 C15 C22 C23 C25 C33 C35 C44 C46 C55 C66",
    "triclinic": "C11 C12 C13 C14 C15 C16 C22 C23 C24 C25 C26 "
    "C33 C34 C35 C36 C44 C45 C46 C55 C56 C66",
}
NAMES = {symmetry: names.split() for symmetry, names in NAMES.items()}
#: Constants that depend on others; half is (C11 - C12) / 2.
RULES = {
    "isotropic": "C22=C11 C33=C11 C13=C12 C23=C12 C44=half C55=half C66=half",
    "cubic": "C22=C11 C33=C11 C13=C12 C23=C12 C55=C44 C66=C44",
    "hexagonal": "C22=C11 C23=C13 C55=C44 C66=half",
    "tetragonal": "C22=C11 C23=C13 C55=C44",
    "tetragonal 4/m": "C22=C11 C23=C13 C55=C44 C26=-C16",
    "trigonal": "C22=C11 C23=C13 C55=C44 C66=half C24=-C14 C56=C14",
    "trigonal -3": "C22=C11 C23=C13 C55=C44 C66=half C24=-C14 C56=C14 C25=-C15 C46=-C15",
}
#: Rotations that the field of a class is known to have (a subgroup serves): crystal axis and fold.
GENERATORS = {"trigonal": [(2, 3), (0, 2)], "orthorhombic": [(2, 2), (0, 2)]}
#: Azimuths, degrees, between which they and inversion leave nothing out in the upper hemisphere:
#: start and width.
WEDGES = {"trigonal": (30, 60), "orthorhombic": (0, 90)}


def stiffness(symmetry: str, constants: np.ndarray) -> np.ndarray:
    """Stiffness in Voigt order 11, 22, 33, 23, 13, 12 of constants (..., k): (..., 6, 6), GPa."""
    c = dict(zip(NAMES[symmetry], np.moveaxis(np.asarray(constants, float), -1, 0), strict=True))
    c["half"] = (c["C11"] - c["C12"]) / 2
    for rule in RULES.get(symmetry, "").split():
        name, source = rule.split("=")
        c[name] = -c[source[1:]] if source.startswith("-") else c[source]
    full = np.zeros((*c.pop("half").shape, 6, 6))
    for name, value in c.items():
        i, j = int(name[1]) - 1, int(name[2]) - 1
        full[..., i, j] = full[..., j, i] = value
    return full


def kelvin(voigt: np.ndarray) -> np.ndarray:
    """Kelvin's form: rows and columns 4 to 6 times root two."""
    weight = np.array([1, 1, 1, ROOT2, ROOT2, ROOT2])
    return voigt * weight * weight[:, None]


def orthonormal_space(symmetry: str) -> tuple[np.ndarray, np.ndarray]:
    """Orthonormal basis (k, 6, 6) of the class's Kelvin matrices, and the matrix (k, k) that maps
    coordinates in it to constants.
    """
    k = len(NAMES[symmetry])
    units = kelvin(stiffness(symmetry, np.eye(k))).reshape(k, 36)
    q, r = np.linalg.qr(units.T)  # units.T = q r: coordinates are r c
    return q.T.reshape(k, 6, 6), np.linalg.inv(r)


def fourth_rank(voigt: np.ndarray) -> np.ndarray:
    """C_ijkl (3, 3, 3, 3) of a stiffness in Voigt order."""
    index = np.array([[0, 5, 4], [5, 1, 3], [4, 3, 2]])
    return voigt[index[:, :, None, None], index[None, None]]


def axis_rotation(axis: int, fold: int) -> np.ndarray:
    """Rotation by 2 pi / fold about a crystal axis."""
    c, s = math.cos(2 * math.pi / fold), math.sin(2 * math.pi / fold)
    i, j = (axis + 1) % 3, (axis + 2) % 3
    g = np.eye(3)
    g[i, i], g[i, j], g[j, i], g[j, j] = c, -s, s, c
    return g


def rotations(symmetry: str) -> np.ndarray:
    """The rotations (n, 3, 3) of GENERATORS, the identity first."""
    generators = GENERATORS.get(symmetry, [])
    group = [np.eye(3)]
    for g in itertools.chain(group):
        for axis, fold in generators:
            product = axis_rotation(axis, fold) @ g
            if not any(np.allclose(product, other) for other in group):
                group.append(product)
    return np.array(group)


def bunge(euler_deg: np.ndarray) -> np.ndarray:
    """Rotations g (n, 3, 3) from sample to crystal axes of Bunge's angles (n, 3), degrees."""
    (c1, c, c2), (s1, s, s2) = np.cos(np.radians(euler_deg)).T, np.sin(np.radians(euler_deg)).T
    rows = [
        [c1 * c2 - s1 * s2 * c, s1 * c2 + c1 * s2 * c, s2 * s],
        [-c1 * s2 - s1 * c2 * c, -s1 * s2 + c1 * c2 * c, c2 * s],
        [s1 * s, -c1 * s, c],
    ]
    return np.moveaxis(np.array(rows), 2, 0)


def barnett(c4: np.ndarray, t: np.ndarray, points: int) -> np.ndarray:
    """8 pi^2 B(t) (n, 3, 3) of one crystal for directions t (n, 3), trapezoidal rule with `points`
    angles over the half turn.
    """
    first, second = perpendicular(t)
    phi = np.arange(points) * math.pi / points
    m = first[:, None] * np.cos(phi)[:, None] + second[:, None] * np.sin(phi)[:, None]
    n = second[:, None] * np.cos(phi)[:, None] - first[:, None] * np.sin(phi)[:, None]
    mm, mn, nn = (
        np.einsum("tpi,ijkl,tpl->tpjk", a, c4, b, optimize=True)
        for a, b in ((m, m), (m, n), (n, n))
    )
    return (mm - mn @ np.linalg.inv(nn) @ np.swapaxes(mn, -1, -2)).mean(axis=1) * 2 * math.pi


def perpendicular(t: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Two unit vectors that complete each t to an orthonormal triad."""
    least = np.eye(3)[np.argmin(np.abs(t), axis=-1)]
    first = np.cross(t, least)
    first /= np.linalg.norm(first, axis=-1, keepdims=True)
    return first, np.cross(t, first)


def direct_modulus(
    voigt: np.ndarray, euler_deg: np.ndarray, points: int = 128, angles: int = 96
) -> np.ndarray:
    """Half-space moduli (n,) of one crystal: no expansion, and a general minimiser for the
    ellipse.
    """
    from scipy.optimize import minimize

    c4, theta = fourth_rank(voigt), np.arange(angles) * math.pi / angles
    result = []
    for g in bunge(np.atleast_2d(euler_deg)):
        t = np.cos(theta)[:, None] * g[:, 0] + np.sin(theta)[:, None] * g[:, 1]
        h = np.einsum("i,tij,j->t", g[:, 2], np.linalg.inv(barnett(c4, t, points)), g[:, 2])

        def integral(p, h=h):
            under = 1 + p[0] * np.cos(2 * theta) + p[1] * np.sin(2 * theta)
            return h.mean() * 10 if under.min() <= 0 else np.mean(h / np.sqrt(under))

        best = minimize(
            integral,
            [0.0, 0.0],
            method="Nelder-Mead",
            options={"xatol": 1e-7, "fatol": 1e-13 * h.mean(), "maxiter": 2000},
        )
        result.append(1 / (math.pi * best.fun))
    return np.array(result)


class FieldTheory:
    """Half-space moduli of an ensemble of crystals of one class in fixed grains, by the expansion
    of B^-1(t) to an even degree.
    """

    #: Pairs of the six components of a symmetric matrix.
    PAIRS = ((0, 0), (0, 1), (0, 2), (1, 1), (1, 2), (2, 2))

    def __init__(
        self,
        symmetry: str,
        euler_deg: np.ndarray,
        degree: int,
        nodes: int,
        points: int = 12,
        angles: int = 12,
        newton: int = 2,
        precision=np.float32,
    ):
        self.symmetry, self.points, self.newton, self.precision = (
            symmetry,
            points,
            newton,
            precision,
        )
        self.grains, self.euler_deg = len(euler_deg), euler_deg
        base = self.fundamental_nodes(symmetry, nodes)
        self.prepare_barnett(base)
        self.theta = np.arange(angles) * math.pi / angles
        g = bunge(euler_deg)
        t = (
            np.cos(self.theta)[:, None, None] * g[:, :, 0]
            + np.sin(self.theta)[:, None, None] * g[:, :, 1]
        )
        self.prepare_field(base, t.reshape(-1, 3), np.tile(g[:, :, 2], (angles, 1)), degree)
        harmonics = np.array([np.ones(angles), np.cos(2 * self.theta), np.sin(2 * self.theta)])
        second = (
            np.array([harmonics[1] ** 2, harmonics[1] * harmonics[2], harmonics[2] ** 2]) / angles
        )
        self.harmonics, self.second = harmonics.astype(precision), second.astype(precision)

    @staticmethod
    def fundamental_nodes(symmetry: str, count: int) -> np.ndarray:
        """Directions (count, 3) spread evenly over the part of the hemisphere that the class's
        rotations multiply to the whole.
        """
        start, width = WEDGES.get(symmetry, (0, 360))
        z = (np.arange(count) + 0.5) / count
        azimuth = np.radians(start + width * (np.arange(count) * (math.sqrt(5) - 1) / 2 % 1))
        r = np.sqrt(1 - z * z)
        return np.column_stack([r * np.cos(azimuth), r * np.sin(azimuth), z])

    def prepare_barnett(self, base: np.ndarray) -> None:
        """Matrices that give (mm) integrated, (nn) and (mn) at every node and angle from the
        constants.
        """
        units = np.array(
            [fourth_rank(c) for c in stiffness(self.symmetry, np.eye(len(NAMES[self.symmetry])))]
        )
        first, second = perpendicular(base)
        phi = np.arange(self.points) * math.pi / self.points
        m = np.cos(phi)[:, None, None] * first + np.sin(phi)[:, None, None] * second
        n = np.cos(phi)[:, None, None] * second - np.sin(phi)[:, None, None] * first
        mm, mn, nn = (
            np.einsum("pti,cijkl,ptl->jkptc", a, units, b, optimize=True)
            for a, b in ((m, m), (m, n), (n, n))
        )
        # 6, nodes, k
        self.mm = np.array([mm[i, j].mean(axis=0) for i, j in self.PAIRS]).astype(self.precision)
        rows = [nn[i, j] for i, j in self.PAIRS] + [mn[i, j] for i in range(3) for j in range(3)]
        # angles, 15, nodes, k
        self.products = np.ascontiguousarray(
            np.moveaxis(np.array(rows), 1, 0), dtype=self.precision
        )

    def prepare_field(
        self, base: np.ndarray, t: np.ndarray, normal: np.ndarray, degree: int
    ) -> None:
        """Matrix from the six components of (8 pi^2 B)^-1 at the nodes to h at each direction t
        with its surface's normal.
        """
        group = rotations(self.symmetry)
        orbit = np.einsum("gij,nj->gni", group, base)
        interpolation = monomials(t, degree) @ np.linalg.pinv(
            monomials(orbit.reshape(-1, 3), degree)
        )
        interpolation = interpolation.reshape(len(t), len(group), len(base))
        turned = np.einsum("gij,ti->tgj", group, normal)  # n' g F g' n = (g' n)' F (g' n)
        self.field = np.empty((len(t), 6, len(base)))
        for p, (i, j) in enumerate(self.PAIRS):
            weight = turned[:, :, i] * turned[:, :, j] * (1 if i == j else 2)
            self.field[:, p] = np.einsum("tgn,tg->tn", interpolation, weight)
        self.field = self.field.reshape(len(t), -1).astype(self.precision)

    def inverse_field(self, constants: np.ndarray) -> np.ndarray:
        """Components (6, nodes, crystals) of (8 pi^2 B)^-1 of constants (crystals, k)."""
        c = np.ascontiguousarray(constants.T, dtype=self.precision)
        b = [values @ c for values in self.mm]
        for angle in self.products:
            xx, xy, xz, yy, yz, zz, *mn = (angle.reshape(-1, len(c)) @ c).reshape(
                15, -1, c.shape[1]
            )
            # L D L' of (nn), then (mn) (nn)^-1 (nm) as the sum of three squares.
            l21, l31 = xy / xx, xz / xx
            d2 = yy - l21 * xy
            e = yz - l31 * xy
            l32 = e / d2
            weights = (
                1 / (self.points * xx),
                1 / (self.points * d2),
                1 / (self.points * (zz - l31 * xz - l32 * e)),
            )
            solved = []
            for row in range(3):
                y1 = mn[3 * row]
                y2 = mn[3 * row + 1] - l21 * y1
                solved.append((y1, y2, mn[3 * row + 2] - l31 * y1 - l32 * y2))
            for i in range(3):
                weighted = [solved[row][i] * weights[i] for row in range(3)]
                for p, (row, column) in enumerate(self.PAIRS):
                    b[p] -= weighted[row] * solved[column][i]
        xx, xy, xz, yy, yz, zz = b
        inverse = np.array(
            [
                yy * zz - yz * yz,
                xz * yz - xy * zz,
                xy * yz - xz * yy,
                xx * zz - xz * xz,
                xy * xz - xx * yz,
                xx * yy - xy * xy,
            ]
        )
        inverse /= (xx * inverse[0] + xy * inverse[1] + xz * inverse[2]) * 2 * math.pi
        return inverse

    def moduli(self, constants: np.ndarray) -> np.ndarray:
        """Moduli (crystals, grains), GPa, of constants (crystals, k)."""
        count = len(constants)
        inverse = self.inverse_field(constants).reshape(-1, count)
        h = (self.field @ inverse).reshape(len(self.theta), -1)
        ab = np.zeros((2, h.shape[1]), self.precision)
        for _ in range(self.newton):
            value, step, drop = self.newton_step(h, ab)
            ab = ab + step
            ab *= np.minimum(1, 0.9 / np.maximum(np.hypot(ab[0], ab[1]), 1e-12)).astype(
                self.precision
            )
        return (1 / (math.pi * (value - drop))).reshape(self.grains, count).T.astype(float)

    def newton_step(
        self, h: np.ndarray, ab: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Mean of h (1 + a cos + b sin)^-1/2 over the angles, Newton's step in (a, b), and the
        decrease that it foresees.
        """
        angles = len(self.theta)
        under = 1 + self.harmonics[1:].T @ ab
        term = h / np.sqrt(under)
        value = term.mean(axis=0)
        term /= under
        gradient = self.harmonics[1:] @ term * (-0.5 / angles)
        term /= under
        cc, cs, ss = 0.75 * (self.second @ term)
        determinant = cc * ss - cs * cs
        step = (
            np.array([cs * gradient[1] - ss * gradient[0], cs * gradient[0] - cc * gradient[1]])
            / determinant
        )
        return value, step, -0.5 * (step * gradient).sum(axis=0)


def monomials(t: np.ndarray, degree: int) -> np.ndarray:
    """Monomials of an even degree on the unit sphere, each times the root of its multinomial: they
    span all even harmonics up to it.
    """
    powers = t[:, :, None] ** np.arange(degree + 1)
    columns = []
    for i in range(degree + 1):
        for j in range(degree + 1 - i):
            k = degree - i - j
            weight = math.sqrt(
                math.factorial(degree) / (math.factorial(i) * math.factorial(j) * math.factorial(k))
            )
            columns.append(weight * powers[:, 0, i] * powers[:, 1, j] * powers[:, 2, k])
    return np.array(columns).T
