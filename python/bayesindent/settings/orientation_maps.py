"""Orientation maps (EBSD): what they say of the grain at each indent."""

import csv
import re
from contextlib import redirect_stdout
from io import StringIO
from pathlib import Path

import numpy as np
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components
from scipy.spatial import cKDTree

from ..core import InputError
from ..crystal.directions import representative
from ..crystal.elasticity import class_name
from .foreign_files import reader_of

__all__ = ["page_of"]

#: Neighbours that differ by more are of two grains, degrees.
BOUNDARY_DEG = 5.0
#: Grains of fewer pixels are noise, and no neighbours.
LEAST_PIXELS = 4


def page_of(place: str, path: Path, x_um, y_um, columns, symmetry: str | None) -> tuple[str, str]:
    """A line for each indent at (x_um, y_um) of the map: Bunge's angles of the mean orientation of its grain, and, where the measurements
    have no such column, `grain`, its number in the map, `orientation_sd_deg`, the spread of the indented direction over it, and
    `grain_radius_um`, the distance to the nearest other grain. Then what is to be told of the phase beside the stated `symmetry`, or
    nothing. `place` begins the message of a refusal."""
    for name in columns:
        if name.lower().startswith(("phi", "φ", "euler")):
            raise InputError(f"{place}the column {name} states the orientation too; one of them is allowed")
    grid = Grid(place, path)
    indents = np.column_stack([x_um, y_um])
    away, pixel = cKDTree(grid.positions).query(indents)
    for row in np.flatnonzero(away > grid.step):
        low, high = (", ".join(f"{value:g}" for value in edge) for edge in (grid.positions.min(axis=0), grid.positions.max(axis=0)))
        raise InputError(
            f"{place}row {row + 1}: ({x_um[row]:g}, {y_um[row]:g}) um is {away[row]:.3g} um from the next indexed point; the map is from ({low}) to ({high})"
        )
    told = grid.compare_phase(grid.phase[pixel], symmetry)
    header = ["phi1_deg", "Phi_deg", "phi2_deg", "grain", "orientation_sd_deg", "grain_radius_um"]
    there = {re.sub("[ -]", "_", name.lower()).removesuffix("_id").removesuffix("_number") for name in columns}
    kept = [number for number, name in enumerate(header) if name not in there]
    page = StringIO()
    writer = csv.writer(page, lineterminator="\n")
    writer.writerow(header[number] for number in kept)
    of_grain = {grain: grid.mean_orientation(grain) for grain in set(grid.grain[pixel].tolist())}
    for position, grain in zip(indents, grid.grain[pixel].tolist()):
        euler, spread = of_grain[grain]
        cells = [*euler, f"EBSD {grain}", spread, grid.distance_to_boundary(position, grain)]
        writer.writerow(cells[number] for number in kept)
    return page.getvalue(), told


class Grid:
    """The indexed points of a map and the grains that they form."""

    def __init__(self, place: str, path: Path):
        io = reader_of(place, path, "an orientation map", "orix.io")
        try:
            with redirect_stdout(StringIO()):  # where it tells of the names of phases
                loaded = io.load(str(path))
        except Exception as error:  # whatever a damaged file makes its reader raise
            raise InputError(f"{place}is no map that orix reads ({type(error).__name__}: {error})") from None
        found = loaded[loaded.phase_id >= 0]
        if found.size < 2 or loaded.scan_unit != "um":
            raise InputError(f"{place}has {found.size} indexed points in the unit {loaded.scan_unit!r}; a map in um is needed")
        #: (n, 2), um.
        self.positions = np.column_stack([found.x, found.y]).astype(float)
        #: From sample to crystal axes, (n, 4).
        self.rotations = found.rotations[:, 0].data if found.rotations.ndim > 1 else found.rotations.data
        self.phase = found.phase_id
        self.place = place
        #: Of each phase the name, its Laue class, which is all that diffraction sees, and the proper rotations of this, (m, 4).
        self.names, self.laue, self.symmetry = {}, {}, {}
        for number in np.unique(self.phase).tolist():
            self.names[number], group = loaded.phases[number].name, loaded.phases[number].point_group
            if group is None:
                raise InputError(f"{place}does not say the point group of phase {number} ({self.names[number]})")
            self.laue[number], self.symmetry[number] = group.laue.name, group.laue.proper_subgroup.data
        tree = cKDTree(self.positions)
        #: Distance of neighbours, um.
        self.step = float(np.median(tree.query(self.positions, k=2)[0][:, 1]))
        self.grain = self._grains(tree.query_pairs(1.2 * self.step, output_type="ndarray"))
        #: Whether a point is of a grain that is more than noise.
        self.counts = np.bincount(self.grain)[self.grain] >= LEAST_PIXELS

    def _grains(self, pairs: np.ndarray) -> np.ndarray:
        """The number of each point's grain: neighbours of one phase whose misorientation is small are connected."""
        first, second = pairs.T
        alike = np.zeros(len(pairs), dtype=bool)
        for phase, group in self.symmetry.items():
            own = (self.phase[first] == phase) & (self.phase[second] == phase)
            alike[own] = closest(group, self.rotations[first[own]], self.rotations[second[own]])[1] > np.cos(np.radians(BOUNDARY_DEG) / 2)
        n = len(self.positions)
        return connected_components(coo_array((alike[alike], (first[alike], second[alike])), shape=(n, n)), directed=False)[1]

    def compare_phase(self, phases: np.ndarray, symmetry: str | None) -> str:
        """What is to be told of the phase at the indents, (n,), whose crystals are stated to have a `symmetry`; refused if there are several or
        if orientations that are equivalent in the phase are not so by the symmetry, with its axes."""
        number = int(phases[0])
        name = self.names[number]
        if len(others := np.flatnonzero(phases != number)):
            rows = ", ".join(str(row + 1) for row in others[:10]) + (", .." if len(others) > 10 else "")
            raise InputError(
                f"{self.place}the indent of row 1 is on the phase {name}, those of rows {rows} are on "
                f"{self.names[int(phases[others[0]])]}; leave one of them out: the constants are those of one phase"
            )
        if not symmetry:
            return ""
        own = class_name(self.laue[number])
        somewhere = np.array([0.3, 0.4, 0.5, np.sqrt(0.5)])
        images = normal(np.stack([product(operation, somewhere[None])[0] for operation in self.symmetry[number]]))
        differs = f"{self.place}the phase {name} is {own} ({self.laue[number]}), &problem symmetry is {symmetry}"
        if np.ptp(representative(symmetry, images), axis=0).max() > 1e-6:
            raise InputError(
                f"{differs}: orientations that are equivalent in the map are not so in this symmetry and its axes; "
                "state the symmetry of the phase, or the orientations in columns"
            )
        return "" if own == symmetry else f"{differs}, which takes the crystal for more symmetric than the map does"

    def mean_orientation(self, grain: int) -> tuple[list[float], float]:
        """Bunge's angles of the mean orientation, degrees, and the sd of the tilt of the indented direction per component, degrees."""
        inside = np.flatnonzero(self.grain == grain)
        group, rotations = self.symmetry[int(self.phase[inside[0]])], self.rotations[inside]
        aligned = closest(group, rotations, np.broadcast_to(rotations[0], rotations.shape))[0]
        mean = np.linalg.eigh(aligned.T @ aligned)[1][:, -1]
        along, directions = normal(mean[None])[0], normal(aligned)
        spread = np.degrees(np.sqrt(np.mean(np.arccos(np.clip(directions @ along, -1, 1)) ** 2) / 2))
        from orix.quaternion import Rotation

        return np.degrees(Rotation(mean).to_euler()[0]).tolist(), float(spread)

    def distance_to_boundary(self, position: np.ndarray, grain: int) -> float:
        """From a position to the nearest point of another grain, less half a step, um; to the farthest edge of the map where there is none."""
        others = self.positions[(self.grain != grain) & self.counts]
        from_here = others if len(others) else self.positions
        distances = np.linalg.norm(from_here - position, axis=1)
        return float(max(distances.min() - self.step / 2, self.step / 2) if len(others) else distances.max())


def closest(group: np.ndarray, rotations: np.ndarray, others: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Of the equivalents s q of each rotation q (n, 4) that nearest to another one (n, 4), and the cosine of half the angle between them."""
    best, nearest = np.full(len(rotations), -1.0), rotations.copy()
    for operation in group:
        equivalent = product(operation, rotations)
        cosine = np.einsum("ni,ni->n", equivalent, others)
        better = np.abs(cosine) > best
        best[better] = np.abs(cosine[better])
        nearest[better] = np.sign(cosine[better])[:, None] * equivalent[better]
    return nearest, best


def product(p: np.ndarray, q: np.ndarray) -> np.ndarray:
    """The quaternion p (4,) times each of q (n, 4)."""
    a, b, c, d = p
    return q @ np.array([[a, b, c, d], [-b, a, d, -c], [-c, -d, a, b], [-d, c, -b, a]])


def normal(q: np.ndarray) -> np.ndarray:
    """The sample's z in crystal axes (n, 3) by rotations (n, 4)."""
    a, b, c, d = q.T
    return np.column_stack([2 * (b * d + a * c), 2 * (c * d - a * b), a**2 - b**2 - c**2 + d**2])
