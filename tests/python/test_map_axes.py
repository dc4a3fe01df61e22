"""Oxford's .h5oina, and where makers put the axes of a crystal in its cell: two files of one
crystal give one direction.
"""

import h5py
import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import bayesindent as bi
from support.orientation_maps import along, measured, pixels, write

orix_io = pytest.importorskip("orix.io")

#: Laue class, its number and cell (angstrom, degrees): quartz, glaucophane, albite, copper.
CELLS = {
    "trigonal": ("-3m", 7, (4.914, 4.914, 5.405, 90, 90, 120)),
    "monoclinic": ("2/m", 2, (9.541, 17.740, 5.295, 90, 103.67, 90)),
    "triclinic": ("-1", 1, (8.142, 12.785, 7.159, 94.19, 116.61, 87.68)),
    "cubic": ("m-3m", 11, (3.615, 3.615, 3.615, 90, 90, 90)),
}
#: The crystal direction along the indenter, in a, b and c.
UVW = np.array([3, 1, 2])


def edges(cell):
    """a, b and c as rows, c along z and the normal of (010) along y: in spherical trigonometry."""
    a, b, c = cell[:3]
    alpha, beta, gamma = np.radians(cell[3:])
    ca = np.array([np.sin(beta), 0.0, np.cos(beta)]) * a
    x = (np.cos(gamma) - np.cos(alpha) * np.cos(beta)) / np.sin(beta)
    return np.array(
        [ca, b * np.array([x, np.sqrt(np.sin(alpha) ** 2 - x**2), np.cos(alpha)]), [0.0, 0.0, c]]
    )


def frame(x, z):
    x, z = x / np.linalg.norm(x), z / np.linalg.norm(z)
    return np.array([x, np.cross(z, x), z])


def angles_of(cell, axes):
    """Bunge's angles of the crystal in a maker's axes, degrees: UVW along z of the sample, the rest
    free.
    """
    a, b, c = edges(cell)
    maker = frame(a, np.cross(a, b)) if axes == "a" else frame(np.cross(b, c), c)
    z = maker @ (UVW @ edges(cell))
    # The columns of g are the axes of the sample in the crystal.
    g = frame(np.cross(z, [0.3, 0.5, -0.2]), z).T
    return Rotation.from_matrix(g.T).as_euler("ZXZ", degrees=True)


def write_oxford(path, x, y, euler_deg, symmetry, phase=None):
    laue, number, cell = CELLS[symmetry]
    with h5py.File(path, "w") as file:
        file["Format Version"], file["Manufacturer"] = ["5.0"], ["Oxford Instruments"]
        data, crystal = (
            file.create_group("1/EBSD/Data"),
            file.create_group("1/EBSD/Header/Phases/1"),
        )
        data["X"], data["Y"], data["Euler"] = (
            np.asarray(v, np.float32) for v in (x, y, np.radians(euler_deg))
        )
        data["Phase"] = (np.ones(len(x)) if phase is None else phase).astype(np.uint8)
        crystal["Phase Name"] = ["mineral"]
        crystal["Lattice Dimensions"], crystal["Lattice Angles"] = (
            np.float32([cell[:3]]),
            np.float32([np.radians(cell[3:])]),
        )
        crystal["Laue Group"] = np.int32([number])
        crystal["Laue Group"].attrs["Symbol"] = laue
    return path


def write_orix(path, x, y, euler_deg, symmetry):
    from diffpy.structure import Lattice, Structure
    from orix.crystal_map import CrystalMap, Phase, PhaseList
    from orix.quaternion import Rotation as Orientations

    laue, _, cell = CELLS[symmetry]
    phase = Phase("mineral", point_group=laue, structure=Structure(lattice=Lattice(*cell)))
    rotations = Orientations.from_euler(np.radians(euler_deg))
    orix_io.save(
        str(path),
        CrystalMap(
            rotations, np.ones(len(x), int), x, y, phase_list=PhaseList({1: phase}), scan_unit="um"
        ),
    )
    return path


def direction(euler_deg):
    phi, psi = np.radians(euler_deg[1]), np.radians(euler_deg[2])
    return np.array([np.sin(phi) * np.sin(psi), np.sin(phi) * np.cos(psi), np.cos(phi)])


@pytest.mark.parametrize("symmetry", ["trigonal", "monoclinic", "triclinic"])
def test_two_makers_files_of_one_crystal(tmp_path, symmetry):
    x, y, _ = pixels()
    cell = CELLS[symmetry][2]
    true = UVW @ edges(cell) / np.linalg.norm(UVW @ edges(cell))
    for write_map, name, axes in ((write_oxford, "map.h5oina", "a*"), (write_orix, "map.h5", "a")):
        path = write_map(
            tmp_path / name, x, y, np.tile(angles_of(cell, axes), (len(x), 1)), symmetry
        )
        found = direction(measured(path, [(2.1, 5.2)], symmetry).measurements.euler_deg[0])
        # A direction and what the crystal cannot tell from it have one modulus: that of a random
        # crystal of the class.
        c = bi.stiffness(symmetry, **CRYSTALS[symmetry])
        moduli = [
            bi.halfspace_modulus(
                c, [0, np.degrees(np.arccos(v[2])), np.degrees(np.arctan2(v[0], v[1]))]
            )
            for v in (found, true)
        ]
        assert moduli[0] == pytest.approx(moduli[1], rel=1e-5)


#: Of quartz; and stiffnesses of no symmetry but that of the class.
CRYSTALS = {
    "trigonal": {"C11": 86.8, "C12": 7.0, "C13": 11.9, "C14": -18.0, "C33": 105.8, "C44": 58.2},
    "monoclinic": {
        "C11": 122,
        "C12": 45,
        "C13": 37,
        "C15": 12,
        "C22": 231,
        "C23": 75,
        "C25": -5,
        "C33": 254,
        "C35": -24,
        "C44": 80,
        "C46": 5,
        "C55": 53,
        "C66": 51,
    },
    "triclinic": dict(
        zip(
            bi.constants("triclinic"),
            [
                69.9,
                34.0,
                30.8,
                5.1,
                -2.4,
                -0.9,
                183.5,
                5.5,
                -3.9,
                -7.7,
                -5.8,
                179.5,
                -8.7,
                7.1,
                -9.8,
                24.9,
                -2.4,
                -7.2,
                26.8,
                0.5,
                33.5,
            ],
            strict=True,
        )
    ),
}


def test_a_map_of_oxford(tmp_path):
    x, y, euler = pixels()
    phase = np.where(x < 1.0, 0, 1)
    path = write_oxford(tmp_path / "map.h5oina", x, y, euler, "cubic", phase)
    places = [(2.1, 5.2), (12.3, 4.9)]
    plain = measured(write(tmp_path / "map.h5", x, y, euler), places).measurements
    assert along(measured(path, places).measurements.euler_deg) == pytest.approx(
        along(plain.euler_deg), abs=2e-3
    )
    with pytest.raises(bi.InputError, match="from the next indexed point"):
        measured(path, [(0.2, 5.0)])


def test_what_is_no_map_of_oxford(tmp_path):
    path = tmp_path / "map.h5oina"
    path.write_bytes(b"no HDF5")
    with pytest.raises(
        bi.InputError,
        match=r"map.h5oina: is no map .h5oina that can be read; export it again \(OSError\)",
    ):
        measured(path, [(2.1, 5.2)])
    with h5py.File(path, "w") as file:
        file.create_group("1/EBSD/Header/Phases")
    with pytest.raises(
        bi.InputError, match=r"is no map .h5oina that can be read; export it again \(KeyError\)"
    ):
        measured(path, [(2.1, 5.2)])


def problem_with(path, symmetry, axes):
    table = {"x_um": [2.1], "y_um": [5.2], "Er": [200.0], "sd": [4.0]}
    asked = {"ebsd": path, "crystal_axes": axes}
    return bi.Problem.from_keywords(
        "f", {"measurements": table}, problem={"symmetry": symmetry}, measurements=asked
    )


@pytest.mark.parametrize("ending", ["oh5", "osc"])
def test_other_files_of_makers_are_refused_with_what_to_do(tmp_path, ending):
    path = tmp_path / f"map.{ending}"
    path.write_bytes(b"\x89HDF\r\n")
    with pytest.raises(
        bi.InputError,
        match=rf"map.{ending}: maps .{ending} are not read; export the map as .ang",
    ):
        measured(path, [(1.0, 1.0)])


def test_axes_are_asked_for(tmp_path):
    """A .ctf of quartz may be of either maker: the two answers are 30 degrees about c apart."""
    write(path := tmp_path / "map.ctf", *pixels())
    path.write_text(
        path.read_text().replace(
            "2.866;2.866;2.866\t90;90;90\tIron bcc (old)\t11\t229",
            "4.914;4.914;5.405\t90;90;120\tQuartz\t7\t152",
        )
    )
    with pytest.raises(
        bi.InputError,
        match=r"does not say how .*\(-3m\) .* state crystal_axes = 'a' \(x along a, .*'a\*'",
    ):
        problem_with(path, "trigonal", None)
    phi2 = [problem_with(path, "trigonal", axes).measurements.euler_deg[0] for axes in ("a", "a*")]
    assert phi2[0][:2] == pytest.approx(phi2[1][:2], abs=1e-6)
    turn = (phi2[0][2] - phi2[1][2]) % 120
    assert min(abs(turn - 30), abs(turn - 90)) < 1e-6


def test_what_the_file_says_is_not_contradicted(tmp_path):
    x, y, _ = pixels()
    path = write_oxford(
        tmp_path / "map.h5oina", x, y, np.tile([10.0, 20, 30], (len(x), 1)), "trigonal"
    )
    with pytest.raises(
        bi.InputError,
        match=r"crystal_axes = 'a', but this format has x along a\*, z along c; leave",
    ):
        problem_with(path, "trigonal", "a")
    assert len(problem_with(path, "trigonal", "a*").measurements) == 1


@pytest.mark.parametrize(("group", "symmetry"), [("2/m", "monoclinic"), ("-1", "triclinic")])
def test_a_cell_that_cannot_be(tmp_path, group, symmetry):
    x, y, euler = pixels()
    path = write(tmp_path / "map.h5", x, y, euler, group)
    with pytest.raises(
        bi.InputError,
        match=rf"the cell of a phase {group} has alpha, beta and gamma of 90, 90, 90 degrees",
    ):
        measured(path, [(2.1, 5.2)], symmetry)
