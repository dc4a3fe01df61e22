"""Directives from the comments `!>` of the sources. `fortran-folder NAME`: the modules of
fortran/NAME with what they make public. `operations`: the operations of the facade.
"""

from pathlib import Path

from docutils import nodes
from docutils.parsers.rst import Directive

from tools import arguments, operations

FORTRAN = Path(__file__).parents[1] / "fortran"


class FortranFolder(Directive):
    """One section a module: its comment, and its public procedures with their arguments."""

    required_arguments = 1

    def run(self) -> list[nodes.Node]:
        """Sections, which the headings of the page number."""
        return [
            module_section(path) for path in sorted((FORTRAN / self.arguments[0]).glob("*.f90"))
        ]


class Operations(Directive):
    """One item an operation: the names of its values, and what it does."""

    def run(self) -> list[nodes.Node]:
        """A definition list."""
        listed = nodes.definition_list()
        for name, operation in operations.operations(FORTRAN.parent).items():
            item = nodes.definition_list_item()
            item += nodes.term("", "", nodes.literal(text=name))
            values = f"{', '.join(operation.given) or '-'} → {', '.join(operation.result) or '-'}"
            body = nodes.definition("", nodes.paragraph(text=values))
            if operation.meaning:
                body += nodes.paragraph(text=plain(operation.meaning))
            item += body
            listed += item
        return [listed]


def module_section(path: Path) -> nodes.section:
    """A module or a file of the facade."""
    text = path.read_text()
    section = nodes.section(ids=[f"fortran-{path.stem}"])
    section += nodes.title(text=path.stem)
    head = [
        line[2:].strip()
        for line in text.partition("\nmodule ")[0].splitlines()
        if line.startswith("!>")
    ]
    for paragraph in "\n".join(head).split("\n\n"):
        if paragraph.strip():
            section += nodes.paragraph(text=plain(paragraph))
    public = arguments.public_names(text.lower())
    listed = nodes.definition_list()
    for procedure in arguments.procedures(path):
        if not public or procedure.name in public:
            listed += described(procedure)
    if listed.children:
        section += listed
    return section


def described(procedure: arguments.Procedure) -> nodes.definition_list_item:
    """A procedure: its comment, and of each argument the declaration and comment."""
    body = nodes.definition()
    if procedure.comment:
        body += nodes.paragraph(text=plain(procedure.comment))
    items = nodes.bullet_list()
    for name, (kind, shape, comment) in procedure.arguments.items():
        entry = nodes.paragraph()
        entry += nodes.literal(text=f"{kind} :: {name}{shape}")
        entry += nodes.Text(f": {plain(comment)}" if comment else "")
        items += nodes.list_item("", entry)
    if items.children:
        body += items
    term = nodes.term()
    term += nodes.literal(text=f"{procedure.name}({', '.join(procedure.arguments)})")
    return nodes.definition_list_item("", term, body)


def plain(comment: str) -> str:
    """Text in one line."""
    return " ".join(comment.split())


def setup(app) -> dict:
    """Called by Sphinx."""
    app.add_directive("fortran-folder", FortranFolder)
    app.add_directive("operations", Operations)
    return {"version": "1", "parallel_read_safe": True}
