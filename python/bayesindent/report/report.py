"""The report: one HTML page that needs nothing beside it, made from whatever a folder of results holds."""

import base64
import io
from importlib import resources
from pathlib import Path

from jinja2 import Environment

from ..common.result_files import whole_file, write_text
from .figures import FIGURES
from .figures.style import house_style, stamp_synthetic
from .results import Results
from .sections import SECTIONS, constants_table

__all__ = ["write_report"]


def write_report(folder: Path, output: Path | None = None, kind_of_files: str = "") -> Path:
    """Write report.html into `output` (default: the folder itself) from the results in `folder`; return its path.

    With `kind_of_files` ('png', 'pdf' or 'svg') every figure is also a file in `folder`/figures.
    """
    results = Results(Path(folder))
    sections = []
    for name, section_of in SECTIONS.items():
        section = section_of(results)
        if section is not None:
            sections.append((section, draw_figures(results, name, kind_of_files)))
    template = (resources.files("bayesindent") / "report" / "report.html.j2").read_text(encoding="utf-8")
    page = Environment(autoescape=True, trim_blocks=True, lstrip_blocks=True).from_string(template)
    file = Path(output or folder) / "report.html"
    write_text(file, page.render(results=results, constants=constants_table(results), sections=sections))
    return file


def draw_figures(results: Results, section: str, kind_of_files: str) -> list[dict]:
    """The figures of a section as data of PNG files in base 64, with their words; as files too if that is wanted."""
    drawn = []
    for where, function in FIGURES:
        if where != section:
            continue
        with house_style():
            picture = function(results)
            if picture is None:
                continue
            if results.synthetic:
                stamp_synthetic(picture.figure)
            if kind_of_files:
                with whole_file(results.folder / "figures" / f"{function.__name__}.{kind_of_files}") as file:
                    picture.figure.savefig(file)
            buffer = io.BytesIO()
            picture.figure.savefig(buffer, format="png")
        drawn.append({"data": base64.b64encode(buffer.getvalue()).decode(), "alt": picture.alt, "caption": picture.caption})
    return drawn
