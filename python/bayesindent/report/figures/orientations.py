"""The modulus, and what one more grain would teach, over all directions that the crystal tells apart."""

import os

import numpy as np

from ...crystal.directions import direction_lattice, euler_of, indentation_direction, representative
from ...crystal.elasticity import stiffness_rows
from .style import BLACK, BLUE, SKY, Picture, new_figure

__all__ = ["next_grains", "orientations"]

#: Draws of the posterior that are carried through the surrogate.
DRAWS = 100

#: Directions that are named where they are corners of the map.
CORNERS = ((0, 0, 1), (1, 0, 1), (1, 1, 1), (1, 0, 0), (1, 1, 0), (0, 1, 0), (0, 1, 1), (-1, 0, 0), (0, -1, 0))


def orientations(results) -> Picture | None:
    """Posterior of the modulus over all directions, with the grains that were measured."""
    grains, surrogate, samples = results.documents["extract"].get("predicted", []), results.surrogate, results.samples
    if surrogate is None or not samples or any("euler_deg" not in item for item in grains):
        return None
    crystals = stiffness_rows(results.symmetry, results.draws(DRAWS))
    lattice = direction_lattice(results.symmetry)
    modulus = results.as_measured(surrogate.predict(crystals[:, None], euler_of(lattice), threads=len(os.sched_getaffinity(0)))[0])
    mean, sd = modulus.mean(axis=0), modulus.std(axis=0)
    directions = representative(results.symmetry, indentation_direction([item["euler_deg"] for item in grains]))
    measured, error = ([item.get(name) or 0.0 for item in grains] for name in ("measured", "measured_sd"))
    if is_arc(lattice):
        figure = new_figure(3.4)
        axes = figure.subplots()
        angle = declination(lattice)
        axes.fill_between(angle, mean - 2 * sd, mean + 2 * sd, color=SKY, alpha=0.4, lw=0, label="predicted, ± 2 sd")
        axes.plot(angle, mean, color=BLUE, label="predicted, mean")
        axes.errorbar(declination(directions), measured, error, fmt="o", ms=3.5, lw=0.8, color=BLACK, label="measured, ± sd")
        axes.set(xlabel="declination of the c axis (degrees)", ylabel=f"{results.kind} (GPa)", xlim=(-2, 92))
        axes.legend()
        words = "Posterior of the modulus over the declination of the c axis, with the measured grains"
        return Picture(figure, f"{words}.", f"{words}.")
    figure = new_figure(3.2)
    left, right = figure.subplots(1, 2)
    limits = min(mean.min(), *measured), max(mean.max(), *measured)
    draw_map(left, lattice, mean, f"mean of {results.kind} (GPa)", *limits)
    draw_map(right, lattice, sd, f"sd of {results.kind} (GPa)")
    x, y = stereographic(directions)
    left.scatter(x, y, c=measured, vmin=limits[0], vmax=limits[1], edgecolors="white", s=38, linewidths=1.2, zorder=3)
    right.plot(x, y, "o", color="white", mec=BLACK, ms=4, mew=0.8)
    words = "Posterior mean and sd of the modulus over the crystal directions that differ; discs are the measured grains"
    header = ["kind", "crystal_x", "crystal_y", "crystal_z", "mean_gpa", "sd_gpa"]
    rows = [["predicted", *direction, *values] for direction, *values in zip(lattice.tolist(), mean.tolist(), sd.tolist())]
    rows += [["measured", *direction, *values] for direction, *values in zip(directions.tolist(), measured, error)]
    return Picture(figure, f"{words}.", f"{words}, on the left in the colour of what was measured.", (header, rows))


def next_grains(results) -> Picture | None:
    """Gain expected of one more grain over all directions, and those that are suggested, by rank."""
    document = results.documents["next"]
    if not document:
        return None

    def directions_of(items) -> np.ndarray:
        angles = np.array([item["euler_deg"] for item in items]).reshape(-1, 3)
        return representative(results.symmetry, indentation_direction(angles))

    suggested, everywhere = directions_of(document["suggestions"]), directions_of(document["candidates"])
    measured = directions_of([item for item in results.documents["extract"].get("predicted", []) if "euler_deg" in item])
    gain = np.array([item["gain"] for item in document["candidates"]])
    arc = is_arc(everywhere)
    figure = new_figure(3.0 if arc else 3.6)
    axes = figure.subplots()
    if arc:
        axes.plot(declination(everywhere), gain, ".", color=SKY, ms=4, label="gain expected of the next grain")
        axes.plot(declination(measured), np.zeros(len(measured)), "x", color=BLACK, ms=5, label="measured", clip_on=False)
        places = np.column_stack([declination(suggested), [item["gain"] for item in document["suggestions"]]])
        axes.set(xlabel="declination of the c axis (degrees)", ylabel="expected gain", xlim=(-3, 93), ylim=(0, None))
    else:
        draw_map(axes, everywhere, gain, "gain expected of the next grain")
        axes.plot(*stereographic(measured), "x", color="white", ms=5, mew=1.6)
        axes.plot(*stereographic(measured), "x", color=BLACK, ms=5, mew=0.9, label="measured")
        places = np.column_stack(stereographic(suggested))
    axes.plot(*places.T, "o", color="white", mec=BLACK, ms=12, clip_on=False, label="suggested, by rank")
    for rank, place in enumerate(places, start=1):
        axes.annotate(str(rank), place, ha="center", va="center_baseline", size=8.5)
    figure.legend(loc="outside upper left", ncols=3)
    return Picture(
        figure,
        f"The {len(suggested)} orientations that one more measurement would teach most at.",
        "Orientations that are expected to teach most, ranked, "
        + ("over the declination of the c axis; " if arc else "among the crystal directions that differ; ")
        + "from the second on each is given those before it, and gains less than it would as the next.",
        (
            ["kind", "crystal_x", "crystal_y", "crystal_z", "gain"],
            [["candidate", *place, value] for place, value in zip(everywhere.tolist(), gain.tolist())]
            + [["suggested", *place, item["gain"]] for place, item in zip(suggested.tolist(), document["suggestions"])],
        ),
    )


def is_arc(directions) -> bool:
    """Whether directions (n, 3) differ in their declination alone."""
    return bool(np.ptp(np.asarray(directions)[:, 1]) < 1e-9)


def declination(directions) -> np.ndarray:
    """Angle (n,) to the c axis in degrees."""
    return np.degrees(np.arccos(np.clip(np.asarray(directions)[:, 2], -1, 1)))


def stereographic(directions) -> tuple[np.ndarray, np.ndarray]:
    """Places of directions (n, 3) of the upper half in the plane."""
    x, y, z = np.asarray(directions).reshape(-1, 3).T
    return x / (1 + z), y / (1 + z)


def draw_map(axes, directions, values, label: str, low=None, high=None) -> None:
    """Values over directions that fill a region, with its outline and the names of its corners."""
    from scipy.spatial import ConvexHull

    x, y = stereographic(directions)
    image = axes.tripcolor(x, y, values, shading="gouraud", vmin=low, vmax=high, rasterized=True)
    axes.figure.colorbar(image, ax=axes, label=label, shrink=0.85)
    outline = ConvexHull(np.column_stack([x, y])).vertices
    axes.plot(x[[*outline, outline[0]]], y[[*outline, outline[0]]], color=BLACK, lw=1)
    centre = np.array([np.mean(x), np.mean(y)])
    for corner in CORNERS:
        direction = np.array(corner) / np.linalg.norm(corner)
        near = np.flatnonzero(directions @ direction > 1 - 1e-9)
        if len(near) and near[0] in outline:
            place = np.array([x[near[0]], y[near[0]]])
            offset = 13 * (place - centre) / np.linalg.norm(place - centre)
            name = "".join(f"{abs(index)}" + ("\u0305" if index < 0 else "") for index in corner)
            axes.annotate(name, place, offset, textcoords="offset points", ha="center", va="center", annotation_clip=False)
    axes.set(aspect="equal")
    axes.margins(0.08)
    axes.axis("off")
