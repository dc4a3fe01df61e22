"""The orientation map with its indents."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from ..results import NothingToShow, Results
from .style import BLACK, Picture, panels

if TYPE_CHECKING:
    from ...lab.orientation_maps import IndentedMap

#: Pixels of the picture along its longer side.
PIXELS = 700


def orientation_map(results: Results) -> Picture:
    """The map of the measurements, with the residual of each indent."""
    problem = results.problem
    if problem is None or problem.map is None:
        raise NothingToShow
    residuals = [results.residual(item) for item in results.predicted if item.get("measured_sd")]
    return draw_map(
        problem.map,
        problem.measurements.names,
        residuals if len(residuals) == len(problem.map.positions) else None,
    )


def draw_map(
    found: IndentedMap, names: list[str] | None, residuals: list[float] | None = None
) -> Picture:
    """Draw the map in colours of the inverse pole figure along the indenter, with their key and
    indents.

    Indents have names, or their rows if several are in one grain, and the colours of residuals.
    """
    # Imported here: it takes half a second, and most reports have no map.
    from scipy.spatial import cKDTree

    grid = found.grid
    low, high = grid.positions.min(axis=0), grid.positions.max(axis=0)
    spacing = max(grid.step, (high - low).max() / PIXELS)
    x, y = (np.arange(start, end + spacing / 2, spacing) for start, end in zip(low, high))
    away, point = cKDTree(grid.positions).query(np.stack(np.meshgrid(x, y), axis=-1))
    image, grain = grid.colours()[point], grid.grain[point]
    image[away > 1.5 * grid.step] = 1.0
    image[:, 1:][grain[:, 1:] != grain[:, :-1]] = 0.0
    image[1:][grain[1:] != grain[:-1]] = 0.0
    figure, axes = panels(min(8.0, 5 * len(y) / len(x) + 0.8))
    axes.imshow(
        image,
        extent=(x[0] - spacing / 2, x[-1] + spacing / 2, y[-1] + spacing / 2, y[0] - spacing / 2),
        interpolation="nearest",
    )
    for number, group in enumerate(grid.groups.values()):
        place = (1.08, 0.65 - 0.45 * number, 0.25, 0.3)
        key = axes.inset_axes(place, projection="ipf", symmetry=group)
        key.plot_ipf_color_key(show_title=len(grid.groups) > 1)
    values = np.zeros(len(found.positions)) if residuals is None else np.array(residuals)
    marks = axes.scatter(
        *found.positions.T,
        c=values,
        cmap="coolwarm",
        vmin=-3,
        vmax=3,
        edgecolors=BLACK,
        s=42,
        linewidths=1,
    )
    if residuals is not None:
        figure.colorbar(marks, ax=axes, label="residual / sd (1)", location="bottom", shrink=0.6)
    if not names or len(names) != len(values):  # several indents in one grain are one measurement
        names = [str(row) for row in range(1, len(values) + 1)]
    for name, place in zip(names, found.positions):
        label = {"facecolor": "white", "alpha": 0.7, "pad": 1, "edgecolor": "none"}
        axes.annotate(name, place, (5, 5), textcoords="offset points", size=7.5, bbox=label)
    axes.set(xlabel="x of the map (µm)", ylabel="y of the map (µm)")
    axes.grid(False)
    caption = (
        f"Orientation map with {len(values)} indents: the crystal direction along the indenter "
        "in the colours of the inverse pole figure, with their key."
    )
    if residuals is not None:
        caption += " Discs have the colour of the residual, (measured - predicted) / sd."
    rows = [[*place, number] for place, number in zip(found.positions.tolist(), found.grains)]
    return Picture(figure, caption, (["x_um", "y_um", "grain_of_map"], rows))
