"""Read orientation maps of several makers, and find the crystal axes to which their angles refer.

For a point without a solution EDAX writes 4 pi for each angle, a fit of 180 degrees, and a
confidence index of -1 or 0; Oxford writes the phase 0. EDAX numbers a single phase 0 or 1. The
angles of a .ctf refer to the primary axes of the sample (CS0), those of a .h5oina to its surface
(CS1).
"""

import re
from configparser import ConfigParser
from dataclasses import dataclass, field
from io import StringIO
from pathlib import Path
from typing import Any

import h5py
import numpy as np
import pandas as pd
from scipy.spatial.transform import Rotation

from ..core import InputError
from ..crystal.directions import representative
from ..crystal.elasticity import class_name
from .other_files import decoded, reader_of, reading

#: Orientation of the crystal axes in the unit cell, by the values of `crystal_axes`.
AXES = {"a": "x along a, z along c*", "a*": "x along a*, z along c"}
#: Laue classes by their numbers in Oxford's files.
LAUE = "none -1 2/m mmm 4/m 4/mmm -3 -3m 6/m 6/mmm m-3 m-3m"
#: Largest number of signs of a header of .ang.
HEADER = 100_000
#: An angle in radians above any true one and below 4 pi.
ABOVE_ANGLES = 12.5


@dataclass
class MapPoints:
    """The points of a map.

    `positions` are (n, 2) in `unit`, `rotations` lead from sample to crystal axes, and `phase` are
    the numbers of the phases (n,); a point whose number is not among `phases`, which are those of
    orix, is not indexed. `axes` is the convention of the format for the crystal axes: one of
    `AXES`, or None if its angles may follow either. `warnings` are codes and subjects of
    diagnostics.
    """

    positions: np.ndarray
    rotations: Rotation
    phase: np.ndarray
    phases: dict[int, Any]
    axes: str | None = None
    unit: str = "um"
    warnings: list[tuple[str, str]] = field(default_factory=list)


def load_map(path: Path) -> MapPoints:
    """The points of the map in a file."""
    ending = path.suffix.lower()
    if ending in (".oh5", ".osc"):
        raise InputError(f"maps {ending} are not read; export the map as .ang")
    reader_of(path, "an orientation map", "orix.io")
    with reading(f"is no map {ending} that can be read; export it again"):
        readers = {".ang": edax_text, ".ctf": channel_text, ".h5oina": oxford_map}
        readers |= dict.fromkeys((".cpr", ".crc"), oxford_binary)
        return readers.get(ending, orix_map)(path)


def orix_map(path: Path) -> MapPoints:
    """The map of a file .h5 of Bruker, EMsoft or orix."""
    # The package is optional.
    from orix import io

    loaded = io.load(str(path))
    best = loaded.rotations[:, 0] if loaded.rotations.ndim > 1 else loaded.rotations
    with h5py.File(path) as file:
        maker = np.ravel(file.get("manufacturer", [""]))[0]
    y = loaded.y
    if "YSAMPLE" in loaded.prop:
        # orix sorts the points of Bruker by rows, but not y.
        y = loaded.prop["YSAMPLE"] - np.min(loaded.prop["YSAMPLE"])
    return MapPoints(
        np.column_stack([loaded.x, y]),
        rotations_of(best),
        loaded.phase_id,
        {number: phase for number, phase in loaded.phases if number >= 0},
        "a" if maker in (b"orix", "orix") else None,
        loaded.scan_unit,
    )


def oxford_map(path: Path) -> MapPoints:
    """The first slice of a file, by Oxford's specification of H5OINA: angles in radians against the
    surface, positions in um, which may be absent, and phases from 1; 0 is not indexed.
    """
    with h5py.File(path) as file:
        header, data = file["1/EBSD/Header"], file["1/EBSD/Data"]
        phases = {}
        for number, phase in header["Phases"].items():
            name, laue = (np.ravel(phase[key])[0] for key in ("Phase Name", "Laue Group"))
            cell = np.append(phase["Lattice Dimensions"], np.degrees(phase["Lattice Angles"]))
            phases[int(number)] = phase_of(name.decode(), LAUE.split()[laue], cell)
        number = np.ravel(data["Phase"]).astype(int)
        if "X" in data:
            places = [np.ravel(data["X"]), np.ravel(data["Y"])]
        else:
            keys = ("X Cells", "X Step", "Y Step")
            cells, step, step_y = (np.ravel(header[key])[0] for key in keys)
            row, column = np.divmod(np.arange(len(number)), cells)
            places = [column * step, row * step_y]
        euler = np.asarray(data["Euler"], float)
    number[np.isnan(euler).any(axis=1)] = 0
    return MapPoints(np.column_stack(places), bunge(euler), number, phases, "a*")


def channel_text(path: Path) -> MapPoints:
    """The map of a file .ctf, whose decimals may have commas."""
    header, names, rows = re.split(r"^(Phase\s+X\s.*)$", text_of(path), maxsplit=1, flags=re.M)
    columns = dict(zip(names.split(), numbers(rows)))
    phases = {}
    lines = re.split(r"^Phases\b.*$", header, flags=re.M)[1].strip().splitlines()
    for number, line in enumerate(lines, 1):
        lengths, angles, name, laue = line.split("\t")[:4]
        cell = f"{lengths};{angles}".split(";")
        phases[number] = phase_of(name, LAUE.split()[int(laue)], cell)
    rotations = bunge(np.radians([columns[f"Euler{k}"] for k in (1, 2, 3)]).T)
    surface = [float(angle) for angle in re.findall(r"^AcqE\d\s+(\S+)", header, re.M)]
    frame = re.search(r"^Euler angles refer to .*\((CS[01])\)", header, re.M)
    turn, warnings = turn_to_surface(surface, frame[1] if frame else "")
    positions = np.column_stack([columns["X"], columns["Y"]])
    phase = columns["Phase"].astype(int)
    return MapPoints(positions, rotations * turn, phase, phases, warnings=warnings)


def turn_to_surface(surface: list[float], frame: str) -> tuple[Rotation, list[tuple[str, str]]]:
    """The rotation from the acquisition surface, whose Bunge angles in CS0 are `surface` in
    degrees, to the `frame` of a map's angles, CS0 or CS1, and warnings. A turn about the normal of
    the surface leaves the indented direction.
    """
    if frame == "CS1" or not np.sin(np.radians(surface[1:2])).round(6).any():
        return Rotation.identity(), []
    words = f"the header has the acquisition surface AcqE1-3 = {surface} degrees"
    if not frame:
        raise InputError(
            f"{words}, and states neither CS0 nor CS1 for the angles; export the map as "
            ".h5oina, whose angles refer to the surface"
        )
    applied = f"{words}; the angles are turned from CS0 to this surface"
    return Rotation.from_euler("ZXZ", surface, degrees=True), [("surface_turned", applied)]


def oxford_binary(path: Path) -> MapPoints:
    """The map of two files: .cpr with facts, and .crc, where each point has the number of its
    phase, 0 if it is not indexed, and the fields that .cpr lists: bytes those from 7 to 11, others
    single precision.
    """
    facts = ConfigParser(delimiters="=", allow_no_value=True, strict=False, interpolation=None)
    facts.read_string(text_of(path.with_suffix(".cpr")))
    fields = [facts["Fields"][f"Field{k}"] for k in range(1, 1 + int(facts["Fields"]["Count"]))]
    kinds = [(field, "u1" if 7 <= int(field) <= 11 else "<f4") for field in fields]
    points = np.fromfile(path.with_suffix(".crc"), [("phase", "u1"), *kinds])
    job, phases = facts["Job"], {}
    for number in range(1, 1 + int(facts["Phases"]["Count"])):
        phase = facts[f"Phase{number}"]
        cell = map(phase.get, ("a", "b", "c", "alpha", "beta", "gamma"))
        phases[number] = phase_of(
            phase["StructureName"], LAUE.split()[int(phase["LaueGroup"])], cell
        )
    row, column = np.divmod(np.arange(len(points)), int(job["xCells"]))
    positions = np.column_stack([column * float(job["GridDistX"]), row * float(job["GridDistY"])])
    surface = facts["Acquisition Surface"]
    turn_to_surface([float(surface[f"Euler{k}"]) for k in (1, 2, 3)], "")
    euler = np.column_stack([points[field] for field in "345"])
    return MapPoints(positions, bunge(euler), points["phase"].astype(int), phases)


def edax_text(path: Path) -> MapPoints:
    """The map of a file .ang: three angles in radians, x, y, the quality of the image, the index of
    confidence, and the phase; then, if there are more columns, the detector's signal, the fit in
    degrees, and others.
    """
    text = text_of(path)
    order, *found = (
        re.findall(rf"^# *{word}[ \t:]+(.*)$", text[:HEADER], re.M)
        for word in (r"Phase(?=[ \t:]+\d+\s)", "MaterialName", "Symmetry", "LatticeConstants")
    )
    phases = {
        int(number): phase_of(name, group, cell.split())
        for number, name, group, cell in zip(order or range(1, 1 + len(found[0])), *found)
    }
    columns = numbers(text)
    euler, index, phase = columns[:3].T, columns[6], columns[7].astype(int)
    # A single phase has the number 0, unless this means no solution.
    if len(phases) == 1 and not np.isin(phase, [*phases]).any():
        phase[:] = [*phases]
    elif not phases or (columns[7] % 1).any():
        raise ValueError
    lost = (euler > ABOVE_ANGLES).any(axis=1) | (index < 0)
    lost |= (columns[9:10] >= 180).any(axis=0)
    # Zeros where the confidence index is in use.
    lost |= (index == 0) & ~euler.any(axis=1) & (index > 0).any()
    phase[lost] = -1
    unit = "nm" if "ACOM" in text[:HEADER] else "um"
    return MapPoints(columns[3:5].T, bunge(euler), phase, phases, unit=unit)


def text_of(path: Path) -> str:
    """The text of a file, with a decimal point for each comma and one sign at the end of a line."""
    return re.sub(r",(?=\d)", ".", decoded(path.read_bytes())[0]).replace("\r\n", "\n")


def numbers(rows: str) -> np.ndarray:
    """The columns (k, n) of n rows of numbers."""
    # Without its filter pandas refuses cells that are missing.
    table = pd.read_csv(
        StringIO(rows), sep=r"\s+", header=None, comment="#", dtype=float, na_filter=False
    )
    return table.to_numpy().T


def phase_of(name: str, group: str, cell: Any) -> Any:
    """The phase of orix with a point group and a cell: a, b, c, and angles in degrees, or texts of
    these numbers.
    """
    # The packages are optional.
    from diffpy.structure import Lattice, Structure
    from orix.crystal_map import Phase

    return Phase(
        name.strip(),
        point_group=group.strip(),
        structure=Structure(lattice=Lattice(*map(float, cell))),
    )


def bunge(euler: np.ndarray) -> Rotation:
    """Rotations from sample to crystal axes for Bunge's angles (n, 3) in radians."""
    return Rotation.from_euler("ZXZ", np.nan_to_num(euler)).inv()


def rotations_of(rotations: Any) -> Rotation:
    """Rotations of orix, whose quaternions begin with the scalar."""
    return Rotation.from_quat(rotations.data, scalar_first=True)


def turn_of_axes(group: Any, lattice: Any, stated: str | None, of_file: str | None) -> Rotation:
    """The rotation from a map's crystal axes to those of the IEEE standard, z along c, y normal to
    (010), for a phase with this Laue class and `lattice`.
    """
    angles = np.array(lattice.abcABG()[3:])
    # Laue classes with one axis of order 3 or 6 begin with it.
    if group.name.strip("-")[0] in "36":
        if abs(angles[0] - 90.0) > 0.01:
            raise InputError(
                f"a phase {group.name} has a rhombohedral cell, alpha {angles[0]:g} degrees;"
                " export the map with the hexagonal setting"
            )
        # The angles of trigonal and hexagonal phases refer to the hexagonal cell.
        angles = np.array([90.0, 90.0, 120.0])
    oblique = (np.abs(angles - 90.0) > 0.01).tolist()
    if (has_axis_along_z(group) and oblique != [False, True, False]) or (
        group.proper_subgroup.size == 1 and not any(oblique)
    ):
        raise InputError(
            f"the cell of a phase {group.name} has alpha, beta and gamma of "
            f"{', '.join(f'{angle:g}' for angle in angles)} degrees; "
            "two of them are 90 where the two-fold axis is along b, and not all of a triclinic cell"
        )
    turns = {axes: turn_of_cell(lattice, angles, axes) for axes in AXES}
    images = representative(
        class_name(group.name), np.array([turn.apply([0.3, 0.5, 0.8]) for turn in turns.values()])
    )
    if np.ptp(images, axis=0).max() < 1e-6:
        return turns["a"]
    if stated and of_file and stated != of_file:
        raise InputError(
            f"crystal_axes = '{stated}', but this format has {AXES[of_file]}; leave "
            "crystal_axes out"
        )
    if not (axes := stated or of_file):
        known = ", or ".join(f"'{word}' ({words})" for word, words in AXES.items())
        raise InputError(
            f"the file does not say how the axes of its crystals ({group.name}) lie in "
            f"their cell; state crystal_axes = {known}"
        )
    return turns[axes]


def turn_of_cell(lattice: Any, angles: np.ndarray, axes: str) -> Rotation:
    """The same rotation for one of `AXES` and the angles of a cell in degrees, with a `lattice` of
    the class that is to be used.
    """
    # Along a, b and c, in axes with x along a* and z along c.
    a, b, c = type(lattice)(1, 1, 1, *angles).base
    standard = frame(np.cross(np.cross(c, a), c), c)
    return Rotation.from_matrix(standard @ frame(a, np.cross(a, b)).T if axes == "a" else standard)


def frame(x: np.ndarray, z: np.ndarray) -> np.ndarray:
    """The right-handed axes, as rows, with x and z along two vectors normal to each other."""
    x, z = x / np.linalg.norm(x), z / np.linalg.norm(z)
    return np.array([x, np.cross(z, x), z])


def has_axis_along_z(group: Any) -> bool:
    """Whether a Laue class of orix has a single two-fold axis, along z; the IEEE standard has it
    along y.
    """
    return group.proper_subgroup.size == 2 and abs(group.proper_subgroup.axis.data[-1, 2]) > 0.5


def from_standard(group: Any) -> Rotation:
    """The rotation from the crystal axes of the IEEE standard to those of a Laue class of orix."""
    return Rotation.from_euler("x", 90.0 if has_axis_along_z(group) else 0.0, degrees=True)
