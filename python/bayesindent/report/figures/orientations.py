"""The modulus, and the gain of one more grain, over the distinct directions of the crystal."""

from itertools import product
from typing import Any

import numpy as np
from matplotlib.collections import LineCollection
from matplotlib.tri import Triangulation

from ...core import cores
from ...crystal.directions import (
    euler_of,
    indentation_direction,
    representative,
    spread_of_directions,
)
from ..formatting import direction_name, has_four_indices
from ..results import NothingToShow, Results, present
from .style import BLACK, Picture, legend_above, panels

#: Draws of the posterior for which the surrogate predicts moduli.
DRAWS = 100


def orientations(results: Results) -> Picture:
    """Posterior of the modulus over all directions, with the measured grains."""
    present(results.samples)
    grains, surrogate = results.predicted, results.surrogate
    if surrogate is None or any("euler_deg" not in item for item in grains):
        raise NothingToShow
    lattice, directions = spread_of_directions(results.symmetry), directions_of(results, grains)
    crystals, threads = results.draws(DRAWS)[:, None], cores()
    modulus = results.as_measured(
        surrogate.predict(crystals, euler_of(lattice), threads=threads)[0]
    )
    mean, sd = modulus.mean(axis=0), modulus.std(axis=0)
    factor = results.shared_factor
    measured = np.array([(item.get("measured") or 0.0) / factor for item in grains])
    error = [(item.get("measured_sd") or 0.0) / factor for item in grains]
    figure, (left, right) = panels(3.2, 1, 2)
    ends = {"vmin": min([mean.min(), *measured]), "vmax": max([mean.max(), *measured])}
    draw_values(results, left, lattice, mean, f"mean of {results.kind} (GPa)", **ends)
    draw_values(results, right, lattice, sd, f"sd of {results.kind} (GPa)")
    discs = {"edgecolors": BLACK, "s": 32, "zorder": 3}
    left.scatter(*places_of(results, directions, measured), c=measured, **ends, **discs)
    right.scatter(*places_of(results, directions, 0 * measured), c="white", **discs)
    rows = [["predicted", *row] for row in np.column_stack([lattice, mean, sd]).tolist()]
    points = np.column_stack([directions, measured, error])
    rows += [["measured", *row] for row in points.tolist()]
    told = " Discs are the measured grains, on the left by their measured value."
    if factor != 1.0:
        told = f"{told[:-1]} over {factor:.3g}, the factor that all share."
    return Picture(
        figure,
        "Posterior mean and sd of the modulus over the crystal directions that differ"
        + (f".{told}" if grains else "; no modulus was measured."),
        (["kind", "crystal_x", "crystal_y", "crystal_z", "mean_gpa", "sd_gpa"], rows),
    )


def next_grains(results: Results) -> Picture:
    """Expected gain of one more grain over all directions, and suggestions by rank."""
    document = present(results.documents["next"])
    suggestions = document["suggestions"]
    candidates = [item for item in document["candidates"] if "propagation_deg" not in item]
    suggested, everywhere = directions_of(results, suggestions), directions_of(results, candidates)
    measured = directions_of(
        results, [item for item in results.predicted + results.velocities if "euler_deg" in item]
    )
    figure, axes = panels(3.6)
    gain = np.array([item["gain"] for item in candidates])
    draw_values(results, axes, everywhere, gain, f"expected gain ({document.get('unit', '1')})")
    crosses = places_of(results, measured, np.zeros(len(measured)))
    axes.plot(*crosses, "x", color="0.6", ms=5, label="measured")
    places = places_of(results, suggested, np.array([item["gain"] for item in suggestions]))
    discs = {"color": "white", "mec": BLACK, "ms": 12, "clip_on": False, "zorder": 3}
    axes.plot(*places, "o", label="suggested, by rank", **discs)
    for rank, place in enumerate(zip(*places), start=1):
        axes.annotate(str(rank), place, ha="center", va="center_baseline", size=8.5, zorder=4)
    legend_above(figure)
    speeds = " A speed is drawn at the normal of its grain." * any(
        "propagation_deg" in item for item in suggestions
    )
    return Picture(
        figure,
        f"The {len(suggested)} orientations that are expected to bring most information, ranked, "
        f"among the crystal directions that differ. Each is chosen given those before it.{speeds}",
    )


def directions_of(results: Results, items: list[dict]) -> np.ndarray:
    """The indented directions (n, 3) of grains in the region of distinct directions."""
    return representative(
        results.symmetry,
        indentation_direction(np.array([item["euler_deg"] for item in items]).reshape(-1, 3)),
    )


def is_arc(results: Results) -> bool:
    """Whether distinct directions lie on an arc, over which only the declination varies."""
    return bool(np.ptp(spread_of_directions(results.symmetry)[:, 1]) < 1e-9)


def places_of(results: Results, directions: np.ndarray, values: np.ndarray) -> list[np.ndarray]:
    """Where values (n,) of directions (n, 3) are drawn: over the angle to the c axis in degrees, or
    in the stereographic projection of the upper half-space.
    """
    if is_arc(results):
        return [euler_of(directions)[:, 1], values]
    x, y, z = directions.T
    return [x / (1 + z), y / (1 + z)]


def draw_values(
    results: Results,
    axes: Any,
    directions: np.ndarray,
    values: np.ndarray,
    label: str,
    **ends: float,
) -> None:
    """Draw values over the distinct directions: a curve over an arc, or a map with the outline of
    the region and the names of its corners. `ends`: vmin and vmax of its colours.
    """
    x, y = places_of(results, directions, values)
    if is_arc(results):
        order = np.argsort(x)
        axes.plot(x[order], y[order])
        axes.set(xlabel="declination of the c axis (degrees)", ylabel=label)
        return
    triangles = Triangulation(x, y)
    image = axes.tripcolor(triangles, values, shading="gouraud", rasterized=True, **ends)
    axes.figure.colorbar(image, ax=axes, label=label, shrink=0.85)
    places, centre = np.column_stack([x, y]), np.array([x.mean(), y.mean()])
    # The outline consists of sides without a neighbour. (Importing SciPy's hull takes half a
    # second.)
    row, side = np.nonzero(triangles.neighbors < 0)
    outline = triangles.triangles[row, [side, (side + 1) % 3]].T
    axes.add_collection(LineCollection(places[outline], colors=BLACK, linewidths=1))
    for indices in list(product((0, 1, -1), repeat=3))[1:]:
        near = np.flatnonzero(directions @ np.array(indices) / np.linalg.norm(indices) > 1 - 1e-9)
        if len(near) and near[0] in outline:
            place = places[near[0]]
            axes.annotate(
                direction_name(indices, has_four_indices(results.symmetry)),
                place,
                18 * (place - centre) / np.linalg.norm(place - centre),
                textcoords="offset points",
                ha="center",
                va="center",
                annotation_clip=False,
            )
    axes.set(aspect="equal")
    axes.margins(0.08)
    axes.axis("off")
