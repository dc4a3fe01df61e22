"""Orientation maps as their makers write them: points that are not indexed, decimal commas, frames
of the angles, and imprints or stray points below the indents. The maps are made here.
"""

import h5py
import numpy as np
import pytest
from scipy.spatial import cKDTree
from scipy.spatial.transform import Rotation

import bayesindent as bi
from support.diagnostics import codes, of_code
from support.orientation_maps import LEFT, RIGHT, along, bunge, measured, pixels, write
from support.tree import REFERENCE

pytest.importorskip("orix.io")
from orix.quaternion import symmetry as groups

STEP = 2.0
LOST = 4 * np.pi


def copper():
    """Positions and angles of the map, and rows of its indents."""
    angles = np.loadtxt(REFERENCE / "ebsd_copper.csv", delimiter=",")
    y, x = STEP * np.indices((30, 40)).reshape(2, -1)
    indents = np.loadtxt(REFERENCE / "ebsd_copper_indents.csv", delimiter=",")
    return np.column_stack([x, y]), angles, indents


def channel_text(
    path, at, angles, phase, surface=(0, 0, 0), frame="Sample .. (CS0)!", commas=False
):
    """Write a .ctf of a cubic phase with Z between the usual columns and one column more."""
    lines = ["Channel Text File", "Prj\tsample µ", "JobMode\tGrid", f"XStep\t{STEP}"]
    lines += [f"AcqE{k}\t{angle}" for k, angle in enumerate(surface, 1)]
    lines += [f"Euler angles refer to {frame}\tMag\t100", "Phases\t1"]
    lines += ["3.615;3.615;3.615\t90;90;90\tCopper\t11\t225\t\t\t"]
    lines += ["Phase\tX\tY\tZ\tBands\tError\tEuler1\tEuler2\tEuler3\tMAD\tBC\tBS\tGrainIndex"]
    for number, (x, y), e in zip(phase, at, angles, strict=True):
        lines.append(
            f"{number}\t{x}\t{y}\t0\t8\t0\t{e[0]:.3f}\t{e[1]:.3f}\t{e[2]:.3f}\t0.5\t9\t9\t1"
        )
    text = "\r\n".join(lines)
    path.write_bytes((text.replace(".", ",") if commas else text).encode("cp1252"))
    return path


def edax(path, at, angles, rows, phases=("43",), numbered=True):
    """Write an .ang, whose angles are in radians and followed in each row by x, y and `rows`."""
    lines = ["# TEM_PIXperUM 1.000000", "# PhaseDiffFactor_Fit  1", "# NOTES: Start"]
    lines += ["# Phase index: 0 for single phase, starting at 1 for multiphase", "#"]
    for number, symbol in enumerate(phases, 1):
        lines += [f"# Phase {number}"] * numbered
        lines += [f"# MaterialName  \tMetal {number}", "# Formula     \tM", "# Info", "#"]
        lines += [f"# Symmetry              {symbol}"]
        lines += ["# LatticeConstants      3.2 3.2 5.1  90.000  90.000  90.000", "#"]
    lines += ["# GRID: SqrGrid", "# COLUMN_HEADERS: phi1, PHI, phi2, x, y, IQ, CI, Phase index"]
    for e, xy, row in zip(angles, at, rows, strict=True):
        lines.append(" ".join(f"{value:.5f}" for value in (*e, *xy, *row)))
    path.write_text("\n".join(lines) + "\n")
    return path


def away(positions, indents):
    return cKDTree(indents).query(positions)[0]


def case(path, name):
    """Write one of the cases on copper."""
    at, angles, indents = copper()
    phase, places = np.ones(len(at), int), indents[:, :2]
    if name == "4 pi":
        rows = np.tile([1500.0, 0.8, 0, 1, 1.0], (len(at), 1))
        # Imprints of 3 x 3 points under four indents.
        apart = np.abs(at[:, None] - places[[0, 3, 5, 9]]).max(axis=2).min(axis=1)
        rows[apart < 3] = [200.0, 0, 0, 1, 180.0]
        euler = np.where((apart < 3)[:, None], LOST, np.radians(angles))
        return edax(path.with_suffix(".ang"), at, euler, rows), 36
    if name == "spikes":
        angles[cKDTree(at).query(places)[1]] = indents[:, 3:]
    if name == "imprints":
        phase[away(at, places) <= 4] = 0
        angles[phase == 0] = 0
    lost = int(np.sum(phase == 0))
    return channel_text(path.with_suffix(".ctf"), at, angles, phase, commas=name == "commas"), lost


@pytest.mark.parametrize("name", ["plain", "4 pi", "imprints", "spikes", "commas"])
def test_each_indent_of_a_map_has_the_grain_around_it(tmp_path, name):
    at, angles, indents = copper()
    path, lost = case(tmp_path / "map", name)
    problem = measured(path, indents[:, :2])
    assert problem.map.rows == list(range(len(indents)))
    found = bunge(problem.measurements.euler_deg).apply([0, 0, 1])
    g = bunge(angles)
    for (x, y, *_), direction in zip(indents, found, strict=True):
        own = g[cKDTree(at).query([x, y])[1]]
        # Grains are plain by far: their points differ by less than 2 degrees, two grains by more.
        true = g[(g * own.inv()).magnitude() < np.radians(4)].mean().apply([0, 0, 1])
        assert angle_between(direction, true, groups.Oh) < 0.1
    told = [each["subject"].partition("map.")[2][5:] for each in problem.warnings if lost]
    assert (f"{lost} of 1,200 points are not indexed" in told) == (lost > 0)
    bridged = of_code(problem.warnings, "indents_bridged")
    rows = {"4 pi": "1, 4, 6, 10 are", "imprints": "1, 2, 3,", "spikes": "1, 2, 3,"}
    assert [rows[name] in each["subject"] for each in bridged] == [True] * (name in rows)


def angle_between(found, true, group):
    """The angle of two crystal directions in degrees, up to the Laue class of a group."""
    turned = Rotation.from_quat(group.proper_subgroup.data, scalar_first=True).apply(true)
    return np.degrees(np.arccos(np.clip(np.abs(turned @ found).max(), 0, 1)))


def grains(n, size, step, seed, ratio=1.0):
    """A map of n Voronoi grains: positions, grains of the points, seeds of the grains, and their
    orientations.
    """
    rng = np.random.default_rng(seed)
    y, x = np.mgrid[0 : size : ratio * step, 0:size:step].reshape(2, -1)
    at, seeds = np.column_stack([x, y]), rng.random((n, 2)) * size
    # Indents lie where the next boundary is farther than an imprint is wide.
    return at, cKDTree(seeds).query(at)[1], seeds, Rotation.random(n, rng=rng), rng


def within(at, grain, seeds, radius):
    """The seeds whose surroundings of this radius are one grain, with some distance off."""
    near = cKDTree(at).query_ball_point(seeds, radius)
    inner = ((seeds > 1.5) & (seeds < at.max(axis=0) - 1.5)).all(axis=1)
    return [
        k for k, around in enumerate(near) if inner[k] and around and (grain[around] == k).all()
    ]


def angles_of(g, grain, rng):
    tilt = Rotation.from_rotvec(np.radians(0.3) * rng.normal(size=(len(grain), 3)))
    return (g[grain] * tilt).inv().as_euler("ZXZ") % (2 * np.pi)


def made(path, name):
    """A map of its name, the orientations of its grains, their seeds, and those to be indented."""
    if name == "titanium":
        # OIM 8: 13 columns; imprints without a solution, and a second phase that is nowhere.
        at, grain, seeds, g, rng = grains(60, 60.0, 0.75, 1)
        rows = np.tile([900.0, 0.6, 1, 1, 0.8, 5, 5, 5], (len(at), 1))
        indents, euler = within(at, grain, seeds, 2.5), angles_of(g, grain, rng)
        lost = away(at, seeds) < 1.5
        rows[lost], euler[lost] = [0, -1, 0, 0, 180, 0, 0, 0], LOST
        return edax(path.with_suffix(".ang"), at, euler, rows, ("62", "43")), g, seeds, indents
    if name == "old columns":
        # Eight columns, no number of the phase, stray points, 0 for no confidence.
        at, grain, seeds, g, rng = grains(50, 100.0, 1.0, 2)
        rows = np.tile([900.0, 0.3, 0], (len(at), 1))
        indents, euler = within(at, grain, seeds, 3.0), angles_of(g, grain, rng)
        stray = cKDTree(at).query(seeds)[1]
        euler[stray] = Rotation.random(len(stray), rng=rng).inv().as_euler("ZXZ") % (2 * np.pi)
        lost = rng.random(len(at)) < 0.1
        rows[lost], euler[lost] = 0, 0
        return edax(path.with_suffix(".ang"), at, euler, rows, ("43",), False), g, seeds, indents
    if name == "rectangles":
        # Steps of 1 and 2 um, and the surface turned from the axes of the angles.
        at, grain, seeds, g, rng = grains(50, 120.0, 1.0, 3, 2.0)
        surface = (70, 40, 110)
        turn = Rotation.from_euler("ZXZ", surface, degrees=True).inv()
        euler, indents = angles_of(g * turn, grain, rng), within(at, grain, seeds, 4.5)
        phase = (away(at, seeds) > 2.0).astype(int)
        written = channel_text(path.with_suffix(".ctf"), at, np.degrees(euler), phase, surface)
        return written, g, seeds, indents
    if name == "quartz":
        # Without X and Y; the surface is that of the angles, whatever its orientation.
        at, grain, seeds, g, rng = grains(50, 40.0, 0.5, 4)
        euler, indents = angles_of(g, grain, rng), within(at, grain, seeds, 1.5)
        phase = (away(at, seeds) > 1.0).astype(int)
        euler[rng.random(len(at)) < 0.05] = np.nan
        path = path.with_suffix(".h5oina")
        with h5py.File(path, "w") as file:
            header, data = (file.create_group(f"1/EBSD/{part}") for part in ("Header", "Data"))
            data["Euler"], data["Phase"] = euler.astype(np.float32), phase.astype(np.uint8)
            header["X Cells"], header["Y Cells"] = np.int32([80]), np.int32([80])
            header["X Step"], header["Y Step"] = np.float32([0.5]), np.float32([0.5])
            header["Specimen Orientation Euler"] = np.float32([[0.3, 1.2, 0.1]])
            crystal = header.create_group("Phases/1")
            crystal["Phase Name"], crystal["Laue Group"] = ["Quartz"], np.int32([7])
            crystal["Laue Group"].attrs["Symbol"] = "-3m"
            crystal["Lattice Dimensions"] = np.float32([[4.914, 4.914, 5.405]])
            crystal["Lattice Angles"] = np.float32([[np.pi / 2, np.pi / 2, 2 * np.pi / 3]])
        # x along a* is 30 degrees from the standard's, along a.
        return path, Rotation.from_euler("z", 30, degrees=True) * g, seeds, indents
    point_group, size, step = {"forsterite": ("mmm", 150.0, 1.5), "tin": ("4/mmm", 30.0, 0.3)}[name]
    at, grain, seeds, g, rng = grains(50, size, step, 5)
    euler, indents = np.degrees(angles_of(g, grain, rng)), within(at, grain, seeds, 3 * step)
    phase = np.where(away(at, seeds) < 1.5 * step, -1, 1)
    write(path.with_suffix(".h5"), *at.T, euler, point_group, phases=phase)
    return path.with_suffix(".h5"), g, seeds, indents


@pytest.mark.parametrize(
    ("name", "symmetry", "group"),
    [
        ("titanium", "hexagonal", groups.D6h),
        ("old columns", "cubic", groups.Oh),
        ("rectangles", "cubic", groups.Oh),
        ("quartz", "trigonal", groups.D3d),
        ("forsterite", "orthorhombic", groups.D2h),
        ("tin", "tetragonal", groups.D4h),
    ],
)
def test_maps_of_other_makers_steps_frames_and_crystals(tmp_path, name, symmetry, group):
    path, g, seeds, indents = made(tmp_path / "map", name)
    assert len(indents) > 15
    problem = measured(path, seeds[indents], symmetry, grain=[f"g{k}" for k in indents])
    rows = problem.map.rows
    found = bunge(problem.measurements.euler_deg).apply([0, 0, 1])
    true = g[np.array(indents)[rows]].apply([0, 0, 1])
    errors = [angle_between(*pair, group) for pair in zip(found, true, strict=True)]
    assert max(errors) < 0.5
    assert len(rows) >= 0.9 * len(indents)
    assert {"points_not_indexed", "indents_bridged"} <= {*codes(problem.warnings)}
    assert ("surface_turned" in codes(problem.warnings)) == (name == "rectangles")


def test_an_imprint_across_a_boundary_is_named_and_left_out(tmp_path):
    x, y, euler = pixels()
    phase = np.where(np.hypot(x - 8.0, y - 5.0) < 1.6, -1, 1)
    path = write(tmp_path / "map.h5", x, y, euler, phases=phase)
    problem = measured(path, [(2.1, 5.2), (8.0, 5.0), (12.3, 4.9)])
    assert problem.map.rows == [0, 2]
    (found,) = of_code(problem.warnings, "indents_left_out")
    assert "the indents of rows 2 (" in found["subject"]


def test_a_contact_across_a_boundary_is_left_out(tmp_path):
    path = write(tmp_path / "map.h5", *pixels())
    places = [(2.0, 5.0), (7.0, 5.0)]
    assert measured(path, places).map.rows == [0, 1]
    problem = measured(path, places, contact_radius_um=[3.0, 3.0])
    assert problem.map.rows == [0]
    # Of a disc of radius 3 um, 0.75 um from its centre: acos(u) - u sqrt(1 - u²), over pi.
    u = 0.75 / 3.0
    share = 1 - (np.arccos(u) - u * np.sqrt(1 - u**2)) / np.pi
    (found,) = of_code(problem.warnings, "indents_left_out")
    assert int(found["subject"].partition("rows 2 (")[2].partition("%")[0]) == pytest.approx(
        100 * share, abs=5
    )


def test_the_orientation_is_that_of_the_surroundings(tmp_path):
    """In a grain that bends by 0.15 degrees a point, its mean is wrong by 7 degrees at its ends."""
    y, x = (part.ravel() * 1.0 for part in np.mgrid[:20, :100])
    euler = np.column_stack([0 * x, 20 + 0.15 * x, 30 + 0 * x])
    path = write(tmp_path / "map.h5", x, y, euler)
    found = measured(path, [(10.0, 10.0), (50.0, 10.0)], grain=["a", "b"]).measurements.euler_deg
    assert found[:, 1] == pytest.approx([21.5, 27.5], abs=0.1)


def test_frames_that_are_not_stated_are_refused_by_name(tmp_path):
    at, angles, indents = copper()
    phase, places = np.ones(len(at), int), indents[:, :2]

    def euler(surface, frame):
        path = channel_text(tmp_path / "map.ctf", at, angles, phase, surface, frame)
        return measured(path, places).measurements.euler_deg

    plain = euler((0, 0, 0), "Sample Coordinate system (CS0)!")
    # A turn about the normal leaves the indented direction, and angles in CS1 are those of it.
    for surface, frame in (((90, 0, 0), "Sample (CS0)!"), ((90, 90, 0), "Surface (CS1)!")):
        assert euler(surface, frame) == pytest.approx(plain)
    with pytest.raises(
        bi.InputError,
        match=r"map.ctf: the header has the acquisition surface AcqE1-3 = \[90.0, 90.0, 0.0\] "
        "degrees, and states neither CS0 nor CS1 for the angles; export the map as .h5oina",
    ):
        euler((90, 90, 0), "Microscope (CSm)!")


def test_cells_of_another_setting_are_refused(tmp_path):
    write(path := tmp_path / "map.ctf", *pixels())
    cell = "2.866;2.866;2.866\t90;90;90\tIron bcc (old)\t11\t229"
    other = "6.4;6.4;6.4\t46.1;46.1;46.1\tCalcite\t7\t167"
    path.write_text(path.read_text().replace(cell, other))
    with pytest.raises(bi.InputError, match="has a rhombohedral cell, alpha 46.1 degrees; export"):
        measured(path, [(2.1, 5.2)], "trigonal")


def test_a_map_of_bruker_whose_points_have_any_order(tmp_path):
    x, y, euler = pixels()
    order = np.random.default_rng(1).permutation(len(x))
    phase = np.where(np.hypot(x - 2.0, y - 5.0) < 0.6, 0, 1)
    with h5py.File(path := tmp_path / "map.h5", "w") as file:
        file["Manufacturer"] = "Bruker Nano"
        data, header, sem = (
            file.create_group(f"Scan 0/EBSD/{n}") for n in ("Data", "Header", "SEM")
        )
        for name, values in zip(("phi1", "PHI", "phi2"), euler.T, strict=True):
            data[name] = values[order]
        # The axis x of the sample is opposite to that of the picture.
        for name, values in (("X", x.max() - x), ("Y", y), ("Z", 0 * y)):
            data[f"{name} SAMPLE"] = 300 + values[order]
        sem["IX"], sem["IY"] = (np.rint(at[order] / 0.5).astype(int) for at in (x, y))
        data["Phase"] = phase[order]
        names = "PCX PCY DD MAD MADPhase NIndexedBands RadonBandCount RadonQuality"
        for name in (*names.split(), "X BEAM", "Y BEAM"):
            data[name] = np.ones(len(x))
        header["Grid Type"] = "isometric"
        crystal = header.create_group("Phases/1")
        crystal["Name"], crystal["IT"] = "iron", 229
        crystal["LatticeConstants"] = [2.866, 2.866, 2.866, 90.0, 90.0, 90.0]
        crystal["AtomPositions/1"] = "Fe,0,0,0,1"
    found = measured(path, [(2.1, 5.2), (12.3, 4.9)]).measurements.euler_deg
    assert along(found) == pytest.approx(along([LEFT, RIGHT]), abs=0.01)


@pytest.mark.parametrize("tilt", [0.0, 90.0])
def test_the_binary_map_of_oxford(tmp_path, tilt):
    """Steps of 0.5 and 1 um; the fields of the second file in another order than usual."""
    x, y, euler = pixels()
    facts = {
        "General": {"Description": "made here: 50 %", "ProjectFile": "D:\\a.oip"},
        "Job": {"xCells": 30, "yCells": 20, "GridDistX": 0.5, "GridDistY": "1,0"},
        "Acquisition Surface": {"Euler1": 90.0, "Euler2": tilt, "Euler3": 0.0},
        "Fields": dict(zip(("Field1", "Field2", "Field3", "Field4"), (7, 3, 4, 5))) | {"Count": 4},
        "Phases": {"Count": 1},
        "Phase1": {"StructureName": "Iron", "LaueGroup": 11, "a": 2.866, "b": 2.866, "c": 2.866}
        | dict.fromkeys(("alpha", "beta", "gamma"), 90.0),
    }
    lines = []
    for name, section in facts.items():
        lines += [f"[{name}]", *(f"{key}={value}" for key, value in section.items()), "", "Notes"]
    (tmp_path / "map.cpr").write_bytes("\r\n".join(lines).encode())
    points = np.zeros(len(x), "u1, u1, 3<f4")
    points["f0"] = np.hypot(x - 2.0, y - 5.0) > 0.6
    points["f2"] = np.radians(euler)
    points.tofile(tmp_path / "map.crc")
    if tilt:
        with pytest.raises(bi.InputError, match="map.cpr: .*states neither CS0 nor CS1"):
            measured(tmp_path / "map.cpr", [(2.1, 10.4)])
        return
    for name in ("map.cpr", "map.crc"):
        found = measured(tmp_path / name, [(2.1, 10.4), (12.3, 9.8)]).measurements.euler_deg
        assert along(found) == pytest.approx(along([LEFT, RIGHT]), abs=0.01)


def test_a_single_phase_with_points_of_no_phase(tmp_path):
    """MTEX writes zeros for points without a solution, in their confidence too."""
    at, angles, indents = copper()
    rows = np.tile([1500.0, 0, 1, 1, 0.5], (len(at), 1))
    lost = away(at, indents[:, :2]) <= 4
    rows[lost], angles[lost] = 0, 0
    path = edax(tmp_path / "map.ang", at, np.radians(angles), rows)
    problem = measured(path, indents[:, :2])
    assert (
        f"{lost.sum()} of 1,200 points"
        in of_code(problem.warnings, "points_not_indexed")[0]["subject"]
    )


@pytest.mark.parametrize(
    ("chosen", "words"),
    [
        (lambda x, y: y == 3.0, "has its 30 points on a single line; a map is needed"),
        (lambda x, y: (x == 3.0) & (y == 3.0), "has 1 indexed points in the unit 'um'"),
    ],
)
def test_a_single_line_is_no_map(tmp_path, chosen, words):
    x, y, euler = pixels()
    own = chosen(x, y)
    with pytest.raises(bi.InputError, match=words):
        measured(write(tmp_path / "map.ctf", x[own], y[own], euler[own]), [(3.0, 3.0)])


def test_a_table_is_refused_before_its_map_is_read(tmp_path):
    (path := tmp_path / "map.ang").write_text("no map")
    table = {"x_um": [2.0], "y_um": [5.0], "length": [200.0], "sd": [4.0]}
    with pytest.raises(bi.InputError, match="no column is a modulus"):
        bi.Problem.from_keywords(
            "f",
            {"measurements": table},
            problem={"symmetry": "cubic"},
            measurements={"ebsd": path},
        )


def test_tests_without_sds_are_pooled_in_the_grains_of_the_map(tmp_path):
    path = write(tmp_path / "map.h5", *pixels())
    places = [(2.0, 5.0), (3.0, 5.0), (4.0, 5.0), (12.0, 5.0), (12.0, 4.0)]
    moduli = np.array([200.0, 204.0, 202.0, 150.0, 152.0])
    table = dict(zip(("x_um", "y_um"), np.transpose(places).tolist(), strict=True))
    problem = bi.Problem.from_keywords(
        "f",
        {"measurements": table | {"Er": moduli}},
        problem={"symmetry": "cubic"},
        measurements={"ebsd": path},
    )
    # Three degrees of freedom: 8 GPa² about 202, 2 GPa² about 151.
    sd = np.sqrt((8 + 2) / 3)
    assert problem.measurements.modulus_gpa == pytest.approx([202.0, 151.0])
    assert problem.measurements.sd_gpa == pytest.approx([sd / np.sqrt(3), sd / np.sqrt(2)])
