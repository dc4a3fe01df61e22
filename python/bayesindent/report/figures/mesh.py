"""The mesh of the simulations."""

import matplotlib as mpl
import numpy as np

from ...fe.indentation import GROUPS, NOT_OURS, Indentation
from ..results import Results, present
from .style import BLUE, ORANGE, Picture, legend_above, panels

#: Nodes of a brick's faces, in Abaqus' order of nodes.
BRICK_FACES = ([0, 1, 2, 3], [4, 5, 6, 7], [0, 1, 5, 4], [1, 2, 6, 5], [2, 3, 7, 6], [3, 0, 4, 7])

#: Greys of the materials.
GREYS = ["0.95", "0.75", "0.6", "0.5"]


def mesh(results: Results) -> Picture:
    """A section of the mesh of the simulations below the indenter's axis, and its surface there
    with the nodes that may touch.
    """
    present(results.simulations)
    settings = {
        key: value
        for group in GROUPS
        for key, value in results.settings[group].items()
        if key not in NOT_OURS
    }
    indentation = Indentation(**settings)
    arrays, radius = indentation.mesh_arrays(), indentation.contact_radius_max_um
    faces = arrays.x[np.concatenate([arrays.brick[:, face] for face in BRICK_FACES])]
    materials = np.tile(arrays.material, 6)
    touching = arrays.x[arrays.contact][:, :2]
    figure, (left, right) = panels(3.8, 1, 2)
    extent = 1.6 * max(radius, np.abs(touching).max())
    for axes, normal, across, colours, title in (
        (left, 1, (0, 2), GREYS, "section below the indenter"),
        (right, 2, (0, 1), ["none"] * len(GREYS), "the surface under the indenter"),
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
        axes.set(xlabel="x (µm)", ylabel=f"{'xyz'[across[1]]} (µm)", aspect="equal", title=title)
        axes.grid(False)
    left.autoscale_view()
    right.plot(*touching.T, ".", color=ORANGE, ms=2.5, label="may touch")
    right.add_patch(
        mpl.patches.Circle(
            (0, 0), radius, fill=False, color=BLUE, label="contact at the last depth"
        )
    )
    right.set(xlim=(-extent, extent), ylim=(-extent, extent))
    legend_above(figure, columns=2, corner="lower right")
    text = f"The mesh of {indentation.bricks} bricks ({indentation.settings.specimen.geometry})"
    if infinite := indentation.infinite_elements:
        text += f"; {infinite} infinite elements outside stand for the rest of the half-space"
    text += (
        ". Greys are materials. On the right its surface under the indenter, with the circle of "
        "contact on an isotropic half-space at the last depth."
    )
    rows = [[number, *place] for number, place in enumerate(arrays.x.tolist(), start=1)]
    return Picture(figure, text, (["node", "x_um", "y_um", "z_um"], rows))
