"""The report: one HTML page that needs nothing beside it, made from whatever a folder of results holds."""

from pathlib import Path

from ..common.result_files import write_text
from .drawing import draw_figures
from .paper import write_paper
from .results import Results
from .sections import LEAST_SHIFT, MOST_ROWS, report_rows
from .summary import findings, inputs_summary
from .templates import render

__all__ = ["write_report"]


def write_report(folder: Path, output: Path | None = None, kind_of_files: str = "", paper: bool = False) -> Path:
    """Write report.html into `output` (default: the folder itself) from the results in `folder`; return its path.

    With `kind_of_files` ('png', 'pdf' or 'svg') every figure is also a file in `folder`/figures; with
    `paper` there is what a paper takes from the results in `folder`/paper.
    """
    results = Results(folder)
    if paper:
        write_paper(results)
    figures = draw_figures(results, kind_of_files, paper)
    texts = {"inputs": inputs_summary(results), "findings": findings(results), "rows": report_rows(results)}
    file = (output or folder) / "report.html"
    write_text(file, render("report.html.j2", results=results, figures=figures, least_shift=LEAST_SHIFT, most_rows=MOST_ROWS, **texts))
    return file
