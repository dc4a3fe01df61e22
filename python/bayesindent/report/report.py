"""The report: one HTML page that needs nothing beside it, made from whatever a folder of results holds."""

from contextlib import suppress
from pathlib import Path

from ..common.result_files import write_text
from .drawing import draw_figures
from .paper import write_paper
from .results import NothingToShow, Results
from .sections import SECTIONS, constants_table
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
    sections = []
    for name, section in SECTIONS.items():
        with suppress(NothingToShow):
            sections.append((section(results), figures.get(name, [])))
    constants = constants_table(results) if results.documents["extract"] else None
    texts = {"inputs": inputs_summary(results), "findings": findings(results), "constants": constants}
    file = (output or folder) / "report.html"
    write_text(file, render("report.html.j2", results=results, sections=sections, **texts))
    return file
