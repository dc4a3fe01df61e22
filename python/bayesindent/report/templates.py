"""Documents from the templates beside this module."""

from importlib import resources

# Not imported by the package itself: only reports need it.
from jinja2 import Environment

from . import formatting

__all__ = ["read_data", "render"]


def read_data(name: str) -> str:
    """The text of a file beside this module."""
    return (resources.files("bayesindent") / "report" / name).read_text(encoding="utf-8")


def render(name: str, **values: object) -> str:
    """The document that the template `name` makes of these values, with the functions of `formatting`; values are escaped in HTML."""
    environment = Environment(autoescape=name.endswith(".html.j2"), trim_blocks=True, lstrip_blocks=True)
    environment.globals.update({function: getattr(formatting, function) for function in formatting.__all__})
    return environment.from_string(read_data(name)).render(values)
