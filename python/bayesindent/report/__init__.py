"""The report and its figures.

bi.report(folder, output=None, figures='', paper=False) writes report.html for the results in
`folder`, or for the result of `bi.extract`, and returns its path. `output`: the output folder; by
default the folder itself, or for a result the current folder. `figures`: 'png', 'pdf' or 'svg' to
write every figure to figures/ as well. `paper`: write text, tables and figures for a paper to
paper/. This package can be called, so that the function and the package share one name.

Examples
--------
>>> result = bi.extract("grains.csv", "cubic", technique="exact", samples=300)
>>> bi.report(result, "report").name
'report.html'
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
        """Write the report; the docstring of the package describes the arguments."""
        from .report import write_report

        return write_report(folder, Path(output) if output else None, figures, paper)[1]


sys.modules[__name__].__class__ = _Report
