"""The commands, in the order of help.txt. The module of a command is imported only when it runs,
since importing NumPy and the core takes time.
"""

import re
from importlib import import_module
from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from ..command import Command

#: The page of help. Each part has its name, the module of a command with one line on it, and its
#: text. Parts without a module are topics.
PAGE = (Path(__file__).parents[1] / "help.txt").read_text(encoding="utf-8")
PARTS = re.findall(r"^== (\w+)(?: (\w+): (.*))?\n((?:(?!== ).*\n?)*)", PAGE, re.MULTILINE)
HELP = {name: text.strip("\n") for name, _, _, text in PARTS}
SUMMARIES = {name: (module, summary) for name, module, summary, _ in PARTS if module}
TOPICS = [name for name, module, _, _ in PARTS if not module and name != "bayesindent"]


def command_of(name: str) -> "Command":
    """The command of a name."""
    return next(
        command
        for command in import_module(f".{SUMMARIES[name][0]}", __name__).COMMANDS
        if command.name == name
    )
