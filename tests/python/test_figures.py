"""What the figures of the report compute, against closed forms.

Modules: plots.py.
"""

import numpy as np
import pytest

from bayesindent.report.figures.style import logarithmic, panels


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
