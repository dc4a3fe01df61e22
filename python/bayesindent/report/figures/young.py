"""Young's modulus of the crystal over its directions, as a surface."""

from typing import Any

import matplotlib as mpl
import numpy as np
from matplotlib.figure import Figure
from mpl_toolkits.mplot3d.art3d import Poly3DCollection

from ..results import Results, present
from .style import Picture, panels

#: Draws of the posterior, and steps of declination; of azimuth twice as many.
DRAWS, STEPS = 100, 32


def youngs_modulus(stiffness: np.ndarray, directions: np.ndarray) -> np.ndarray:
    """Young's modulus (m, n) in GPa of crystals (m, 6, 6) in GPa along unit vectors (n, 3) in
    crystal axes.
    """
    x, y, z = directions.T
    stress = np.stack([x * x, y * y, z * z, y * z, x * z, x * y], axis=-1)
    return 1 / np.einsum("ni,mij,nj->mn", stress, np.linalg.inv(stiffness), stress, optimize=True)


def young_surface(results: Results) -> Picture:
    """A surface whose radius is the mean Young's modulus; its colour is the mean, or the sd."""
    present(results.samples)
    declination, azimuth = np.meshgrid(
        np.linspace(0, np.pi, STEPS + 1), np.linspace(0, 2 * np.pi, 2 * STEPS + 1), indexing="ij"
    )
    directions = np.stack(
        [
            np.sin(declination) * np.cos(azimuth),
            np.sin(declination) * np.sin(azimuth),
            np.cos(declination),
        ],
        axis=-1,
    )
    young = youngs_modulus(results.draws(DRAWS), directions.reshape(-1, 3))
    mean, share = (
        values.reshape(declination.shape)
        for values in (young.mean(axis=0), 100 * young.std(axis=0) / young.mean(axis=0))
    )
    figure, places = panels(3.5, 1, 2, subplot_kw={"projection": "3d"})
    for axes, values, label in zip(
        places, (mean, share), ("Young's modulus (GPa)", "sd of Young's modulus (%)")
    ):
        draw(figure, axes, directions * mean[..., None], values, label)
    rows = np.column_stack([directions.reshape(-1, 3), mean.ravel(), share.ravel()]).tolist()
    return Picture(
        figure,
        f"Young's modulus over the directions of the crystal, from {mean.min():.0f} to "
        f"{mean.max():.0f} GPa in the mean of the posterior: the distance of the surface from the "
        "centre. Colour: on the left the same, on the right its sd, at most "
        f"{share.max():.1f} %. The axes are those of the crystal.",
        (["crystal_x", "crystal_y", "crystal_z", "young_gpa", "sd_percent"], rows),
    )


def draw(figure: Figure, axes: Any, surface: np.ndarray, values: np.ndarray, label: str) -> None:
    """Draw a closed surface (a, b, 3) coloured by values (a, b), with a colour bar."""
    norm = mpl.colors.Normalize(values.min(), max(values.max(), values.min() * (1 + 1e-6)))
    centre = (values[:-1, :-1] + values[1:, :-1] + values[:-1, 1:] + values[1:, 1:]) / 4
    corners = np.stack(
        [surface[:-1, :-1], surface[:-1, 1:], surface[1:, 1:], surface[1:, :-1]], axis=2
    ).reshape(-1, 4, 3)
    # `plot_surface` would convert colours one by one.
    colours = mpl.colormaps["cividis"](norm(centre)).reshape(-1, 4)
    axes.add_collection3d(
        Poly3DCollection(
            corners, facecolors=colours, edgecolors=(0, 0, 0, 0.3), linewidths=0.15, rasterized=True
        )
    )
    extent = np.abs(surface).max()
    axes.set(xlim=(-extent, extent), ylim=(-extent, extent), zlim=(-extent, extent))
    axes.set_box_aspect((1, 1, 1), zoom=1.1)
    axes.view_init(elev=24, azim=35)
    axes.set_axis_off()
    half = len(surface) // 2
    for place, name in zip((surface[half, 0], surface[half, half], surface[0, 0]), "xyz"):
        end = 1.3 * extent * place / np.linalg.norm(place)
        axes.plot(*np.stack([place, end]).T, color="0.35", lw=0.8)
        axes.text(*(1.1 * end), name, ha="center", va="center")
    figure.colorbar(
        mpl.cm.ScalarMappable(norm, "cividis"), ax=axes, label=label, shrink=0.75, pad=0.0
    )
