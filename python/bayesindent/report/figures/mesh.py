"""The mesh of the simulations."""

from typing import Any

import matplotlib as mpl
import numpy as np
from mpl_toolkits import mplot3d

from ...fe.indentation import GROUPS, NOT_OURS, Indentation
from ..results import Results, present
from .style import BLUE, ORANGE, Picture, legend_above, panels

__all__ = ["mesh"]

#: Nodes of a brick's faces, in Abaqus' order of nodes.
BRICK_FACES = ([0, 1, 2, 3], [4, 5, 6, 7], [0, 1, 5, 4], [1, 2, 6, 5], [2, 3, 7, 6], [3, 0, 4, 7])


def mesh(results: Results) -> Picture:
    """The mesh of the simulations with a quarter cut away, and its surface under the indenter with the nodes that may touch."""
    present(results.simulations)
    settings = {key: value for group in GROUPS for key, value in results.group(group).items() if key not in NOT_OURS}
    indentation = Indentation(**settings)
    arrays = indentation.mesh_arrays()
    outside = indentation.infinite_elements
    text = f"The mesh of {indentation.bricks} bricks ({indentation.settings.specimen.geometry})"
    text += f"; {outside} infinite elements outside stand for the rest of the half-space" if outside else ""
    nodes, contact_radius_um = arrays.x, indentation.contact_radius_max_um
    figure, (place, right) = panels(3.5, 1, 2)
    left = figure.add_subplot(place.get_subplotspec(), projection="3d", computed_zorder=False)
    place.remove()
    solid(left, nodes, arrays.brick)
    faces = outer_faces(arrays.brick)
    surface = nodes[faces[np.all(np.abs(nodes[faces][:, :, 2]) < 1e-9, axis=1)]][:, :, :2]
    right.add_collection(mpl.collections.PolyCollection(surface, facecolors="none", edgecolors="#777777", linewidths=0.4))
    right.plot(*nodes[arrays.contact][:, :2].T, ".", color=ORANGE, ms=2.5, label="may touch")
    circle = np.linspace(0, 2 * np.pi, 200)
    right.plot(contact_radius_um * np.cos(circle), contact_radius_um * np.sin(circle), color=BLUE, label="contact at the last depth")
    extent = 1.6 * max(contact_radius_um, np.abs(nodes[arrays.contact][:, :2]).max())
    limits = {"xlim": (-extent, extent), "ylim": (-extent, extent), "aspect": "equal"}
    right.set(**limits, xlabel="x (µm)", ylabel="y (µm)", title="the surface under the indenter")
    right.grid(False)
    legend_above(figure, columns=2, corner="lower right")
    return Picture(
        figure,
        f"{text}. A quarter is cut away. On the right its surface under the indenter, with the circle of contact on an isotropic half-space at the last depth.",
        (["node", "x_um", "y_um", "z_um"], [[number, *place] for number, place in enumerate(nodes.tolist(), start=1)]),
    )


def solid(axes: Any, nodes: np.ndarray, bricks: np.ndarray) -> None:
    """The bricks but for a quarter, shaded."""
    centre = nodes[bricks].mean(axis=1)
    polygons = nodes[outer_faces(bricks[(centre[:, 0] < 0) | (centre[:, 1] > 0)])]
    normal = np.cross(polygons[:, 2] - polygons[:, 0], polygons[:, 3] - polygons[:, 1])
    shade = np.abs(normal @ [0.25, -0.45, 0.85]) / np.linalg.norm(normal, axis=1)
    colours = np.repeat((0.55 + 0.45 * shade)[:, None], 3, axis=1)
    axes.add_collection3d(mplot3d.art3d.Poly3DCollection(polygons, facecolors=colours, edgecolors="#333333", linewidths=0.12))
    low, high = nodes.min(axis=0), nodes.max(axis=0)
    size = high - low
    axes.set(xlim=(low[0], high[0]), ylim=(low[1], high[1]), zlim=(low[2], high[2]))
    axes.set_box_aspect(size, zoom=0.98)
    axes.view_init(elev=28, azim=-50)
    axes.set_axis_off()
    axes.set_title(f"{size[0]:.3g} × {size[1]:.3g} × {size[2]:.3g} µm, {len(bricks)} bricks\na quarter is cut away")


def outer_faces(bricks: np.ndarray) -> np.ndarray:
    """Faces (f, 4) that belong to one brick only."""
    faces = np.concatenate([bricks[:, face] for face in BRICK_FACES])
    _, first, count = np.unique(np.sort(faces, axis=1), axis=0, return_index=True, return_counts=True)
    return faces[first[count == 1]]
