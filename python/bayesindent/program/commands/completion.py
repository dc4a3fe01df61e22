"""`completion`: commands, options and files in a shell by the Tab key."""

import argparse

from ..command import Command

__all__ = ["COMMANDS"]

#: For zsh, too, which has this builtin of bash.
SCRIPT = """\
[ -n "${ZSH_VERSION-}" ] && autoload -U +X bashcompinit compinit && compinit && bashcompinit
_bayesindent() {
  local options
  case ${COMP_CWORD}:${COMP_WORDS[1]}:${COMP_WORDS[COMP_CWORD]} in
  1:*) options='@COMMANDS@' ;;
@CASES@
  esac
  COMPREPLY=($(compgen -W "$options" -- "${COMP_WORDS[COMP_CWORD]}"))
}
complete -o default -F _bayesindent bayesindent ./bayesindent
"""


def print_script(arguments: argparse.Namespace) -> int:
    """Print the script."""
    from ..cli import parser

    subparsers = next(action for action in parser()._actions if isinstance(action, argparse._SubParsersAction)).choices
    cases = [f"  *:{name}:-*) options='{' '.join(sorted(sub._option_string_actions))}' ;;" for name, sub in subparsers.items()]
    print(SCRIPT.replace("@COMMANDS@", " ".join([*subparsers, "help", "version"])).replace("@CASES@", "\n".join(cases)), end="")
    return 0


COMMANDS = (
    Command(
        "completion",
        "Put source <(bayesindent completion bash) into ~/.bashrc, or the same with zsh into ~/.zshrc.",
        action=print_script,
        arguments=lambda parser: parser.add_argument("shell", choices=("bash", "zsh"), help="of the script"),
    ),
)
