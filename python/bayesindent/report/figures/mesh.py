"""The mesh of the simulations."""

import matplotlib as mpl
import numpy as np

from ...fe.indentation import GROUPS, NOT_OURS, Indentation
from ..results import Results, present
from .style import BLUE, ORANGE, Picture, legend_above, panels

#: Nodes of a brick's faces, in Abaqus' order of nodes.
BRICK_FACES = ([0, 1, 2, 3], [4, 5, 6, 7], [0, 1, 5, 4], [1, 2, 6, 5], [2, 3, 7, 6], [3, 0, 4, 7])


def mesh(results: Results) -> Picture:
    """A section of the mesh of the simulations below the indenter's axis, and its surface there
    with the nodes that may touch.
    """
    present(results.simulations)
    settings = {
        key: value
        for group in GROUPS
        for key, value in results.group(group).items()
        if key not in NOT_OURS
    }
    indentation = Indentation(**settings)
    arrays, radius, infinite = (
        indentation.mesh_arrays(),
        indentation.contact_radius_max_um,
        indentation.infinite_elements,
    )
    faces, materials = (
        arrays.x[np.concatenate([arrays.brick[:, face] for face in BRICK_FACES])],
        np.tile(arrays.material, 6),
    )
    figure, (left, right) = panels(3.8, 1, 2)
    extent = 1.6 * max(radius, np.abs(arrays.x[arrays.contact][:, :2]).max())
    greys, titles = (
        ["0.95", "0.75", "0.6", "0.5"],
        {left: "section below the indenter", right: "the surface under the indenter"},
    )
    for axes, normal, across, colours in (
        (left, 1, (0, 2), greys),
        (right, 2, (0, 1), ["none"] * len(greys)),
    ):
        within = np.all(np.abs(faces[:, :, normal]) < 1e-9, axis=1)
        axes.add_collection(
            mpl.collections.PolyCollection(
                faces[within][:, :, across],
                facecolors=[colours[m] for m in materials[within]],
                edgecolors="#777777",
                linewidths=0.3,
            )
        )
        axes.set(
            xlabel="x (µm)", ylabel=f"{'xyz'[across[1]]} (µm)", aspect="equal", title=titles[axes]
        )
        axes.grid(False)
    left.autoscale_view()
    right.plot(*arrays.x[arrays.contact][:, :2].T, ".", color=ORANGE, ms=2.5, label="may touch")
    right.add_patch(
        mpl.patches.Circle(
            (0, 0), radius, fill=False, color=BLUE, label="contact at the last depth"
        )
    )
    right.set(xlim=(-extent, extent), ylim=(-extent, extent))
    legend_above(figure, columns=2, corner="lower right")
    text = f"The mesh of {indentation.bricks} bricks ({indentation.settings.specimen.geometry})"
    text += f"; {infinite} infinite elements outside stand for the rest of the half-space" * (
        infinite > 0
    )
    right_side = (
        "On the right its surface under the indenter, with the circle of contact on an "
        "isotropic half-space at the last depth."
    )
    table = (
        ["node", "x_um", "y_um", "z_um"],
        [[number, *place] for number, place in enumerate(arrays.x.tolist(), start=1)],
    )
    return Picture(figure, f"{text}. Greys are materials. {right_side}", table)
