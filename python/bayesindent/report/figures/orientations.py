"""The modulus, and the gain of one more grain, over the distinct directions of the crystal."""

import os
from typing import Any

import numpy as np
from matplotlib.collections import LineCollection
from matplotlib.tri import Triangulation

from ...crystal.directions import (
    euler_of,
    indentation_direction,
    representative,
    spread_of_directions,
)
from ..formatting import direction_name, has_four_indices
from ..results import NothingToShow, Results, present
from .style import BLACK, SKY, Picture, legend_above, panels

#: Draws of the posterior for which the surrogate predicts moduli.
DRAWS = 100

#: The axis of the declination, and the first columns of the tables.
DECLINATION = "declination of the c axis (degrees)"
HEADER = ("kind", "crystal_x", "crystal_y", "crystal_z")

#: Directions whose names are shown at corners of the map.
CORNERS = (
    (0, 0, 1),
    (1, 0, 1),
    (1, 1, 1),
    (1, 0, 0),
    (1, 1, 0),
    (0, 1, 0),
    (0, 1, 1),
    (-1, 0, 0),
    (0, -1, 0),
)


def orientations(results: Results) -> Picture:
    """Posterior of the modulus over all directions, with the measured grains."""
    present(results.samples)
    grains, surrogate = results.predicted, results.surrogate
    if surrogate is None or any("euler_deg" not in item for item in grains):
        raise NothingToShow
    lattice, directions = spread_of_directions(results.symmetry), directions_of(results, grains)
    crystals, threads = results.draws(DRAWS)[:, None], len(os.sched_getaffinity(0))
    modulus = results.as_measured(
        surrogate.predict(crystals, euler_of(lattice), threads=threads)[0]
    )
    mean, sd = modulus.mean(axis=0), modulus.std(axis=0)
    measured = [item.get("measured") or 0.0 for item in grains]
    error = [item.get("measured_sd") or 0.0 for item in grains]
    none = "" if grains else "; no modulus was measured"
    if is_arc(lattice):
        figure, axes = panels(3.4)
        angle = declination(lattice)
        axes.fill_between(
            angle,
            mean - 2 * sd,
            mean + 2 * sd,
            color=SKY,
            alpha=0.4,
            lw=0,
            label="predicted, ± 2 sd",
        )
        axes.plot(angle, mean, label="predicted, mean")
        if grains:
            axes.errorbar(
                declination(directions),
                measured,
                error,
                fmt="o",
                ms=3.5,
                lw=0.8,
                color=BLACK,
                label="measured, ± sd",
            )
        axes.set(xlabel=DECLINATION, ylabel=f"{results.kind} (GPa)", xlim=(-2, 92))
        axes.legend()
        marked = none or "; points are the measured grains"
        return Picture(
            figure, f"Posterior of the modulus over the declination of the c axis{marked}."
        )
    figure, (left, right) = panels(3.2, 1, 2)
    ends = {"vmin": min([mean.min(), *measured]), "vmax": max([mean.max(), *measured])}
    four = has_four_indices(results.symmetry)
    draw_map(left, lattice, mean, f"mean of {results.kind} (GPa)", four, **ends)
    draw_map(right, lattice, sd, f"sd of {results.kind} (GPa)", four)
    places = stereographic(directions)
    left.scatter(*places, c=measured, **ends, edgecolors="white", s=38, linewidths=1.2, zorder=3)
    right.plot(*places, "o", color="white", mec=BLACK, ms=4, mew=0.8)
    marked = (
        none or "; discs are the measured grains, on the left in the colour of the measured value"
    )
    text = f"Posterior mean and sd of the modulus over the crystal directions that differ{marked}."
    rows = labelled("predicted", lattice, mean, sd)
    rows += labelled("measured", directions, measured, error)
    return Picture(figure, text, ([*HEADER, "mean_gpa", "sd_gpa"], rows))


def next_grains(results: Results) -> Picture:
    """Expected gain of one more grain over all directions, and suggestions by rank."""
    document = present(results.documents["next"])
    suggestions, unit = document["suggestions"], document.get("unit", "1")
    candidates = [item for item in document["candidates"] if "propagation_deg" not in item]
    suggested, everywhere = directions_of(results, suggestions), directions_of(results, candidates)
    measured = directions_of(
        results, [item for item in results.predicted + results.velocities if "euler_deg" in item]
    )
    gain = np.array([item["gain"] for item in candidates])
    gain_suggested = np.array([item["gain"] for item in suggestions])
    arc = is_arc(everywhere)
    figure, axes = panels(3.0 if arc else 3.6)
    # Suggestions are drawn first, so that the axes include a speed with a gain above all moduli.
    places = np.column_stack(
        [declination(suggested), gain_suggested] if arc else stereographic(suggested)
    )
    axes.plot(
        *places.T,
        "o",
        color="white",
        mec=BLACK,
        ms=12,
        clip_on=False,
        label="suggested, by rank",
        zorder=3,
    )
    label, crosses = f"expected gain ({unit})", {"color": BLACK, "ms": 5, "label": "measured"}
    if arc:
        words = "gain expected of the next grain"
        axes.plot(declination(everywhere), gain, ".", color=SKY, ms=4, label=words)
        axes.plot(declination(measured), 0 * measured[:, 0], "x", clip_on=False, **crosses)
        axes.set(xlabel=DECLINATION, ylabel=label, xlim=(-3, 93), ylim=(0, None))
    else:
        draw_map(axes, everywhere, gain, label, has_four_indices(results.symmetry))
        crossed = stereographic(measured)
        axes.plot(*crossed, "x", color="white", ms=5, mew=1.6)
        axes.plot(*crossed, "x", mew=0.9, **crosses)
    for rank, place in enumerate(places, start=1):
        axes.annotate(str(rank), place, ha="center", va="center_baseline", size=8.5, zorder=4)
    legend_above(figure, columns=3)
    over = (
        "over the declination of the c axis" if arc else "among the crystal directions that differ"
    )
    speeds = " A speed is drawn at the normal of its grain." * any(
        "propagation_deg" in item for item in suggestions
    )
    rows = labelled("candidate", everywhere, gain)
    rows += labelled("suggested", suggested, gain_suggested)
    text = (
        f"The {len(suggested)} orientations that are expected to bring most information, "
        f"ranked, {over}. Each is chosen given those before it.{speeds}"
    )
    return Picture(figure, text, ([*HEADER, "gain"], rows))


def directions_of(results: Results, items: list[dict]) -> np.ndarray:
    """The indented directions (n, 3) of grains in the region of distinct directions."""
    return representative(
        results.symmetry,
        indentation_direction(np.array([item["euler_deg"] for item in items]).reshape(-1, 3)),
    )


def labelled(kind: str, directions: np.ndarray, *columns: Any) -> list[list]:
    """Rows of a table: kind, direction, and values."""
    return [[kind, *values] for values in np.column_stack([directions, *columns]).tolist()]


def is_arc(directions: np.ndarray) -> bool:
    """Whether the region of directions is an arc, over which only the declination varies."""
    return bool(np.ptp(directions[:, 1]) < 1e-9)


def declination(directions: np.ndarray) -> np.ndarray:
    """Angle (n,) to the c axis in degrees."""
    return euler_of(directions)[:, 1]


def stereographic(directions: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """The stereographic projection of directions (n, 3) of the upper half-space."""
    x, y, z = directions.T
    return x / (1 + z), y / (1 + z)


def draw_map(
    axes: Any,
    directions: np.ndarray,
    values: np.ndarray,
    label: str,
    four: bool,
    **ends: float,
) -> None:
    """Draw values over a region of directions, with its outline and the names of its corners.

    `four`: whether the names have four indices. `ends`: vmin and vmax of the colours.
    """
    x, y = stereographic(directions)
    triangles = Triangulation(x, y)
    image = axes.tripcolor(triangles, values, shading="gouraud", rasterized=True, **ends)
    axes.figure.colorbar(image, ax=axes, label=label, shrink=0.85)
    places, centre = np.column_stack([x, y]), np.array([x.mean(), y.mean()])
    # The outline consists of sides without a neighbour. (Importing SciPy's hull takes half a
    # second.)
    row, side = np.nonzero(triangles.neighbors < 0)
    outline = triangles.triangles[row, [side, (side + 1) % 3]].T
    axes.add_collection(
        LineCollection(places[outline], colors=BLACK, linewidths=1, capstyle="round")
    )
    for indices in CORNERS:
        near = np.flatnonzero(directions @ np.array(indices) / np.linalg.norm(indices) > 1 - 1e-9)
        if len(near) and near[0] in outline:
            place = places[near[0]]
            offset = 18 * (place - centre) / np.linalg.norm(place - centre)
            axes.annotate(
                direction_name(indices, four),
                place,
                offset,
                textcoords="offset points",
                ha="center",
                va="center",
                annotation_clip=False,
            )
    axes.set(aspect="equal")
    axes.margins(0.08)
    axes.axis("off")
