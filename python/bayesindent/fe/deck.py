"""Write the indentation problem as an input deck that Abaqus and CalculiX read. Units: um, mN,
GPa.
"""

from collections import defaultdict
from collections.abc import Iterable, Iterator, Sequence
from itertools import count
from types import SimpleNamespace

import numpy as np

from ..settings.problem import batched

#: Voigt indices (order 11,22,33,23,13,12) in the order 11,22,33,12,13,23 of *ELASTIC, TYPE=ANISO.
ABAQUS_ORDER = (0, 1, 2, 5, 4, 3)

#: Names of the materials of the bricks.
MATERIALS = ("CRYSTAL", "SURROUNDINGS")

#: Penalties of CalculiX: the stiffness of a closed gap (mN/um), by which closed gaps give way less
#: than 1e-8 um, and the force of a wide open one (mN).
GAP_STIFFNESS, GAP_TENSION = 1.0e6, 1.0e-9


def write_deck(
    mesh: SimpleNamespace, depths: Iterable[float], element: str, title: str, parts: Sequence[str]
) -> str:
    """The text of the deck. It has a step for each depth and prints the force on the indenter as
    the reaction of node set INDENTER.

    The header names the material of each of the `parts` of the specimen. Unilateral gaps between
    the contact nodes and one node, which represents the indenter, model the contact. Networks of
    springs with the same stiffness matrix replace infinite elements, and equations constrain
    hanging nodes.
    """
    indenter = len(mesh.x) + 1
    used = MATERIALS[: 1 + mesh.material.max()]
    lines = [
        "*HEADING",
        title,
        "** Units: um, mN, GPa; the axes of the sample, material below z = 0",
    ]
    for name, part, matrix in zip(used, parts, mesh.materials):
        lines += [f"** Material {name}: {part}, {description(matrix)}"]
    if len(mesh.facet):
        lines += ["** Springs: infinite elements, beyond the mesh"]
    lines += ["*NODE, NSET=ALL"] + [
        f"{i}, {x:.10g}, {y:.10g}, {z:.10g}" for i, (x, y, z) in enumerate(mesh.x, start=1)
    ]
    lines += ["*NODE, NSET=INDENTER", f"{indenter}, 0, 0, 0"]
    for material, name in enumerate(used):
        lines += [f"*ELEMENT, TYPE={element}, ELSET={name}"]
        for e in np.flatnonzero(mesh.material == material):
            lines += [", ".join(map(str, (e + 1, *(mesh.brick[e] + 1))))]
        lines += [
            f"*MATERIAL, NAME={name}",
            "*ELASTIC, TYPE=ANISO",
            *elastic_constants(mesh.materials[material]),
            f"*SOLID SECTION, ELSET={name}, MATERIAL={name}",
        ]
    lines += gaps(mesh, indenter, len(mesh.brick))
    lines += never_yielding(indenter + 1, 1.5 * mesh.x.max(), len(mesh.brick) + len(mesh.contact))
    lines += springs(mesh.facet, mesh.infinite, len(mesh.brick) + len(mesh.contact) + 1)
    for node, masters in zip(mesh.hanging, mesh.master):
        masters = masters[masters >= 0]
        for axis in (1, 2, 3):
            terms = [f"{node + 1}, {axis}, 1.0"] + [
                f"{m + 1}, {axis}, {-1.0 / len(masters)!r}" for m in masters
            ]
            lines += ["*EQUATION", str(len(terms)), *map(", ".join, batched(terms, 4))]
    lines += ["*BOUNDARY"] + [f"{n + 1}, 1, 3" for n in mesh.clamped] + [f"{indenter}, 1, 2"]
    for depth in depths:
        lines += ["*STEP, INC=100", "*STATIC", "1.0, 1.0"]
        lines += ["*BOUNDARY", f"{indenter}, 3, 3, {-depth:.12g}"]
        lines += ["*NODE PRINT, NSET=INDENTER", "U, RF", "*END STEP"]
    return "\n".join(lines) + "\n"


def description(stiffness: np.ndarray) -> str:
    """A short description of a stiffness (6, 6) in GPa."""
    lame, shear = stiffness[0, 1], stiffness[3, 3]
    isotropic = np.diag([2.0, 2.0, 2.0, 1.0, 1.0, 1.0]) * shear
    isotropic[:3, :3] += lame
    if not np.allclose(stiffness, isotropic, rtol=0, atol=1e-6 * shear):
        return "anisotropic"
    nu = lame / (2 * (lame + shear))
    return f"E = {2 * shear * (1 + nu):.6g} GPa and nu = {nu:.4g} in all directions"


def elastic_constants(stiffness: np.ndarray) -> list[str]:
    """The 21 constants column by column of the upper triangle, eight a line."""
    order = stiffness[np.ix_(ABAQUS_ORDER, ABAQUS_ORDER)]
    values = [f"{order[i, j]:.10g}" for j in range(6) for i in range(j + 1)]
    return ",\n".join(map(", ".join, batched(values, 8))).splitlines()


def gaps(mesh: SimpleNamespace, indenter: int, offset: int) -> list[str]:
    """A unilateral gap under each contact node; gaps of equal clearance share a card."""
    same = defaultdict(list)
    for i, (node, gap) in enumerate(zip(mesh.contact, mesh.gap)):
        same[f"{gap:.12g}"].append((offset + i + 1, node + 1))
    lines = []
    for i, (gap, elements) in enumerate(same.items()):
        lines += [f"*ELEMENT, TYPE=GAPUNI, ELSET=GAP{i}"] + [
            f"{e}, {node}, {indenter}" for e, node in elements
        ]
        lines += [f"*GAP, ELSET=GAP{i}", f"{gap}, 0, 0, 1, , {GAP_STIFFNESS:g}, {GAP_TENSION:g}"]
    return lines


def never_yielding(node: int, offset: float, element: int) -> list[str]:
    """A fixed cube beside the sample, whose material has a yield stress that it never reaches.

    CalculiX iterates on gaps only in a nonlinear analysis, and plasticity makes it one; geometric
    nonlinearity would change the force by 2 per cent.
    """
    corners = [(offset + x, y, z) for z in (0, 1) for x, y in ((0, 0), (1, 0), (1, 1), (0, 1))]
    lines = ["*NODE, NSET=CUBE"] + [
        f"{node + i}, {x:.10g}, {y}, {z}" for i, (x, y, z) in enumerate(corners)
    ]
    lines += [
        "*ELEMENT, TYPE=C3D8, ELSET=CUBE",
        ", ".join(str(n) for n in (element + 1, *range(node, node + 8))),
    ]
    lines += ["*MATERIAL, NAME=CUBE", "*ELASTIC", "1.0, 0.3", "*PLASTIC", "1.0e10, 0.0"]
    return [*lines, "*SOLID SECTION, ELSET=CUBE, MATERIAL=CUBE", "*BOUNDARY", "CUBE, 1, 3"]


def springs(facet: np.ndarray, infinite: np.ndarray, offset: int) -> Iterator[str]:
    """Springs between pairs of displacements, and to ground, with the stiffness matrix of the
    infinite elements.
    """
    pairs: dict[tuple[int, ...], float] = defaultdict(float)
    ground: dict[tuple[int, ...], float] = defaultdict(float)
    for nodes, matrix in zip(facet, infinite):
        freedom = (3 * nodes[:, None] + np.arange(3)).ravel().tolist()
        for i, end in enumerate(freedom):
            ground[(end,)] += matrix[i].sum()
            for j in range(i):
                pairs[tuple(sorted((end, freedom[j])))] -= matrix[i, j]
    numbers = count(offset + 1)
    for name, kind, items in (("G", "SPRING1", ground), ("S", "SPRING2", pairs)):
        for i, (ends, value) in enumerate(items.items()):
            yield f"*ELEMENT, TYPE={kind}, ELSET={name}{i}"
            yield f"{next(numbers)}, " + ", ".join(str(end // 3 + 1) for end in ends)
            # CalculiX reads a number without a decimal point as a degree of freedom.
            yield from (
                f"*SPRING, ELSET={name}{i}",
                ", ".join(str(end % 3 + 1) for end in ends),
                f"{value:.12e}",
            )
