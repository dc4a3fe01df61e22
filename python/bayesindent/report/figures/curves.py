"""The figure of Step 0: curves with their elastic fits."""

import numpy as np

from ...stages.curves import read_columns
from ..results import NothingToShow, Results, present
from .style import (
    BLACK,
    GREEN,
    Picture,
    evenly,
    panels,
)

#: Most tests in the figure, chosen evenly from those that were used.
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
        in_test = columns["test"] == row["test"]
        load, depth, fit, elastic = (
            columns[name][in_test] for name in ("load_mn", "depth_nm", "fit_nm", "elastic")
        )
        left.plot(depth - row["zero_nm"], load, ".", ms=2)
        left.plot(fit - row["zero_nm"], load, color=BLACK, lw=0.8)
        left.set_title(f"{row['test']}: {row['effective_modulus_gpa']:.1f} GPa", loc="left")
        right.plot(load, depth - fit, lw=1)
        right.axhline(0, color=BLACK, lw=0.8)
        # Six sds of the elastic part. Residuals of the plastic part are positive.
        limit = 6 * max(np.std((depth - fit)[elastic > 0.5]), row["noise_nm"])
        right.set_ylim(-limit, 2 * limit)
        for span in (left.axhspan, right.axvspan):
            span(row["elastic_from_mn"], row["elastic_to_mn"], color=GREEN, alpha=0.15, lw=0)
    axes[-1, 0].set(xlabel="depth from the zero (nm)", ylabel="load (mN)")
    axes[-1, 1].set(xlabel="load (mN)", ylabel="residual (nm)")
    return Picture(
        figure,
        f"Loading curves of {len(chosen)} of {len(tests)} tests with their elastic fits, and "
        "the residuals of depth. Green: the mean elastic window.",
    )
