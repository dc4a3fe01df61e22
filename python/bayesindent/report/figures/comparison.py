"""Posteriors of several runs in one figure."""

from collections.abc import Sequence

import numpy as np

from ..comparison import Run
from ..formatting import subscript
from .style import CYCLE, Picture, density_axes, grid_of_constants

#: The axes are at most so many times as wide as the narrowest posterior.
WIDEST = 9.0
CUT_OFF = "Much wider posteriors than the narrowest are cut off"


def forest(runs: Sequence[Run], names: Sequence[str]) -> Picture:
    """Mean, sd and 95 % interval of the constants of these names in every run."""
    figure, grid = grid_of_constants(names, 0.28 * len(runs) + 0.9, 0.4)
    ends = {name: limits(runs, name) for name in names}
    for number, (name, axes) in enumerate(grid.items()):
        for place, (run, colour) in enumerate(zip(runs, np.resize(CYCLE, len(runs)))):
            if name not in run.parameters:
                continue
            mean, sd, interval = (run.parameters[name][key] for key in ("mean", "sd", "hdi_95"))
            axes.plot(interval, [-place, -place], color=colour, lw=1.2)
            axes.plot(
                [mean - sd, mean + sd], [-place, -place], color=colour, lw=4, solid_capstyle="butt"
            )
            beyond = np.clip(mean, *ends[name])
            axes.plot(
                beyond,
                -place,
                "o" if beyond == mean else "<" if mean < beyond else ">",
                color="white",
                mec=colour,
                ms=5,
            )
        axes.set_yticks(
            -np.arange(len(runs)),
            [run.label if number % min(3, len(names)) == 0 else "" for run in runs],
        )
        axes.set(xlabel=f"{subscript(name)} (GPa)", xlim=ends[name], ylim=(0.6 - len(runs), 0.6))
        axes.grid(axis="y")
    values = [
        [f"{name} {item['mean']:.0f} ± {item['sd']:.0f}" for name, item in run.parameters.items()]
        for run in runs
    ]
    found = "; ".join(
        f"{run.label}: {', '.join(constants)}" for run, constants in zip(runs, values)
    )
    text = (
        "Each constant in every run: mean (circle), ± sd (thick) and the interval that holds 95 "
        "% of the posterior (thin)."
    )
    return Picture(
        figure,
        f"{text} {CUT_OFF}; a triangle points to a mean outside.",
        values=f"In GPa: {found}.",
    )


def overlay(runs: Sequence[Run], names: Sequence[str]) -> Picture:
    """Marginal distributions of the constants of these names, of all runs over each other."""
    figure, grid = grid_of_constants(names, 2.1, 0.4)
    for name, axes in grid.items():
        for run, colour in zip(runs, np.resize(CYCLE, len(runs))):
            if name in run.samples:
                axes.hist(
                    run.samples[name].ravel(),
                    bins=48,
                    density=True,
                    histtype="step",
                    color=colour,
                    label=run.label,
                    lw=1.4,
                )
        axes.set_xlim(limits(runs, name))
    density_axes(figure, grid)
    return Picture(
        figure, f"Histograms of the posterior of each constant in {len(runs)} runs. {CUT_OFF}."
    )


def limits(runs: Sequence[Run], name: str) -> tuple[float, float]:
    """The ends of an axis that shows the narrowest posterior of a constant well, and of the others
    as much as fits.
    """
    ends = [
        (run.samples[name].min(), run.samples[name].max()) for run in runs if name in run.samples
    ]
    low, high = min(ends)[0], max(end for _, end in ends)
    narrow = min(ends, key=lambda pair: pair[1] - pair[0])
    width = min(high - low, WIDEST * (narrow[1] - narrow[0]))
    start = np.clip((sum(narrow) - width) / 2, low, high - width)
    return start - 0.03 * width, start + 1.03 * width
