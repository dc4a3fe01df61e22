"""Simulated indentations, and the exact theory beside them."""

import numpy as np

from ..formatting import orientation
from ..results import NothingToShow, Results, present
from .style import CYCLE, MARKERS, Picture, evenly, panels, parity_panels

#: Curves that are shown at most.
SHOWN = 6


def load_depth(results: Results) -> Picture:
    """Force of simulated indentations against that of the isotropic half-space of unit modulus, and
    the modulus over depth.
    """
    rows = present(results.simulations)
    figure, (left, right) = panels(3.8, 1, 2)
    for row, colour, marker in zip(evenly(rows, SHOWN), CYCLE, MARKERS):
        force, by_depth = np.array(row["force_mn"]), np.array(row["modulus_by_depth_gpa"])
        unit, modulus = force / by_depth, row["indentation_modulus_gpa"]
        end = np.array([0.0, unit.max()])
        left.plot(end, modulus * end, color=colour, lw=1)
        label = f"{orientation(row['euler_deg'])}: {modulus:.1f} GPa"
        left.plot(unit, force, marker, color=colour, ms=4.5, label=label)
        right.axhline(modulus, color=colour, lw=1)
        right.plot(1e3 * np.array(row["depth_um"]), by_depth, marker, color=colour, ms=4.5)
    left.set(
        xlabel="P/M of an isotropic half-space (µm²)",
        ylabel="force P (mN)",
        xlim=(0, None),
        ylim=(0, None),
    )
    left.legend(title="(φ₁, Φ, φ₂): modulus", loc="upper left")
    right.set(xlabel="depth h (nm)", ylabel="modulus of each depth alone (GPa)", xlim=(0, None))
    shape = results.settings["indenter"].get("shape", "paraboloid")
    form = " (4/3 √R h^1.5)" if shape == "paraboloid" else ""
    return Picture(
        figure,
        f"Simulated indentations. Left: force under a rigid {shape} against the force over "
        "modulus, P/M, of an isotropic half-space at the same depths by Sneddon's closed "
        f"form{form}. The slope of the fit through the origin is the indentation modulus. Right: "
        "the modulus of each depth alone, with the fit as a line. The fit leaves out the first "
        "depths, where the contact spans less than five elements.",
    )


def theory(results: Results) -> Picture:
    """Simulated moduli beside the exact theory of the half-space."""
    rows, exact = results.simulations, results.theory_moduli
    if exact is None:
        raise NothingToShow
    simulated = np.array([row["indentation_modulus_gpa"] for row in rows])
    values = 100 * (simulated / exact - 1)
    labels = ("half-space theory (GPa)", "finite elements (GPa)", "difference (%)")
    figure, right = parity_panels(exact, simulated, values, labels, bands=False, ms=4)
    largest = np.abs(values).max()
    # Limits that show the line of zero and all values.
    least = max(largest, 0.1) / 4
    right.set_ylim(1.25 * min(-least, values.min()), 1.25 * max(least, values.max()))
    return Picture(
        figure,
        "Finite elements beside the exact theory of the half-space: they differ by at most "
        f"{largest:.2f} %.",
    )
