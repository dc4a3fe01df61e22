"""The figures of the report as functions of a result of `bi.extract`, or of a folder."""

from collections.abc import Callable
from typing import Any

from ..core import InputError
from .results import NothingToShow, Results

__all__ = [
    "plot_chains",
    "plot_constants",
    "plot_error_budget",
    "plot_grains",
    "plot_knowledge",
    "plot_orientations",
    "plot_pairs",
    "plot_residuals",
    "plot_shares",
    "plot_young",
]


def plotter(name: str, figure: str, words: str) -> Callable:
    """Make the function `name`, which draws a figure of the report; `words` describe it."""

    def plot(result: Any, ax: Any = None) -> Any:
        # Imported here, since importing matplotlib takes long. Notebooks show figures if pyplot is
        # imported.
        import matplotlib.pyplot  # noqa: F401

        from .figures import FIGURES, style

        draw = next(function for _, function in FIGURES if function.__name__ == figure)
        place = None
        if ax is not None:
            if ax.get_subplotspec() is None:
                raise InputError(f"bi.{name}: ax is not part of a grid; take one of plt.subplots")
            place = ax.figure.add_subfigure(ax.get_subplotspec())
            ax.remove()
        token = style.PLACE.set(place)
        try:
            with style.house_style():
                return draw(Results(result)).figure
        except NothingToShow:
            raise InputError(f"bi.{name}: the result has no data for this figure") from None
        finally:
            style.PLACE.reset(token)

    plot.__name__ = plot.__qualname__ = name
    about = (
        "`result`: what `bi.extract` gave, or the folder of results. `ax`: of plt.subplots, the "
        "figure takes its place; else it is one of its own."
    )
    plot.__doc__ = (
        f"{words}\n\n{about}\n\nReturns a matplotlib Figure, or a SubFigure in the place of `ax`."
    )
    return plot


plot_constants = plotter(
    "plot_constants", "marginals", "Each constant before and after the measurements."
)
plot_pairs = plotter("plot_pairs", "pairs", "The constants in pairs.")
plot_grains = plotter(
    "plot_grains",
    "grain_comparison",
    "The modulus of each grain, measured and predicted.",
)
plot_residuals = plotter(
    "plot_residuals",
    "residuals",
    "Residuals of the grains in order beside normal quantiles.",
)
plot_orientations = plotter(
    "plot_orientations",
    "orientations",
    "The modulus over the directions of the crystal.",
)
plot_young = plotter(
    "plot_young", "young_surface", "Young's modulus over the directions of the crystal."
)
plot_chains = plotter("plot_chains", "traces", "The chains.")
plot_shares = plotter(
    "plot_shares",
    "shares",
    "Shares of the measurements, of the knowledge and of the prior.",
)
plot_error_budget = plotter(
    "plot_error_budget",
    "error_budget",
    "Which errors the sd of each constant is due to.",
)
plot_knowledge = plotter(
    "plot_knowledge", "knowledge", "What further knowledge would reduce each sd to."
)
