"""The commands, in the order of help.txt. The module of a command is imported when it is asked for:
numpy and the core take time.
"""

import re
from importlib import import_module
from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from ..command import Command

#: Of each part of the page of help: its name, of a command the module and one line on it, and its
#: text.
PAGE = (Path(__file__).parents[1] / "help.txt").read_text(encoding="utf-8")
PARTS = re.findall(r"^== (\w+)(?: (\w+): (.*))?\n((?:(?!== ).*\n?)*)", PAGE, re.MULTILINE)
HELP = {name: text.strip("\n") for name, _, _, text in PARTS}
SUMMARIES = {name: (module, summary) for name, module, summary, _ in PARTS if module}


def command_of(name: str) -> "Command":
    """The command of a name."""
    return next(
        command
        for command in import_module(f".{SUMMARIES[name][0]}", __name__).COMMANDS
        if command.name == name
    )
