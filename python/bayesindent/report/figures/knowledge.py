"""What further knowledge would bring."""

import numpy as np

from ..formatting import quantities_label, subscript
from ..results import Results, present
from .style import BLACK, CYCLE, MARKERS, Picture, panels

__all__ = ["knowledge"]


def knowledge(results: Results) -> Picture:
    """The sd of each constant now, and as it would be with one more piece of knowledge."""
    rows = present(results.identifiability("knowledge"))
    names = [name for name in results.constants if name in rows[0]["sd_then"]]
    now = np.array([results.documents["extract"]["parameters"][name]["sd"] for name in names])
    place = -np.arange(len(names), dtype=float)
    figure, axes = panels(0.4 * len(names) + 0.2 * len(rows) + 1.2)
    axes.plot(now, place, "|", color=BLACK, ms=13, mew=2, label="sd now")
    table = []
    for number, (row, colour, marker) in enumerate(zip(rows, np.resize(CYCLE, len(rows)), np.resize(list(MARKERS), len(rows)))):
        then = np.array([row["sd_then"][name] for name in names])
        lifted = place + 0.5 * ((number + 1) / (len(rows) + 1) - 0.5)
        axes.hlines(lifted, np.minimum(then, now), now, color=colour, lw=1.2)
        label = f"{quantities_label(row)} known to {100 * row['relative_sd']:.0f} %"
        axes.plot(then, lifted, marker, color=colour, ms=5, label=label)
        table += [[row["name"], row["relative_sd"], *sds] for sds in zip(names, now.tolist(), then.tolist())]
    axes.set_yticks(place, [subscript(name) for name in names])
    axes.set(xlabel="sd (GPa)", xlim=(0, 1.05 * now.max()), ylim=(place[-1] - 0.6, 0.6))
    figure.legend(loc="outside upper left", ncols=1)
    return Picture(
        figure,
        f"Standard deviation of {len(names)} constants now, and with each of {len(rows)} further pieces of knowledge.",
        "What else to measure or to look up: the sd of each constant now (black), and what is expected of it with each further piece of "
        "knowledge by itself.",
        (["known", "relative_sd", "constant", "sd_now_gpa", "sd_then_gpa"], table),
    )
