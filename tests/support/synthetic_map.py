"""A synthetic orientation map of copper with indents, for the tutorial: grains of a Voronoi
diagram, exact half-space theory and noise.

PYTHONPATH=tests .venv/bin/python -m support.synthetic_map inputs/data
writes copper_map.ctf, copper_map_indents.csv and copper_map_points.csv.
"""

import sys
from pathlib import Path

import numpy as np
from scipy.spatial import cKDTree
from scipy.spatial.transform import Rotation

from support.reference_theory import direct_modulus, stiffness

#: C11, C12, C44 of copper, GPa; noise of a modulus, GPa; spread of the orientations within a grain,
#: degrees.
COPPER, NOISE, SPREAD_DEG = (168.4, 121.4, 75.4), 2.0, 0.3
COLUMNS, ROWS, GRAINS, STEP_UM = 44, 32, 14, 2.0
#: Stage = TURN map + OFFSET: the sample is rotated slightly under the indenter.
TURN, OFFSET_UM = np.array([[0.999, 0.035], [-0.035, 0.999]]), np.array([12040.0, 8310.0])


def write(folder: Path) -> None:
    """Write the three files."""
    rng = np.random.default_rng(21)
    size = np.array([COLUMNS, ROWS]) * STEP_UM
    seeds = np.array(
        [[(k % 5 + 0.5) / 5, (k // 5 + 0.5) / 3] for k in range(GRAINS)]
    ) * size + rng.uniform(-4, 4, (GRAINS, 2))
    grains = Rotation.random(GRAINS, random_state=21)
    y, x = (part.ravel() * STEP_UM for part in np.mgrid[:ROWS, :COLUMNS])
    grain = cKDTree(seeds).query(np.column_stack([x, y]))[1]
    tilts = Rotation.from_rotvec(np.radians(SPREAD_DEG) * rng.normal(size=(len(x), 3)))
    # Orientations lead from sample to crystal axes; Bunge's angles are those of their inverse in
    # SciPy's convention.
    euler = (grains[grain] * tilts).inv().as_euler("ZXZ", degrees=True) % 360
    lines = [
        "Channel Text File",
        "Prj\tsynthetic: copper, Voronoi grains",
        "Author\t[synthetic]",
        "JobMode\tGrid",
        f"XCells\t{COLUMNS}",
        f"YCells\t{ROWS}",
        f"XStep\t{STEP_UM}",
        f"YStep\t{STEP_UM}",
        "AcqE1\t0",
        "AcqE2\t0",
        "AcqE3\t0",
        "Euler angles refer to Sample Coordinate system (CS0)!\tMag\t100",
        "Phases\t1",
        "3.615;3.615;3.615\t90;90;90\tCopper\t11\t225\t\t\t",
        "Phase\tX\tY\tBands\tError\tEuler1\tEuler2\tEuler3\tMAD\tBC\tBS",
    ]
    lines += [
        f"1\t{a:g}\t{b:g}\t8\t0\t{e[0]:.2f}\t{e[1]:.2f}\t{e[2]:.2f}\t0.5\t100\t100"
        for a, b, e in zip(x, y, euler, strict=True)
    ]
    (folder / "copper_map.ctf").write_text("\n".join(lines) + "\n", encoding="ascii")
    # An indent in the middle of each grain, and its modulus.
    places = np.array([np.column_stack([x, y])[grain == k].mean(axis=0) for k in range(GRAINS)])
    angles = grains.inv().as_euler("ZXZ", degrees=True) % 360
    copper = stiffness("cubic", np.array(COPPER))
    moduli = direct_modulus(copper, angles) + NOISE * rng.normal(size=GRAINS)
    stage = places @ TURN.T + OFFSET_UM
    rows = [f"{a:.1f},{b:.1f},{m:.1f},{NOISE}" for (a, b), m in zip(stage, moduli, strict=True)]
    head = (
        f"# synthetic: exact half-space theory at {COPPER} GPa (C11,C12,C44) plus N(0, {NOISE} "
        "GPa) noise\n"
    )
    (folder / "copper_map_indents.csv").write_text(
        head + "x_um,y_um,indentation_modulus_gpa,sd_gpa\n" + "\n".join(rows) + "\n",
        encoding="ascii",
    )
    corners = np.array([[2, 2], [82, 4], [80, 58], [4, 60]], float)
    seen = corners @ TURN.T + OFFSET_UM + rng.normal(0, 0.3, (4, 2))
    rows = [
        f"{s[0]:.1f},{s[1]:.1f},{m[0]:.1f},{m[1]:.1f}" for s, m in zip(seen, corners, strict=True)
    ]
    head = (
        "# synthetic: marks of the sample, seen by the stage and on the map\n"
        "x_um,y_um,map_x_um,map_y_um\n"
    )
    (folder / "copper_map_points.csv").write_text(head + "\n".join(rows) + "\n", encoding="ascii")


if __name__ == "__main__":
    write(Path(sys.argv[1]))
