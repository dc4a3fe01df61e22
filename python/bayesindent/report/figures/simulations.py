"""Simulated indentations, and the exact theory beside them."""

import numpy as np

from ..words import orientation
from .style import BLACK, BLUE, CYCLE, MARKERS, ORANGE, Picture, diagonal, new_figure, room_about_zero

__all__ = ["load_depth", "theory"]

#: Curves that are shown at most.
SHOWN = 6


def load_depth(results) -> Picture | None:
    """Force against depth^1.5 of simulated indentations, with the fits through the origin that give the moduli."""
    rows = results.simulations
    if not rows:
        return None
    radius = results.group("simulation").get("radius_um", 16.0)
    figure = new_figure(3.8)
    axes = figure.subplots()
    chosen = [rows[i] for i in np.unique(np.linspace(0, len(rows) - 1, min(SHOWN, len(rows))).round().astype(int))]
    for row, colour, marker in zip(chosen, CYCLE, MARKERS):
        x = (1e3 * np.asarray(row["depth_um"])) ** 1.5
        end = np.array([0.0, x.max()])
        modulus = row["indentation_modulus_gpa"]
        axes.plot(end, 4 / 3 * modulus * np.sqrt(radius) * end / 1e3**1.5, color=colour, lw=1)
        label = f"{orientation(row['euler_deg'])}: {modulus:.1f} GPa"
        axes.plot(x, row["force_mn"], marker, color=colour, ms=4.5, label=label)
    axes.set(xlabel="depth to the power 1.5, h$^{1.5}$ (nm$^{1.5}$)", ylabel="force P (mN)", xlim=(0, None), ylim=(0, None))
    axes.legend(title="(φ₁, Φ, φ₂): modulus", loc="upper left")
    return Picture(
        figure,
        f"Force against depth to the power 1.5 for {len(rows)} simulated indentations; the points lie on straight lines.",
        f"Force against depth to the power 1.5 under a rigid sphere of radius {radius:g} µm. The slope of the fit through the origin is "
        "4/3 M √R, with M the indentation modulus.",
    )


def theory(results) -> Picture | None:
    """Simulated moduli beside the exact theory of the half-space."""
    rows, exact = results.simulations, results.theory_moduli
    if exact is None:
        return None
    simulated = np.array([row["indentation_modulus_gpa"] for row in rows])
    angles = np.array([row["euler_deg"] for row in rows])
    words = f"Finite elements beside the exact theory of the half-space: they differ by at most {100 * np.abs(simulated / exact - 1).max():.2f} %."
    series = {results.group("simulation").get("mesh", "halfspace"): simulated}
    if other := results.documents["simulate"].get("other_mesh"):
        moduli = np.array(other["indentation_modulus_gpa"], dtype=float)
        bias = 100 * (moduli / exact - 1)
        words += (
            f" On the {other['mesh']} mesh: by {np.nanmin(bias):.1f} to {np.nanmax(bias):.1f} %; the finite block of the paper is "
            "stiffer than a half-space, by an amount that depends on crystal and orientation."
        )
        if np.isfinite(moduli).all():
            series[other["mesh"]] = moduli
    one_crystal = all(row["constants"] == rows[0]["constants"] for row in rows) and len(rows) > 1
    if one_crystal and np.ptp(angles[:, 1]) > 0 and not np.ptp(angles[:, [0, 2]], axis=0).any():
        figure = over_declination(angles[:, 1], series, exact)
    else:
        figure = against_theory(simulated, exact)
    return Picture(figure, words, words + " The simulations use nothing of the theory.")


def over_declination(declination_deg, simulated: dict, theory):
    """Moduli of one crystal simulated on one mesh or two and the theory over the declination Φ, with the differences."""
    order = np.argsort(declination_deg)
    angle, exact = declination_deg[order], theory[order]
    figure = new_figure(4.4)
    top, bottom = figure.subplots(2, 1, sharex=True, height_ratios=(2.5, 1))
    top.plot(angle, exact, color=BLACK, label="half-space theory")
    bottom.axhline(0, color=BLACK, lw=0.8)
    differences = []
    for (mesh, moduli), color, marker in zip(simulated.items(), (BLUE, ORANGE), "os", strict=False):
        top.plot(angle, moduli[order], marker, color=color, label=f"finite elements, {mesh} mesh")
        differences.append(100 * (moduli[order] / exact - 1))
        bottom.plot(angle, differences[-1], f"{marker}-", color=color, lw=0.8)
    room_about_zero(bottom, np.concatenate(differences))
    top.set_ylabel("indentation modulus (GPa)")
    top.legend()
    bottom.set(xlabel="declination Φ (degrees)", ylabel="difference (%)")
    return figure


def against_theory(simulated, theory):
    """Simulated moduli of various crystals against the theory."""
    figure = new_figure(3.4)
    left, right = figure.subplots(1, 2)
    diagonal(left, simulated, theory)
    left.plot(theory, simulated, "o", color=BLUE, ms=4)
    left.set(xlabel="half-space theory (GPa)", ylabel="finite elements (GPa)")
    difference = 100 * (simulated / theory - 1)
    right.axhline(0, color=BLACK, lw=0.8)
    right.plot(theory, difference, "o", color=BLUE, ms=4)
    right.set(xlabel="half-space theory (GPa)", ylabel="difference (%)")
    room_about_zero(right, difference)
    return figure
