"""How the surrogate was taught, and how well it knows the simulations."""

import numpy as np

from ...crystal.elasticity import stiffness_rows
from ..words import number
from .style import BLACK, BLUE, CYCLE, MARKERS, SKY, Picture, diagonal, new_figure, plain_log_ticks

__all__ = ["coefficients", "learning_curve", "parity", "truncations", "validation"]

#: More points than that are drawn small.
MANY = 400


def learning_curve(results) -> Picture | None:
    """Error against the number of simulations."""
    history = results.documents["build"].get("history", [])
    if len(history) < 2:
        return None
    baselines = results.documents["build"].get("baselines", {})
    figure = new_figure(3.4)
    axes = figure.subplots()
    count = [entry["simulations"] for entry in history]
    labels = {"leave_crystal_out_gpa": "a crystal left out", "next_gpa": "the next points, before they are added"}
    for (name, label), colour, marker in zip(labels.items(), CYCLE, MARKERS):
        error = [np.nan if entry[name] is None else entry[name] for entry in history]
        axes.plot(count, error, marker=marker, ms=3.5, lw=1, color=colour, label=label)
    lines = {"theory_gpa": "theory alone", "theory_times_ratio_gpa": "theory times one ratio"}
    # The one shows below the other where they are the same.
    for (name, label), line in zip(lines.items(), ({"color": "0.75", "lw": 3}, {"color": BLACK, "lw": 1, "ls": "--"})):
        if baselines.get(name):
            axes.axhline(baselines[name], label=label, **line)
    axes.set(xlabel="simulations", ylabel="mean absolute error (GPa)", yscale="log")
    plain_log_ticks(axes.yaxis)
    axes.xaxis.get_major_locator().set_params(integer=True)
    figure.legend(loc="outside upper left", ncols=2)
    last = number(history[-1]["leave_crystal_out_gpa"], 2)
    beside = " Beside them, what the half-space theory does without a surrogate." if any(baselines.get(name) for name in lines) else ""
    return Picture(
        figure,
        f"Error against the number of simulations; the error of a crystal left out ends at {last} GPa.",
        "Mean absolute error against the number of simulations: of crystals left out of the fit, and of the next points, which the "
        "variance chooses as the hardest." + beside,
    )


def coefficients(results) -> Picture | None:
    """Norm of the coefficient vector, and the angle through which each update turned it."""
    history = results.documents["build"].get("history", [])
    if len(history) < 2:
        return None
    count = [entry["simulations"] for entry in history]
    figure = new_figure(3.0)
    left, right = figure.subplots(1, 2)
    left.plot(count, [entry["norm"] for entry in history], color=BLUE)
    left.set(xlabel="simulations", ylabel="norm of the coefficients")
    right.plot(count, [entry["angle_deg"] for entry in history], color=BLUE)
    right.set(xlabel="simulations", ylabel="turn since the last update (degrees)", yscale="log")
    plain_log_ticks(right.yaxis)
    for axes in (left, right):
        axes.xaxis.get_major_locator().set_params(integer=True)
    return Picture(
        figure,
        "Norm of the coefficient vector, and the angle between updates, against the number of simulations.",
        "The vector of coefficients settles: its norm, and the angle through which each update turns it.",
    )


def parity(results) -> Picture | None:
    """The surrogate on the simulations that taught it."""
    surrogate = results.surrogate if results.documents["build"] else None
    if surrogate is None or not surrogate.data:
        return None
    predicted, sd = surrogate.predict(stiffness_rows(surrogate.symmetry, surrogate.data["constants"]), surrogate.data["euler_deg"])
    return Picture(
        against_simulated(surrogate.data["modulus_gpa"], predicted, sd),
        f"Predicted against simulated moduli; the mean difference is {number(np.abs(predicted - surrogate.data['modulus_gpa']).mean(), 2)} GPa.",
        "The surrogate on the simulations that taught it, with one sd. The bands on the right are 1 and 2 sd.",
    )


def validation(results) -> Picture | None:
    """The surrogate on simulations that it has not seen."""
    unseen = results.documents["build"].get("validation")
    if not unseen:
        return None
    error = number(unseen["mean_absolute_gpa"], 2)
    return Picture(
        against_simulated(unseen["simulated"], unseen["predicted"], unseen["sd"]),
        f"Predicted against simulated moduli of {unseen['points']} points that the surrogate has not seen; mean error {error} GPa.",
        f"The surrogate on {unseen['points']} simulations that it has not seen, the next by variance: mean absolute error "
        f"{error} GPa, {100 * unseen['within_1_sd']:.0f} % within 1 sd and {100 * unseen['within_2_sd']:.0f} % within 2.",
    )


def against_simulated(simulated, predicted, sd):
    """Predicted against simulated moduli with one sd, and the residuals in units of the sd."""
    simulated, predicted, sd = (np.asarray(values, dtype=float) for values in (simulated, predicted, sd))
    figure = new_figure(3.4)
    left, right = figure.subplots(1, 2)
    diagonal(left, simulated, predicted)
    size, width, colour = (1.5, 0.4, SKY) if len(simulated) > MANY else (3.5, 0.8, BLUE)
    left.errorbar(simulated, predicted, sd, fmt="o", ms=size, lw=width, color=BLUE, ecolor=colour)
    left.set(xlabel="simulated modulus (GPa)", ylabel="predicted modulus (GPa)")
    for reach, alpha in ((2, 0.2), (1, 0.3)):
        right.axhspan(-reach, reach, color=SKY, alpha=alpha, lw=0)
    right.axhline(0, color=BLACK, lw=0.8)
    right.plot(simulated, (predicted - simulated) / sd, "o", ms=size, color=BLUE)
    right.set(xlabel="simulated modulus (GPa)", ylabel="(predicted - simulated) / sd")
    return figure


def truncations(results) -> Picture | None:
    """Leave-one-out error against the number of simulations: a colour for each degree, a marker for each bandlimit."""
    scan = results.documents["build"].get("scan")
    if not scan:
        return None
    figure = new_figure(3.4)
    axes = figure.subplots()
    degrees, bandlimits = (sorted({entry[name] for entry in scan}) for name in ("degree", "bandlimit"))
    for entry in scan:
        axes.plot(
            entry["curve"]["simulations"],
            entry["curve"]["loocv_gpa"],
            color=CYCLE[degrees.index(entry["degree"]) % len(CYCLE)],
            marker=MARKERS[bandlimits.index(entry["bandlimit"]) % len(MARKERS)],
            ms=4,
            lw=1,
            label=f"degree {entry['degree']}, bandlimit {entry['bandlimit']}, {entry['terms']} terms",
        )
    axes.set(xlabel="simulations", ylabel="leave-one-out error (GPa)", yscale="log")
    plain_log_ticks(axes.yaxis)
    figure.legend(loc="outside upper left", ncols=2)
    best = max(scan, key=lambda entry: entry["log_evidence"])
    return Picture(
        figure,
        "Leave-one-out error of several truncations against the number of simulations.",
        "Other truncations on the same simulations. The evidence is largest with degree "
        f"{best['degree']} and bandlimit {best['bandlimit']}.",
    )
