"""The figures of the report: each function takes plain data and returns a matplotlib figure."""

from collections.abc import Callable, Sequence
from contextlib import contextmanager

import matplotlib as mpl
import numpy as np
from matplotlib.figure import Figure
from mpl_toolkits import mplot3d

__all__ = [
    "coefficients",
    "contraction",
    "curve_over_declination",
    "grain_comparison",
    "house_style",
    "learning_curve",
    "load_depth",
    "marginals",
    "mesh_picture",
    "modulus_against_theory",
    "modulus_over_declination",
    "modulus_over_triangle",
    "next_grains",
    "pairs",
    "parity",
    "stamp_synthetic",
    "traces",
    "truncations",
]

# The palette of Okabe and Ito, which colour-blind readers can tell apart.
BLACK, ORANGE, SKY, GREEN, YELLOW, BLUE, RED, PURPLE = (
    "#000000",
    "#E69F00",
    "#56B4E9",
    "#009E73",
    "#F0E442",
    "#0072B2",
    "#D55E00",
    "#CC79A7",
)
CYCLE = (BLUE, ORANGE, GREEN, RED, PURPLE, SKY, BLACK)
MARKERS = "osD^vP*"

STYLE = {
    "axes.axisbelow": True,
    "axes.grid": True,
    "axes.prop_cycle": mpl.cycler(color=CYCLE),
    "axes.spines.right": False,
    "axes.spines.top": False,
    "axes.titlesize": 10,
    "figure.constrained_layout.use": True,
    "font.size": 9,
    "grid.color": "#e4e4e4",
    "grid.linewidth": 0.6,
    "image.cmap": "cividis",
    "legend.frameon": False,
    "lines.linewidth": 1.4,
    "savefig.dpi": 160,
}
#: Nodes of a brick's faces, in Abaqus' order of nodes.
BRICK_FACES = ([0, 1, 2, 3], [4, 5, 6, 7], [0, 1, 5, 4], [1, 2, 6, 5], [2, 3, 7, 6], [3, 0, 4, 7])

#: More points than that are drawn small.
MANY = 400

#: Width of a figure in inches.
WIDTH = 7.0


@contextmanager
def house_style():
    """Draw in one style, whatever the user's configuration is."""
    with mpl.rc_context({**mpl.rcParamsDefault, "backend": "agg", **STYLE}):
        yield


def stamp_synthetic(figure: Figure) -> None:
    """Mark a figure that rests on made-up data."""
    figure.get_layout_engine().set(rect=(0, 0, 1, 0.94))
    figure.text(0.995, 0.985, "SYNTHETIC DATA", ha="right", va="top", color=RED, weight="bold", size=9)


def load_depth(results: Sequence[dict], radius_um: float, shown: int = 6) -> Figure:
    """Force against depth^1.5 of simulated indentations, with the fits through the origin that give the moduli."""
    figure = Figure(figsize=(WIDTH, 3.8))
    axes = figure.subplots()
    chosen = [results[i] for i in np.unique(np.linspace(0, len(results) - 1, min(shown, len(results))).round().astype(int))]
    for result, colour, marker in zip(chosen, CYCLE, MARKERS):
        x = (1e3 * np.asarray(result["depth_um"])) ** 1.5
        end = np.array([0.0, x.max()])
        modulus = result["indentation_modulus_gpa"]
        axes.plot(end, 4 / 3 * modulus * np.sqrt(radius_um) * end / 1e3**1.5, color=colour, lw=1)
        label = f"{orientation(result['euler_deg'])}: {modulus:.1f} GPa"
        axes.plot(x, result["force_mn"], marker, color=colour, ms=4.5, label=label)
    axes.set(xlabel="depth to the power 1.5, h$^{1.5}$ (nm$^{1.5}$)", ylabel="force P (mN)", xlim=(0, None), ylim=(0, None))
    axes.legend(title="(φ₁, Φ, φ₂): modulus", loc="upper left")
    return figure


def modulus_over_declination(declination_deg, simulated: dict[str, Sequence], theory) -> Figure:
    """Moduli of one crystal simulated on one mesh or two and the exact theory over the declination Φ, with the differences."""
    order = np.argsort(declination_deg)
    angle, theory = (np.asarray(values, dtype=float)[order] for values in (declination_deg, theory))
    figure = Figure(figsize=(WIDTH, 4.4))
    top, bottom = figure.subplots(2, 1, sharex=True, height_ratios=(2.5, 1))
    top.plot(angle, theory, color=BLACK, label="half-space theory")
    bottom.axhline(0, color=BLACK, lw=0.8)
    differences = []
    for (mesh, values), color, marker in zip(simulated.items(), (BLUE, ORANGE), "os", strict=False):
        moduli = np.asarray(values, dtype=float)[order]
        top.plot(angle, moduli, marker, color=color, label=f"finite elements, {mesh} mesh")
        differences.append(100 * (moduli / theory - 1))
        bottom.plot(angle, differences[-1], f"{marker}-", color=color, lw=0.8)
    room_about_zero(bottom, np.concatenate(differences))
    top.set_ylabel("indentation modulus (GPa)")
    top.legend()
    bottom.set(xlabel="declination Φ (degrees)", ylabel="difference (%)")
    return figure


def modulus_against_theory(simulated, theory) -> Figure:
    """Simulated moduli of various crystals against the exact theory."""
    simulated, theory = np.asarray(simulated), np.asarray(theory)
    figure = Figure(figsize=(WIDTH, 3.4))
    left, right = figure.subplots(1, 2)
    diagonal(left, simulated, theory)
    left.plot(theory, simulated, "o", color=BLUE, ms=4)
    left.set(xlabel="half-space theory (GPa)", ylabel="finite elements (GPa)")
    difference = 100 * (simulated / theory - 1)
    right.axhline(0, color=BLACK, lw=0.8)
    right.plot(theory, difference, "o", color=BLUE, ms=4)
    right.set(xlabel="half-space theory (GPa)", ylabel="difference (%)")
    room_about_zero(right, difference)
    return figure


def mesh_picture(nodes, bricks, contact_nodes, contact_radius_um: float) -> Figure:
    """The mesh with a quarter cut away, and its surface under the indenter with the nodes that may touch.

    nodes (n, 3) in µm; bricks (e, 8), numbers of nodes from 0; contact_nodes from 0; contact radius at the last depth in µm.
    """
    centre = nodes[bricks].mean(axis=1)
    kept = bricks[(centre[:, 0] < 0) | (centre[:, 1] > 0)]
    figure = Figure(figsize=(WIDTH, 3.5))
    left = figure.add_subplot(1, 2, 1, projection="3d", computed_zorder=False)
    polygons = nodes[outer_faces(kept)]
    normal = np.cross(polygons[:, 2] - polygons[:, 0], polygons[:, 3] - polygons[:, 1])
    shade = np.abs(normal @ [0.25, -0.45, 0.85]) / np.linalg.norm(normal, axis=1)
    colours = np.repeat((0.55 + 0.45 * shade)[:, None], 3, axis=1)
    left.add_collection3d(mplot3d.art3d.Poly3DCollection(polygons, facecolors=colours, edgecolors="#333333", linewidths=0.12))
    low, high = nodes.min(axis=0), nodes.max(axis=0)
    left.set(xlim=(low[0], high[0]), ylim=(low[1], high[1]), zlim=(low[2], high[2]))
    left.set_box_aspect(high - low, zoom=0.98)
    left.view_init(elev=28, azim=-50)
    left.set_axis_off()
    size = high - low
    left.set_title(f"{size[0]:.3g} × {size[1]:.3g} × {size[2]:.3g} µm, {len(bricks)} bricks\na quarter is cut away")
    right = figure.add_subplot(1, 2, 2)
    faces = outer_faces(bricks)
    surface = nodes[faces[np.all(np.abs(nodes[faces][:, :, 2]) < 1e-9, axis=1)]][:, :, :2]
    right.add_collection(mpl.collections.PolyCollection(surface, facecolors="none", edgecolors="#777777", linewidths=0.4))
    right.plot(*nodes[contact_nodes][:, :2].T, ".", color=ORANGE, ms=2.5, label="may touch")
    circle = np.linspace(0, 2 * np.pi, 200)
    right.plot(contact_radius_um * np.cos(circle), contact_radius_um * np.sin(circle), color=BLUE, label="contact at the last depth")
    reach = 1.6 * max(contact_radius_um, np.abs(nodes[contact_nodes][:, :2]).max())
    right.set(
        xlim=(-reach, reach), ylim=(-reach, reach), aspect="equal", xlabel="x (µm)", ylabel="y (µm)", title="the surface under the indenter"
    )
    right.grid(False)
    figure.legend(loc="outside lower right", ncols=2)
    return figure


def outer_faces(bricks) -> np.ndarray:
    """Faces (f, 4) that belong to one brick only."""
    faces = np.concatenate([bricks[:, face] for face in BRICK_FACES])
    _, first, count = np.unique(np.sort(faces, axis=1), axis=0, return_index=True, return_counts=True)
    return faces[first[count == 1]]


def learning_curve(series: dict[str, tuple[Sequence, Sequence]], baselines: dict[str, float]) -> Figure:
    """Error against the number of simulations; `series` maps a label to counts and errors in GPa, `baselines` to one error."""
    figure = Figure(figsize=(WIDTH, 3.4))
    axes = figure.subplots()
    for (label, (count, error)), colour, marker in zip(series.items(), CYCLE, MARKERS):
        axes.plot(count, error, marker=marker, ms=3.5, lw=1, color=colour, label=label)
    for (label, error), dash in zip(baselines.items(), (":", "--")):
        axes.axhline(error, color=BLACK, lw=1, ls=dash, label=label)
    axes.set(xlabel="simulations", ylabel="mean absolute error (GPa)", yscale="log")
    plain_log_ticks(axes.yaxis)
    figure.legend(loc="outside upper left", ncols=2)
    return figure


def truncations(scan: Sequence[dict]) -> Figure:
    """Leave-one-out error against the number of simulations: a colour for each degree, a marker for each bandlimit."""
    figure = Figure(figsize=(WIDTH, 3.4))
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
    figure.legend(loc="outside right upper")
    return figure


def parity(simulated, predicted, sd) -> Figure:
    """Predicted against simulated moduli with one sd, and the residuals in units of the sd."""
    simulated, predicted, sd = (np.asarray(values, dtype=float) for values in (simulated, predicted, sd))
    figure = Figure(figsize=(WIDTH, 3.4))
    left, right = figure.subplots(1, 2)
    diagonal(left, simulated, predicted)
    many = len(simulated) > MANY
    size, colour = (1.5, SKY) if many else (3.5, BLUE)
    left.errorbar(simulated, predicted, sd, fmt="o", ms=size, lw=0.4 if many else 0.8, color=BLUE, ecolor=colour)
    left.set(xlabel="simulated modulus (GPa)", ylabel="predicted modulus (GPa)")
    right.axhspan(-2, 2, color=SKY, alpha=0.2, lw=0)
    right.axhspan(-1, 1, color=SKY, alpha=0.3, lw=0)
    right.axhline(0, color=BLACK, lw=0.8)
    right.plot(simulated, (predicted - simulated) / sd, "o", ms=size, color=BLUE)
    right.set(xlabel="simulated modulus (GPa)", ylabel="(predicted - simulated) / sd")
    return figure


def coefficients(count, norm, angle_deg) -> Figure:
    """Norm of the coefficient vector, and the angle through which each update turned it."""
    figure = Figure(figsize=(WIDTH, 3.0))
    left, right = figure.subplots(1, 2)
    left.plot(count, norm, color=BLUE)
    left.set(xlabel="simulations", ylabel="norm of the coefficients")
    right.plot(count, angle_deg, color=BLUE)
    right.set(xlabel="simulations", ylabel="turn since the last update (degrees)", yscale="log")
    return figure


def marginals(samples: dict[str, np.ndarray], most_probable: dict[str, float], bounds: dict[str, tuple[float, float]]) -> Figure:
    """Marginal distribution of each constant, with mean, sd, most probable value, and the bounds of the prior where near."""
    names = list(samples)
    columns = min(3, len(names))
    rows = -(-len(names) // columns)
    figure = Figure(figsize=(WIDTH, 2.5 * rows))
    for axes, name in zip(grid(figure, rows, columns, len(names)), names):
        values = samples[name].ravel()
        mean, sd = values.mean(), values.std()
        axes.hist(values, bins=48, density=True, color=SKY, alpha=0.7, lw=0)
        axes.axvline(mean, color=BLUE, label="mean")
        axes.axvline(most_probable[name], color=RED, ls="--", label="most probable")
        low, high = axes.get_xlim()
        for bound in bounds.get(name, ()):
            if low - 0.1 * (high - low) <= bound <= high + 0.1 * (high - low):
                axes.axvline(bound, color=BLACK, lw=2.5, label="bound of the prior")
        axes.set(xlabel=f"{subscript(name)} (GPa)", yticks=[], title=f"{mean:.1f} ± {sd:.1f} GPa")
        axes.grid(False)
        axes.spines["left"].set_visible(False)
    unique_legend(figure)
    return figure


def pairs(samples: dict[str, np.ndarray], points: int = 3000) -> Figure:
    """Every pair of constants: points of the posterior, which show its ridges, with the correlation in the other half."""
    names = list(samples)
    table = np.stack([samples[name].ravel() for name in names])
    correlation = np.corrcoef(table)
    table = table[:, :: max(1, table.shape[1] // points)]
    count = len(names)
    figure = Figure(figsize=(WIDTH, WIDTH * 0.92))
    axes = figure.subplots(count, count, squeeze=False)
    for i, j in np.ndindex(count, count):
        cell = axes[i, j]
        cell.grid(False)
        if i < j:
            cell.axis("off")
            cell.text(0.5, 0.5, f"{correlation[i, j]:+.2f}", ha="center", va="center", size=11, color="#555555", transform=cell.transAxes)
        elif i == j:
            cell.hist(table[i], bins=36, color=SKY, alpha=0.7, lw=0)
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
    return figure


def grain_comparison(predicted: Sequence[dict], unit: str) -> Figure:
    """Measured moduli, grain by grain, beside what the posterior predicts."""
    order = np.argsort([item["mean"] for item in predicted])
    mean = np.array([predicted[i]["mean"] for i in order])
    sd = np.array([predicted[i]["sd"] for i in order])
    measured = np.array([predicted[i]["measured"] for i in order])
    error = [predicted[i].get("measured_sd") or 0.0 for i in order]
    place = np.arange(len(order))
    figure = Figure(figsize=(WIDTH, 3.4))
    axes = figure.subplots()
    axes.errorbar(place, mean, 2 * sd, fmt="none", ecolor=SKY, elinewidth=9 if len(order) <= 20 else 4, label="predicted, ± 2 sd")
    axes.plot(place, mean, "_", color=BLUE, ms=9 if len(order) <= 20 else 4, mew=1.8, label="predicted, mean")
    axes.errorbar(place, measured, error, fmt="o", ms=4, lw=1, color=BLACK, label="measured, ± sd")
    axes.set(ylabel=f"{unit} (GPa)", xlabel="grain (row of the measurements)")
    step = -(-len(order) // 25)
    axes.set_xticks(place[::step], [str(i + 1) for i in order[::step]])
    axes.grid(axis="x")
    axes.legend(loc="upper left", ncols=3, bbox_to_anchor=(0, 1.12))
    return figure


def modulus_over_triangle(predict: Callable, euler_deg, measured, unit: str) -> Figure:
    """Mean and sd of the modulus over the standard triangle of a cubic crystal, with the grains that were measured.

    `predict(euler_deg (n, 3))` gives mean and sd in GPa.
    """
    x, y, triangle, angles = triangle_mesh()
    mean, sd = predict(angles)
    px, py = inverse_pole(euler_deg)
    figure = Figure(figsize=(WIDTH, 3.2))
    left, right = figure.subplots(1, 2)
    measured = np.asarray(measured, dtype=float)
    low, high = min(mean.min(), measured.min()), max(mean.max(), measured.max())
    for axes, values, limits, title in ((left, mean, (low, high), "mean"), (right, sd, (None, None), "sd")):
        image = axes.tripcolor(x, y, triangle, values, shading="gouraud", vmin=limits[0], vmax=limits[1], rasterized=True)
        figure.colorbar(image, ax=axes, label=f"{title} of {unit} (GPa)", shrink=0.85)
        triangle_frame(axes)
    left.scatter(px, py, c=measured, vmin=low, vmax=high, edgecolors="white", s=38, linewidths=1.2, zorder=3)
    right.plot(px, py, "o", color="white", mec=BLACK, ms=4, mew=0.8)
    return figure


def curve_over_declination(predict: Callable, euler_deg, measured, measured_sd, unit: str) -> Figure:
    """Posterior of the modulus of a hexagonal crystal over the declination of its axis, with the grains that were measured."""
    angle = np.linspace(0, 90, 46)
    mean, sd = predict(np.stack([np.zeros_like(angle), angle, np.zeros_like(angle)], axis=1))
    declination = folded(euler_deg)
    figure = Figure(figsize=(WIDTH, 3.4))
    axes = figure.subplots()
    axes.fill_between(angle, mean - 2 * sd, mean + 2 * sd, color=SKY, alpha=0.4, lw=0, label="predicted, ± 2 sd")
    axes.plot(angle, mean, color=BLUE, label="predicted, mean")
    axes.errorbar(declination, measured, measured_sd, fmt="o", ms=3.5, lw=0.8, color=BLACK, label="measured, ± sd")
    axes.set(xlabel="declination of the c axis (degrees)", ylabel=f"{unit} (GPa)", xlim=(-2, 92))
    axes.legend()
    return figure


def traces(samples: dict[str, np.ndarray]) -> Figure:
    """Chains (chain, sample) of each constant."""
    figure = Figure(figsize=(WIDTH, 1.25 * len(samples) + 0.4))
    rows = figure.subplots(len(samples), 1, sharex=True, squeeze=False)[:, 0]
    for axes, (name, chains) in zip(rows, samples.items()):
        step = max(1, chains.shape[1] // 1500)
        for chain, colour in zip(chains, np.resize(CYCLE, len(chains))):
            axes.plot(np.arange(0, chain.size, step), chain[::step], lw=0.4, alpha=0.8, color=colour, rasterized=True)
        axes.set_ylabel(f"{subscript(name)} (GPa)")
    rows[-1].set_xlabel("sample of the chain")
    figure.align_ylabels(rows)
    return figure


def contraction(labels: Sequence[str], shares: Sequence[float], combinations: int) -> Figure:
    """Share of the prior's variance that the data removed: of combinations of the constants, which come first, and of quantities."""
    shares = np.clip(np.asarray(shares, dtype=float), 0, 1)
    place = -np.arange(len(labels)) - 0.6 * (np.arange(len(labels)) >= combinations)
    figure = Figure(figsize=(WIDTH, 0.27 * len(labels) + 1.1))
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
    return figure


def next_grains(suggestions: Sequence[dict], cubic: bool, measured_euler: Sequence, candidates: Sequence[dict]) -> Figure:
    """Gain expected of one more grain over all orientations, and the orientations that are suggested, by rank.

    Over the standard triangle (cubic) or the declination of the c axis (hexagonal).
    """
    angles = np.array([item["euler_deg"] for item in suggestions])
    gain = np.array([item["gain"] for item in suggestions])
    everywhere = np.array([item["euler_deg"] for item in candidates]).reshape(-1, 3)
    field = np.array([item["gain"] for item in candidates])
    measured = np.array(measured_euler, dtype=float).reshape(-1, 3)
    figure = Figure(figsize=(WIDTH, 3.6 if cubic else 3.0))
    axes = figure.subplots()
    if cubic:
        triangle_frame(axes)
        if len(field) > 2:
            image = axes.tripcolor(*inverse_pole(everywhere), field, shading="gouraud", rasterized=True)
            figure.colorbar(image, ax=axes, label="gain expected of the next grain", shrink=0.8)
        axes.plot(*inverse_pole(measured), "x", color="white", ms=5, mew=1.6)
        axes.plot(*inverse_pole(measured), "x", color=BLACK, ms=5, mew=0.9, label="measured")
        places = np.stack(inverse_pole(angles), axis=1)
        axes.plot(*places.T, "o", color="white", mec=BLACK, ms=11, clip_on=False, label="suggested, by rank")
    else:
        if len(field):
            axes.plot(folded(everywhere), field, ".", color=SKY, ms=4, label="gain expected of the next grain")
        axes.plot(folded(measured), np.zeros(len(measured)), "x", color=BLACK, ms=5, label="measured", clip_on=False)
        places = np.stack([folded(angles), gain], axis=1)
        axes.plot(*places.T, "o", color="white", mec=BLACK, ms=11, label="suggested, by rank")
        axes.set(xlabel="declination of the c axis (degrees)", ylabel="expected gain", xlim=(-3, 93), ylim=(0, None))
    for rank, place in enumerate(places, start=1):
        axes.annotate(str(rank), place, ha="center", va="center_baseline", size=7.5)
    axes.legend(loc="upper left") if cubic else figure.legend(loc="outside upper left", ncols=3)
    return figure


def folded(euler_deg) -> np.ndarray:
    """Declination of an axis without a sense, 0..90 degrees."""
    declination = np.asarray(euler_deg)[:, 1]
    return np.minimum(declination, 180 - declination)


def product_of_powers(exponents: dict[str, float]) -> str:
    """A product of powers of constants for matplotlib; powers that hardly count are left out."""
    kept = {name: power for name, power in exponents.items() if abs(power) >= 0.05}
    factors = [f"C_{{{name[1:]}}}" + ("" if abs(power - 1) < 0.005 else f"^{{{power:.2f}}}") for name, power in kept.items()]
    return "$" + r"\,".join(factors) + "$"


def orientation(euler_deg) -> str:
    """Angles in words."""
    return "(" + ", ".join(f"{angle:g}" for angle in np.round(euler_deg, 1)) + ")°"


def subscript(name: str) -> str:
    """C11 as C with a subscript."""
    return f"C$_{{{name[1:]}}}$" if name[:1] == "C" and name[1:].isdigit() else name


def inverse_pole(euler_deg) -> tuple[np.ndarray, np.ndarray]:
    """Stereographic place in the standard triangle of the indentation direction of cubic crystals at Bunge angles (n, 3)."""
    _, declination, phi2 = np.radians(np.asarray(euler_deg, dtype=float)).T
    direction = np.stack([np.sin(phi2) * np.sin(declination), np.cos(phi2) * np.sin(declination), np.cos(declination)])
    least, middle, most = np.sort(np.abs(direction), axis=0)
    return middle / (1 + most), least / (1 + most)


def triangle_mesh(divisions: int = 24):
    """Places in the standard triangle, their triangulation, and Bunge angles that bring each to the indenter."""
    corners = np.array([[0, 0, 1], [0, np.sqrt(0.5), np.sqrt(0.5)], np.full(3, np.sqrt(1 / 3))])
    weights = [(i, j, divisions - i - j) for i in range(divisions + 1) for j in range(divisions + 1 - i)]
    direction = np.array(weights) @ corners
    direction /= np.linalg.norm(direction, axis=1, keepdims=True)
    number = {weight: index for index, weight in enumerate(weights)}
    triangles = []
    for i, j, k in weights:
        if k > 0:
            triangles.append([number[i, j, k], number[i + 1, j, k - 1], number[i, j + 1, k - 1]])
        if k > 1:
            triangles.append([number[i + 1, j, k - 1], number[i + 1, j + 1, k - 2], number[i, j + 1, k - 1]])
    declination = np.degrees(np.arccos(np.clip(direction[:, 2], -1, 1)))
    phi2 = np.degrees(np.arctan2(direction[:, 0], direction[:, 1]))
    angles = np.stack([np.zeros_like(phi2), declination, phi2], axis=1)
    return (*inverse_pole(angles), np.array(triangles), angles)


def triangle_frame(axes) -> None:
    """Edges and corners of the standard triangle."""
    side = np.linspace(0, 1, 40)[:, None]
    corners = np.array([[0, 0, 1], [0, 1, 1], [1, 1, 1]])
    path = np.concatenate([(1 - side) * corners[i] + side * corners[(i + 1) % 3] for i in range(3)])
    path = path / np.linalg.norm(path, axis=1, keepdims=True)
    axes.plot(path[:, 1] / (1 + path[:, 2]), path[:, 0] / (1 + path[:, 2]), color=BLACK, lw=1)
    for label, place, align in (("001", (0, -0.01), "left"), ("101", (0.414, -0.01), "right"), ("111", (0.366, 0.376), "center")):
        axes.text(*place, label, ha=align, va="bottom" if label == "111" else "top")
    axes.set(aspect="equal", xlim=(-0.02, 0.44), ylim=(-0.04, 0.41))
    axes.axis("off")


def grid(figure: Figure, rows: int, columns: int, count: int) -> list:
    """The first `count` axes of a grid; the others are removed."""
    axes = figure.subplots(rows, columns, squeeze=False).ravel()
    for spare in axes[count:]:
        spare.remove()
    return list(axes[:count])


def diagonal(axes, x, y) -> None:
    """The line of equality, over the range of the data."""
    low, high = min(np.min(x), np.min(y)), max(np.max(x), np.max(y))
    axes.plot([low, high], [low, high], color=BLACK, lw=0.8)


def room_about_zero(axes, values) -> None:
    """Limits that show zero and all values."""
    limit = 1.25 * max(np.max(np.abs(values)), 0.1)
    axes.set_ylim(min(-0.25 * limit, 1.25 * np.min(values)), max(0.25 * limit, 1.25 * np.max(values)))


def plain_log_ticks(axis) -> None:
    """Numbers such as 0.5 on a logarithmic axis, not powers."""
    axis.set_major_locator(mpl.ticker.LogLocator(subs=(1, 2, 5)))
    axis.set_major_formatter(mpl.ticker.FormatStrFormatter("%g"))
    axis.set_minor_formatter(mpl.ticker.NullFormatter())


def unique_legend(figure: Figure) -> None:
    """One legend above all axes."""
    entries = {}
    for axes in figure.axes:
        for handle, label in zip(*axes.get_legend_handles_labels()):
            entries.setdefault(label, handle)
    figure.legend(entries.values(), entries.keys(), loc="outside upper left", ncols=len(entries))
