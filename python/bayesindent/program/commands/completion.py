"""`completion`: commands, options and files in a shell by the Tab key."""

import argparse
from pathlib import Path

from ..command import Command

__all__ = ["COMMANDS"]


def print_script(arguments: argparse.Namespace) -> int:
    """Print the script."""
    from ..cli import parser

    subparsers = next(action for action in parser()._actions if isinstance(action, argparse._SubParsersAction)).choices
    cases = [f"  *:{name}:-*) options='{' '.join(sorted(sub._option_string_actions))}' ;;" for name, sub in subparsers.items()]
    script = Path(__file__).with_name("completion.sh").read_text(encoding="utf-8")
    print(script.replace("@COMMANDS@", " ".join([*subparsers, "help", "version"])).replace("@CASES@", "\n".join(cases)), end="")
    return 0


COMMANDS = (
    Command(
        "completion",
        action=print_script,
        arguments=lambda parser: parser.add_argument("shell", choices=("bash", "zsh"), help="of the script"),
    ),
)
