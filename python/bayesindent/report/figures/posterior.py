"""The posterior of the constants, what is left of the measurements when its prediction is taken off, and what further knowledge would bring."""

from statistics import NormalDist

import numpy as np

from ..formatting import number, product_label, quantity_label, quantity_name, subscript
from ..results import NothingToShow, Results, present
from .style import BLACK, BLUE, CYCLE, MARKERS, RED, SKY, Picture, density_axes, grid_of_constants, panels, parity_panels, sd_axes

__all__ = [
    "chi_square", "error_budget", "expected_sds", "grain_comparison", "knowledge", "marginals", "pairs", "prior_posterior", "residuals", "shares",
    "traces", "velocities",
]  # fmt: skip

#: Samples of normal numbers behind the band of the quantiles.
SAMPLES = 2000


def chi_square(predicted: list[dict]) -> tuple[float, float]:
    """The sum of squares of the residuals in units of the measurements' sds, and what is expected of it.

    Of a linear model with normal errors s a prediction of sd p leaves a residual of variance s² - p².
    """
    measured, mean, error, sd = (np.array([item[name] for item in predicted]) for name in ("measured", "mean", "measured_sd", "sd"))
    return float(np.sum(((measured - mean) / error) ** 2)), float(np.sum(np.maximum(0.0, 1 - (sd / error) ** 2)))


def residuals(results: Results) -> Picture:
    """Residuals of the grains, and their quantiles beside those of a normal distribution."""
    predicted, count = results.predicted, len(results.predicted)
    if count < 2 or not all(item.get("measured_sd") for item in predicted):
        raise NothingToShow
    mean, measured, error = (np.array([item[name] for item in predicted]) for name in ("mean", "measured", "measured_sd"))
    values = (measured - mean) / error
    small = 3 if count > 60 else 4
    figure, (left, right) = panels(3.3, 1, 2)
    sd_axes(left)
    left.plot(mean, values, "o", color=BLUE, ms=small)
    for index in np.flatnonzero(np.abs(values) > 2):
        left.annotate(str(index + 1), (mean[index], values[index]), (4, 3), textcoords="offset points")
    limit = max(2.6, 1.15 * np.abs(values).max())
    left.set(xlabel=f"predicted {results.kind} (GPa)", ylabel="(measured - predicted) / sd", ylim=(-limit, limit))
    quantiles = np.array([NormalDist().inv_cdf((k + 0.5) / count) for k in range(count)])
    low, high = np.percentile(np.sort(np.random.default_rng(1).standard_normal((SAMPLES, count)), axis=1), [2.5, 97.5], axis=0)
    right.fill_between(quantiles, low, high, color=SKY, alpha=0.35, lw=0, label="95 % of normal samples")
    ends = np.array([min(quantiles[0], values.min()), max(quantiles[-1], values.max())])
    right.plot(ends, ends, color=BLACK, lw=0.8)
    right.plot(quantiles, np.sort(values), "o", color=BLUE, ms=small)
    right.set(xlabel="quantile of a normal distribution", ylabel="residual / sd, in order")
    right.legend(loc="upper left")
    total, expected = map(number, chi_square(predicted))
    statistic = f"χ² = {total} for {count} grains"
    return Picture(
        figure,
        f"Residuals of {count} grains in units of their sd, and their normal quantiles; {statistic}.",
        f"Left: measured minus predicted modulus of each grain in units of the sd of its measurement; the bands are 1 and 2 sd, and rows of "
        f"the measurements beyond 2 are numbered. Right: the same in order beside the quantiles of a normal distribution. {statistic} about the mean prediction, "
        f"where some {expected} are expected if the stated sds are right, since the fit takes up a part.",
    )


def knowledge(results: Results) -> Picture:
    """The sd of each constant now, and as it would be with one more piece of knowledge."""
    rows = present(results.identifiability("knowledge"))
    names = [name for name in results.constants if name in rows[0]["sd_then"]]
    now = np.array([results.documents["extract"]["parameters"][name]["sd"] for name in names])
    place = -np.arange(len(names), dtype=float)
    figure, axes = panels(0.4 * len(names) + 0.2 * len(rows) + 1.2)
    axes.plot(now, place, "|", color=BLACK, ms=13, mew=2, label="sd now")
    table = []
    for index, (row, colour, marker) in enumerate(zip(rows, np.resize(CYCLE, len(rows)), np.resize(list(MARKERS), len(rows)))):
        then = np.array([row["sd_then"][name] for name in names])
        lifted = place + 0.5 * ((index + 1) / (len(rows) + 1) - 0.5)
        axes.hlines(lifted, np.minimum(then, now), now, color=colour, lw=1.2)
        label = f"{quantity_label(row)} known to {100 * row['relative_sd']:.0f} %"
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


#: Points of the posterior that are drawn at most.
POINTS, LINE_POINTS = 3000, 1500
#: Share of a variance below which a source has no bar.
LEAST_PART = 0.005


def marginals(results: Results) -> Picture:
    """Marginal distribution of each constant, with mean, sd, most probable value, and the bounds of the prior where near."""
    samples, parameters = present(results.samples), results.documents["extract"]["parameters"]
    bounds = dict(zip(samples, zip(results.posterior["lower"], results.posterior["upper"])))
    figure, grid = grid_of_constants(samples, 2.5)
    for name, axes in grid.items():
        mean, sd, best = samples[name].mean(), samples[name].std(), parameters[name]["map"]
        axes.stairs(*np.histogram(samples[name], 48, density=True), fill=True, color=SKY, alpha=0.7)
        axes.axvline(mean, color=BLUE, label="mean")
        if best is not None:
            axes.axvline(best, color=RED, ls="--", label="most probable")
        low, high = axes.get_xlim()
        for bound in bounds.get(name, ()):
            if low - 0.1 * (high - low) <= bound <= high + 0.1 * (high - low):
                axes.axvline(bound, color=BLACK, lw=2.5, label="bound of the prior")
        axes.set_title(f"{mean:.1f} ± {sd:.1f} GPa")
    density_axes(figure, grid)
    values = ", ".join(f"{name} {item['mean']:.0f} with sd {item['sd']:.0f}" for name, item in parameters.items())
    return Picture(
        figure,
        f"Histograms of the posterior of each constant, in GPa: {values}.",
        "What the measurements say of each constant by itself; above each, mean ± sd. A thick line is a bound of the prior: where the "
        "histogram ends at one, the prior truncates it. A most probable value is shown where it lies within the 95 % interval.",
    )


def prior_posterior(results: Results) -> Picture:
    """Prior and posterior of each constant on one axis."""
    samples = present(results.samples)
    figure, grid = grid_of_constants(samples, 1.7, 0.3)
    for (name, axes), before in zip(grid.items(), np.moveaxis(results.posterior["prior_draws"], -1, 0)):
        after = samples[name]
        low, high = np.percentile(before, [0.5, 99.5])
        edges = np.linspace(min(low, after.min()), max(high, after.max()), 61)
        for values, colour, label in ((before, "0.7", "prior"), (after, BLUE, "posterior")):
            # Relative to the highest bin: a sharp posterior would flatten the prior.
            counts = np.histogram(values, edges)[0]
            axes.stairs(counts / counts.max(), edges, color=colour, fill=True, alpha=0.6, label=label)
        axes.set_ylim(0, 1.05)
    density_axes(figure, grid)
    return Picture(
        figure,
        f"Histograms of the prior and of the posterior of {', '.join(samples)}.",
        "Each constant before the measurements (grey; the prior with what else was known) and after them (blue). Each histogram has the height 1, so that both "
        "can be seen; one per cent of the prior may lie outside.",
    )


def pairs(results: Results) -> Picture:
    """Every pair of constants: points of the posterior, which show its ridges, with the correlation in the other half."""
    samples = present(results.samples)
    table = np.stack([chains.ravel() for chains in samples.values()])
    correlation = np.atleast_2d(np.corrcoef(table))
    table = table[:, :: max(1, table.shape[1] // POINTS)]
    labels = [f"{subscript(name)} (GPa)" for name in samples]
    last = len(labels) - 1
    figure, grid = panels(6.4, len(labels), len(labels), squeeze=False)
    for (i, j), cell in np.ndenumerate(grid):
        cell.grid(False)
        if i < j:
            cell.axis("off")
            text = f"{correlation[i, j]:+.2f}".replace("-", "−")
            cell.text(0.5, 0.5, text, ha="center", va="center", size=11, color="#555555", transform=cell.transAxes)
        elif i == j:
            cell.stairs(*np.histogram(table[i], 36), fill=True, color=SKY, alpha=0.7)
            cell.set_yticks([])
        else:
            cell.plot(table[j], table[i], ".", ms=2.2, alpha=0.4, color=BLUE, rasterized=True, mew=0)
        if i == last:
            cell.set_xlabel(labels[j])
            cell.tick_params(axis="x", rotation=45)
        else:
            cell.set_xticklabels([])
        if j == 0 < i:
            cell.set_ylabel(labels[i])
        elif j > 0:
            cell.set_yticklabels([])
    return Picture(
        figure,
        "Points of the posterior for each pair of constants, with their correlations.",
        "Pairs of constants. Long thin clouds are ridges: combinations along which the measurements cannot tell crystals apart. The "
        "numbers are correlations.",
        ([f"{name}_gpa" for name in samples], table.T.tolist()),
    )


def grain_comparison(results: Results) -> Picture:
    """Measured moduli, grain by grain, beside what the posterior predicts."""
    grains = enumerate(present(results.predicted), start=1)
    rows = [[grain, item["measured"], item.get("measured_sd") or 0.0, item["mean"], item["sd"]] for grain, item in grains]
    rows.sort(key=lambda row: row[3])
    names, measured, error, mean, sd = zip(*rows)
    place = np.arange(len(rows))
    wide = len(rows) <= 20
    figure, axes = panels(3.4)
    axes.errorbar(place, mean, 2 * np.array(sd), fmt="none", ecolor=SKY, elinewidth=9 if wide else 4, label="predicted, ± 2 sd")
    axes.plot(place, mean, "_", color=BLUE, ms=9 if wide else 4, mew=1.8, label="predicted, mean")
    axes.errorbar(place, measured, error, fmt="o", ms=4, lw=1, color=BLACK, label="measured, ± sd")
    axes.set(ylabel=f"{results.kind} (GPa)", xlabel="grain (row of the measurements)")
    step = -(-len(rows) // 25)
    axes.set_xticks(place[::step], list(map(str, names[::step])))
    axes.grid(axis="x")
    axes.legend(loc="upper left", ncols=3, bbox_to_anchor=(0, 1.12))
    return Picture(
        figure,
        "Measured modulus of each grain beside the prediction of the posterior.",
        f"The {results.kind} of each grain, measured and as the posterior predicts it, in order of the prediction.",
        (["grain", "measured_gpa", "measured_sd_gpa", "predicted_gpa", "predicted_sd_gpa"], rows),
    )


def velocities(results: Results) -> Picture:
    """Measured speeds of surface waves against what the posterior predicts."""
    names = ("propagation_deg", "measured", "measured_sd", "mean", "sd")
    rows = [[item[name] for name in names] for item in present(results.velocities)]
    _, measured, error, mean, sd = np.array(rows).T
    labels = ("predicted Rayleigh velocity (m/s)", "measured Rayleigh velocity (m/s)", "(measured - predicted) / sd")
    figure, right = parity_panels(mean, measured, (measured - mean) / error, labels, yerr=error, xerr=sd)
    sd_axes(right)
    text = f"Rayleigh velocity in {len(rows)} directions, measured and as the posterior predicts it"
    return Picture(figure, f"{text}.", f"{text}; {results.documents['extract']['velocities_left_out']} were left out.", ([*names], rows))


def traces(results: Results) -> Picture:
    """Chains of each constant."""
    samples = present(results.samples)
    figure, column = panels(1.25 * len(samples) + 0.4, len(samples), 1, sharex=True, squeeze=False)
    for axes, (name, chains) in zip(column.ravel(), samples.items()):
        step = max(1, chains.shape[1] // LINE_POINTS)
        for chain, colour in zip(chains, np.resize(CYCLE, len(chains))):
            axes.plot(np.arange(0, chain.size, step), chain[::step], lw=0.4, alpha=0.8, color=colour, rasterized=True)
        axes.set_ylabel(f"{subscript(name)} (GPa)")
    column[-1, 0].set_xlabel("sample of the chain")
    figure.align_ylabels(column)
    return Picture(figure, "The sampled values of each chain in order.", "The chains. Healthy ones overlap and show no trend.")


def shares(results: Results) -> Picture:
    """Shares of the measurements, of what else was known and of the prior: of combinations of the constants, and of quantities."""
    combinations, quantities = (results.identifiability(kind) for kind in ("combination", "quantity"))
    labels = [product_label(row["exponents"]) for row in combinations] + [subscript(quantity_name(row["name"])) for row in quantities]
    return stacked(
        {row["name"]: row["share"] for row in combinations + quantities},
        labels,
        len(combinations),
        "Above, products of powers of the constants, from the best to the worst identified; below, the constants and quantities that "
        "follow from them.",
    )


def error_budget(results: Results) -> Picture:
    """The parts of the variance of each constant by source."""
    budget = present(results.documents["extract"].get("error_budget"))
    return stacked(budget, list(map(subscript, budget)), len(budget), "The sources of error behind the sd of each constant.")


def stacked(parts: dict[str, dict], labels: list[str], above: int, caption: str) -> Picture:
    """A bar for each row, of its parts in per cent one after another; rows from `above` on stand apart."""
    names = list(next(iter(present(parts).values())))
    values = np.array([[part[name] for name in names] for part in parts.values()], dtype=float)
    shown = [j for j in range(len(names)) if np.any(values[:, j] >= LEAST_PART)]
    place = -np.arange(len(values)) - 0.6 * (np.arange(len(values)) >= above)
    figure, axes = panels(0.29 * len(values) + 1.2)
    left = np.zeros(len(values))
    for j, colour in zip(present(shown), np.resize(CYCLE, len(shown))):
        width = 100 * np.nan_to_num(values[:, j])
        last = names[j] == "prior"
        axes.barh(place, width, left=left, color="0.75" if last else colour, height=0.7, label=quantity_name(names[j]))
        left += width
    axes.set_yticks(place, labels)
    axes.set(xlim=(0, 100), ylim=(place.min() - 0.6, 0.6), xlabel="share of the variance (%)")
    axes.grid(axis="y")
    figure.legend(loc="outside upper left", ncols=min(4, len(shown)))
    text = "; ".join(f"{name}: {', '.join(f'{names[j]} {100 * row[j]:.0f}' for j in shown)}" for name, row in zip(parts, values))
    return Picture(
        figure, f"Shares of variances in per cent. {text}.", caption, (["name", *names], [[*row] for row in zip(parts, *values.T.tolist())])
    )


def expected_sds(results: Results) -> Picture:
    """The sds that a plan expects, against the number of grains and the noise."""
    document = present(results.documents["plan"])
    rows = sorted(document["results"], key=lambda row: row["grains"])
    figure, grid = grid_of_constants(document["constants"], 2.4, 0.4)
    for name, axes in grid.items():
        for noise, marker in zip(sorted({row["noise"] for row in rows}), MARKERS):
            points = [(row["grains"], row["sd"][name]) for row in rows if row["noise"] == noise]
            axes.plot(*zip(*points), marker=marker, ms=4, label=f"noise {100 * noise:g} %")
        axes.set(xlabel="grains", ylabel=f"sd of {subscript(name)} (GPa)", ylim=(0, None))
    figure.legend(*axes.get_legend_handles_labels(), loc="outside upper left", ncols=4)
    text = "Expected sd of each constant against the number of grains, for each noise of the moduli."
    return Picture(figure, text, f"{text} Means over posteriors of made-up data sets of the stated crystal.")
