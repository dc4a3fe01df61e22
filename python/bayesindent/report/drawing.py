"""Writes figures as images, and the numbers behind them."""

import base64
import io
from collections import defaultdict
from collections.abc import Iterable, Iterator, Sequence
from itertools import chain, product
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.collections import LineCollection
from matplotlib.figure import Figure

from ..common.progress import progress_bar
from ..common.result_files import whole_file, write_csv
from .figures import FIGURES
from .figures.style import (
    COLUMN,
    WIDTH,
    Picture,
    house_style,
    letter_panels,
    panels_of,
    stamp_synthetic,
)
from .results import NothingToShow, Results

#: Columns of the numbers behind a figure.
HEADER = ("panel", "x_axis", "y_axis", "kind", "series", "point", "x", "y")


def figure_table(picture: Picture) -> tuple[Sequence[str], list[list]]:
    """Header and rows of the numbers behind a figure: its own table, or every line and error bar in
    units of the axes.
    """
    if picture.table is not None:
        return picture.table
    rows = []
    for panel, axes in enumerate(panels_of(picture.figure), start=1):
        for number, (kind, label, points) in enumerate(series_of(axes), start=1):
            name = f"series {number}" if label.startswith("_") or not label else label
            about = [panel, axes.get_xlabel() or axes.get_title(), axes.get_ylabel(), kind, name]
            rows += [[*about, point, *map(float, xy)] for point, xy in enumerate(points, start=1)]
    return HEADER, rows


def series_of(axes: Any) -> Iterator[tuple[str, str, Iterable[Sequence[float]]]]:
    """Kind, label and points of each series in units of the axes."""
    for line in axes.lines:
        if line.get_transform() == axes.transData:
            yield "line", line.get_label(), np.column_stack(line.get_data(orig=False))
    for item in axes.collections:
        if isinstance(item, LineCollection):
            yield "segments", item.get_label(), chain(*item.get_segments())


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
    also write figures as wide as a column and as a page, and their numbers as CSV, to
    `paper/figures`.
    """
    paper_folder = results.folder / "paper" / "figures"
    files = {WIDTH: [(results.folder / "figures", kind_of_files, SCREEN)] if kind_of_files else []}
    if paper:
        files[COLUMN] = [(paper_folder, kind, dots) for kind, dots in FOR_PAPERS.items()]
    drawn: dict[str, list[dict]] = defaultdict(list)
    with progress_bar("figures", len(files) * len(FIGURES)) as counted:
        for width, (section, function) in product(files, FIGURES):
            counted()
            name, in_paper = function.__name__, width == COLUMN
            for_paper = paper and section not in NO_PAPER
            if in_paper and not for_paper:
                continue
            with house_style(width):
                try:
                    picture = function(results)
                except NothingToShow:
                    # Remove files of other inputs.
                    for folder, kind, _ in [*files[width], *[(paper_folder, "csv", 0)] * in_paper]:
                        (folder / f"{name}.{kind}").unlink(missing_ok=True)
                    (paper_folder / f"{name}_wide.pdf").unlink(missing_ok=True)
                    continue
                figure = picture.figure
                if results.synthetic and section in MEASURED:
                    stamp_synthetic(figure)
                if for_paper:
                    letter_panels(figure)
                if in_paper:
                    write_csv(paper_folder / f"{name}.csv", *figure_table(picture), picture.caption)
                for folder, kind, dots in files[width]:
                    save(figure, folder / f"{name}.{kind}", dots)
                if not in_paper:
                    drawn[section].append(embedded(picture))
                    if for_paper:
                        save(figure, paper_folder / f"{name}_wide.pdf", FOR_PAPERS["pdf"])
    return drawn


def save(figure: Figure, path: Path, dots: int) -> None:
    """Write a figure in the format of the file's name, with so many dots per inch."""
    with whole_file(path) as file:
        figure.savefig(file, format=path.suffix[1:], dpi=dots, **SAVED[path.suffix[1:]])
    # Its other files have the same layout, which takes time.
    figure.set_layout_engine("none")


def embedded(picture: Picture) -> dict:
    """The PNG of a figure (base 64), its texts, and its sizes in points."""
    buffer = io.BytesIO()
    picture.figure.savefig(buffer, format="png", **SAVED["png"])
    picture.figure.set_layout_engine("none")
    width, height = (72 * inches for inches in picture.figure.get_size_inches())
    return {
        "data": base64.b64encode(buffer.getvalue()).decode(),
        "alt": picture.alt,
        "caption": picture.caption,
        "width": width,
        "height": height,
    }
