"""What is left of the measurements when the posterior's prediction is taken off."""

from statistics import NormalDist

import numpy as np

from ..words import number
from .style import BLACK, BLUE, SKY, Picture, new_figure

__all__ = ["chi_square", "residuals"]

#: Samples of normal numbers behind the band of the quantiles.
SAMPLES = 2000


def chi_square(predicted: list[dict]) -> tuple[float, float]:
    """The sum of squares of the residuals in units of the measurements' sds, and what is expected of it.

    Of a linear model with normal errors s a prediction of sd p leaves a residual of variance s² - p².
    """
    measured, mean, error, sd = (np.array([item[name] for item in predicted]) for name in ("measured", "mean", "measured_sd", "sd"))
    return float(np.sum(((measured - mean) / error) ** 2)), float(np.sum(np.maximum(0.0, 1 - (sd / error) ** 2)))


def residuals(results) -> Picture | None:
    """Residuals of the grains, and their quantiles beside those of a normal distribution."""
    predicted = results.documents["extract"].get("predicted", [])
    if len(predicted) < 2 or not all(item.get("measured_sd") for item in predicted):
        return None
    mean, measured, error = (np.array([item[name] for item in predicted]) for name in ("mean", "measured", "measured_sd"))
    values = (measured - mean) / error
    total, expected = chi_square(predicted)
    count = len(values)
    small = 3 if count > 60 else 4
    figure = new_figure(3.3)
    left, right = figure.subplots(1, 2)
    for reach, alpha in ((2, 0.2), (1, 0.3)):
        left.axhspan(-reach, reach, color=SKY, alpha=alpha, lw=0)
    left.axhline(0, color=BLACK, lw=0.8)
    left.plot(mean, values, "o", color=BLUE, ms=small)
    for index in np.flatnonzero(np.abs(values) > 2):
        left.annotate(str(index + 1), (mean[index], values[index]), (4, 3), textcoords="offset points")
    left.set(xlabel=f"predicted {results.kind} (GPa)", ylabel="(measured - predicted) / sd")
    limit = max(2.6, 1.15 * np.abs(values).max())
    left.set_ylim(-limit, limit)
    quantiles = np.array([NormalDist().inv_cdf((k + 0.5) / count) for k in range(count)])
    low, high = np.percentile(np.sort(np.random.default_rng(1).standard_normal((SAMPLES, count)), axis=1), [2.5, 97.5], axis=0)
    right.fill_between(quantiles, low, high, color=SKY, alpha=0.35, lw=0, label="95 % of normal samples")
    ends = np.array([min(quantiles[0], values.min()), max(quantiles[-1], values.max())])
    right.plot(ends, ends, color=BLACK, lw=0.8)
    right.plot(quantiles, np.sort(values), "o", color=BLUE, ms=small)
    right.set(xlabel="quantile of a normal distribution", ylabel="residual / sd, in order")
    right.legend(loc="upper left")
    words = f"χ² = {number(total)} for {count} grains"
    return Picture(
        figure,
        f"Residuals of {count} grains in units of their sd, and their normal quantiles; {words}.",
        f"Left: measured minus predicted modulus of each grain in units of the sd of its measurement; the bands are 1 and 2 sd, and rows of "
        f"the measurements beyond 2 are numbered. Right: the same in order beside the quantiles of a normal distribution. {words} about the mean prediction, "
        f"where some {number(expected)} are expected if the stated sds are right, since the fit takes up a part.",
    )
