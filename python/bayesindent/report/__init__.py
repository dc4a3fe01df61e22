"""The report and its figures.

bi.report(folder, output=None, figures='', paper=False) writes report.html of the results in
`folder`, or of what `bi.extract` gave, and returns its path. `output`: where to; default: the
folder itself, of a result the current folder. `figures`: 'png', 'pdf' or 'svg' for every figure as
a file in figures/ too; `paper`: text, tables and figures for a paper in paper/. This package is
also the function, so that neither hides the other.
"""

import sys
from os import PathLike
from pathlib import Path
from types import ModuleType
from typing import Any


class _Report(ModuleType):
    def __call__(
        self,
        folder: Any,
        output: str | PathLike | None = None,
        *,
        figures: str = "",
        paper: bool = False,
    ) -> Path:
        """See the package."""
        from .report import write_report

        return write_report(folder, Path(output) if output else None, figures, paper)[1]


sys.modules[__name__].__class__ = _Report
