"""Figures of the posterior, of residuals, and of plans."""

from itertools import cycle

import numpy as np

from ..formatting import plus_minus, subscript
from ..results import Results, present
from .style import (
    BLACK,
    BLUE,
    CYCLE,
    MARKERS,
    RED,
    SKY,
    Picture,
    grid_of_constants,
    legend_above,
    panels,
    parity_panels,
)

#: Points of grains are small if there are more grains than this.
MANY = 60

#: About so many points of the posterior are drawn: at least this number, if there are as many, and
#: less than twice as many. In all, and for each chain.
POINTS, LINE_POINTS = 3000, 1500


def marginals(results: Results) -> Picture:
    """Prior and posterior of each constant, with its reference."""
    samples, parameters = present(results.samples), results.extracted["parameters"]
    label, reference = results.reference
    figure, grid = grid_of_constants(samples, 1.9, 0.3)
    for (name, axes), before in zip(
        grid.items(), np.moveaxis(results.posterior["prior_draws"], -1, 0)
    ):
        after = samples[name]
        low, high = np.percentile(before, [0.5, 99.5])
        edges = np.linspace(min(low, after.min()), max(high, after.max()), 61)
        for values, colour, source in ((before, "0.7", "prior"), (after, BLUE, "posterior")):
            # The highest bin of each is 1: otherwise a sharp posterior would flatten the prior.
            counts = np.histogram(values, edges)[0]
            heights = counts / counts.max()
            axes.stairs(heights, edges, color=colour, fill=True, alpha=0.6, label=source)
        if reference:
            axes.axvline(reference[name], color=BLACK, ls="--", lw=1, label=label)
        # The heights have no meaning.
        axes.set(
            xlabel=f"{subscript(name)} (GPa)",
            yticks=[],
            title=f"{plus_minus(parameters[name])} GPa",
        )
    legend_above(figure, *axes.get_legend_handles_labels())
    return Picture(
        figure,
        "Each constant before the measurements (grey: the prior with what else was known) and "
        "after them (blue). Above each: mean ± sd. All histograms are drawn to the same height. A "
        "posterior that ends abruptly is truncated by a limit of the prior.",
        values="; ".join(f"{name} {plus_minus(item)} GPa" for name, item in parameters.items()),
    )


def pairs(results: Results) -> Picture:
    """Draws of each pair of constants below the diagonal, and correlations above it."""
    samples = present(results.samples)
    table = np.stack([chains.ravel() for chains in samples.values()])
    correlation = np.atleast_2d(np.corrcoef(table))
    table = table[:, :: max(1, table.shape[1] // POINTS)]
    labels = [f"{subscript(name)} (GPa)" for name in samples]
    label, reference = results.reference
    true = [reference.get(name) for name in samples]
    figure, grid = panels(6.4 if len(labels) > 2 else 4.0, len(labels), len(labels), squeeze=False)
    for (i, j), cell in np.ndenumerate(grid):
        cell.grid(False)
        if i < j:
            cell.axis("off")
            text = f"{correlation[i, j]:+.2f}".replace("-", "−")
            cell.text(0.5, 0.5, text, ha="center", va="center", size="large", color="#555555")
            continue
        # A histogram has no constant along y.
        cell.set(xlabel=labels[j], ylabel="" if i == j else labels[i])
        cell.tick_params(axis="x", rotation=45)
        if i == j:
            cell.stairs(*np.histogram(table[i], 36), fill=True, color=SKY, alpha=0.7)
            cell.set_yticks([])
            if reference:
                cell.axvline(true[i], color=RED, lw=1)
        else:
            cell.plot(table[j], table[i], ".", ms=2.2, alpha=0.4, rasterized=True, mew=0)
            if reference:
                cell.plot(true[j], true[i], "+", color=RED, ms=9, mew=1.6)
        cell.label_outer()
    red = f" Red: {label}." if reference else ""
    return Picture(
        figure,
        f"Pairs of constants: points of the posterior, and their correlations.{red} A long thin "
        "cloud is a combination that the measurements do not determine.",
        ([f"{name}_gpa" for name in samples], table.T.tolist()),
    )


def grain_comparison(results: Results) -> Picture:
    """Measured against predicted moduli. The predictions contain the factor that all grains share,
    and the sds contain the inferred scatter between grains.
    """
    grains = [] if results.without_orientations else results.predicted
    return compared(
        grains,
        results.kind,
        "GPa",
        "grains",
        scatter=results.scatter,
        factor=results.shared_factor,
    )


def velocities(results: Results) -> Picture:
    """Measured against predicted speeds of waves."""
    left_out = results.extracted.get("velocities_left_out")
    more = f" Left out: {left_out}." if left_out else ""
    return compared(results.velocities, results.speed, "m/s", "directions", more)


def numbers_of(item: dict) -> list[float]:
    """The measured value and its sd, and the predicted mean and sd. A missing number is 0."""
    return [item.get(name) or 0.0 for name in ("measured", "measured_sd", "mean", "sd")]


def compared(
    items: list[dict],
    quantity: str,
    unit: str,
    of: str,
    more: str = "",
    scatter: float = 0.0,
    factor: float = 1.0,
) -> Picture:
    """Measured against predicted values, and the residuals, in units of the measured sd if all are
    stated. A relative `scatter` adds to this sd. The predictions are multiplied by a `factor` that
    all measurements share.
    """
    measured, error, mean, sd = np.array(list(map(numbers_of, present(items)))).T
    stated = bool(np.all(error > 0))
    if stated:
        error = np.hypot(error, scatter * factor * mean)
    if factor != 1.0:
        mean, sd = factor * mean, np.zeros_like(sd)
        more += f" Predictions are times {factor:.3g}, the factor that all share."
    residual = (measured - mean) / (error if stated else 1.0)
    labels = (
        f"predicted {quantity} ({unit})",
        f"measured {quantity} ({unit})",
        f"measured - predicted ({'sd' if stated else unit})",
    )
    small: dict = {"ms": 3, "lw": 0.5} if len(items) > MANY else {}
    figure = parity_panels(mean, measured, residual, labels, stated, yerr=error, xerr=sd, **small)
    bands = ""
    if stated:
        bands = (
            " in units of the sd, with bands of 1 and 2 sd; rows of the measurements beyond "
            "2 sd are numbered"
        )
        for index in np.flatnonzero(np.abs(residual) > 2):
            figure.axes[1].annotate(
                str(index + 1), (mean[index], residual[index]), (4, 3), textcoords="offset points"
            )
    return Picture(
        figure,
        f"Measured and predicted {quantity} of {len(items)} {of}. Left: bars are ± 1 sd. Right: "
        f"residuals{bands}.{more}",
    )


def traces(results: Results) -> Picture:
    """Chains of each constant."""
    samples = present(results.samples)
    figure, column = panels(1.25 * len(samples) + 0.4, len(samples), 1, sharex=True, squeeze=False)
    for axes, (name, chains) in zip(column.ravel(), samples.items()):
        step = max(1, chains.shape[1] // LINE_POINTS)
        sample = np.arange(0, chains.shape[1], step)
        for chain, colour in zip(chains[:, ::step], cycle(CYCLE)):
            axes.plot(sample, chain, lw=0.4, alpha=0.8, color=colour, rasterized=True)
        axes.set_ylabel(f"{subscript(name)} (GPa)")
    column[-1, 0].set_xlabel("sample of the chain")
    figure.align_ylabels(column)
    return Picture(
        figure,
        "The sampled values of each chain in order. Chains that have mixed overlap and show no "
        "trend.",
    )


def expected_sds(results: Results) -> Picture:
    """The sds that a plan expects, against the number of grains and the noise."""
    document = present(results.documents["plan"])
    rows = sorted(document["results"], key=lambda row: row["grains"])
    noises = sorted({row["noise"] for row in rows})
    figure, grid = grid_of_constants(document["constants"], 2.4, 0.4)
    for name, axes in grid.items():
        for noise, marker in zip(noises, MARKERS):
            points = [(row["grains"], row["sd"][name]) for row in rows if row["noise"] == noise]
            axes.plot(*zip(*points), marker=marker, ms=4, label=f"noise {100 * noise:g} %")
        axes.set(xlabel="grains", ylabel=f"sd of {subscript(name)} (GPa)", ylim=(0, None))
    legend_above(figure, *axes.get_legend_handles_labels())
    return Picture(
        figure,
        "Expected sd of each constant against the number of grains, for each noise of the moduli. "
        "Medians over posteriors of simulated data sets of the stated crystal.",
    )
