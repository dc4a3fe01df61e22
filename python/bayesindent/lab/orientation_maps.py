"""Orientation maps (EBSD): the grain at each indent, its orientation and its size."""

import csv
import re
from dataclasses import dataclass
from functools import cache, reduce
from pathlib import Path
from typing import Any

import numpy as np
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components
from scipy.spatial import cKDTree
from scipy.spatial.transform import Rotation

from ..core import InputError
from ..crystal.directions import representative
from ..crystal.elasticity import class_name
from .columns import abridged
from .map_files import axes_of_file, from_standard, load_map, turn_of_axes
from .other_files import reading

#: Misorientation of neighbouring points, in degrees, above which they belong to two grains.
BOUNDARY_DEG = 5.0
#: Grains of fewer points are noise; they do not count as neighbours.
LEAST_PIXELS = 4
#: Columns of homologous points: positions on the stage, and in the map.
POINT_COLUMNS = ("x_um", "y_um", "map_x_um", "map_y_um")
#: Number of errors of registration that are drawn, and the least probability of an indent's grain.
SAMPLE, LEAST_SHARE = 400, 0.95
#: The largest coordinate that is accepted; every sample is smaller.
FARTHEST_UM = 1e9
#: The sample's axis that the indenter moves along.
NORMAL = (0.0, 0.0, 1.0)


@dataclass
class IndentedMap:
    """A map with indents at `positions` (n, 2) in its own coordinates, um, and the grain of each.

    `rows` are their rows in the measurements, from 0; the grain of the other rows is uncertain.
    `columns` have a value for each indent: Bunge's angles of the mean orientation of its
    grain, and, unless the measurements have these columns, `grain` (its number in the map),
    `orientation_sd_deg` (the spread of the indented direction over the grain), and
    `grain_radius_um` (the distance to the nearest other grain).
    """

    grid: "Grid"
    rows: list[int]
    positions: np.ndarray
    grains: list[int]
    columns: dict[str, list]
    #: Codes and subjects of diagnostics.
    warnings: list[tuple[str, str]]


def indented_map(
    path: Path,
    indents: np.ndarray,
    sd: np.ndarray,
    columns: list[str],
    symmetry: str | None,
    axes: str | None,
) -> IndentedMap:
    """The map of a file with `indents` at positions (n, 2), whose registration has the `sd` (n,)
    per coordinate, in um. `columns` are those of the measurements; for `axes` see `AXES` of
    map_files.
    """
    for name in columns:
        if name.lower().startswith(("phi", "φ", "euler")):
            raise InputError(
                f"the column {name} states the orientation too; one of them is allowed"
            )
    grid = Grid(path, axes)
    away, pixel = grid.tree.query(indents)
    for row in np.flatnonzero(away > grid.step):
        (left, lower), (right, upper) = grid.positions.min(axis=0), grid.positions.max(axis=0)
        x, y = indents[row]
        raise InputError(
            f"row {row + 1}: ({x:g}, {y:g}) um is {away[row]:.3g} um from the next indexed "
            f"point; the map is from ({left:g}, {lower:g}) to ({right:g}, {upper:g})"
        )
    grains = grid.grain[pixel].tolist()
    warnings = grid.compare_phase(grid.phase[pixel], symmetry)
    # The probability of a grain is the share of sampled registrations that place the indent in it.
    nearest = grid.tree.query(
        indents + np.random.default_rng(0).normal(size=(SAMPLE, 1, 2)) * sd[:, None]
    )[1]
    share = np.mean(grid.grain[nearest] == grains, axis=0)
    retained = np.flatnonzero(share >= LEAST_SHARE).tolist()
    if doubtful := [f"{row + 1} ({share[row]:.0%})" for row in np.flatnonzero(share < LEAST_SHARE)]:
        reason = (
            f"the indents of rows {abridged(doubtful)} are left out: their grain is uncertain. In "
            "brackets: the probability of the grain, with a registration of "
            f"± {sd.max():.2g} um; {LEAST_SHARE:.0%} is needed"
        )
        if not retained:
            raise InputError(reason)
        warnings.append(("indents_left_out", reason))
    stated = {
        re.sub("[ -]", "_", name.lower()).removesuffix("_id").removesuffix("_number")
        for name in columns
    }
    orientation = cache(grid.mean_orientation)
    indents, grains = indents[retained], [grains[row] for row in retained]
    of_indents: dict[str, list] = {}
    for position, grain in zip(indents, grains):
        euler_deg, spread = orientation(grain)
        radius = grid.distance_to_boundary(position, grain)
        values = {"grain": f"EBSD {grain}", "orientation_sd_deg": spread, "grain_radius_um": radius}
        values |= dict(zip(("phi1_deg", "Phi_deg", "phi2_deg"), euler_deg))
        for name in values.keys() - stated:
            of_indents.setdefault(name, []).append(values[name])
    return IndentedMap(grid, retained, indents, grains, of_indents, warnings)


def registered(path: Path, stage: np.ndarray) -> tuple[np.ndarray, np.ndarray, list[tuple]]:
    """Transform positions of the stage to the map by the affine map that fits homologous points by
    least squares. Returns the positions (n, 2), their sd per coordinate (n,) in um, and a warning
    if the sd is unknown.
    """
    try:
        lines = path.read_text(encoding="utf-8-sig").splitlines()
        stated = (line for line in lines if not line.startswith("#"))
        rows = csv.DictReader(stated, skipinitialspace=True)
        cells = [float(row[name]) for row in rows for name in POINT_COLUMNS]
        known = np.array(cells).reshape(-1, 4)
    except OSError as error:
        raise InputError(f"{error.strerror}") from None
    except (ValueError, KeyError, TypeError, csv.Error):
        known = np.full((1, 4), np.nan)
    if not (np.abs(known) < FARTHEST_UM).all():
        raise InputError(
            f"is no CSV of numbers in the columns {', '.join(POINT_COLUMNS)}, a row for "
            f"each point, up to {FARTHEST_UM:g}"
        )
    n, centre = len(known), known[:, :2].sum(axis=0) / max(1, len(known))
    spread = known[:, :2] - centre
    design = np.column_stack([np.ones(n), spread])
    if n < 3 or np.linalg.svd(spread, compute_uv=False)[1] < 1e-3 * np.abs(spread).max():
        raise InputError(
            f"{n} points on a line or at one place; three or more that span the sample are needed"
        )
    affine = np.linalg.lstsq(design, known[:, 2:], rcond=None)[0]
    at = np.column_stack([np.ones(len(stage)), stage - centre])
    leverage = np.einsum("ij,jk,ik->i", at, np.linalg.inv(design.T @ design), at)
    residual = np.linalg.norm(known[:, 2:] - design @ affine) / np.sqrt(max(1, 2 * (n - 3)))
    unknown = "three points leave no residual, so that the error of the registration is unknown"
    return (
        at @ affine,
        residual * np.sqrt(1 + leverage),
        [("registration_unknown", unknown)] * (n == 3),
    )


class Grid:
    """The indexed points of a map and the grains that they form."""

    def __init__(self, path: Path, axes: str | None):
        loaded = load_map(path)
        with reading("is no map that orix reads"):
            found = loaded[loaded.phase_id >= 0]
            #: Positions (n, 2) in um.
            self.positions = np.column_stack([found.x, found.y]).astype(float)
            #: Rotations from sample to crystal axes.
            self.rotations = rotations_of(
                found.rotations[:, 0] if found.rotations.ndim > 1 else found.rotations
            )
        if (
            found.size < 2
            or loaded.scan_unit != "um"
            or not (np.abs(self.positions) < FARTHEST_UM).all()
        ):
            raise InputError(
                f"has {found.size} indexed points in the unit {loaded.scan_unit!r}; a "
                f"map in um is needed, within {FARTHEST_UM:g}"
            )
        self.phase = found.phase_id
        #: By phase its name, its Laue class (diffraction sees no more of the point group), and the
        #: proper rotations of that class.
        self.names, self.groups, self.symmetry = {}, {}, {}
        for number in np.unique(self.phase).tolist():
            phase = loaded.phases[number]
            self.names[number], group = phase.name, phase.point_group
            if group is None:
                raise InputError(
                    f"does not say the point group of phase {number} ({self.names[number]})"
                )
            self.groups[number], turn = group.laue, from_standard(group.laue)
            self.symmetry[number] = turn.inv() * rotations_of(group.laue.proper_subgroup) * turn
            to_standard = turn_of_axes(
                group.laue, phase.structure.lattice, axes, axes_of_file(path)
            )
            own = np.flatnonzero(self.phase == number)
            self.rotations[own] = to_standard * self.rotations[own]
        self.tree = cKDTree(self.positions)
        #: Distance of neighbouring points in um.
        self.step = float(np.median(self.tree.query(self.positions, k=2)[0][:, 1]))
        if not self.step > 0:
            raise InputError("has most of its points twice at the same place; a map has each once")
        self.grain = self._grains(self.tree.query_pairs(1.2 * self.step, output_type="ndarray"))
        #: Whether the grain of a point is large enough to be no noise.
        self.counts = np.bincount(self.grain)[self.grain] >= LEAST_PIXELS

    def _grains(self, pairs: np.ndarray) -> np.ndarray:
        """The number of each point's grain. A grain connects neighbours of one phase whose
        misorientation is small; `pairs` are the neighbours.
        """
        first, second = pairs.T
        between = (self.rotations[second] * self.rotations[first].inv()).as_quat()
        alike = np.zeros(len(pairs), dtype=bool)
        for phase, group in self.symmetry.items():
            own = (self.phase[first] == phase) & (self.phase[second] == phase)
            # Operations of the group are tried one after the other to save memory: a map may have
            # millions of points.
            cosine = reduce(
                np.maximum, (np.abs(between[own] @ operation) for operation in group.as_quat())
            )
            alike[own] = cosine > np.cos(np.radians(BOUNDARY_DEG) / 2)
        n = len(self.positions)
        return connected_components(
            coo_array((alike[alike], (first[alike], second[alike])), shape=(n, n)), directed=False
        )[1]

    def compare_phase(self, phases: np.ndarray, symmetry: str | None) -> list[tuple]:
        """Compare the phase at each indent (n,) with the stated `symmetry`, and return the
        warnings. Several phases are refused, and a symmetry in which equivalent orientations of the
        phase are not equivalent.
        """
        number = int(phases[0])
        name = self.names[number]
        if len(others := np.flatnonzero(phases != number)):
            raise InputError(
                f"the indent of row 1 is on the phase {name}, those of "
                f"rows {abridged(others + 1)} are on "
                f"{self.names[int(phases[others[0]])]}; leave one "
                "of them out: the constants are those of one phase"
            )
        if not symmetry:
            return []
        laue = self.groups[number].name
        own = class_name(laue)
        images = (self.symmetry[number] * Rotation.from_quat([0.4, 0.5, np.sqrt(0.5), 0.3])).apply(
            NORMAL
        )
        differs = f"the phase {name} is {own} ({laue}), symmetry is {symmetry}"
        if np.ptp(representative(symmetry, images), axis=0).max() > 1e-6:
            raise InputError(
                f"{differs}: orientations that are equivalent in the map are "
                "not so in this symmetry and its axes; state the symmetry of "
                "the phase, or the orientations in columns"
            )
        warning = f"{differs}, which takes the crystal for more symmetric than the map does"
        return [] if own == symmetry else [("phase_differs", warning)]

    def misread(self, positions: np.ndarray) -> np.ndarray:
        """The indented directions (7, n, 3) in crystal axes for positions (n, 2) whose axes are
        exchanged or reversed.
        """
        # The seven mistakes are those of fortran/inference/orientation_check.f90. A position beside
        # the map gets the orientation at its edge.
        low, size = self.positions.min(axis=0), np.ptp(self.positions, axis=0)

        def places(way: int) -> np.ndarray:
            exchanged = (positions - low)[:, :: -1 if way & 4 else 1]
            return low + np.where([way & 1, way & 2], size - exchanged, exchanged)

        return np.stack(
            [self.rotations[self.tree.query(places(way))[1]].apply(NORMAL) for way in range(1, 8)]
        )

    def colours(self) -> np.ndarray:
        """The colours RGB (n, 3) of the crystal directions along the indenter in the inverse pole
        figure.
        """
        # The package is optional, like the reader of the map.
        from orix.plot import IPFColorKeyTSL
        from orix.quaternion import Orientation

        found = np.zeros((len(self.phase), 3))
        for number, group in self.groups.items():
            own = self.phase == number
            turned = (from_standard(group) * self.rotations[own]).as_quat(scalar_first=True)
            found[own] = IPFColorKeyTSL(group).orientation2color(
                Orientation(turned, symmetry=group)
            )
        return found

    def mean_orientation(self, grain: int) -> tuple[list[float], float]:
        """Bunge's angles of the mean orientation, degrees, and the sd of the tilt of the indented
        direction per component, degrees.
        """
        inside = np.flatnonzero(self.grain == grain)
        group, rotations = self.symmetry[int(self.phase[inside[0]])], self.rotations[inside]
        # Each orientation is replaced by its equivalent that is nearest to the first one.
        cosine = np.abs((rotations[0] * rotations.inv()).as_quat() @ group.as_quat().T)
        aligned = group[cosine.argmax(axis=1)] * rotations
        mean = aligned.mean()
        tilt = np.arccos(np.clip(aligned.apply(NORMAL) @ mean.apply(NORMAL), -1, 1))
        # The package is optional, like the reader of the map.
        from orix.quaternion import Rotation as OrixRotation

        euler = OrixRotation(mean.as_quat(scalar_first=True)).to_euler()[0]
        return np.degrees(euler).tolist(), float(np.degrees(np.sqrt(np.mean(tilt**2) / 2)))

    def distance_to_boundary(self, position: np.ndarray, grain: int) -> float:
        """The distance in um from a position to the nearest point of another grain, less half a
        step; to the farthest point of the map if there is no other grain.
        """
        others = self.positions[(self.grain != grain) & self.counts]
        if not len(others):
            return float(np.linalg.norm(self.positions - position, axis=1).max())
        return float(
            max(np.linalg.norm(others - position, axis=1).min() - self.step / 2, self.step / 2)
        )


def rotations_of(rotations: Any) -> Rotation:
    """Rotations of orix, whose quaternions begin with the scalar."""
    return Rotation.from_quat(rotations.data, scalar_first=True)
