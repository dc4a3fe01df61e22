"""Documents from the templates beside this module."""

from importlib import resources

# Only reports import this module, so that the package starts without Jinja2.
from jinja2 import Environment
from markupsafe import Markup

from . import formatting, sections, summary


def read_data(name: str) -> str:
    """The text of a file beside this module."""
    return (resources.files("bayesindent") / "report" / name).read_text(encoding="utf-8")


def render(name: str, **values: object) -> str:
    """Fill in the template `name` with these values and what `formatting`, `sections` and `summary`
    define.

    Values are escaped in HTML, and unless they are `Markup` in LaTeX.
    """
    escape = (
        (lambda value: value if isinstance(value, Markup) else formatting.latex(str(value)))
        if ".tex." in name
        else None
    )
    environment = Environment(
        autoescape=name.endswith(".html.j2"), finalize=escape, trim_blocks=True, lstrip_blocks=True
    )
    for module in (formatting, sections, summary):
        environment.globals.update(vars(module))
    return environment.from_string(read_data(name)).render(values)
