"""A page of paragraphs, tables and figures, written as Markdown for the documentation and as HTML
that needs nothing beside it.
"""

import base64
import html
import io
import re
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field
from pathlib import Path

from matplotlib.figure import Figure

from bayesindent.common.result_files import write_text
from bayesindent.report.drawing import SAVED
from bayesindent.report.templates import read_data

__all__ = ["Page", "fixed"]

#: Dots per inch of figures: at 7 inches a page's width in print.
DOTS = 200


@dataclass
class Page:
    """The blocks of a page: their Markdown and their HTML, and figures by name."""

    title: str
    markdown: list[str] = field(default_factory=list)
    body: list[str] = field(default_factory=list)
    figures: dict[str, Figure] = field(default_factory=dict)
    #: Numbers of the run, for programs.
    numbers: dict = field(default_factory=dict)

    def heading(self, text: str) -> None:
        """A section's title."""
        self.markdown.append(f"## {text}")
        self.body.append(f"<h2>{in_html(text)}</h2>")

    def text(self, *paragraphs: str) -> None:
        """Paragraphs with `code`, **bold** and [links](page.md)."""
        for text in paragraphs:
            self.markdown.append(text)
            self.body.append(f"<p>{in_html(text)}</p>")

    def code(self, *lines: str) -> None:
        """Lines of a terminal."""
        block = "\n".join(lines)
        self.markdown.append(f"```\n{block}\n```")
        self.body.append(f"<pre>{html.escape(block)}</pre>")

    def table(
        self, caption: str, header: Sequence[str], rows: Sequence[Sequence], prose: bool = False
    ) -> None:
        """A table; `prose`: its cells are sentences."""
        header, rows = list(map(str, header)), [list(map(str, row)) for row in rows]
        lines = [header, ["---"] * len(header), *rows]
        marked = "\n".join(f"| {' | '.join(row)} |" for row in lines)
        self.markdown.append(f"{caption}\n\n{marked}")
        head = "".join(f'<th scope="col">{in_html(cell)}</th>' for cell in header)
        body = "".join(map(row_in_html, rows))
        kind = ' class="prose"' if prose else ""
        self.body.append(
            f'<p class="caption">{in_html(caption)}</p>\n<div class="wide"><table{kind}>'
            f"<thead><tr>{head}</tr></thead>\n<tbody>\n{body}</tbody></table></div>"
        )

    def figure(self, name: str, figure: Figure, caption: str) -> None:
        """A figure, whose file has this name."""
        self.figures[name] = figure
        self.markdown.append(f"![{caption}](figures/{name}.png)\n\n*{caption}*")
        buffer = io.BytesIO()
        figure.savefig(buffer, format="png", dpi=DOTS, **SAVED["png"])
        data = base64.b64encode(buffer.getvalue()).decode()
        self.body.append(
            f'<figure><img src="data:image/png;base64,{data}" alt="{html.escape(caption)}">'
            f"<figcaption>{in_html(caption)}</figcaption></figure>"
        )

    def write_html(self, path: Path) -> None:
        """Write the page in the style of the report."""
        style = re.search(r"<style>.*?</style>", read_data("report.html.j2"), re.DOTALL)
        write_text(
            path,
            '<!doctype html>\n<html lang="en">\n<head>\n<meta charset="utf-8">\n'
            '<meta name="viewport" content="width=device-width, initial-scale=1">\n'
            f"<title>{html.escape(self.title)}</title>\n{style.group() if style else ''}\n"
            f"</head>\n<body>\n<h1>{html.escape(self.title)}</h1>\n"
            + "\n".join(self.body)
            + "\n</body>\n</html>\n",
        )

    def write_markdown(self, path: Path) -> None:
        """Write the page, and its figures into figures/ beside it."""
        write_text(path, "\n\n".join([f"# {self.title}", *self.markdown]) + "\n")
        (path.parent / "figures").mkdir(exist_ok=True)
        for name, figure in self.figures.items():
            file = path.parent / "figures" / f"{name}.png"
            figure.savefig(file, dpi=DOTS, pil_kwargs={"compress_level": 9})


def fixed(values: Iterable[float], digits: int) -> list[str]:
    """Numbers with so many decimals."""
    return [f"{value:.{digits}f}" for value in values]


def row_in_html(row: Sequence[str]) -> str:
    """A row of a table."""
    cells = "".join(f"<td>{in_html(cell)}</td>" for cell in row)
    return f"<tr>{cells}</tr>\n"


def in_html(text: str) -> str:
    """Markdown within a line as HTML; links to other pages become their text."""
    text = html.escape(text)
    text = re.sub(r"`([^`]+)`", r"<code>\1</code>", text)
    text = re.sub(r"\*\*([^*]+)\*\*", r"<strong>\1</strong>", text)
    return re.sub(r"\[([^\]]+)\]\(([^)]+)\)", r"\1", text)
