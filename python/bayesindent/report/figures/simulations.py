"""Simulated indentations, and the exact theory beside them."""

import numpy as np

from ..formatting import orientation
from ..results import NothingToShow, Results, present
from .style import BLACK, CYCLE, MARKERS, Picture, panels, parity_panels

#: Curves that are shown at most.
SHOWN = 6


def load_depth(results: Results) -> Picture:
    """Force of simulated indentations against that of the isotropic half-space of unit modulus, and
    the modulus over depth.
    """
    rows = present(results.simulations)
    figure, (left, right) = panels(3.8, 1, 2)
    chosen = [
        rows[i]
        for i in np.unique(np.linspace(0, len(rows) - 1, min(SHOWN, len(rows))).round().astype(int))
    ]
    for row, colour, marker in zip(chosen, CYCLE, MARKERS):
        force, by_depth, modulus = (
            np.array(row["force_mn"]),
            np.array(row["modulus_by_depth_gpa"]),
            row["indentation_modulus_gpa"],
        )
        unit = force / by_depth
        end = np.array([0.0, unit.max()])
        left.plot(end, modulus * end, color=colour, lw=1)
        left.plot(
            unit,
            force,
            marker,
            color=colour,
            ms=4.5,
            label=f"{orientation(row['euler_deg'])}: {modulus:.1f} GPa",
        )
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
    shape = results.group("indenter").get("shape", "paraboloid")
    text = (
        f"Left: force under a rigid {shape} against the force over modulus, P/M, of an "
        "isotropic half-space at the same depths by"
    )
    form = f"Sneddon's closed form{' (4/3 √R h^1.5)' if shape == 'paraboloid' else ''}."
    fit = (
        "The slope of the fit through the origin is the indentation modulus. Right: the modulus "
        "of each depth alone, with the fit as a line."
    )
    left_out = (
        "The fit leaves out the first depths, where the contact spans less than five elements."
    )
    return Picture(figure, f"Simulated indentations. {text} {form} {fit} {left_out}")


def theory(results: Results) -> Picture:
    """Simulated moduli beside the exact theory of the half-space."""
    rows, exact = results.simulations, results.theory_moduli
    if exact is None:
        raise NothingToShow
    simulated = np.array([row["indentation_modulus_gpa"] for row in rows])
    values = 100 * (simulated / exact - 1)
    text = (
        "Finite elements beside the exact theory of the half-space: they differ by at most "
        f"{np.abs(values).max():.2f} %."
    )
    figure, right = parity_panels(
        exact,
        simulated,
        values,
        ("half-space theory (GPa)", "finite elements (GPa)", "difference (%)"),
        ms=4,
    )
    right.axhline(0, color=BLACK, lw=0.8)
    # Limits that show the line of zero and all values.
    limit = 1.25 * max(np.max(np.abs(values)), 0.1)
    right.set(
        ylim=(min(-0.25 * limit, 1.25 * np.min(values)), max(0.25 * limit, 1.25 * np.max(values)))
    )
    return Picture(figure, text)
