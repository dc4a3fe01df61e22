"""Figures 4, 9 and 10 of the paper: posteriors of the constants by its method beside the exact one,
the ridges behind them, and the moduli that follow.
"""

import numpy as np

from bayesindent.crystal.elasticity import halfspace_modulus, stiffness
from bayesindent.report.figures.style import (
    BLACK,
    BLUE,
    GREEN,
    ORANGE,
    RED,
    SKY,
    new_figure,
)
from bayesindent.report.formatting import subscript
from reproduction.published import LITERATURE
from reproduction.step_2 import DECLINATIONS, EXACT, METHOD

__all__ = ["marginals", "predictions", "ridges"]

#: Pairs of constants whose ridges are drawn.
PAIRS = {"cubic": (("C11", "C12"), ("C44", "C12")), "hexagonal": (("C11", "C12"), ("C33", "C13"))}


def marginals(study):
    """Figs. 4 and 9: the distribution of each constant."""
    rows = -(-len(study.names) // 3)
    figure = new_figure(2.3 * rows + 0.3)
    grid = figure.subplots(rows, 3, squeeze=False).ravel()
    for spare in grid[len(study.names) :]:
        spare.remove()
    mean, sd = study.published
    for j, (axes, name) in enumerate(zip(grid, study.names, strict=False)):
        bounds = study.bounds[name]
        method, exact = (study.draws[label][:, :, j] for label in (METHOD, EXACT))
        low, high = min(method.min(), exact.min()), max(method.max(), exact.max())
        bins = np.linspace(low, high, 41)
        axes.hist(
            method.ravel(),
            bins,
            density=True,
            color=SKY,
            alpha=0.6,
            lw=0,
            label="the paper's method, 4 chains",
        )
        for chain in method:
            axes.hist(
                chain,
                bins,
                density=True,
                histtype="step",
                color=BLUE,
                lw=0.6,
                label="each of them",
            )
        axes.hist(
            exact.ravel(),
            bins,
            density=True,
            histtype="step",
            color=BLACK,
            lw=1.4,
            label="exact posterior",
        )
        top = axes.get_ylim()[1]
        error = None if sd is None else sd[j]
        axes.errorbar(
            mean[j],
            1.06 * top,
            xerr=error,
            fmt="o",
            ms=4,
            color=RED,
            label="paper" + (", ± sd" if sd else ""),
        )
        axes.plot(
            LITERATURE[study.symmetry][j],
            1.14 * top,
            "v",
            ms=5,
            color=ORANGE,
            label="literature",
        )
        axes.axvline(study.truth[j], color=GREEN, lw=1.2, ls="--", label="truth of the data")
        for bound in bounds:
            if low - 0.05 * (high - low) <= bound <= high + 0.05 * (high - low):
                axes.axvline(bound, color=BLACK, lw=2.5, label="bound")
        axes.set(xlabel=f"{subscript(name)} (GPa)", yticks=[], ylim=(0, 1.2 * top))
        axes.grid(False)
        axes.spines["left"].set_visible(False)
    narrow_legend(figure)
    return figure


def ridges(study):
    """Pairs of constants, with the paper's estimate."""
    figure = new_figure(3.6)
    mean, sd = study.published
    for axes, pair in zip(figure.subplots(1, 2), PAIRS[study.symmetry], strict=True):
        i, j = (study.names.index(name) for name in pair)
        for label, colour in ((EXACT, BLACK), (METHOD, SKY)):
            flat = study.draws[label].reshape(-1, len(study.names))
            flat = flat[np.linspace(0, len(flat) - 1, 2500).astype(int)]
            axes.plot(
                flat[:, i],
                flat[:, j],
                ".",
                ms=3,
                mew=0,
                alpha=0.5,
                color=colour,
                label=label,
                rasterized=True,
            )
        limits = axes.get_xlim(), axes.get_ylim()
        if sd is None:
            axes.plot(mean[i], mean[j], "o", ms=5, color=RED, label="paper")
        else:
            axes.errorbar(
                mean[i],
                mean[j],
                xerr=sd[i],
                yerr=sd[j],
                fmt="o",
                ms=4,
                color=RED,
                label="paper, ± sd",
            )
        literature = LITERATURE[study.symmetry]
        axes.plot(literature[i], literature[j], "v", ms=7, color=ORANGE, label="literature")
        axes.plot(
            study.truth[i],
            study.truth[j],
            "*",
            ms=9,
            color=GREEN,
            mec="white",
            mew=0.5,
            label="truth of the data",
        )
        for name, line, (low, high) in zip(pair, (axes.axvline, axes.axhline), limits, strict=True):
            for bound in study.bounds[name]:
                if low <= bound <= high:
                    line(bound, color=BLACK, lw=0.8, ls=":", label="bound")
        axes.set(xlabel=f"{subscript(pair[0])} (GPa)", ylabel=f"{subscript(pair[1])} (GPa)")
    narrow_legend(figure)
    return figure


def predictions(study):
    """Fig. 10: the modulus over the declination, and its distribution at some."""
    figure = new_figure(3.8)
    left, right = figure.subplots(1, 2)
    angle = np.linspace(0, 90, 46)
    for label, colour in ((METHOD, BLUE), (EXACT, BLACK)):
        moduli = study.moduli(label, angle)
        mean, sd = moduli.mean(axis=0), moduli.std(axis=0)
        if label == METHOD:
            left.fill_between(
                angle,
                mean - 2 * sd,
                mean + 2 * sd,
                color=SKY,
                alpha=0.5,
                lw=0,
                label=f"{label}, ± 2 sd",
            )
        else:
            for side in (-2, 2):
                left.plot(
                    angle,
                    mean + side * sd,
                    color=colour,
                    lw=0.9,
                    ls="--",
                    label=f"{label}, ± 2 sd",
                )
        at_some = study.moduli(label, DECLINATIONS)
        for place, values in zip(DECLINATIONS, at_some.T, strict=True):
            density, edges = np.histogram(values, np.arange(115, 149, 0.5), density=True)
            middle = (edges[1:] + edges[:-1]) / 2
            shown = density > 0
            right.plot(
                middle[shown],
                place + 13 * density[shown],
                color=colour,
                lw=1.1,
                ls="-" if label == METHOD else "--",
            )
    truth = stiffness(study.symmetry, **dict(zip(study.names, study.truth, strict=True)))
    curve = halfspace_modulus(truth, np.array([(0.0, value, 0.0) for value in angle]))
    left.plot(angle, curve, color=GREEN, lw=1.2, label="truth of the data")
    folded = 90 - np.abs(90 - study.measured.euler_deg[:, 1])
    left.errorbar(
        folded,
        study.measured.modulus_gpa,
        study.measured.sd_gpa,
        fmt="o",
        ms=2.5,
        lw=0.6,
        color=RED,
        label="measured, ± sd",
    )
    left.set(
        xlabel="declination of the c axis (degrees)",
        ylabel="indentation modulus (GPa)",
        xlim=(-2, 92),
    )
    right.set(
        xlabel="indentation modulus (GPa)",
        ylabel="declination of the c axis (degrees)",
        yticks=DECLINATIONS,
    )
    narrow_legend(figure)
    return figure


def narrow_legend(figure) -> None:
    """One legend above all axes, in columns that leave room for the mark of synthetic data."""
    entries = {
        label: handle
        for axes in figure.axes
        for handle, label in zip(*axes.get_legend_handles_labels(), strict=True)
    }
    figure.legend(
        entries.values(), entries.keys(), loc="outside upper left", ncols=3, markerscale=1.5
    )
