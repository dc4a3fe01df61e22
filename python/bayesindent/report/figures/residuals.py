"""What is left of the measurements when the posterior's prediction is taken off."""

from statistics import NormalDist

import numpy as np

from ..formatting import number
from ..results import NothingToShow, Results
from .style import BLACK, BLUE, SKY, Picture, panels, sd_axes

__all__ = ["chi_square", "residuals"]

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
