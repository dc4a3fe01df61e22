"""Make keywords of Python functions from the schema of namelists: signatures, help, and errors that
name keywords in place of namelist variables.
"""

import difflib
import inspect
import re
import sys
import textwrap
import warnings
from collections.abc import Callable, Collection
from functools import cache, partial, wraps
from typing import Any

from ..common.diagnostics import labelled, message
from ..core import BayesindentWarning, InputError, MachineError
from .problem import Variable, schema

TYPES = {"logical": bool, "integer": int, "real": float}
#: Variables and groups of namelists whose keyword has another name.
KEYWORDS = {
    "c_min": "bounds",
    "c_max": "bounds",
    "quantity": "knowledge",
    "mean": "knowledge mean",
    "sd": "knowledge sd",
    "stiffness_file": "knowledge['stiffness']",
    "prior": "bounds",
}


def takes(
    *groups: str, without: Collection[str] = (), of: Callable | None = None
) -> Callable[[Any], Any]:
    """Decorate a function so that its `**settings` are the variables of these groups, apart from
    those of `without`, and the keywords of the function `of` that takes them.

    Signature and help list each keyword with its type, its default and its meaning. A name that
    several groups have belongs to the first of them. Other names are refused, and messages name
    keywords.
    """
    of_groups = [
        variable
        for variable in schema()
        if variable.group in groups and variable.name not in without
    ]
    variables = {variable.name: variable for variable in of_groups}
    variables |= {variable.name: variable for variable in of_groups if variable.group == groups[0]}

    def decorate(function: Callable) -> Callable:
        own = inspect.signature(function)
        stated = dict(own.parameters)
        for name, one in inspect.signature(of).parameters.items() if of else ():
            if one.kind is one.KEYWORD_ONLY and name not in variables:
                stated.setdefault(name, one)
        stated.pop("settings", None)
        listed = [variable for name, variable in variables.items() if name not in stated]
        keyword = partial(inspect.Parameter, kind=inspect.Parameter.KEYWORD_ONLY)
        more = [
            keyword(variable.name, default=default_of(variable), annotation=type_of(variable))
            for variable in listed
        ]
        known = {*stated, *variables}

        @wraps(function)
        def checked(*arguments: Any, **keywords: Any) -> Any:
            if unknown := next((name for name in keywords if name not in known), None):
                near = difflib.get_close_matches(unknown, known, 1)
                guess = f", did you mean '{near[0]}'?" if near else ""
                raise InputError(
                    f"keyword '{unknown}' is unknown{guess}; help({origin}) lists all", origin
                )
            try:
                return function(*arguments, **keywords)
            except (InputError, MachineError) as error:
                name = error.variable or error.group
                error.keyword = KEYWORDS.get(name, name)
                raise error.with_traceback(None) from None

        origin = f"bi.{function.__qualname__.removesuffix('.__init__')}"
        signature = own.replace(parameters=[*stated.values(), *more])
        checked.__signature__ = signature  # type: ignore[attr-defined]
        text = inspect.cleandoc(function.__doc__ or "")
        before, *after = re.split(r"\n(?=\n(?:Returns|Examples)\n)", text, maxsplit=1)
        checked.__doc__ = "\n".join([before, *map(explained, listed), *after])
        return checked

    return decorate


def type_of(variable: Variable) -> Any:
    """The type of a keyword."""
    plain = TYPES.get(variable.kind, str)
    kind = plain if variable.shape == "one" else list[plain]  # type: ignore[valid-type]
    return kind if default_of(variable) is not None else kind | None


def default_of(variable: Variable) -> Any:
    """The default of a keyword; None if it has none."""
    return None if variable.default in ("*", "unset") else variable.value_of([variable.default])


@cache
def explained(variable: Variable) -> str:
    """The entry of a keyword in the format of numpydoc."""
    default = default_of(variable)
    kind = inspect.formatannotation(type_of(variable))
    allowed = variable.allowed if variable.kind not in ("logical", "text") else ""
    details = ", ".join(filter(None, [variable.unit, allowed]))
    words = f"{variable.meaning[:1].upper()}{variable.meaning[1:]}"
    words += f" ({details})." if details else "."
    return (
        f"{variable.name} : {kind}, default {default!r}\n"
        f"{textwrap.indent(textwrap.fill(words, 96), '    ')}"
    )


def warn_of(document: dict) -> None:
    """Issue the diagnostics of a document as warnings of Python, which name the line that called
    the public function.
    """
    level, frame = 1, sys._getframe()
    while frame.f_back and frame.f_globals.get("__name__", "").startswith(
        f"{__package__.partition('.')[0]}."
    ):
        level, frame = level + 1, frame.f_back
    for found in document["warnings"]:
        line = message(found) if found["severity"] == "warning" else labelled(found)
        warning = BayesindentWarning(line)
        warning.diagnostic = found
        warnings.warn(warning, stacklevel=level)
