"""The figures of the report as functions of a result of `bi.extract`, or of a folder."""

from collections.abc import Callable
from typing import Any

from ..core import InputError
from .results import NothingToShow, Results

#: Figures of the report by the names of their functions.
NAMES = {
    "plot_chains": "traces",
    "plot_constants": "marginals",
    "plot_grains": "grain_comparison",
    "plot_orientations": "orientations",
    "plot_pairs": "pairs",
}


def plotter(name: str, figure: str) -> Callable:
    """The function `name`, which draws a figure of the report."""

    def plot(result: Any) -> Any:
        # Imported here, since importing matplotlib takes long. Notebooks show figures if pyplot is
        # imported.
        import matplotlib.pyplot  # noqa: F401

        from .figures import FIGURES, style

        draw = next(function for _, function in FIGURES if function.__name__ == figure)
        try:
            with style.house_style():
                return draw(Results(result)).figure
        except NothingToShow:
            raise InputError(f"bi.{name}: the result has no data for this figure") from None

    plot.__name__ = plot.__qualname__ = name
    plot.__doc__ = (
        f"The figure '{figure}' of the report as a matplotlib Figure, of a `result` of bi.extract "
        f"or a folder of results.\n\nExamples\n--------\n>>> figure = bi.{name}(result)"
    )
    return plot


PLOTS = {name: plotter(name, figure) for name, figure in NAMES.items()}
