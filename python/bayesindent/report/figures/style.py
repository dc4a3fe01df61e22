"""Style and helpers that all figures share."""

from collections.abc import Collection, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from string import ascii_lowercase
from typing import Any

import matplotlib as mpl
import numpy as np
from matplotlib.figure import Figure

# The palette of Okabe and Ito, which colour-blind readers can distinguish.
BLACK, ORANGE, SKY, GREEN, YELLOW, BLUE, RED, PURPLE = (
    "#000000",
    "#E69F00",
    "#56B4E9",
    "#009E73",
    "#F0E442",
    "#0072B2",
    "#D55E00",
    "#CC79A7",
)
CYCLE = (BLUE, ORANGE, GREEN, RED, PURPLE, SKY, BLACK)
MARKERS = "osD^vP*"

STYLE = mpl.rc_params_from_file(
    Path(__file__).with_name("house.mplstyle"), use_default_template=False
)
STYLE["axes.prop_cycle"] = mpl.cycler(color=CYCLE)

#: A figure with at least this many panels is a matrix, whose panels have no letters.
MATRIX = 9

#: Widths in inches of a figure of the report and of a journal's column; font size of the latter.
WIDTH, COLUMN, SMALL = 7.0, 3.35, 7.0


@dataclass(frozen=True)
class Picture:
    """A figure and its caption.

    `table`: header and rows of its numbers, if it has more than lines, bars and areas. `values`:
    the text that follows the first sentence of the caption in the alternative text.
    """

    figure: Figure
    caption: str
    table: tuple[list[str], list[list]] | None = None
    values: str = ""

    @property
    def alt(self) -> str:
        """The alternative text for readers who cannot see the figure."""
        return f"{self.caption.partition('. ')[0].rstrip('.')}. {self.values}".strip()


def new_figure(height: float) -> Figure:
    """An empty figure of this height in inches."""
    return Figure(figsize=(mpl.rcParams["figure.figsize"][0], height), layout="constrained")


def is_column() -> bool:
    """Whether figures are as wide as a column of a journal."""
    return bool(mpl.rcParams["figure.figsize"][0] < WIDTH)


def panels(height: float, rows: int = 1, columns: int = 1, **settings: Any) -> tuple[Figure, Any]:
    """A figure of this `height` in inches and its axes; `settings` are those of `subplots`.

    In a column of a journal two panels are one above the other.
    """
    if is_column() and (rows, columns) == (1, 2):
        rows, columns, height = 2, 1, 1.45 * height
    elif is_column():
        height *= 0.75
    figure = new_figure(height)
    return figure, figure.subplots(rows, columns, **settings)


def panels_of(figure: Figure) -> list[Any]:
    """The axes of a figure without those of its colour bars."""
    return [axes for axes in figure.axes if axes.get_label() != "<colorbar>"]


def evenly(rows: Sequence, most: int) -> list:
    """At most so many of the rows, evenly over them."""
    places = np.linspace(0, len(rows) - 1, min(most, len(rows))).round().astype(int)
    return [rows[place] for place in np.unique(places)]


def letter_panels(figure: Figure) -> None:
    """Add (a), (b), .. to the panels of a figure with several panels, unless it is a matrix."""
    shown = panels_of(figure)
    for letter, axes in zip(ascii_lowercase, shown if 1 < len(shown) < MATRIX else []):
        axes.set_title(f"({letter}) {axes.get_title(loc='left')}", loc="left")


def legend_above(figure: Figure, *entries: Any, columns: int = 4) -> None:
    """A legend outside the axes; `entries` are those of matplotlib's `legend`."""
    columns = min(columns, 2 if is_column() else columns)
    figure.legend(*entries, loc="outside upper left", ncols=columns)


def grid_of_constants(
    names: Collection[str], height: float, further: float
) -> tuple[Figure, dict[str, Any]]:
    """A figure with axes for each constant, three in a row.

    `height`: of each row; `further`: additional height of the figure; both in inches.
    """
    columns = min(2 if is_column() else 3, len(names))
    rows = -(-len(names) // columns)
    figure, grid = panels(height * rows + further, rows, columns, squeeze=False)
    for spare in grid.ravel()[len(names) :]:
        spare.remove()
    return figure, dict(zip(names, grid.ravel()))


@contextmanager
def house_style(width: float = WIDTH) -> Iterator[None]:
    """Draw figures of this width in inches, independent of the user's configuration."""
    small = (
        {"font.size": SMALL, "axes.titlesize": SMALL, "lines.linewidth": 1.0}
        if width < WIDTH
        else {}
    )
    own = {"backend": "agg", **STYLE, **small, "figure.figsize": (width, width)}
    with mpl.rc_context({**mpl.rcParamsDefault, **own}):
        yield


def stamp_synthetic(figure: Figure) -> None:
    """Mark a figure of synthetic data."""
    height = 0.2 / figure.get_figheight()
    figure.get_layout_engine().set(rect=(0, height, 1, 1 - height))
    figure.text(0.995, 0.1 * height, "SYNTHETIC DATA", ha="right", va="bottom", color=RED)


def parity_panels(
    x: np.ndarray,
    y: np.ndarray,
    difference: np.ndarray,
    labels: Sequence[str],
    bands: bool = True,
    **style: Any,
) -> Figure:
    """A figure of y against x with the line of equality, and beside it of a difference.

    `labels`: those of x, y and the difference. `bands`: whether it is in sds, with bands of one and
    two. `style`: of the points.
    """
    figure, (left, right) = panels(3.4, 1, 2)
    ends = [min(x.min(), y.min()), max(x.max(), y.max())]
    left.plot(ends, ends, color=BLACK, lw=0.8)
    points = left.errorbar(x, y, **{"fmt": "o", "ms": 3.5, "lw": 0.8} | style)
    # Draw the points above the line of zero.
    right.plot(x, difference, "o", ms=points.lines[0].get_markersize(), zorder=3)
    for axes, label in zip((left, right), labels[1:]):
        axes.set(xlabel=labels[0], ylabel=label)
    for multiple, alpha in ((2, 0.2), (1, 0.3)) if bands else ():
        right.axhspan(-multiple, multiple, color=SKY, alpha=alpha, lw=0)
    right.axhline(0, color=BLACK, lw=0.8)
    return figure


def logarithmic(axes: Any) -> None:
    """Make the y axis logarithmic, with labels such as 0.5, if there are positive values."""
    if not any((np.asarray(line.get_ydata(), dtype=float) > 0).any() for line in axes.lines):
        return
    axes.set_yscale("log")
    axis = axes.yaxis
    axis.set_major_locator(mpl.ticker.LogLocator(subs=(1, 2, 5)))
    axis.set_major_formatter(mpl.ticker.FormatStrFormatter("%g"))
    axis.set_minor_formatter(mpl.ticker.NullFormatter())
