"""The directive `diagnostics`: every row of docs/diagnostics.md with an example of it."""

from pathlib import Path

from docutils import nodes
from docutils.parsers.rst import Directive
from warning_examples import EXAMPLES

PAGE = Path(__file__).parent / "diagnostics.md"
#: Titles of the parts, by severity and consequence.
TITLES = {
    "unusable": "The result cannot be used",
    "undetermined": "Constants are not determined",
    "biased": "Constants may be biased",
    "draws": "Too few draws",
    "surrogate": "The surrogate is uncertain",
    "inputs": "Inputs need a look",
}


def rows() -> dict[str, list[str]]:
    """The cells of each row of the page by its code: severity, consequence, numbers, sentence and
    remedy.
    """
    lines = [line for line in PAGE.read_text(encoding="utf-8").splitlines() if line[:1] == "|"]
    cells = [[cell.strip() for cell in line.strip("|").split("|")] for line in lines]
    return {row[0]: row[1:] for row in cells if row[0] != "code" and row[0].strip("-:")}


def example(code: str) -> tuple[str, str, str]:
    """What was done, the sentence with the numbers of the example, and the remedy."""
    _, _, names, sentence, remedy = rows()[code]
    done, subject, numbers = EXAMPLES[code]
    places = dict(zip(filter(None, names.split(", ")), numbers, strict=True), subject=subject)
    return done, sentence.format(**places), remedy.format(**places)


def part_of(code: str) -> str:
    """The key of the part in which a diagnostic stands."""
    severity, consequence = rows()[code][:2]
    return severity if severity == "unusable" else consequence


class Diagnostics(Directive):
    """A section for each part, with an item for each diagnostic."""

    def run(self) -> list[nodes.Node]:
        """Sections of definition lists."""
        sections = []
        for part, title in TITLES.items():
            section = nodes.section(ids=[f"wrong-{part}"])
            section += nodes.title(text=title)
            listed = nodes.definition_list()
            for code in filter(lambda code: part_of(code) == part, EXAMPLES):
                done, sentence, remedy = example(code)
                item = nodes.definition_list_item()
                item += nodes.term("", done)
                body = nodes.definition("", nodes.paragraph("", "", nodes.emphasis(text=sentence)))
                if remedy:
                    body += nodes.paragraph(text=f"{remedy}.")
                item += body
                listed += item
            section += listed
            sections.append(section)
        return sections


def setup(app) -> dict:
    """Called by Sphinx."""
    app.add_directive("diagnostics", Diagnostics)
    return {"version": "1", "parallel_read_safe": True}
