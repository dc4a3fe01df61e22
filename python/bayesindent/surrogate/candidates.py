"""The crystals and directions that a design chooses from."""

from dataclasses import dataclass, field

import numpy as np

from ..crystal.directions import euler_of, spread_of_directions
from ..crystal.elasticity import stiffness_rows
from ..surrogate.basis import Basis
from ..surrogate.domain import Domain

__all__ = ["Candidates", "candidates_of", "outside"]


@dataclass
class Candidates:
    """Crystals (n, k) in GPa at angles (n, 3) in degrees."""

    constants: np.ndarray
    euler_deg: np.ndarray
    numbers: dict = field(init=False)

    def __post_init__(self):
        points = list(zip(map(tuple, self.constants.tolist()), map(tuple, self.euler_deg.tolist()), strict=True))
        # Of candidates that are alike the first counts.
        self.numbers = {point: number for number, point in reversed(list(enumerate(points)))}

    def __len__(self) -> int:
        return len(self.constants)

    def find(self, rows) -> list[int]:
        """Numbers of the candidates that rows of a campaign are about."""
        found = (self.numbers.get((row.constants, row.euler_deg)) for row in rows)
        return [number for number in found if number is not None]

    def points(self, numbers) -> list[tuple[tuple, tuple]]:
        """Constants and angles of candidates, as a campaign takes them."""
        return [(tuple(self.constants[i].tolist()), tuple(self.euler_deg[i].tolist())) for i in numbers]


def candidates_of(problem, basis: Basis) -> tuple[Candidates, list[str]]:
    """The candidates that &design asks for, and warnings."""
    design, table, seed, domain = problem.settings.design, problem.candidates, problem.settings.problem.seed, basis.domain
    warnings = []
    if table is not None:
        constants, euler_deg = table.constants_array(), np.array(table.euler_deg)
        keep = ~outside(constants, basis)
        if not keep.all():
            warnings.append(f"{(~keep).sum()} of {len(keep)} candidates are outside the domain and are left out")
        constants, euler_deg = constants[keep], euler_deg[keep]
    elif design.candidates == "factorial":
        constants, euler_deg = factorial(domain, design.n_candidates, design.n_directions, seed)
    else:
        # The initial set is a hypercube of its own.
        first = design.initial if design.initial_set == "latin" else 0
        sizes = enumerate((first, max(0, design.n_candidates - first)))
        blocks = [spread(domain, size, seed + 1_000_003 * block, design.orientations) for block, size in sizes if size > 0]
        constants, euler_deg = (np.vstack(part) for part in zip(*blocks, strict=True))
    return Candidates(constants, euler_deg), warnings


def factorial(domain: Domain, n: int, per_crystal: int, seed: int) -> tuple[np.ndarray, np.ndarray]:
    """Crystals of a Latin hypercube, each in the same directions."""
    crystals = domain.latin(max(1, n // per_crystal), seed)
    angles = euler_of(spread_of_directions(domain.symmetry, per_crystal))
    return np.repeat(crystals, per_crystal, axis=0), np.tile(angles, (len(crystals), 1))


def spread(domain: Domain, n: int, seed: int, orientations: str) -> tuple[np.ndarray, np.ndarray]:
    """A Latin hypercube of crystals and directions over the sphere, or of declinations."""
    if orientations == "sphere":
        return domain.crystals(n, seed)
    points = domain.latin(n, seed, n_angles=1)
    return points[:, :-1], np.column_stack([np.zeros(n), 90 * points[:, -1], np.zeros(n)])


def outside(constants, basis: Basis) -> np.ndarray:
    """Whether crystals (n, k) in GPa are outside what a surrogate with this basis covers."""
    return ~basis.coverage(stiffness_rows(basis.domain.symmetry, constants))[1]
