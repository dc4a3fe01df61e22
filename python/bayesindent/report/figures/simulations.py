"""Simulated indentations."""

import numpy as np

from ..formatting import orientation
from ..results import Results, present
from .style import CYCLE, MARKERS, Picture, evenly, panels

#: Curves that are shown at most.
SHOWN = 6


def load_depth(results: Results) -> Picture:
    """Force of simulated indentations, and the modulus, over depth."""
    rows = present(results.simulations)
    figure, (left, right) = panels(3.8, 1, 2)
    for row, colour, marker in zip(evenly(rows, SHOWN), CYCLE, MARKERS):
        depth, modulus = 1e3 * np.array(row["depth_um"]), row["indentation_modulus_gpa"]
        label = f"{orientation(row['euler_deg'])}: {modulus:.1f} GPa"
        left.plot(depth, row["force_mn"], color=colour, marker=marker, ms=4.5, lw=1, label=label)
        right.plot(depth, row["modulus_by_depth_gpa"], marker, color=colour, ms=4.5)
        right.axhline(modulus, color=colour, lw=1)
    left.legend(title="(φ₁, Φ, φ₂): modulus", loc="upper left")
    for axes, label in ((left, "force (mN)"), (right, "modulus of each depth alone (GPa)")):
        axes.set(xlabel="depth (nm)", ylabel=label, xlim=(0, None))
    shape = results.settings["indenter"].get("shape", "paraboloid")
    return Picture(
        figure,
        f"Simulated indentations under a rigid {shape}. Left: force over depth. Right: the modulus "
        "of each depth alone, with the indentation modulus, a least-squares fit of the whole "
        "curve, as a line. The fit leaves out the first depths, where the contact spans less than "
        "five elements.",
    )
