"""The report: one HTML page that needs nothing beside it, made from whatever a folder of results holds."""

from pathlib import Path
from typing import Any

from ..common.progress import Progress
from ..common.result_files import write_text
from .drawing import draw_figures
from .paper import write_paper
from .results import Results
from .sections import LEAST_SHIFT, MOST_ROWS, report_rows
from .summary import findings, inputs_summary
from .templates import render

__all__ = ["write_report"]


def write_report(
    folder: Any, output: Path | None = None, kind_of_files: str = "", paper: bool = False, progress: Progress | None = None
) -> tuple[Results, Path]:
    """Write report.html into `output` (default: the folder itself) from the results in `folder`; return these and its path.

    `folder` may be what `bi.extract` gave; then the folder is the current one, or `output`. With `kind_of_files` ('png', 'pdf' or 'svg') every figure is also a file in `folder`/figures; with
    `paper` there is what a paper takes from the results in `folder`/paper.
    """
    results = Results(folder)
    if results.result is not None:
        results.folder = output or results.folder
    if paper:
        write_paper(results)
    figures = draw_figures(results, kind_of_files, paper, progress or Progress())
    texts = {"inputs": inputs_summary(results), "findings": findings(results), "rows": report_rows(results)}
    file = (output or results.folder) / "report.html"
    write_text(file, render("report.html.j2", results=results, figures=figures, least_shift=LEAST_SHIFT, most_rows=MOST_ROWS, **texts))
    return results, file
