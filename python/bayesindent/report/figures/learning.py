"""How the surrogate was trained, and how well it predicts the simulations."""

import numpy as np
from matplotlib.figure import Figure

from ..formatting import number, percent
from ..results import NothingToShow, Results, present
from .style import (
    CYCLE,
    MARKERS,
    SKY,
    Picture,
    legend_above,
    logarithmic,
    panels,
    parity_panels,
)

#: Points are drawn small if there are more than this.
MANY = 400


def learning_curve(results: Results) -> Picture:
    """Error against the number of simulations."""
    updates, baselines = (results.built.get(name, {}) for name in ("history", "baselines"))
    if len(updates) < 2:
        raise NothingToShow
    simulations = [update["simulations"] for update in updates]
    figure, axes = panels(3.4)
    curves = {"leave_crystal_out_gpa": "a crystal left out", "next_gpa": "next simulations"}
    for (name, label), colour, marker in zip(curves.items(), CYCLE, MARKERS):
        values = np.array([update[name] for update in updates], dtype=float)
        axes.plot(simulations, values, marker=marker, ms=3.5, lw=1, color=colour, label=label)
    lines = {"theory_gpa": "theory alone", "theory_times_ratio_gpa": "theory times one ratio"}
    for (name, label), style in zip(lines.items(), ("-", "--")):
        if baselines.get(name):
            axes.axhline(baselines[name], label=label, color="0.6", ls=style)
    axes.set(xlabel="simulations", ylabel="mean absolute error (GPa)")
    logarithmic(axes)
    axes.xaxis.get_major_locator().set_params(integer=True)
    legend_above(figure, columns=2)
    last = number(updates[-1]["leave_crystal_out_gpa"], 2)
    return Picture(
        figure,
        "Mean absolute error of the surrogate against the number of simulations. Of crystals left "
        "out of the fit, and of the next simulations before the surrogate is trained on them. "
        "Grey: the half-space theory without a surrogate.",
        values=f"The error of a crystal left out ends at {last} GPa.",
    )


def parity(results: Results) -> Picture:
    """Each crystal, predicted from the simulations of the other crystals."""
    surrogate = results.surrogate if results.built else None
    if surrogate is None:
        raise NothingToShow
    data = present(surrogate.data)
    predicted, z = surrogate.leave_out(np.unique(data["constants"], axis=0, return_inverse=True)[1])
    simulated = data["modulus_gpa"]
    error = number(np.abs(predicted - simulated).mean(), 2)
    return Picture(
        against_simulated(simulated, predicted, z),
        f"Leave-one-out: the {len(simulated)} simulations as the surrogate predicts them from "
        f"those of other crystals. The mean absolute error is {error} GPa. Right: the errors in "
        "units of their predicted sd; bands of 1 and 2 sd.",
    )


def validation(results: Results) -> Picture:
    """Predictions of simulations on which the surrogate was not trained."""
    unseen = present(results.built.get("validation"))
    simulated, predicted, sd = (
        np.array(unseen[name], dtype=float) for name in ("simulated", "predicted", "sd")
    )
    return Picture(
        against_simulated(simulated, predicted, (predicted - simulated) / sd, sd),
        f"The surrogate on {unseen['points']} simulations that it was not trained on, those of "
        f"largest variance. The mean absolute error is {number(unseen['mean_absolute_gpa'], 2)} "
        f"GPa; {percent(unseen['within_1_sd'])} % within 1 sd and "
        f"{percent(unseen['within_2_sd'])} % within 2.",
    )


def against_simulated(
    simulated: np.ndarray, predicted: np.ndarray, z: np.ndarray, sd: np.ndarray | None = None
) -> Figure:
    """Predicted against simulated moduli, with one sd, and the errors in units of the sd."""
    labels = ("simulated modulus (GPa)", "predicted modulus (GPa)", "(predicted - simulated) / sd")
    small: dict = {"ms": 1.5, "lw": 0.4, "ecolor": SKY} if len(simulated) > MANY else {}
    return parity_panels(simulated, predicted, z, labels, yerr=sd, **small)


def truncations(results: Results) -> Picture:
    """Leave-one-out error against the number of simulations: a colour for each degree, a marker for
    each bandlimit.
    """
    scan = present(results.built.get("scan"))
    figure, axes = panels(3.4)
    degrees = sorted({entry["degree"] for entry in scan})
    bandlimits = sorted({entry["bandlimit"] for entry in scan})
    for entry in scan:
        colour = CYCLE[degrees.index(entry["degree"]) % len(CYCLE)]
        marker = MARKERS[bandlimits.index(entry["bandlimit"]) % len(MARKERS)]
        label = f"degree {entry['degree']}, bandlimit {entry['bandlimit']}, {entry['terms']} terms"
        points = entry["curve"]["simulations"], entry["curve"]["loocv_gpa"]
        axes.plot(*points, color=colour, marker=marker, ms=4, lw=1, label=label)
    axes.set(xlabel="simulations", ylabel="leave-one-out error (GPa)")
    logarithmic(axes)
    legend_above(figure, columns=2)
    best = max(scan, key=lambda entry: entry["log_evidence"])
    return Picture(
        figure,
        "Leave-one-out error of several truncations against the number of simulations, which "
        f"are the same. The evidence is largest with degree {best['degree']} and bandlimit "
        f"{best['bandlimit']}.",
    )
