"""Figures of the posterior, of residuals, and of the effect of further knowledge."""

from itertools import cycle
from statistics import NormalDist
from textwrap import fill

import numpy as np

from ..formatting import number, plus_minus, product_label, quantity_label, quantity_name, subscript
from ..results import NothingToShow, Results, present, residual
from .style import (
    BLACK,
    BLUE,
    CYCLE,
    MARKERS,
    RED,
    SKY,
    Picture,
    grid_of_constants,
    is_column,
    legend_above,
    panels,
    parity_panels,
)

#: Samples of normal numbers behind the band of the quantiles.
SAMPLES = 2000
#: Grains are drawn small if there are more than this.
MANY = 60


def residuals(results: Results) -> Picture:
    """Residuals of the grains in order against the quantiles of a normal distribution."""
    predicted, count = results.predicted, len(results.predicted)
    if (
        count < 2
        or results.without_orientations
        or not all(item.get("measured_sd") for item in predicted)
    ):
        raise NothingToShow
    values = np.sort(list(map(residual, predicted)))
    figure, axes = panels(3.3)
    quantiles = np.array([NormalDist().inv_cdf((k + 0.5) / count) for k in range(count)])
    low, high = np.percentile(
        np.sort(np.random.default_rng(1).standard_normal((SAMPLES, count)), axis=1),
        [2.5, 97.5],
        axis=0,
    )
    axes.fill_between(
        quantiles, low, high, color=SKY, alpha=0.35, lw=0, label="95 % of normal samples"
    )
    axes.plot(quantiles[[0, -1]], quantiles[[0, -1]], color=BLACK, lw=0.8)
    axes.plot(quantiles, values, "o", ms=3 if count > MANY else 4)
    axes.set(xlabel="quantile of a normal distribution", ylabel="residual / sd, in order")
    axes.legend(loc="upper left")
    return Picture(
        figure,
        "Residuals of the grains in order of size, in units of the stated sd, beside the "
        f"quantiles of a normal distribution. Their sum of squares is {number(np.sum(values**2))}.",
    )


def knowledge(results: Results) -> Picture:
    """The sd of each constant now, and the sd expected with one more quantity known."""
    rows = present(results.identifiability("knowledge"))
    names = [name for name in results.constants if name in rows[0]["sd_then"]]
    now = np.array([results.extracted["parameters"][name]["sd"] for name in names])
    place = -np.arange(len(names), dtype=float)
    figure, axes = panels(0.4 * len(names) + 0.2 * len(rows) + 1.2)
    axes.plot(now, place, "|", color=BLACK, ms=13, mew=2, label="sd now")
    table = []
    for index, (row, colour, marker) in enumerate(zip(rows, cycle(CYCLE), cycle(MARKERS)), 1):
        then = np.array([row["sd_then"][name] for name in names])
        lifted = place + 0.5 * (index / (len(rows) + 1) - 0.5)
        axes.hlines(lifted, np.minimum(then, now), now, color=colour, lw=1.2)
        label = fill(
            f"{quantity_label(row, results.symmetry)} known to {100 * row['relative_sd']:.0f} %",
            48 if is_column() else 99,
        )
        axes.plot(then, lifted, marker, color=colour, ms=5, label=label)
        table += [
            [row["name"], row["relative_sd"], *sds]
            for sds in zip(names, now.tolist(), then.tolist())
        ]
    axes.set_yticks(place, [subscript(name) for name in names])
    axes.set(xlabel="sd (GPa)", xlim=(0, 1.05 * now.max()), ylim=(place[-1] - 0.6, 0.6))
    legend_above(figure, columns=1)
    return Picture(
        figure,
        "What else to measure or to look up: the sd of each constant now (black), and the sd "
        "that is expected with one further quantity known.",
        (["known", "relative_sd", "constant", "sd_now_gpa", "sd_then_gpa"], table),
    )


#: Most points of the posterior that are drawn, in all and for each chain.
POINTS, LINE_POINTS = 3000, 1500
#: Share of a variance below which a source has no bar.
LEAST_PART = 0.005


def marginals(results: Results) -> Picture:
    """Prior and posterior of each constant, with its most probable value and its reference."""
    samples, parameters = present(results.samples), results.extracted["parameters"]
    label, reference = results.reference
    figure, grid = grid_of_constants(samples, 1.9, 0.3)
    entries: dict = {}
    for (name, axes), before in zip(
        grid.items(), np.moveaxis(results.posterior["prior_draws"], -1, 0)
    ):
        after = samples[name]
        low, high = np.percentile(before, [0.5, 99.5])
        edges = np.linspace(min(low, after.min()), max(high, after.max()), 61)
        for values, colour, words in ((before, "0.7", "prior"), (after, BLUE, "posterior")):
            # Relative to the highest bin: a sharp posterior would flatten the prior.
            counts = np.histogram(values, edges)[0]
            axes.stairs(
                counts / counts.max(), edges, color=colour, fill=True, alpha=0.6, label=words
            )
        for value, colour, words in (
            (parameters[name]["map"], RED, "most probable"),
            (reference.get(name), BLACK, label),
        ):
            if value is not None:
                axes.axvline(value, color=colour, ls="--", lw=1, label=words)
        # The heights have no meaning.
        axes.set(
            xlabel=f"{subscript(name)} (GPa)",
            ylim=(0, 1.05),
            yticks=[],
            title=f"{plus_minus(parameters[name])} GPa",
        )
        axes.grid(False)
        axes.spines["left"].set_visible(False)
        handles, labels = axes.get_legend_handles_labels()
        entries |= zip(labels, handles)
    legend_above(figure, entries.values(), entries.keys())
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
    last, (label, reference) = len(labels) - 1, results.reference
    true = [reference.get(name) for name in samples]
    figure, grid = panels(6.4 if last > 1 else 4.0, len(labels), len(labels), squeeze=False)
    for (i, j), cell in np.ndenumerate(grid):
        cell.grid(False)
        if i < j:
            cell.axis("off")
            text = f"{correlation[i, j]:+.2f}".replace("-", "−")
            cell.text(0.5, 0.5, text, ha="center", va="center", size=11, color="#555555")
        elif i == j:
            cell.stairs(*np.histogram(table[i], 36), fill=True, color=SKY, alpha=0.7)
            cell.set_yticks([])
            if reference:
                cell.axvline(true[i], color=RED, lw=1)
        else:
            cell.plot(table[j], table[i], ".", ms=2.2, alpha=0.4, rasterized=True, mew=0)
            if reference:
                cell.plot(true[j], true[i], "+", color=RED, ms=9, mew=1.6)
        if i == last:
            cell.set_xlabel(labels[j])
            cell.tick_params(axis="x", rotation=45)
        else:
            cell.set_xticklabels([])
        if j == 0 < i:
            cell.set_ylabel(labels[i])
        elif j > 0:
            cell.set_yticklabels([])
    red = f" Red: {label}." if reference else ""
    return Picture(
        figure,
        f"Pairs of constants: points of the posterior, and their correlations.{red} A long thin "
        "cloud is a combination that the measurements do not determine.",
        ([f"{name}_gpa" for name in samples], table.T.tolist()),
    )


def grain_comparison(results: Results) -> Picture:
    """Measured against predicted moduli."""
    return compared(
        [] if results.without_orientations else results.predicted, results.kind, "GPa", "grains"
    )


def velocities(results: Results) -> Picture:
    """Measured against predicted speeds of waves."""
    left_out = results.extracted.get("velocities_left_out")
    more = f" Left out: {left_out}." if left_out else ""
    return compared(results.velocities, results.speed, "m/s", "directions", more)


def numbers_of(item: dict) -> list[float]:
    """The measured value and its sd, and the predicted mean and sd; 0 for what is not there."""
    return [item.get(name) or 0.0 for name in ("measured", "measured_sd", "mean", "sd")]


def compared(items: list[dict], quantity: str, unit: str, of: str, more: str = "") -> Picture:
    """Measured against predicted values, and the residuals, in units of the stated sd where there
    is one.
    """
    measured, error, mean, sd = np.array(list(map(numbers_of, present(items)))).T
    stated = bool(np.all(error > 0))
    residual = (measured - mean) / (error if stated else 1.0)
    labels = (
        f"predicted {quantity} ({unit})",
        f"measured {quantity} ({unit})",
        f"measured - predicted ({'sd' if stated else unit})",
    )
    small: dict = {"ms": 3, "lw": 0.5} if len(items) > MANY else {}
    figure, right = parity_panels(
        mean, measured, residual, labels, stated, yerr=error, xerr=sd, **small
    )
    for index in np.flatnonzero(np.abs(residual) > 2) if stated else ():
        right.annotate(
            str(index + 1), (mean[index], residual[index]), (4, 3), textcoords="offset points"
        )
    bands = (
        " in units of the stated sd, with bands of 1 and 2 sd; rows of the measurements beyond "
        "2 sd are numbered"
    )
    return Picture(
        figure,
        f"Measured and predicted {quantity} of {len(items)} {of}. Left: bars are ± 1 sd. Right: "
        f"residuals{bands * stated}.{more}",
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


def shares(results: Results) -> Picture:
    """Shares of measurements, knowledge and prior in variances of combinations and quantities."""
    combinations, quantities = (
        results.identifiability(kind) for kind in ("combination", "quantity")
    )
    labels = [product_label(row["exponents"]) for row in combinations]
    labels += [subscript(quantity_name(row["name"], results.symmetry)) for row in quantities]
    return stacked(
        [row["share"] for row in combinations + quantities],
        labels,
        len(combinations),
        "Shares of variances. Above: products of powers of the constants, from the best to the "
        "worst determined. Below: the constants and quantities that follow from them.",
    )


def error_budget(results: Results) -> Picture:
    """The parts of the variance of each constant by source."""
    budget = present(results.extracted.get("error_budget"))
    return stacked(
        list(budget.values()),
        list(map(subscript, budget)),
        len(budget),
        "Error budget: the sources of the variance of each constant. Calibration: what moduli "
        "share.",
    )


def stacked(parts: list[dict], labels: list[str], above: int, caption: str) -> Picture:
    """A bar for each row with its parts in per cent; rows from `above` on are set apart."""
    names = list(present(parts)[0])
    values = np.array([tuple(map(part.get, names)) for part in parts], dtype=float)
    shown = [j for j in range(len(names)) if np.any(values[:, j] >= LEAST_PART)]
    place = -np.arange(len(values)) - 0.6 * (np.arange(len(values)) >= above)
    figure, axes = panels(0.29 * len(values) + 1.2)
    left = np.zeros(len(values))
    for j, colour in zip(present(shown), cycle(CYCLE)):
        width = 100 * np.nan_to_num(values[:, j])
        colour = "0.75" if names[j] == "prior" else colour
        name = quantity_name(names[j])
        axes.barh(place, width, left=left, height=0.7, color=colour, label=name)
        left += width
    axes.set_yticks(place, labels)
    axes.set(xlim=(0, 100), ylim=(place.min() - 0.6, 0.6), xlabel="share of the variance (%)")
    axes.grid(axis="y")
    legend_above(figure, columns=min(4, len(shown)))
    texts = []
    for label, row in zip(labels, values):
        shares = ", ".join(f"{names[j]} {100 * row[j]:.0f}" for j in shown)
        texts.append(f"{label}: {shares}")
    table = [[label, *row] for label, row in zip(labels, values.tolist())]
    return Picture(figure, caption, (["name", *names], table), f"In per cent: {'; '.join(texts)}.")


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
