"""Read orientation maps, from files that orix reads and from Oxford's .h5oina, and find the crystal
axes to which their angles refer.
"""

from contextlib import redirect_stdout
from io import StringIO
from pathlib import Path
from typing import Any

import h5py
import numpy as np
from scipy.spatial.transform import Rotation

from ..core import InputError
from ..crystal.directions import representative
from ..crystal.elasticity import class_name
from .other_files import reader_of, reading

#: Orientation of the crystal axes in the unit cell, by the values of `crystal_axes`.
AXES = {"a": "x along a, z along c*", "a*": "x along a*, z along c"}


def load_map(path: Path) -> Any:
    """The map of a file as an object of orix."""
    io = reader_of(path, "an orientation map", "orix.io")
    if path.suffix.lower() == ".h5oina":
        with reading("is no map of Oxford's .h5oina"), h5py.File(path) as file:
            return oxford_map(file)
    if path.suffix.lower() in (".oh5", ".cpr", ".crc"):
        raise InputError(
            f"maps {path.suffix} are not read; export the map as .ang or .ctf, or as .h5oina"
        )
    # orix prints the names of the phases.
    with reading("is no map that orix reads"), redirect_stdout(StringIO()):
        return io.load(str(path))


def oxford_map(file: h5py.File) -> Any:
    """The first slice of a file, by Oxford's specification of H5OINA: angles in radians, positions
    in um, phases from 1; 0 is not indexed.
    """
    # The package is optional.
    from diffpy.structure import Lattice, Structure
    from orix.crystal_map import CrystalMap, Phase, PhaseList
    from orix.quaternion import Rotation as Orientations

    scan = file["1/EBSD"]
    phases = {}
    for number, phase in scan["Header/Phases"].items():
        name = np.ravel(phase["Phase Name"])[0]
        lattice = Lattice(
            *np.ravel(phase["Lattice Dimensions"]), *np.degrees(np.ravel(phase["Lattice Angles"]))
        )
        symbol = phase["Laue Group"].attrs["Symbol"]
        name, symbol = (
            text.decode() if isinstance(text, bytes) else str(text)
            for text in (name, np.ravel(symbol)[0])
        )
        phases[int(number)] = Phase(name, point_group=symbol, structure=Structure(lattice=lattice))
    data = scan["Data"]
    phase_id = np.ravel(data["Phase"]).astype(int)
    phase_id[phase_id == 0] = -1
    found = PhaseList(
        {number: phases[number] for number in np.unique(phase_id[phase_id > 0]).tolist()}
    )
    rotations = Orientations.from_euler(np.asarray(data["Euler"], float))
    return CrystalMap(
        rotations,
        phase_id,
        np.ravel(data["X"]),
        np.ravel(data["Y"]),
        phase_list=found,
        scan_unit="um",
    )


def axes_of_file(path: Path) -> str | None:
    """The convention of a file's format for the crystal axes: one of `AXES`, or None if its angles
    may follow either.
    """
    if path.suffix.lower() == ".h5oina":
        return "a*"
    try:
        with h5py.File(path) as file:
            maker = np.ravel(file["manufacturer"])[0]
    except (OSError, KeyError):
        return None
    return "a" if maker in (b"orix", "orix") else None


def turn_of_axes(group: Any, lattice: Any, stated: str | None, of_file: str | None) -> Rotation:
    """The rotation from a map's crystal axes to those of the IEEE standard, z along c, y normal to
    (010), for a phase with this Laue class and `lattice`.
    """
    operations = group.proper_subgroup
    angles = np.array(lattice.abcABG()[3:])
    if (
        np.isclose(operations.angle, 2 * np.pi / 3) & (np.abs(operations.axis.data[:, 2]) > 0.99)
    ).any():
        # The angles of trigonal and hexagonal phases refer to the hexagonal cell.
        angles = np.array([90.0, 90.0, 120.0])
    oblique = (np.abs(angles - 90.0) > 0.01).tolist()
    if (has_axis_along_z(group) and oblique != [False, True, False]) or (
        operations.size == 1 and not any(oblique)
    ):
        raise InputError(
            f"the cell of a phase {group.name} has alpha, beta and gamma of "
            f"{', '.join(f'{angle:g}' for angle in angles)} degrees; "
            "two of them are 90 where the two-fold axis is along b, and not all of a triclinic cell"
        )
    turns = {axes: turn_of_cell(angles, axes) for axes in AXES}
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


def turn_of_cell(angles: np.ndarray, axes: str) -> Rotation:
    """The same rotation for one of `AXES` and the angles of a cell in degrees."""
    alpha, beta, gamma = np.radians(angles)
    # Unit vectors along a, b and c: a along x, b in the plane of x and y.
    a, b = np.array([1.0, 0.0, 0.0]), np.array([np.cos(gamma), np.sin(gamma), 0.0])
    y = (np.cos(alpha) - np.cos(beta) * np.cos(gamma)) / np.sin(gamma)
    c = np.array([np.cos(beta), y, np.sqrt(max(1.0 - np.cos(beta) ** 2 - y**2, 0.0))])
    standard = frame(np.cross(np.cross(c, a), c), c)
    return Rotation.from_matrix(
        standard @ (frame(a, np.cross(a, b)) if axes == "a" else frame(np.cross(b, c), c)).T
    )


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
