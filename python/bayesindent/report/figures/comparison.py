"""Posteriors of several runs in one figure."""

import numpy as np

from ..words import subscript
from .style import CYCLE, Picture, density_axes, grid_of_constants, unique_legend

__all__ = ["forest", "overlay"]


def forest(runs) -> Picture:
    """Mean, sd and 95 % interval of each constant in every run."""
    names = list(dict.fromkeys(name for run in runs for name in run.parameters))
    figure, grid = grid_of_constants(names, 0.28 * len(runs) + 0.9, 0.4)
    for number, (axes, name) in enumerate(zip(grid, names)):
        for place, (run, colour) in enumerate(zip(runs, np.resize(CYCLE, len(runs)))):
            if name not in run.parameters:
                continue
            item = run.parameters[name]
            axes.plot(item["hdi_95"], [-place, -place], color=colour, lw=1.2)
            axes.plot([item["mean"] - item["sd"], item["mean"] + item["sd"]], [-place, -place], color=colour, lw=4, solid_capstyle="butt")
            axes.plot(item["mean"], -place, "o", color="white", mec=colour, ms=5)
        axes.set_yticks(-np.arange(len(runs)), [run.label for run in runs] if number % min(3, len(names)) == 0 else [""] * len(runs))
        axes.set(xlabel=f"{subscript(name)} (GPa)", ylim=(0.6 - len(runs), 0.6))
        axes.grid(axis="y")
    words = "; ".join(
        f"{run.label}: " + ", ".join(f"{n} {i['mean']:.0f} ± {i['sd']:.0f}" for n, i in run.parameters.items()) for run in runs
    )
    return Picture(
        figure,
        f"Means and intervals of the constants in GPa. {words}.",
        "Each constant in every run: mean (circle), ± sd (thick) and the interval that holds 95 % of the posterior (thin).",
    )


def overlay(runs) -> Picture:
    """Marginal distributions of all runs over each other."""
    names = list(dict.fromkeys(name for run in runs for name in run.parameters))
    figure, grid = grid_of_constants(names, 2.1, 0.4)
    for axes, name in zip(grid, names):
        for run, colour in zip(runs, np.resize(CYCLE, len(runs))):
            if name in run.samples:
                axes.hist(run.samples[name].ravel(), bins=48, density=True, histtype="step", color=colour, label=run.label, lw=1.4)
        density_axes(axes, name)
    unique_legend(figure)
    return Picture(
        figure,
        f"Histograms of the posterior of each constant, in GPa, of {len(runs)} runs: {', '.join(run.label for run in runs)}.",
        "What the measurements of each run say of each constant by itself.",
    )
