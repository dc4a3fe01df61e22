"""The report: one HTML page that needs nothing beside it, made from whatever a folder of results
holds.
"""

from pathlib import Path
from typing import Any

from ..common.result_files import write_text
from ..stages.results_folder import using_documents
from .drawing import draw_figures
from .paper import write_paper
from .results import Results
from .sections import tables
from .templates import render


def write_report(
    folder: Any, output: Path | None, kind_of_files: str, paper: bool
) -> tuple[Results, Path]:
    """Write the page as `bi.report` says, whose `figures` are here `kind_of_files`; return the
    results and its path.
    """
    results = Results(folder)
    if results.result is not None:
        results.folder = output or results.folder
    with using_documents(results.folder):
        found = tables(results)
        if paper:
            write_paper(results, found)
        page = render(
            "report.html.j2",
            results=results,
            tables=found,
            figures=draw_figures(results, kind_of_files, paper),
        )
    file = (output or results.folder) / "report.html"
    write_text(file, page)
    return results, file
