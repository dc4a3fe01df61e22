"""Small orientation maps (EBSD) of two grains, written in the formats of two vendors and of orix,
and tables of indents on them.
"""

import numpy as np
from scipy.spatial.transform import Rotation

import bayesindent as bi

__all__ = [
    "EDGE",
    "LEFT",
    "RIGHT",
    "STEP",
    "along",
    "bunge",
    "columns",
    "measured",
    "pixels",
    "write",
]

STEP, EDGE = 0.5, 8.0
#: Bunge's angles of the grains left and right of x = EDGE, degrees.
LEFT, RIGHT = (30.0, 40.0, 70.0), (200.0, 75.0, 20.0)
SD_DEG = 0.4


def bunge(euler_deg):
    """The rotation from sample to crystal axes."""
    return Rotation.from_euler("ZXZ", euler_deg, degrees=True).inv()


def pixels(equivalents=False, sd=SD_DEG):
    """Positions and angles (degrees) of a map of 30 x 20 points: two grains, tilted a little from
    point to point.
    """
    y, x = (part.ravel() * STEP for part in np.mgrid[:20, :30])
    rng = np.random.default_rng(3)
    tilt = Rotation.from_rotvec(np.radians(sd) * rng.normal(size=(len(x), 3)))
    quarter = Rotation.from_rotvec(
        np.outer(np.pi / 2 * rng.integers(0, 4 if equivalents else 1, len(x)), [0, 0, 1])
    )
    mean = bunge(np.where((x < EDGE)[:, None], LEFT, RIGHT))
    return x, y, (quarter * mean * tilt).inv().as_euler("ZXZ", degrees=True) % 360


def write(path, x, y, euler, point_group="m-3m", phases=None):
    """Write the map in the format of the file's ending; return its path."""
    if path.suffix == ".ctf":
        lines = [
            "Channel Text File",
            "Prj\tmade by hand",
            "Author\t[Unknown]",
            "JobMode\tGrid",
            "XCells\t30",
            "YCells\t20",
            f"XStep\t{STEP}",
            f"YStep\t{STEP}",
            "AcqE1\t0",
            "AcqE2\t0",
            "AcqE3\t0",
            "Euler angles refer to Sample Coordinate system (CS0)!\tMag\t100",
            "Phases\t1",
            "2.866;2.866;2.866\t90;90;90\tIron bcc (old)\t11\t229\t\t\t",
            "Phase\tX\tY\tBands\tError\tEuler1\tEuler2\tEuler3\tMAD\tBC\tBS",
        ]
        lines += [
            f"1\t{a:.4f}\t{b:.4f}\t8\t0\t{e[0]:.5f}\t{e[1]:.5f}\t{e[2]:.5f}\t0.5\t100\t100"
            for a, b, e in zip(x, y, euler, strict=True)
        ]
        path.write_text("\n".join(lines) + "\n")
        return path
    from orix import io
    from orix.crystal_map import CrystalMap, Phase, PhaseList
    from orix.quaternion import Rotation as Orientations

    numbers = np.ones(len(x), int) if phases is None else phases
    known = {1: Phase("iron", point_group=point_group), 2: Phase("second", point_group=point_group)}
    present = PhaseList(
        {number: known[number] for number in np.unique(numbers[numbers > 0]).tolist()}
    )
    rotations = Orientations.from_euler(np.radians(euler))
    io.save(str(path), CrystalMap(rotations, numbers, x, y, phase_list=present, scan_unit="um"))
    return path


def measured(path, positions, symmetry="cubic", **further):
    table = dict(zip(("x_um", "y_um"), np.asarray(positions, float).T.tolist(), strict=True))
    table |= {
        "Er": [200.0 + k for k in range(len(positions))],
        "sd": len(positions) * [4.0],
    } | further
    return bi.Problem.from_keywords(
        "f", {"measurements": table}, problem={"symmetry": symmetry}, measurements={"ebsd": path}
    )


def along(euler_deg):
    """The indented direction up to the symmetry of the cube."""
    return np.sort(np.abs(bunge(euler_deg).apply([0, 0, 1])), axis=-1)


def columns(problem, *names):
    """The values that the map added to the table, for each of these columns."""
    table = problem.table
    return [list(table.cells[table.column(name)]) for name in names]
