"""The numbers behind a figure, read off the figure itself unless it brings its own: what is drawn is what the table says."""

from collections.abc import Iterator
from typing import Any

import numpy as np
from matplotlib.collections import LineCollection, PolyCollection
from matplotlib.patches import Rectangle, StepPatch

from .figures.style import Picture

__all__ = ["figure_table"]

#: The panel by its number, what its axes show, kind and label of the series, the number of the point in it; of bars also their extent.
HEADER = ("panel", "x_axis", "y_axis", "kind", "series", "point", "x", "y", "width", "height")


def figure_table(picture: Picture) -> tuple[list[str], list[list]]:
    """Header and rows: every line, bar and area of the figure in units of its axes, or the table that it brings."""
    if picture.table is not None:
        return picture.table
    rows = []
    for panel, axes in enumerate((axes for axes in picture.figure.axes if axes.get_label() != "<colorbar>"), start=1):
        for number, (kind, label, points) in enumerate(series_of(axes), start=1):
            name = f"series {number}" if label.startswith("_") or not label else label
            about = [panel, axes.get_xlabel() or axes.get_title(), axes.get_ylabel(), kind, name]
            rows += [[*about, point, *values, *[""] * (4 - len(values))] for point, values in enumerate(points, start=1)]
    return list(HEADER), rows


def series_of(axes: Any) -> Iterator[tuple[str, str, list[list[float]]]]:
    """Kind, label and points of what is drawn in the units of the axes."""
    for line in axes.lines:
        if line.get_transform() == axes.transData:
            yield "line", str(line.get_label()), np.column_stack(line.get_data(orig=False)).astype(float).tolist()
    for item in axes.collections:
        if isinstance(item, LineCollection):
            yield "segments", str(item.get_label()), [end for segment in item.get_segments() for end in np.asarray(segment).tolist()]
        elif isinstance(item, PolyCollection):
            yield "area", str(item.get_label()), [corner for path in item.get_paths() for corner in np.asarray(path.vertices).tolist()]
    drawn = [patch for patch in axes.patches if isinstance(patch, Rectangle) and patch.get_data_transform() == axes.transData]
    if drawn:
        yield "bar", "", [[bar.get_x(), bar.get_y(), bar.get_width(), bar.get_height()] for bar in drawn]
    for patch in axes.patches:
        if isinstance(patch, StepPatch):
            heights, edges, _ = patch.get_data()
            yield "bar", str(patch.get_label()), np.column_stack([edges[:-1], 0 * heights, np.diff(edges), heights]).tolist()
