"""The bias of moduli by the size of the specimen."""

import numpy as np
from matplotlib.figure import Figure

from ..formatting import orientation
from ..results import Results, present
from .style import BLACK, CYCLE, Picture, panels

__all__ = ["draw_bias", "specimen_size"]

LINES = {"softer": "--", "stiffer": ":"}


def specimen_size(results: Results) -> Picture:
    """The bias against thickness or radius."""
    document = present(results.documents["size"])
    text = f"Bias of the indentation modulus against the half-space, by {document['variable'].removesuffix('_um').replace('_', ' ')}."
    return Picture(
        draw_bias(document),
        text,
        f"{text} Each colour is a crystal; full lines: the surroundings as stated; dashed: half as stiff, dotted: twice. "
        f"Grey: within {100 * document['limit']:g} %.",
    )


def draw_bias(document: dict) -> Figure:
    """The figure of a document of `size`."""
    figure, axes = panels(3.4)
    limit = 100 * document["limit"]
    axes.axhspan(-limit, limit, color="0.9")
    axes.axhline(0, color=BLACK, lw=0.8)
    crystals: dict[str, int] = {}
    for row in document["results"]:
        number = crystals.setdefault(f"{row['constants']} {row['euler_deg']}", len(crystals))
        line, colour = LINES.get(row["surroundings"], "-"), CYCLE[number % len(CYCLE)]
        label = f"crystal {number + 1}, {orientation(row['euler_deg'])}" if row["surroundings"] not in LINES else None
        axes.plot(row["size_um"], 100 * np.array(row["bias"]), line, marker=".", color=colour, label=label)
    for name in dict.fromkeys(row["surroundings"] for row in document["results"]):
        axes.plot([], [], LINES.get(name, "-"), color=BLACK, label=f"surroundings {name}")
    axes.set_yscale("symlog", linthresh=limit)
    axes.yaxis.set_major_formatter("{x:g}")
    axes.set(xscale="log", xlabel=f"{document['variable'].removesuffix('_um').replace('_', ' ')} (µm)", ylabel="bias of the modulus (%)")
    axes.legend()
    return figure
