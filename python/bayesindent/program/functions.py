"""Commands as functions of Python: `bi.theory("FILE.nml")` returns the document of the command."""

from collections.abc import Callable
from pathlib import Path
from typing import Any

from ..core import InputError
from .cli import parser
from .commands import SUMMARIES

#: Commands whose functions have the words of the command line, a file first, with the words of an
#: example. The others are functions with keywords of their own.
EXAMPLES = {
    "init": "metal='Cu', output='new'",
    "table": "'grains.csv'",
    "map": "'map.nml'",
    "run": "'grains.nml'",
    "simulate": "'crystals.nml', output='simulated'",
    "theory": "'crystals.nml', output='exact'",
    "next": "'grains.nml'",
    "tensor": "'grains.nml', 'copper.json', relative_sd=0.05",
    "predict": "surrogate='block', points='crystals.csv', symmetry='cubic'",
}


def function_of(name: str, example: str) -> Callable[..., dict]:
    """The function of a command."""

    def command(*words: str | Path, **options: Any) -> dict:
        arguments = [name, *map(str, words)]
        for option, value in options.items():
            flag = f"--{option.replace('_', '-')}"
            arguments += [flag] if value is True else [flag, str(value)]
        try:
            parsed = parser(arguments).parse_args(arguments)
        except SystemExit:
            raise InputError(f"bi.{name}: see bayesindent {name} --help") from None
        return parsed.command.action(parsed)

    command.__name__ = command.__qualname__ = name
    summary = SUMMARIES[name][1].capitalize()
    command.__doc__ = (
        f"{summary}.\n\nThe document of `bayesindent {name}`, whose words and options are those of "
        "the command line: `output='DIR'` is --output DIR.\n\nExamples\n--------\n"
        f">>> document = bi.{name}({example})"
    )
    return command


FUNCTIONS = {name: function_of(name, example) for name, example in EXAMPLES.items()}
