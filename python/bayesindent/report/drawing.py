"""Writes figures as images, and the numbers behind them."""

import base64
import io
from collections.abc import Iterator
from contextlib import suppress
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
    for panel, axes in enumerate(
        (axes for axes in picture.figure.axes if axes.get_label() != "<colorbar>"), start=1
    ):
        for number, (kind, label, points) in enumerate(series_of(axes), start=1):
            name = f"series {number}" if label.startswith("_") or not label else label
            about = [panel, axes.get_xlabel() or axes.get_title(), axes.get_ylabel(), kind, name]
            rows += [
                [*about, point, *values, *[""] * (4 - len(values))]
                for point, values in enumerate(points, start=1)
            ]
    return list(HEADER), rows


def series_of(axes: Any) -> Iterator[tuple[str, str, list[list[float]]]]:
    """Kind, label and points of each series in units of the axes."""
    for line in axes.lines:
        if line.get_transform() == axes.transData:
            yield (
                "line",
                str(line.get_label()),
                np.column_stack(line.get_data(orig=False)).astype(float).tolist(),
            )
    for item in axes.collections:
        if isinstance(item, LineCollection):
            yield (
                "segments",
                str(item.get_label()),
                [end for segment in item.get_segments() for end in np.asarray(segment).tolist()],
            )
        elif isinstance(item, PolyCollection):
            yield (
                "area",
                str(item.get_label()),
                [
                    corner
                    for path in item.get_paths()
                    for corner in np.asarray(path.vertices).tolist()
                ],
            )
    drawn = [
        patch
        for patch in axes.patches
        if isinstance(patch, Rectangle) and patch.get_data_transform() == axes.transData
    ]
    if drawn:
        yield (
            "bar",
            "",
            [[bar.get_x(), bar.get_y(), bar.get_width(), bar.get_height()] for bar in drawn],
        )
    for patch in axes.patches:
        if isinstance(patch, StepPatch):
            heights, edges, _ = patch.get_data()
            yield (
                "bar",
                str(patch.get_label()),
                np.column_stack([edges[:-1], 0 * heights, np.diff(edges), heights]).tolist(),
            )


#: File formats of figures for papers, and the dots per inch of their images.
FOR_PAPERS = {"svg": 300, "pdf": 300, "png": 600}

#: Sections whose figures show measurements, and those whose figures are not for papers.
MEASURED, NO_PAPER = ("next", "result", "curves", "diagnostics"), ("next", "diagnostics")

#: Dots per inch of all other files.
SCREEN = 160

#: Fast compression of runs of equal bytes (Z_RLE of zlib), which suits drawings.
FAST: dict = {"png": {"pil_kwargs": {"compress_level": 1, "compress_type": 3}}}

#: No dates, so that equal results give equal files.
UNDATED = {"svg": {"Date": None}, "pdf": {"CreationDate": None}}


def draw_figures(results: Results, kind_of_files: str, paper: bool) -> dict[str, list[dict]]:
    """Draw all figures of the results; return for each section their PNG (base 64) and texts.

    `kind_of_files`: a format in which figures are also written to the folder `figures`. `paper`:
    also write figures as wide as a column, and their numbers as CSV, to `paper/figures`.
    """
    paper_folder = results.folder / "paper" / "figures"
    files = {WIDTH: [(results.folder / "figures", kind_of_files, SCREEN)] if kind_of_files else []}
    if paper:
        files[COLUMN] = [(paper_folder, kind, dots) for kind, dots in FOR_PAPERS.items()]
    pictures: dict[tuple[float, str], Picture] = {}
    for width in files:
        with house_style(width):
            for section, function in (
                FIGURES if width == WIDTH else [item for item in FIGURES if item[0] not in NO_PAPER]
            ):
                with suppress(NothingToShow):
                    picture = pictures[width, function.__name__] = function(results)
                    if results.synthetic and section in MEASURED:
                        stamp_synthetic(picture.figure)

    def draw(key: tuple[float, str]) -> dict:
        (width, name), picture = key, pictures[key]
        figure = picture.figure
        with house_style(width):
            if width == COLUMN:
                letter_panels(figure)
                write_csv(paper_folder / f"{name}.csv", *figure_table(picture), picture.caption)
            lay_out(figure, max((dots for *_, dots in files[width]), default=SCREEN))
            for folder, kind, dots in files[width]:
                with whole_file(folder / f"{name}.{kind}") as file:
                    figure.savefig(file, dpi=dots, metadata=UNDATED.get(kind), **FAST.get(kind, {}))
            if width == COLUMN:
                return {}
            buffer = io.BytesIO()
            figure.savefig(buffer, format="png", **FAST["png"])
        width, height = (72 * inches for inches in figure.get_size_inches())
        return {
            "data": base64.b64encode(buffer.getvalue()).decode(),
            "alt": picture.alt,
            "caption": picture.caption,
            "width": width,
            "height": height,
            "text": text_size(figure),
        }

    drawn = {}
    with progress_bar("figures", len(pictures)) as counted:
        for key in pictures:
            drawn[key] = draw(key)
            counted()
    sections: dict[str, list[dict]] = {}
    for section, function in FIGURES:
        name = function.__name__
        if (WIDTH, name) in drawn:
            sections.setdefault(section, []).append(drawn[WIDTH, name])
            continue
        # Remove files of other inputs.
        for folder, kind in [
            (folder, kind) for own in files.values() for folder, kind, _ in own
        ] + [(paper_folder, "csv")] * paper:
            (folder / f"{name}.{kind}").unlink(missing_ok=True)
    return sections
