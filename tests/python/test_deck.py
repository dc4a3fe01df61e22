"""The exported deck, solved by CalculiX, gives the same curve; fields are in equilibrium with the
force.
"""

import os
import shutil
import subprocess

import numpy as np
import pytest

import bayesindent as bi

ZINC = bi.stiffness("hexagonal", C11=161.1, C12=34.2, C44=38.3, C33=61.1, C13=50.3)
ANGLES = (20, 35, 10)


@pytest.fixture(scope="module")
def block():
    """The smallest mesh of the paper's block, integrated as CalculiX does."""
    return bi.Indentation(geometry="block", refine=0.65, integration="full", depths=3)


@pytest.mark.long
@pytest.mark.skipif(
    shutil.which("ccx") is None, reason="CalculiX (Debian package calculix-ccx) is not installed"
)
@pytest.mark.parametrize(
    "options",
    [
        {"refine": 0.6, "depths": 1, "element": "c3d8"},
        {"geometry": "block", "refine": 0.65, "depths": 2, "shape": "sphere", "radius_um": 0.7},
        {"geometry": "block", "refine": 0.65, "depths": 1, "shape": "cone", "width_um": 6.0},
        {
            "geometry": "grain",
            "refine": 0.55,
            "depths": 2,
            "grain_radius_um": 1.6,
            "element": "c3d8",
        },
    ],
    ids=[
        "half-space with springs and hanging nodes",
        "sphere on a block",
        "cone",
        "grain in its polycrystal",
    ],
)
def test_calculix_solves_the_deck_to_the_same_curve(options, tmp_path):
    model = bi.Indentation(integration="full", **options)
    (tmp_path / "deck.inp").write_text(model.deck(ZINC, ANGLES))
    subprocess.run(
        ["ccx", "deck"],
        cwd=tmp_path,
        check=True,
        capture_output=True,
        env=os.environ | {"OMP_NUM_THREADS": "1"},
    )
    steps = (tmp_path / "deck.dat").read_text().split("forces (fx,fy,fz)")[1:]
    force = [-float(step.splitlines()[2].split()[3]) for step in steps]
    # Both solve the same discrete problem; what is left is CalculiX' convergence and printing.
    assert force == pytest.approx(model.run(ZINC, ANGLES).force_mn, rel=1e-4)


@pytest.mark.parametrize(
    ("options", "around"),
    [
        (
            {
                "geometry": "grain",
                "grain_radius_um": 2.0,
                "matrix": "isotropic",
                "matrix_young_gpa": 160.0,
                "matrix_nu": 0.25,
            },
            "the matrix around it, E = 160 GPa and nu = 0.25",
        ),
        ({"geometry": "grain", "grain_radius_um": 2.0}, "the matrix around it, E = "),
        ({"refine": 0.6}, None),
    ],
    ids=["matrix", "grain", "half-space"],
)
def test_the_header_of_a_deck_names_what_each_material_is(options, around):
    model = bi.Indentation(**({"refine": 0.6} | options))
    deck = model.deck(ZINC, ANGLES, depth_um=[0.01])
    header = deck.split("*NODE, NSET=ALL")[0]
    named = [
        line.split(":")[0].split()[-1]
        for line in header.splitlines()
        if line.startswith("** Material")
    ]
    assert (
        named
        == [line.split("=")[-1] for line in deck.splitlines() if line.startswith("*MATERIAL")][:-1]
    )
    assert f"{model.settings.specimen.geometry if around else 'specimen'}, anisotropic" in header
    assert around is None or f"SURROUNDINGS: {around}" in header


def test_stress_balances_the_force(block):
    mesh, result = block.mesh_arrays(ZINC, ANGLES), block.run(ZINC, ANGLES)
    u, stress = block.fields(ZINC, ANGLES)
    assert u[mesh.clamped] == pytest.approx(0.0, abs=0.0)
    # The indenter pushes the contact nodes down to its surface, to what single precision leaves of
    # a depth of 0.016 um.
    clearance = mesh.gap - result.depth_um[-1] - u[mesh.contact, 2]
    assert clearance.max() > 0 and clearance.min() == pytest.approx(0.0, abs=1e-7)
    volume, force = brick_volumes(mesh), result.force_mn[-1]
    # Virtual work of displacements that grow with the height above the clamped bottom: of the
    # force, normal to the surface.
    assert (volume @ stress)[2:5] == pytest.approx([-4.8 * force, 0.0, 0.0], abs=1e-8 * force)
    # The force does 2/5 P h of work, which is the strain energy; that of the mean stresses is a
    # little less.
    compliance = np.linalg.inv(bond_rotated(ZINC, ANGLES))
    energy = 0.5 * (volume * np.einsum("ei,ij,ej->e", stress, compliance, stress)).sum()
    assert 0.9 < energy / (2 / 5 * force * result.depth_um[-1]) < 1.0


def brick_volumes(mesh):
    """Volumes of bricks by six tetrahedra each."""
    corner = mesh.x[mesh.brick]
    tets = [(0, 1, 2, 6), (0, 2, 3, 6), (0, 3, 7, 6), (0, 7, 4, 6), (0, 4, 5, 6), (0, 5, 1, 6)]
    edges = [
        (corner[:, b] - corner[:, a], corner[:, c] - corner[:, a], corner[:, d] - corner[:, a])
        for a, b, c, d in tets
    ]
    return sum(np.abs(np.einsum("ei,ei->e", np.cross(p, q), r)) / 6 for p, q, r in edges)


def bond_rotated(stiffness, angles):
    """Stiffness in the sample frame, by the tensor."""
    a, b, c = np.radians(angles)

    def turn(t):
        return np.array([[np.cos(t), np.sin(t), 0], [-np.sin(t), np.cos(t), 0], [0, 0, 1]])

    tilt = np.array([[1, 0, 0], [0, np.cos(b), np.sin(b)], [0, -np.sin(b), np.cos(b)]])
    g = turn(c) @ tilt @ turn(a)
    voigt = np.array([[0, 5, 4], [5, 1, 3], [4, 3, 2]])
    tensor = np.einsum(
        "pi,qj,rk,sl,pqrs->ijkl",
        g,
        g,
        g,
        g,
        np.asarray(stiffness)[voigt[:, :, None, None], voigt[None, None]],
    )
    i, j = np.array([(0, 0), (1, 1), (2, 2), (1, 2), (0, 2), (0, 1)]).T
    return tensor[i[:, None], j[:, None], i, j]


def test_vtu_holds_displacement_and_stress(block, tmp_path):
    meshio = pytest.importorskip("meshio")
    block.write_vtu(tmp_path / "zinc.vtu", ZINC, ANGLES, step=0)
    mesh = meshio.read(tmp_path / "zinc.vtu")
    u, stress = block.fields(ZINC, ANGLES, step=0)
    assert mesh.point_data["displacement_um"] == pytest.approx(u)
    assert mesh.cell_data["stress_gpa"][0][:, 3] == pytest.approx(stress[:, 5])


def test_step_that_does_not_exist_is_refused(block):
    with pytest.raises(bi.InputError, match="depth number 7 does not exist"):
        block.fields(ZINC, ANGLES, step=6)
    with pytest.raises(bi.InputError, match="depth number 0 does not exist"):
        block.fields(ZINC, ANGLES, step=-4)


def test_the_mesh_of_the_deck_fits_the_crystal():
    # The contact ellipse of this crystal (index 60) is so long that the simulation takes a wider
    # mesh.
    model = bi.Indentation(refine=0.6, depths=2)
    crystal = bi.stiffness("hexagonal", C11=106.3, C12=103.6, C44=87.2, C33=133.8, C13=69.2)
    depth = model.run(crystal, (0, 90, 0)).depth_um
    deck = model.deck(crystal, (0, 90, 0))
    nodes = deck.split("*NODE, NSET=ALL\n")[1].split("*NODE")[0].count("\n")
    assert nodes == len(model.mesh_arrays(crystal, (0, 90, 0)).x) > model.nodes
    steps = deck.split("*BOUNDARY\n")[-2:]
    assert [-float(step.splitlines()[0].split(",")[3]) for step in steps] == pytest.approx(
        list(depth), rel=1e-9
    )
