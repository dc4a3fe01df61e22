"""Writes figures as images, and the numbers behind them."""

import base64
import io
from collections import defaultdict
from collections.abc import Iterable, Iterator, Sequence
from contextlib import suppress
from itertools import chain, product
from typing import Any

import numpy as np
from matplotlib.collections import LineCollection, PolyCollection
from matplotlib.patches import Rectangle, StepPatch

from ..common.progress import progress_bar
from ..common.result_files import whole_file, write_csv
from .figures import FIGURES
from .figures.style import (
    COLUMN,
    WIDTH,
    Picture,
    house_style,
    lay_out,
    letter_panels,
    panels_of,
    stamp_synthetic,
    text_size,
)
from .results import NothingToShow, Results

#: Columns of the numbers behind a figure; only bars have width and height.
HEADER = ("panel", "x_axis", "y_axis", "kind", "series", "point", "x", "y", "width", "height")


def figure_table(picture: Picture) -> tuple[list[str], list[list]]:
    """Header and rows of the numbers behind a figure.

    They are its own table, or every line, bar and area in units of the axes.
    """
    if picture.table is not None:
        return picture.table
    rows = []
    for panel, axes in enumerate(panels_of(picture.figure), start=1):
        for number, (kind, label, points) in enumerate(series_of(axes), start=1):
            name = f"series {number}" if label.startswith("_") or not label else label
            about = [panel, axes.get_xlabel() or axes.get_title(), axes.get_ylabel(), kind, name]
            for point, values in enumerate(points, start=1):
                rows.append([*about, point, *map(float, values), *[""] * (4 - len(values))])
    return list(HEADER), rows


def series_of(axes: Any) -> Iterator[tuple[str, str, Iterable[Sequence[float]]]]:
    """Kind, label and points of each series in units of the axes."""
    for line in axes.lines:
        if line.get_transform() == axes.transData:
            yield "line", line.get_label(), np.column_stack(line.get_data(orig=False))
    for item in axes.collections:
        if isinstance(item, LineCollection):
            yield "segments", item.get_label(), chain(*item.get_segments())
        elif isinstance(item, PolyCollection):
            corners = (path.vertices for path in item.get_paths())
            yield "area", item.get_label(), chain(*corners)
    drawn = [
        (*bar.get_xy(), bar.get_width(), bar.get_height())
        for bar in axes.patches
        if isinstance(bar, Rectangle) and bar.get_data_transform() == axes.transData
    ]
    if drawn:
        yield "bar", "", drawn
    for patch in axes.patches:
        if isinstance(patch, StepPatch):
            heights, edges, _ = patch.get_data()
            bars = np.column_stack([edges[:-1], 0 * heights, np.diff(edges), heights])
            yield "bar", patch.get_label(), bars


#: File formats of figures for papers, and the dots per inch of their images.
FOR_PAPERS = {"svg": 300, "pdf": 300, "png": 600}

#: Sections whose figures show measurements, and those whose figures are not for papers.
MEASURED, NO_PAPER = ("next", "result", "curves", "diagnostics"), ("next", "diagnostics")

#: Dots per inch of all other files.
SCREEN = 160

#: How files are written: PNG by fast compression of runs of equal bytes (Z_RLE of zlib), which
#: suits drawings; the others without dates, so that equal results give equal files.
SAVED: dict[str, dict] = {
    "png": {"pil_kwargs": {"compress_level": 1, "compress_type": 3}},
    "svg": {"metadata": {"Date": None}},
    "pdf": {"metadata": {"CreationDate": None}},
}


def draw_figures(results: Results, kind_of_files: str, paper: bool) -> dict[str, list[dict]]:
    """Draw all figures of the results; return them by section, see `embedded`.

    `kind_of_files`: a format in which figures are also written to the folder `figures`. `paper`:
    also write figures as wide as a column, and their numbers as CSV, to `paper/figures`.
    """
    paper_folder = results.folder / "paper" / "figures"
    files = {WIDTH: [(results.folder / "figures", kind_of_files, SCREEN)] if kind_of_files else []}
    if paper:
        files[COLUMN] = [(paper_folder, kind, dots) for kind, dots in FOR_PAPERS.items()]
    pictures: dict[tuple[float, str], tuple[str, Picture]] = {}
    for width, (section, function) in product(files, FIGURES):
        if width == WIDTH or section not in NO_PAPER:
            with house_style(width), suppress(NothingToShow):
                picture = function(results)
                pictures[width, function.__name__] = section, picture
                if results.synthetic and section in MEASURED:
                    stamp_synthetic(picture.figure)
    drawn: dict[str, list[dict]] = defaultdict(list)
    with progress_bar("figures", len(pictures)) as counted:
        for (width, name), (section, picture) in pictures.items():
            figure = picture.figure
            with house_style(width):
                if width == COLUMN:
                    letter_panels(figure)
                    write_csv(paper_folder / f"{name}.csv", *figure_table(picture), picture.caption)
                lay_out(figure, max((dots for *_, dots in files[width]), default=SCREEN))
                for folder, kind, dots in files[width]:
                    with whole_file(folder / f"{name}.{kind}") as file:
                        figure.savefig(file, dpi=dots, **SAVED[kind])
                if width == WIDTH:
                    drawn[section].append(embedded(picture))
            counted()
    for _, function in FIGURES:
        if (WIDTH, function.__name__) not in pictures:
            # Remove files of other inputs.
            for folder, kind, _ in chain(*files.values(), [(paper_folder, "csv", 0)] * paper):
                (folder / f"{function.__name__}.{kind}").unlink(missing_ok=True)
    return drawn


def embedded(picture: Picture) -> dict:
    """The PNG of a figure (base 64), its texts, and its sizes in points."""
    buffer = io.BytesIO()
    picture.figure.savefig(buffer, format="png", **SAVED["png"])
    width, height = (72 * inches for inches in picture.figure.get_size_inches())
    return {
        "data": base64.b64encode(buffer.getvalue()).decode(),
        "alt": picture.alt,
        "caption": picture.caption,
        "width": width,
        "height": height,
        "text": text_size(picture.figure),
    }
