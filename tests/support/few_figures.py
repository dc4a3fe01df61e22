"""Reports with a few quick figures, for cases that look at their texts or at other files."""

from contextlib import contextmanager

import pytest

__all__ = ["few_figures"]

#: The figures that remain. Each takes a tenth of a second or two.
QUICK = (
    "grain_comparison",
    "parity",
    "learning_curve",
    "validation",
)


@contextmanager
def few_figures():
    """Within it, reports of this process draw no other figures than these."""
    from bayesindent.report import drawing

    with pytest.MonkeyPatch.context() as patch:
        quick = [item for item in drawing.FIGURES if item[1].__name__ in QUICK]
        assert len(quick) == len(QUICK)
        patch.setattr(drawing, "FIGURES", quick)
        yield
