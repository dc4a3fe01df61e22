"""The commands, in the order of the help, whose page is help.txt. The module of a command is imported when it is asked for: numpy and the core
take a tenth of a second."""

from importlib import import_module
from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from ..command import Command

__all__ = ["HELP", "SUMMARIES", "command_of"]


def read_help() -> tuple[dict[str, str], dict[str, tuple[str, str]]]:
    """The text of each part of the page by its name, and of each command its module and one line on it."""
    texts, commands = {}, {}
    for part in (Path(__file__).parents[1] / "help.txt").read_text(encoding="utf-8").split("\n== ")[1:]:
        head, _, text = part.partition("\n")
        name, _, words = head.partition(" ")
        texts[name] = text.strip("\n")
        if words:
            module, _, summary = words.partition(": ")
            commands[name] = (module, summary)
    return texts, commands


HELP, SUMMARIES = read_help()


def command_of(name: str) -> "Command":
    """The command of a name."""
    module = import_module(f".{SUMMARIES[name][0]}", __name__)
    return next(command for command in module.COMMANDS if command.name == name)
