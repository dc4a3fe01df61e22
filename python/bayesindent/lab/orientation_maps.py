"""Orientation maps (EBSD): the grain at each indent, its orientation and its size."""

from dataclasses import dataclass
from functools import reduce
from pathlib import Path
from warnings import catch_warnings, simplefilter

import numpy as np
import pandas as pd
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components
from scipy.spatial import cKDTree
from scipy.spatial.transform import Rotation

from ..core import InputError
from ..crystal.directions import representative
from ..crystal.elasticity import class_name
from .columns import ANGLES, abridged
from .map_files import from_standard, load_map, rotations_of, turn_of_axes
from .other_files import reading

#: Misorientation of neighbouring points, in degrees, above which they belong to two grains.
BOUNDARY_DEG = 5.0
#: Grains of fewer points are noise and left out.
LEAST_PIXELS = 4
#: Number of points around an indent that give its orientation, as far as they are of its grain.
SURROUNDINGS = 100
#: Columns of homologous points: positions on the stage, and in the map.
POINT_COLUMNS = ["x_um", "y_um", "map_x_um", "map_y_um"]
#: Columns that a map adds.
MAP_COLUMNS = ("grain", "grain_radius_um", *ANGLES, "orientation_sd_deg")
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
    surroundings in its grain, and, unless the measurements have these columns, `grain` (its number
    in the map), `orientation_sd_deg` (the spread of the indented direction there), and
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
    contact: np.ndarray,
    lines: np.ndarray,
    columns: list[str],
    symmetry: str | None,
    axes: str | None,
) -> IndentedMap:
    """The map of a file with `indents` at positions (n, 2), whose registration has the `sd` (n,)
    per coordinate, and whose radii of `contact` (n,) are 0 if unknown, in um. They are of the
    `lines` (n,) of the measurements, and `columns` are the meanings of the columns there; for
    `axes` see `AXES` of map_files.
    """
    grid = Grid(path, axes)
    grid.refuse_outside(indents, lines)
    if len(grid.groups) == 1:
        grid.compare_phase(grid.phase[:1], symmetry, lines)
    grid.find_grains()
    away, nearest = grid.tree.query(indents, k=min(2 * SURROUNDINGS, len(grid.phase)))
    pixel, away = nearest[:, 0], away[:, 0]
    grains = grid.grain[pixel]
    warnings = grid.warnings + grid.compare_phase(grid.phase[pixel], symmetry, lines)
    if (bridged := lines[away > 0.75 * grid.step]).size:
        reason = (
            f"the indents of rows {abridged(bridged)} are on points that are not indexed, or "
            f"stray. They belong to the grain around them, which is up to {away.max():.2g} um away"
        )
        warnings.append(("indents_bridged", reason))
    # The probability of a grain is the share of sampled places that are nearest to it: over errors
    # of the registration, and over the contact, whose radius is stated, or at most that of a hole.
    random = np.random.default_rng(0)
    places = indents + random.normal(size=(SAMPLE, 1, 2)) * sd[:, None]
    square = random.uniform(-1, 1, size=(2 * SAMPLE, 2))
    disc = square[np.linalg.norm(square, axis=1) < 1][:SAMPLE]
    radius = np.maximum(contact, away * random.random((SAMPLE, 1)))
    places += disc[:, None] * radius[..., None]
    share = np.mean(grid.grain[grid.tree.query(places)[1]] == grains, axis=0)
    retained = np.flatnonzero(share >= LEAST_SHARE).tolist()
    uncertain = share < LEAST_SHARE
    if doubtful := [f"{line} ({p:.0%})" for line, p in zip(lines[uncertain], share[uncertain])]:
        reason = (
            f"the indents of rows {abridged(doubtful)} are left out: their grain is uncertain. In "
            "brackets: the probability of the grain, with a registration of "
            f"± {sd.max():.2g} um and contacts or holes of up to {radius.max():.2g} um; "
            f"{LEAST_SHARE:.0%} is needed"
        )
        if not retained:
            raise InputError(reason)
        warnings.append(("indents_left_out", reason))
    indents, grains = indents[retained], grains[retained].tolist()
    of_indents = []
    for position, grain, around in zip(indents, grains, nearest[retained]):
        is_own = grid.grain[around] == grain
        radius_um = grid.distance_to_boundary(position, grain, around[~is_own])
        mean = grid.mean_orientation(around[is_own][:SURROUNDINGS])
        of_indents.append([f"EBSD {grain}", radius_um, *mean])
    found = zip(MAP_COLUMNS, zip(*of_indents))
    added = {name: list(values) for name, values in found if name not in columns}
    return IndentedMap(grid, retained, indents, grains, added, warnings)


def registered(path: Path, stage: np.ndarray) -> tuple[np.ndarray, np.ndarray, list[tuple]]:
    """Transform positions of the stage to the map by the affine map that fits homologous points by
    least squares. Returns the positions (n, 2), their sd per coordinate (n,) in um, and a warning
    if the sd is unknown.
    """
    words = f"is no CSV of numbers in the columns {', '.join(POINT_COLUMNS)}, a row for each point"
    with reading(words):
        table = pd.read_csv(path, comment="#", skipinitialspace=True, encoding="utf-8-sig")
        known = table[POINT_COLUMNS].to_numpy(float)
    if not (np.abs(known) < FARTHEST_UM).all():
        raise InputError(f"{words}, up to {FARTHEST_UM:g}")
    n, centre = len(known), known[:, :2].sum(axis=0) / max(1, len(known))
    spread = known[:, :2] - centre
    design = np.column_stack([np.ones(n), spread])
    if n < 3 or np.linalg.svd(spread, compute_uv=False)[1] < 1e-3 * np.abs(spread).max():
        raise InputError(
            f"{n} points on a line or at one place; three or more that span the sample are needed"
        )
    solve = np.linalg.pinv(design)
    affine, at = solve @ known[:, 2:], np.column_stack([np.ones(len(stage)), stage - centre])
    leverage = np.sum((at @ solve) ** 2, axis=1)
    residual = np.linalg.norm(known[:, 2:] - design @ affine) / np.sqrt(max(1, 2 * (n - 3)))
    unknown = "three points leave no residual, so that the error of the registration is unknown"
    return (
        at @ affine,
        residual * np.sqrt(1 + leverage),
        [("registration_unknown", unknown)] * (n == 3),
    )


class Grid:
    """The indexed points of a map and, after `find_grains`, the grains that they form."""

    def __init__(self, path: Path, axes: str | None):
        loaded = load_map(path)
        indexed = np.isin(loaded.phase, [*loaded.phases])
        n, found = len(indexed), int(np.sum(indexed))
        #: Positions (n, 2) in um.
        self.positions = loaded.positions[indexed].astype(float)
        if found < 2 or loaded.unit != "um" or not (np.abs(self.positions) < FARTHEST_UM).all():
            raise InputError(
                f"has {found} indexed points in the unit {loaded.unit!r}; a "
                f"map in um is needed, within {FARTHEST_UM:g}"
            )
        if np.linalg.matrix_rank(self.positions - self.positions[0]) < 2:
            raise InputError(f"has its {found} points on a single line; a map is needed")
        #: Rotations from sample to crystal axes.
        self.rotations, self.phase = loaded.rotations[indexed], loaded.phase[indexed]
        self.warnings = loaded.warnings
        if found < n:
            reason = f"{path.name}: {n - found:,} of {n:,} points are not indexed"
            self.warnings.append(("points_not_indexed", reason))
        #: Phases of orix by number.
        self.phases = loaded.phases
        #: By phase its Laue class (diffraction sees no more of the point group), and the proper
        #: rotations of that class.
        self.groups, self.symmetry = {}, {}
        for number in np.unique(self.phase).tolist():
            phase = self.phases[number]
            if phase.point_group is None:
                raise InputError(f"does not say the point group of phase {number}")
            self.groups[number] = laue = phase.point_group.laue
            turn = from_standard(laue)
            self.symmetry[number] = turn.inv() * rotations_of(laue.proper_subgroup) * turn
            to_standard = turn_of_axes(laue, phase.structure.lattice, axes, loaded.axes)
            own = np.flatnonzero(self.phase == number)
            self.rotations[own] = to_standard * self.rotations[own]
        self.tree = cKDTree(self.positions)
        some = self.positions[:: 1 + found // 10_000]
        away = np.median(self.tree.query(some, k=min(5, found))[0], axis=0)
        #: Distance of neighbouring points in um; of a rectangle the longer one.
        self.step = float(away[-1])
        if not away[1] > 0:
            raise InputError("has most of its points twice at the same place; a map has each once")

    def refuse_outside(self, positions: np.ndarray, lines: np.ndarray) -> None:
        """Refuse a position (n, 2), of a line (n,), that lies beside the map."""
        low, high = self.positions.min(axis=0), self.positions.max(axis=0)
        away = np.linalg.norm(positions - positions.clip(low, high), axis=1)
        for row in np.flatnonzero(away > self.step):
            raise InputError(
                f"row {lines[row]}: ({positions[row, 0]:g}, {positions[row, 1]:g}) um is "
                f"{away[row]:.3g} um from the next indexed point; the map is from "
                f"({low[0]:g}, {low[1]:g}) to ({high[0]:g}, {high[1]:g})"
            )

    def find_grains(self) -> None:
        """Number the grains, which connect neighbours of one phase whose misorientation is small,
        and retain the points of those that are no noise.
        """
        first, second = self.tree.query_pairs(1.2 * self.step, output_type="ndarray").T
        between = (self.rotations[second] * self.rotations[first].inv()).as_quat()
        alike = np.zeros(len(first), dtype=bool)
        for phase, group in self.symmetry.items():
            own = (self.phase[first] == phase) & (self.phase[second] == phase)
            # Operations of the group are tried one after the other to save memory: a map may have
            # millions of points.
            cosine = reduce(
                np.maximum, (np.abs(between[own] @ operation) for operation in group.as_quat())
            )
            alike[own] = cosine > np.cos(np.radians(BOUNDARY_DEG) / 2)
        n = len(self.positions)
        grain = connected_components(
            coo_array((alike[alike], (first[alike], second[alike])), shape=(n, n)), directed=False
        )[1]
        own = np.flatnonzero(np.bincount(grain)[grain] >= LEAST_PIXELS)
        if not len(own):
            raise InputError(f"has no grain of {LEAST_PIXELS} points")
        self.positions, self.phase, self.grain = self.positions[own], self.phase[own], grain[own]
        self.rotations, self.tree = self.rotations[own], cKDTree(self.positions)

    def compare_phase(
        self, phases: np.ndarray, symmetry: str | None, lines: np.ndarray
    ) -> list[tuple]:
        """Compare the phase at each indent (n,), of a line (n,), with the stated `symmetry`, and
        return the warnings. Several phases are refused, and a symmetry in which equivalent
        orientations of the phase are not equivalent.
        """
        number = int(phases[0])
        name = self.phases[number].name
        if len(others := np.flatnonzero(phases != number)):
            raise InputError(
                f"the indent of row {lines[0]} is on the phase {name}, those of "
                f"rows {abridged(lines[others])} are on "
                f"{self.phases[phases[others[0]]].name}; leave one "
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
        # The seven mistakes are those of fortran/rivals/order_rivals.f90. A position beside
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

    def mean_orientation(self, inside: np.ndarray) -> list[float]:
        """Bunge's angles of the mean orientation of points (n,) of a grain, nearest first, and the
        sd of the tilt of the indented direction per component, in degrees.
        """
        group, rotations = self.symmetry[int(self.phase[inside[0]])], self.rotations[inside]
        # Each orientation is replaced by its equivalent that is nearest to the first one.
        cosine = np.abs((rotations[0] * rotations.inv()).as_quat() @ group.as_quat().T)
        aligned = group[cosine.argmax(axis=1)] * rotations
        # Points beyond a boundary of small angle differ from the nearest ones by more than most.
        off = (aligned * aligned[:10].mean().inv()).magnitude()
        aligned = aligned[off <= 3 * np.median(off)]
        mean = aligned.mean()
        tilt = np.arccos(np.clip(aligned.apply(NORMAL) @ mean.apply(NORMAL), -1, 1))
        with catch_warnings():
            # Where Phi is 0, only the sum of the other angles is known.
            simplefilter("ignore")
            euler = mean.inv().as_euler("ZXZ", degrees=True) % 360
        return [*euler.tolist(), float(np.degrees(np.sqrt(np.mean(tilt**2) / 2)))]

    def distance_to_boundary(self, position: np.ndarray, grain: int, near: np.ndarray) -> float:
        """The distance in um from a position to the nearest point of another grain, less half a
        step; to the farthest point of the map if there is no other grain. `near` are numbers of
        points (n,) of other grains, the nearest one among them; none if they are not known.
        """
        others = self.positions[near if len(near) else self.grain != grain]
        if not len(others):
            return float(np.linalg.norm(self.positions - position, axis=1).max())
        return float(
            max(np.linalg.norm(others - position, axis=1).min() - self.step / 2, self.step / 2)
        )
