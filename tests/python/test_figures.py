"""What the figures of the report compute, against closed forms.

Modules: plots.py.
"""

import numpy as np
import pytest

import bayesindent as bi
from bayesindent.report.figures.posterior import stacked
from bayesindent.report.figures.style import logarithmic, panels
from bayesindent.report.figures.young import youngs_modulus
from bayesindent.report.results import NothingToShow


def test_youngs_modulus_of_a_cubic_crystal():
    # 1/E = S11 - 2 (S11 - S12 - S44/2) (x²y² + y²z² + z²x²), and 2 (1 + nu) G of an isotropic one
    # in every direction.
    c11, c12, c44 = 168.4, 121.4, 75.4
    s11, s12 = (c11 + c12) / ((c11 - c12) * (c11 + 2 * c12)), -c12 / ((c11 - c12) * (c11 + 2 * c12))
    directions = np.random.default_rng(3).standard_normal((50, 3))
    directions /= np.linalg.norm(directions, axis=1)[:, None]
    x, y, z = directions.T**2
    expected = 1 / (s11 - 2 * (s11 - s12 - 0.5 / c44) * (x * y + y * z + z * x))
    crystals = np.stack(
        [
            bi.stiffness("cubic", C11=c11, C12=c12, C44=c44),
            bi.stiffness("isotropic", C11=269.23077, C12=115.38462),
        ]
    )
    copper, steel = youngs_modulus(crystals, directions)
    assert copper == pytest.approx(expected, rel=1e-12)
    assert steel == pytest.approx(200.0, rel=1e-7)


def test_shares_that_are_not_numbers_have_no_bar():
    parts = [{"noise": 0.25, "prior": 0.75, "tip": 0.001}, dict.fromkeys(("noise", "prior", "tip"))]
    picture = stacked(parts, ["C11", "C12"], 2, "")
    noise, prior = picture.figure.axes[0].containers
    assert [bar.get_width() for bar in noise] == [25, 0]
    assert [bar.get_width() for bar in prior] == [75, 0]
    assert [row[0] for row in picture.table[1]] == ["C11", "C12"]
    assert picture.values.startswith("In per cent: C11: noise 25, prior 75; C12: ")
    with pytest.raises(NothingToShow):
        stacked(parts[1:], ["C12"], 1, "")


@pytest.mark.filterwarnings("error")
def test_errors_that_are_all_zero_are_drawn_without_a_warning():
    figure, axes = panels(3.4)
    axes.plot([1, 2], [0.0, 0.0])
    logarithmic(axes)
    figure.canvas.draw()
    assert axes.get_yscale() == "linear"
    axes.plot([1, 2], [0.5, np.nan])
    logarithmic(axes)
    figure.canvas.draw()
    assert axes.get_yscale() == "log"
