"""What all figures share: the style, and how a figure is handed over."""

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass

import matplotlib as mpl
import numpy as np
from matplotlib.figure import Figure
from matplotlib.text import Text

from ..words import subscript

__all__ = [
    "Picture",
    "density_axes",
    "diagonal",
    "grid_of_constants",
    "house_style",
    "new_figure",
    "plain_log_ticks",
    "room_about_zero",
    "stamp_synthetic",
    "text_size",
    "unique_legend",
]

# The palette of Okabe and Ito, which colour-blind readers can tell apart.
BLACK, ORANGE, SKY, GREEN, YELLOW, BLUE, RED, PURPLE = (
    "#000000", "#E69F00", "#56B4E9", "#009E73", "#F0E442", "#0072B2", "#D55E00", "#CC79A7",
)  # fmt: skip
CYCLE = (BLUE, ORANGE, GREEN, RED, PURPLE, SKY, BLACK)
MARKERS = "osD^vP*"

STYLE = {
    "axes.axisbelow": True,
    "axes.grid": True,
    "axes.prop_cycle": mpl.cycler(color=CYCLE),
    "axes.spines.right": False,
    "axes.spines.top": False,
    "axes.titlesize": 10,
    "figure.constrained_layout.use": True,
    "font.size": 9,
    "grid.color": "#e4e4e4",
    "grid.linewidth": 0.6,
    "image.cmap": "cividis",
    "legend.frameon": False,
    "lines.linewidth": 1.4,
    # Text that can be searched and edited.
    "pdf.fonttype": 42,
    "savefig.dpi": 160,
    "svg.fonttype": "none",
    "svg.hashsalt": "bayesindent",
}

#: Width of a figure in inches.
WIDTH = 7.0


@dataclass(frozen=True)
class Picture:
    """A figure, its words for those who cannot see it, its caption, and header and rows of the numbers behind it where it has more than
    lines, bars and areas."""

    figure: Figure
    alt: str
    caption: str
    table: tuple[list[str], list[list]] | None = None


def new_figure(height: float) -> Figure:
    """An empty figure of this height in inches."""
    return Figure(figsize=(WIDTH, height))


def grid_of_constants(names: Sequence[str], height: float, further: float = 0.0):
    """A figure with axes for each constant, three in a row: of a `height` a row, and `further` in all, in inches."""
    columns = min(3, len(names))
    rows = -(-len(names) // columns)
    figure = new_figure(height * rows + further)
    grid = figure.subplots(rows, columns, squeeze=False).ravel()
    for spare in grid[len(names) :]:
        spare.remove()
    return figure, grid


def density_axes(axes, name: str, **further) -> None:
    """Axes of a histogram of a constant, whose height is no matter."""
    axes.set(xlabel=f"{subscript(name)} (GPa)", yticks=[], **further)
    axes.grid(False)
    axes.spines["left"].set_visible(False)


@contextmanager
def house_style() -> Iterator[None]:
    """Draw in one style, whatever the user's configuration is."""
    with mpl.rc_context({**mpl.rcParamsDefault, "backend": "agg", **STYLE}):
        yield


def text_size(figure: Figure) -> float:
    """The smallest size of text that is seen, in points; indices of formulas apart."""
    return min(
        (text.get_fontsize() for text in figure.findobj(Text) if text.get_visible() and text.get_text().strip()), default=STYLE["font.size"]
    )


def stamp_synthetic(figure: Figure) -> None:
    """Mark a figure that rests on made-up data."""
    figure.get_layout_engine().set(rect=(0, 0, 1, 0.94))
    figure.text(0.995, 0.985, "SYNTHETIC DATA", ha="right", va="top", color=RED, weight="bold", size=9)


def diagonal(axes, x, y) -> None:
    """The line of equality, over the range of the data."""
    low, high = min(np.min(x), np.min(y)), max(np.max(x), np.max(y))
    axes.plot([low, high], [low, high], color=BLACK, lw=0.8)


def room_about_zero(axes, values) -> None:
    """Limits that show zero and all values."""
    limit = 1.25 * max(np.max(np.abs(values)), 0.1)
    axes.set_ylim(min(-0.25 * limit, 1.25 * np.min(values)), max(0.25 * limit, 1.25 * np.max(values)))


def plain_log_ticks(axis) -> None:
    """Numbers such as 0.5 on a logarithmic axis, not powers."""
    axis.set_major_locator(mpl.ticker.LogLocator(subs=(1, 2, 5)))
    axis.set_major_formatter(mpl.ticker.FormatStrFormatter("%g"))
    axis.set_minor_formatter(mpl.ticker.NullFormatter())


def unique_legend(figure: Figure) -> None:
    """One legend above all axes."""
    entries: dict = {}
    for axes in figure.axes:
        for handle, label in zip(*axes.get_legend_handles_labels(), strict=True):
            entries.setdefault(label, handle)
    figure.legend(entries.values(), entries.keys(), loc="outside upper left", ncols=len(entries))
