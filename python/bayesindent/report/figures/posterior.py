"""The posterior of the constants."""

import numpy as np

from ..words import power_label, quantity_in_words, subscript
from .style import BLACK, BLUE, CYCLE, ORANGE, RED, SKY, Picture, density_axes, grid_of_constants, new_figure, unique_legend

__all__ = ["contraction", "grain_comparison", "marginals", "pairs", "prior_posterior", "traces"]

#: Points of the posterior that are drawn at most.
POINTS, LINE_POINTS = 3000, 1500


def marginals(results) -> Picture | None:
    """Marginal distribution of each constant, with mean, sd, most probable value, and the bounds of the prior where near."""
    samples = results.samples
    if not samples:
        return None
    figure, grid = grid_of_constants(list(samples), 2.5)
    for axes, (name, chains) in zip(grid, samples.items()):
        values = chains.ravel()
        mean, sd, best = values.mean(), values.std(), results.documents["extract"]["parameters"][name]["map"]
        axes.stairs(*np.histogram(values, 48, density=True), fill=True, color=SKY, alpha=0.7)
        axes.axvline(mean, color=BLUE, label="mean")
        if best is not None:
            axes.axvline(best, color=RED, ls="--", label="most probable")
        low, high = axes.get_xlim()
        for bound in results.bounds.get(name, ()):
            if low - 0.1 * (high - low) <= bound <= high + 0.1 * (high - low):
                axes.axvline(bound, color=BLACK, lw=2.5, label="bound of the prior")
        density_axes(axes, name, title=f"{mean:.1f} ± {sd:.1f} GPa")
    unique_legend(figure)
    parameters = results.documents["extract"]["parameters"]
    words = ", ".join(f"{name} {item['mean']:.0f} with sd {item['sd']:.0f}" for name, item in parameters.items())
    return Picture(
        figure,
        f"Histograms of the posterior of each constant, in GPa: {words}.",
        "What the measurements say of each constant by itself; above each, mean ± sd. A thick line is a bound of the prior: where the "
        "histogram ends at one, the bound decided. A most probable value is shown where the data decided more than the prior.",
    )


def prior_posterior(results) -> Picture | None:
    """Prior and posterior of each constant on one axis."""
    samples, before = results.samples, results.prior_samples
    if not samples:
        return None
    figure, grid = grid_of_constants(list(samples), 1.7, 0.3)
    for axes, name in zip(grid, samples):
        after = samples[name].ravel()
        low, high = np.percentile(before[name], [0.5, 99.5])
        edges = np.linspace(min(low, after.min()), max(high, after.max()), 61)
        for values, colour, label in ((before[name], "0.7", "prior"), (after, BLUE, "posterior")):
            # Relative to the highest bin: a sharp posterior would flatten the prior.
            counts = np.histogram(values, edges)[0]
            axes.stairs(counts / counts.max(), edges, color=colour, fill=True, alpha=0.6, label=label)
        density_axes(axes, name, ylim=(0, 1.05))
    unique_legend(figure)
    return Picture(
        figure,
        f"Histograms of the prior and of the posterior of {', '.join(samples)}.",
        "Each constant before the measurements (grey; the prior with what else was known) and after them (blue). Each histogram has the height 1, so that both "
        "can be seen; one per cent of the prior may lie outside.",
    )


def pairs(results) -> Picture | None:
    """Every pair of constants: points of the posterior, which show its ridges, with the correlation in the other half."""
    samples = results.samples
    if not samples:
        return None
    names = list(samples)
    table = np.stack([samples[name].ravel() for name in names])
    correlation = np.atleast_2d(np.corrcoef(table))
    table = table[:, :: max(1, table.shape[1] // POINTS)]
    count = len(names)
    figure = new_figure(6.4)
    axes = figure.subplots(count, count, squeeze=False)
    for i, j in np.ndindex(count, count):
        cell = axes[i, j]
        cell.grid(False)
        if i < j:
            cell.axis("off")
            cell.text(
                0.5,
                0.5,
                f"{correlation[i, j]:+.2f}".replace("-", "−"),
                ha="center",
                va="center",
                size=11,
                color="#555555",
                transform=cell.transAxes,
            )
        elif i == j:
            cell.stairs(*np.histogram(table[i], 36), fill=True, color=SKY, alpha=0.7)
            cell.set_yticks([])
        else:
            cell.plot(table[j], table[i], ".", ms=2.2, alpha=0.4, color=BLUE, rasterized=True, mew=0)
        if i == count - 1:
            cell.set_xlabel(f"{subscript(names[j])} (GPa)")
            cell.tick_params(axis="x", rotation=45)
        else:
            cell.set_xticklabels([])
        if j == 0 and i > 0:
            cell.set_ylabel(f"{subscript(names[i])} (GPa)")
        elif j > 0:
            cell.set_yticklabels([])
    return Picture(
        figure,
        "Points of the posterior for each pair of constants, with their correlations.",
        "Pairs of constants. Long thin clouds are ridges: combinations along which the measurements cannot tell crystals apart. The "
        "numbers are correlations.",
        ([f"{name}_gpa" for name in names], table.T.tolist()),
    )


def grain_comparison(results) -> Picture | None:
    """Measured moduli, grain by grain, beside what the posterior predicts."""
    predicted = sorted(enumerate(results.documents["extract"].get("predicted", []), start=1), key=lambda pair: pair[1]["mean"])
    if not predicted:
        return None
    mean, sd, measured = (np.array([item[name] for _, item in predicted]) for name in ("mean", "sd", "measured"))
    error = [item.get("measured_sd") or 0.0 for _, item in predicted]
    place = np.arange(len(predicted))
    wide = len(predicted) <= 20
    figure = new_figure(3.4)
    axes = figure.subplots()
    axes.errorbar(place, mean, 2 * sd, fmt="none", ecolor=SKY, elinewidth=9 if wide else 4, label="predicted, ± 2 sd")
    axes.plot(place, mean, "_", color=BLUE, ms=9 if wide else 4, mew=1.8, label="predicted, mean")
    axes.errorbar(place, measured, error, fmt="o", ms=4, lw=1, color=BLACK, label="measured, ± sd")
    axes.set(ylabel=f"{results.kind} (GPa)", xlabel="grain (row of the measurements)")
    step = -(-len(predicted) // 25)
    axes.set_xticks(place[::step], [str(grain) for grain, _ in predicted[::step]])
    axes.grid(axis="x")
    axes.legend(loc="upper left", ncols=3, bbox_to_anchor=(0, 1.12))
    return Picture(
        figure,
        "Measured modulus of each grain beside the prediction of the posterior.",
        f"The {results.kind} of each grain, measured and as the posterior predicts it, in order of the prediction.",
        (
            ["grain", "measured_gpa", "measured_sd_gpa", "predicted_gpa", "predicted_sd_gpa"],
            [[grain, m, e, p, s] for (grain, _), m, e, p, s in zip(predicted, measured.tolist(), error, mean.tolist(), sd.tolist())],
        ),
    )


def traces(results) -> Picture | None:
    """Chains of each constant."""
    samples = results.samples
    if not samples:
        return None
    figure = new_figure(1.25 * len(samples) + 0.4)
    rows = figure.subplots(len(samples), 1, sharex=True, squeeze=False)[:, 0]
    for axes, (name, chains) in zip(rows, samples.items()):
        step = max(1, chains.shape[1] // LINE_POINTS)
        for chain, colour in zip(chains, np.resize(CYCLE, len(chains))):
            axes.plot(np.arange(0, chain.size, step), chain[::step], lw=0.4, alpha=0.8, color=colour, rasterized=True)
        axes.set_ylabel(f"{subscript(name)} (GPa)")
    rows[-1].set_xlabel("sample of the chain")
    figure.align_ylabels(rows)
    return Picture(figure, "The sampled values of each chain in order.", "The chains. Healthy ones overlap and show no trend.")


def contraction(results) -> Picture | None:
    """Share of the prior's variance that the data removed: of combinations of the constants, and of quantities."""
    rows = results.documents["extract"].get("identifiability", [])
    if not rows:
        return None
    combinations = [row for row in rows if row["kind"] == "combination"]
    quantities = [row for row in rows if row["kind"] == "quantity"]
    labels = [power_label(row["exponents"]) for row in combinations]
    labels += [subscript(quantity_in_words(row["name"])) for row in quantities]
    shares = np.clip([row["contraction"] for row in combinations + quantities], 0, 1)
    place = -np.arange(len(labels)) - 0.6 * (np.arange(len(labels)) >= len(combinations))
    figure = new_figure(0.29 * len(labels) + 1.2)
    axes = figure.subplots()
    axes.barh(place, shares, color=BLUE, height=0.7, label="decided by the data")
    axes.barh(place, 1 - shares, left=shares, color=ORANGE, height=0.7, alpha=0.55, label="left to the prior")
    for y, share in zip(place, shares):
        axes.text(1.01, y, f"{100 * share:.0f} %", va="center")
    axes.set_yticks(place, labels)
    axes.set(xlim=(0, 1.1), ylim=(place.min() - 0.6, 0.6), xlabel="contraction: share of the prior's variance that the data removed")
    axes.set_xticks(np.linspace(0, 1, 6))
    axes.grid(axis="y")
    figure.legend(loc="outside upper left", ncols=2)
    return Picture(
        figure,
        f"Contraction of {len(combinations)} combinations of the constants, from {shares[0]:.3f} to {shares[len(combinations) - 1]:.3f}, "
        f"and of {len(quantities)} quantities of the crystal.",
        "Above, products of powers of the constants, from the best to the worst identified; below, the constants and quantities that "
        "follow from them.",
        (["kind", "name", "contraction"], [[row["kind"], row["name"], row["contraction"]] for row in combinations + quantities]),
    )
