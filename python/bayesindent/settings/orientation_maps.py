"""Orientation maps (EBSD): what they say of the grain at each indent."""

import re
from collections.abc import Sequence
from contextlib import redirect_stdout
from functools import reduce
from io import StringIO
from pathlib import Path
from typing import Any

import numpy as np
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components
from scipy.spatial import cKDTree
from scipy.spatial.transform import Rotation

from ..common.result_files import as_csv
from ..core import InputError
from ..crystal.directions import representative
from ..crystal.elasticity import class_name
from .laboratory_tables import reader_of

__all__ = ["page_of"]

#: Neighbours that differ by more are of two grains, degrees.
BOUNDARY_DEG = 5.0
#: Grains of fewer pixels are noise, and no neighbours.
LEAST_PIXELS = 4
#: The sample's axis that the indenter moves along.
NORMAL = (0.0, 0.0, 1.0)


def page_of(place: str, path: Path, x_um: np.ndarray, y_um: np.ndarray, columns: Sequence[str], symmetry: str | None) -> tuple[str, str]:
    """A line for each indent at (x_um, y_um) of the map: Bunge's angles of the mean orientation of its grain, and, where the measurements
    have no such column, `grain`, its number in the map, `orientation_sd_deg`, the spread of the indented direction over it, and
    `grain_radius_um`, the distance to the nearest other grain. Then the warning on the phase beside the stated `symmetry`, or
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
    warning = grid.compare_phase(grid.phase[pixel], symmetry)
    stated = {re.sub("[ -]", "_", name.lower()).removesuffix("_id").removesuffix("_number") for name in columns}
    grains = grid.grain[pixel].tolist()
    orientations = {grain: grid.mean_orientation(grain) for grain in set(grains)}
    rows = []
    for position, grain in zip(indents, grains):
        euler, spread = orientations[grain]
        values = {"grain": f"EBSD {grain}", "orientation_sd_deg": spread, "grain_radius_um": grid.distance_to_boundary(position, grain)}
        angles = dict(zip(("phi1_deg", "Phi_deg", "phi2_deg"), euler))
        rows.append(angles | {name: value for name, value in values.items() if name not in stated})
    return as_csv(list(rows[0]), [list(row.values()) for row in rows]), warning


class Grid:
    """The indexed points of a map and the grains that they form."""

    def __init__(self, place: str, path: Path):
        io = reader_of(place, path, "an orientation map", "orix.io")
        try:
            with redirect_stdout(StringIO()):  # where orix names the phases
                loaded = io.load(str(path))
            found = loaded[loaded.phase_id >= 0]
            #: (n, 2), um.
            self.positions = np.column_stack([found.x, found.y]).astype(float)
            #: From sample to crystal axes.
            self.rotations = rotations_of(found.rotations[:, 0] if found.rotations.ndim > 1 else found.rotations)
        except Exception as error:  # whatever a damaged file makes its reader raise
            raise InputError(f"{place}is no map that orix reads ({' '.join(f'{type(error).__name__}: {error}'.split())})") from None
        if found.size < 2 or loaded.scan_unit != "um":
            raise InputError(f"{place}has {found.size} indexed points in the unit {loaded.scan_unit!r}; a map in um is needed")
        self.phase = found.phase_id
        self.place = place
        #: Of each phase the name, its Laue class, which is all that diffraction sees, and the proper rotations of this.
        self.names, self.laue, self.symmetry = {}, {}, {}
        for number in np.unique(self.phase).tolist():
            self.names[number], group = loaded.phases[number].name, loaded.phases[number].point_group
            if group is None:
                raise InputError(f"{place}does not say the point group of phase {number} ({self.names[number]})")
            self.laue[number], self.symmetry[number] = group.laue.name, rotations_of(group.laue.proper_subgroup)
        tree = cKDTree(self.positions)
        #: Distance of neighbours, um.
        self.step = float(np.median(tree.query(self.positions, k=2)[0][:, 1]))
        self.grain = self._grains(tree.query_pairs(1.2 * self.step, output_type="ndarray"))
        #: Whether a point is of a grain that is more than noise.
        self.counts = np.bincount(self.grain)[self.grain] >= LEAST_PIXELS

    def _grains(self, pairs: np.ndarray) -> np.ndarray:
        """The number of each point's grain: neighbours of one phase whose misorientation is small are connected."""
        first, second = pairs.T
        between = (self.rotations[second] * self.rotations[first].inv()).as_quat()
        alike = np.zeros(len(pairs), dtype=bool)
        for phase, group in self.symmetry.items():
            own = (self.phase[first] == phase) & (self.phase[second] == phase)
            # One operation after the other: a map may have millions of points.
            cosine = reduce(np.maximum, (np.abs(between[own] @ operation) for operation in group.as_quat()))
            alike[own] = cosine > np.cos(np.radians(BOUNDARY_DEG) / 2)
        n = len(self.positions)
        return connected_components(coo_array((alike[alike], (first[alike], second[alike])), shape=(n, n)), directed=False)[1]

    def compare_phase(self, phases: np.ndarray, symmetry: str | None) -> str:
        """The warning, or nothing, on the phase at the indents, (n,), whose crystals are stated to have a `symmetry`; refused if there are several or
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
        images = (self.symmetry[number] * Rotation.from_quat([0.4, 0.5, np.sqrt(0.5), 0.3])).apply(NORMAL)
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
        # Of the equivalents of each the one that is nearest to the first.
        cosine = np.abs((rotations[0] * rotations.inv()).as_quat() @ group.as_quat().T)
        aligned = group[cosine.argmax(axis=1)] * rotations
        mean = aligned.mean()
        tilt = np.arccos(np.clip(aligned.apply(NORMAL) @ mean.apply(NORMAL), -1, 1))
        # Of an optional package, like the reader of the map.
        from orix.quaternion import Rotation as OrixRotation

        euler = OrixRotation(mean.as_quat(scalar_first=True)).to_euler()[0]
        return np.degrees(euler).tolist(), float(np.degrees(np.sqrt(np.mean(tilt**2) / 2)))

    def distance_to_boundary(self, position: np.ndarray, grain: int) -> float:
        """From a position to the nearest point of another grain, less half a step, um; to the farthest edge of the map where there is none."""
        others = self.positions[(self.grain != grain) & self.counts]
        if not len(others):
            return float(np.linalg.norm(self.positions - position, axis=1).max())
        return float(max(np.linalg.norm(others - position, axis=1).min() - self.step / 2, self.step / 2))


def rotations_of(rotations: Any) -> Rotation:
    """Rotations of orix, whose quaternions begin with the scalar."""
    return Rotation.from_quat(rotations.data, scalar_first=True)
