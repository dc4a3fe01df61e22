"""The report: one HTML page that needs nothing beside it, made from whatever a folder of results holds."""

from importlib import resources
from pathlib import Path

from jinja2 import Environment

from ..common.result_files import write_text
from .drawing import draw_figures
from .paper import write_paper
from .results import Results
from .sections import SECTIONS, constants_table
from .summary import asked, well_known
from .words import with_powers

__all__ = ["write_report"]


def write_report(folder: Path, output: Path | None = None, kind_of_files: str = "", paper: bool = False) -> Path:
    """Write report.html into `output` (default: the folder itself) from the results in `folder`; return its path.

    With `kind_of_files` ('png', 'pdf' or 'svg') every figure is also a file in `folder`/figures; with
    `paper` there is what a paper takes from the results in `folder`/paper.
    """
    results = Results(Path(folder))
    if paper:
        write_paper(results)
    figures = draw_figures(results, kind_of_files, paper)
    sections = [(section, figures.get(name, [])) for name, function in SECTIONS.items() if (section := function(results)) is not None]
    template = (resources.files("bayesindent") / "report" / "report.html.j2").read_text(encoding="utf-8")
    environment = Environment(autoescape=True, trim_blocks=True, lstrip_blocks=True)
    page = environment.from_string(template).render(
        results=results,
        with_powers=with_powers,
        asked=asked(results),
        known=well_known(results),
        constants=constants_table(results),
        sections=sections,
    )
    file = Path(output or folder) / "report.html"
    write_text(file, page)
    return file
