"""Figures of Step 0: curves with elastic fits, the tip, moduli of grains, and their errors."""

from operator import itemgetter

import numpy as np

from ...stages.curves import read_columns
from ..results import NothingToShow, Results, present
from .style import (
    BLACK,
    CYCLE,
    GREEN,
    ORANGE,
    RED,
    SKY,
    Picture,
    evenly,
    is_column,
    panels,
    sd_axes,
)

#: Most tests that are shown, evenly over those that were used.
SHOWN = 4


def curve_fits(results: Results) -> Picture:
    """Curves, fits, elastic windows and residuals of some tests."""
    tests = [row for row in present(results.documents["curves"])["tests"] if row["used"]]
    if not (file := results.folder / "fits.csv").exists():
        raise NothingToShow
    columns = {name: np.array(column) for name, column in read_columns(file).items()}
    chosen = evenly(tests, SHOWN)
    figure, axes = panels(1.7 * len(chosen), len(chosen), 2, squeeze=False)
    for (left, right), row in zip(axes, chosen):
        own = columns["test"] == row["test"]
        load, depth, fit, elastic = (
            columns[name][own] for name in ("load_mn", "depth_nm", "fit_nm", "elastic")
        )
        left.plot(depth - row["zero_nm"], load, ".", ms=2)
        left.plot(fit - row["zero_nm"], load, color=BLACK, lw=0.8)
        left.set_title(f"{row['test']}: {row['effective_modulus_gpa']:.1f} GPa", loc="left")
        right.plot(load, depth - fit, lw=1)
        sd_axes(right, bands=False)
        spread = 6 * max(np.std((depth - fit)[elastic > 0.5]), row["noise_nm"])
        right.set_ylim(-spread, 2 * spread)
        for span in (left.axhspan, right.axvspan):
            span(row["elastic_from_mn"], row["elastic_to_mn"], color=GREEN, alpha=0.15, lw=0)
    axes[-1, 0].set(xlabel="depth from the zero (nm)", ylabel="load (mN)")
    axes[-1, 1].set(xlabel="load (mN)", ylabel="residual (nm)")
    return Picture(
        figure,
        f"Loading curves of {len(chosen)} of {len(tests)} tests with their elastic fits, and "
        "the residuals of depth. Green: the mean elastic window.",
    )


def tip_radius(results: Results) -> Picture:
    """The local radius of the tip by depth."""
    document = present(results.documents["curves"])
    radius, beta = document["tip"]["radius_um"], document["tip"]["beta"]
    figure, axes = panels(3.0)
    # At a contact radius of x R the depth is R (x^2 + beta x^4/3), and the curvature of the profile
    # there (1 + 3/2 beta x^2)/R.
    used = [
        row["elastic_to_mn"] / row["effective_modulus_gpa"]
        for row in document["tests"]
        if row["used"]
    ]
    ratio = np.linspace(0, (0.75 * max(used) / radius["mean"] ** 2) ** (1 / 3), 60)
    covariance = np.array(document["shared"]["covariance"])[:2, :2]
    drawn = np.random.default_rng(1).multivariate_normal(
        [np.log(radius["mean"]), beta["mean"]], covariance, 2000
    )
    local = np.exp(drawn[:, :1]) / np.maximum(0.05, 1 + 1.5 * drawn[:, 1:] * ratio**2)
    depth = radius["mean"] * 1e3 * (ratio**2 + beta["mean"] * ratio**4 / 3)
    for low, high, alpha in ((2.5, 97.5, 0.2), (16, 84, 0.3)):
        axes.fill_between(
            depth, *np.percentile(local, [low, high], axis=0), color=SKY, alpha=alpha, lw=0
        )
    axes.plot(depth, np.median(local, axis=0))
    axes.set(xlabel="depth (nm)", ylabel="local radius (µm)")
    return Picture(
        figure,
        "Local radius of curvature of the tip at the edge of the contact by depth; at the apex "
        f"{radius['mean']:.2f} ± {radius['sd']:.2f} µm. Bands: 1 and 2 sd.",
    )


def curve_moduli(results: Results) -> Picture:
    """Moduli of tests and grains, by session."""
    document = present(results.documents["curves"])
    figure, axes = panels(3.8)
    grains = [row["grain"] for row in present(document["grains"])]
    tests = [row for row in document["tests"] if row["used"] and row.get("grain") in grains]
    for number, session in enumerate(dict.fromkeys(row["session"] for row in tests), 1):
        rows = [row for row in tests if row["session"] == session]
        places = []
        for row in rows:
            # Tests of a grain stand side by side on its left.
            before = sum(row["grain"] == other["grain"] for other in tests[: tests.index(row)])
            places.append(grains.index(row["grain"]) - 0.35 + 0.1 * (before % 3))
        label = f"tests, session {session}" if session else "tests"
        axes.plot(
            places,
            [row["effective_modulus_gpa"] for row in rows],
            ".",
            color=CYCLE[number % len(CYCLE)],
            label=label,
        )
    place = range(len(grains))
    columns = itemgetter("effective_modulus_gpa", "sd_gpa", "own_sd_gpa")
    moduli, sds, own = zip(*map(columns, document["grains"]))
    axes.errorbar(place, moduli, sds, fmt="none", color=SKY, lw=4, label="sd")
    axes.errorbar(place, moduli, own, fmt="o", ms=4, label="sd of the grain's own")
    crowded = len(grains) > (7 if is_column() else 15)
    axes.set_xticks(place, grains, rotation=90 * crowded)
    low, high = axes.get_ylim()
    axes.set(
        xlabel="grain", ylabel="effective modulus (GPa)", ylim=(low, high + 0.3 * (high - low))
    )
    axes.legend(loc="upper center", ncols=2)
    return Picture(
        figure,
        f"Effective moduli of {len(grains)} grains and of their tests. Wide bars: sd of all "
        "errors; narrow bars: sd of those that grains do not share.",
    )


def moduli_errors(results: Results) -> Picture:
    """The error budget of the moduli."""
    budget = present(present(results.documents["curves"]).get("error_budget", {}))
    figure, axes = panels(2.4)
    for name, share in budget.items():
        label = "shape of the tip" if name == "beta" else name.replace("_", " ")
        colour = ORANGE if name in ("drift", "repeat_and_window") else RED
        axes.barh(label, 100 * share, color=colour)
    axes.invert_yaxis()
    axes.set_xlabel("relative sd of a grain's modulus, median (%)")
    return Picture(
        figure,
        "Sources of error of a grain's modulus. Red: shared by all grains, so more grains do not "
        "reduce them. Orange: of each grain by itself.",
    )
