"""How the surrogate was trained, and how well it predicts the simulations."""

import numpy as np
from matplotlib.figure import Figure

from ...crystal.elasticity import stiffness_rows
from ..formatting import number
from ..results import NothingToShow, Results, present
from .style import BLACK, BLUE, CYCLE, MARKERS, SKY, Picture, logarithmic, panels, parity_panels, sd_axes

__all__ = ["coefficients", "learning_curve", "parity", "truncations", "validation"]

#: More points than that are drawn small.
MANY = 400


def history_of(results: Results) -> dict[str, list]:
    """Each number of the history of a build, one for each update."""
    history = results.documents["build"].get("history", [])
    if len(history) < 2:
        raise NothingToShow
    return {name: [entry[name] for entry in history] for name in history[0]}


def learning_curve(results: Results) -> Picture:
    """Error against the number of simulations."""
    history, baselines = history_of(results), results.documents["build"].get("baselines", {})
    figure, axes = panels(3.4)
    curves = {"leave_crystal_out_gpa": "a crystal left out", "next_gpa": "the next points, before they are added"}
    for (name, label), colour, marker in zip(curves.items(), CYCLE, MARKERS):
        axes.plot(history["simulations"], np.array(history[name], dtype=float), marker=marker, ms=3.5, lw=1, color=colour, label=label)
    lines = {"theory_gpa": "theory alone", "theory_times_ratio_gpa": "theory times one ratio"}
    # The one shows below the other where they are the same.
    for (name, label), line in zip(lines.items(), ({"color": "0.75", "lw": 3}, {"color": BLACK, "lw": 1, "ls": "--"})):
        if baselines.get(name):
            axes.axhline(baselines[name], label=label, **line)
    axes.set(xlabel="simulations", ylabel="mean absolute error (GPa)")
    logarithmic(axes)
    axes.xaxis.get_major_locator().set_params(integer=True)
    figure.legend(loc="outside upper left", ncols=2)
    last = number(history["leave_crystal_out_gpa"][-1], 2)
    beside = " Beside them, what the half-space theory does without a surrogate." if any(map(baselines.get, lines)) else ""
    return Picture(
        figure,
        f"Error against the number of simulations; the error of a crystal left out ends at {last} GPa.",
        "Mean absolute error against the number of simulations: of crystals left out of the fit, and of the next points, which the "
        "variance chooses as the hardest." + beside,
    )


def coefficients(results: Results) -> Picture:
    """Norm of the coefficient vector, and the angle through which each update turned it."""
    history = history_of(results)
    figure, (left, right) = panels(3.0, 1, 2)
    labels = {"norm": "norm of the coefficients", "angle_deg": "turn since the last update (degrees)"}
    for axes, (name, label) in zip((left, right), labels.items()):
        axes.plot(history["simulations"], history[name], color=BLUE)
        axes.set(xlabel="simulations", ylabel=label)
        axes.xaxis.get_major_locator().set_params(integer=True)
    logarithmic(right)
    return Picture(
        figure,
        "Norm of the coefficient vector, and the angle between updates, against the number of simulations.",
        "The vector of coefficients settles: its norm, and the angle through which each update turns it.",
    )


def parity(results: Results) -> Picture:
    """The surrogate on the simulations that trained it."""
    surrogate = results.surrogate if results.documents["build"] else None
    if surrogate is None:
        raise NothingToShow
    data = present(surrogate.data)
    predicted, sd = surrogate.predict(stiffness_rows(surrogate.symmetry, data["constants"]), data["euler_deg"])
    return Picture(
        against_simulated(data["modulus_gpa"], predicted, sd),
        f"Predicted against simulated moduli; the mean difference is {number(np.abs(predicted - data['modulus_gpa']).mean(), 2)} GPa.",
        "The surrogate on the simulations that taught it, with one sd. The bands on the right are 1 and 2 sd.",
    )


def validation(results: Results) -> Picture:
    """The surrogate on simulations that it has not seen."""
    unseen = present(results.documents["build"].get("validation"))
    error = number(unseen["mean_absolute_gpa"], 2)
    return Picture(
        against_simulated(*(np.array(unseen[name], dtype=float) for name in ("simulated", "predicted", "sd"))),
        f"Predicted against simulated moduli of {unseen['points']} points that the surrogate has not seen; mean error {error} GPa.",
        f"The surrogate on {unseen['points']} simulations that it has not seen, the next by variance: mean absolute error "
        f"{error} GPa, {100 * unseen['within_1_sd']:.0f} % within 1 sd and {100 * unseen['within_2_sd']:.0f} % within 2.",
    )


def against_simulated(simulated: np.ndarray, predicted: np.ndarray, sd: np.ndarray) -> Figure:
    """Predicted against simulated moduli with one sd, and the residuals in units of the sd."""
    labels = ("simulated modulus (GPa)", "predicted modulus (GPa)", "(predicted - simulated) / sd")
    small = {"ms": 1.5, "lw": 0.4, "ecolor": SKY} if len(simulated) > MANY else {}
    figure, right = parity_panels(simulated, predicted, (predicted - simulated) / sd, labels, yerr=sd, **small)
    sd_axes(right)
    return figure


def truncations(results: Results) -> Picture:
    """Leave-one-out error against the number of simulations: a colour for each degree, a marker for each bandlimit."""
    scan = present(results.documents["build"].get("scan"))
    figure, axes = panels(3.4)
    degrees, bandlimits = (sorted({entry[name] for entry in scan}) for name in ("degree", "bandlimit"))
    for entry in scan:
        colour, marker = CYCLE[degrees.index(entry["degree"]) % len(CYCLE)], MARKERS[bandlimits.index(entry["bandlimit"]) % len(MARKERS)]
        label = f"degree {entry['degree']}, bandlimit {entry['bandlimit']}, {entry['terms']} terms"
        curve = entry["curve"]
        axes.plot(curve["simulations"], curve["loocv_gpa"], color=colour, marker=marker, ms=4, lw=1, label=label)
    axes.set(xlabel="simulations", ylabel="leave-one-out error (GPa)")
    logarithmic(axes)
    figure.legend(loc="outside upper left", ncols=2)
    best = max(scan, key=lambda entry: entry["log_evidence"])
    return Picture(
        figure,
        "Leave-one-out error of several truncations against the number of simulations.",
        "Other truncations on the same simulations. The evidence is largest with degree "
        f"{best['degree']} and bandlimit {best['bandlimit']}.",
    )
