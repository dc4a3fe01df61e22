"""The command line: parse the arguments, run the command, and report errors by an exit status."""

import argparse
import difflib
import errno
import json
import logging
import os
import re
import sys
import textwrap
import warnings
from collections.abc import Iterable, Sequence
from contextlib import suppress
from io import TextIOWrapper
from pathlib import Path
from typing import Any, NoReturn

from ..version import __version__
from .commands import HELP, SUMMARIES, TOPICS, command_of

DONE, FAILED, BAD_INPUT, UNUSABLE, INTERRUPTED = 0, 1, 2, 3, 130

log = logging.getLogger("bayesindent")
# Without a handler the logger would print the errors that `tell` prints.
log.addHandler(logging.NullHandler())

#: Number of warnings that are printed; the most consequential come first.
MOST_WARNINGS = 8

#: Reasons why the machine cannot read or write a file, by number of error.
REASONS = {
    errno.ENOSPC: "cannot be written: the disk is full",
    errno.EDQUOT: "cannot be written: the quota of the disk is used up",
    errno.EFBIG: "cannot be written: larger than files may be here",
    errno.EACCES: "there is no permission",
    errno.EPERM: "there is no permission",
    errno.EROFS: "cannot be written: the disk is read-only",
    errno.ELOOP: "is a link; remove it, or choose another folder",
    errno.ENXIO: "is a pipe; remove it, or choose another folder",
}


def main(argv: Sequence[str] | None = None) -> int:
    """Run the command of these arguments (default: the process's own); return its exit status."""
    argv = list(sys.argv[1:] if argv is None else argv)
    for stream in (sys.stdout, sys.stderr):
        # A terminal with another encoding than UTF-8 may lack a plus-minus sign.
        if isinstance(stream, TextIOWrapper):
            stream.reconfigure(errors="backslashreplace")
    if not argv:
        argv = ["--help"]
    elif argv[:1] == ["version"]:
        argv = ["--version"]
    topic = argv[1] if argv[:1] == ["help"] and argv[1:] else None
    if argv[:1] == ["help"]:
        argv = [*argv[1:], "--help"]
    try:
        if topic in TOPICS or argv == ["completion"]:
            print(HELP[topic] if topic else completion(), flush=True)
            return DONE
        root = parser(argv)
        if argv and argv[0] not in SUMMARIES and not argv[0].startswith("-"):
            near = [f"run {argv[0]}"] if argv[0].endswith(".nml") else SUMMARIES
            allowed = ", ".join([*SUMMARIES, "help COMMAND", "help TOPIC", "completion"])
            root.refuse(f"'{argv[0]}' is no command; allowed: {allowed}", argv[0], near)
        arguments, unknown = root.parse_known_args(argv)
        if unknown:
            said = f"unrecognized arguments: {' '.join(unknown)}"
            arguments.parser.refuse(said, unknown[0], arguments.parser._option_string_actions)
    except OSError as error:
        return fail_by_file(error)
    # These import NumPy and the core, which the help does not need.
    from ..common.progress import show_progress
    from ..core import BayesindentError, InputError, call

    # ArviZ announces its next version at every import.
    warnings.filterwarnings("ignore", category=FutureWarning, module="arviz")
    # Commands print the warnings of their documents; the table of models has those of ArviZ.
    warnings.simplefilter("ignore", UserWarning)
    # A failure to write the log prints no traceback.
    logging.raiseExceptions = False
    try:
        # The tools of a source tree replace this process and handle their own signals.
        if arguments.command.show is not None:
            call("file.watch_signals")
            show_progress(not arguments.quiet)
        return finish(arguments, arguments.command.action(arguments))
    except KeyboardInterrupt:
        return INTERRUPTED
    except BayesindentError as error:
        log.error("%s", error)
        tell(str(error))
        return BAD_INPUT if isinstance(error, InputError) else FAILED
    except OSError as error:
        return fail_by_file(error)
    except Exception as error:
        log.exception("unexpected")
        tell(
            f"{type(error).__name__}: {error}"
            + ("" if open_logs() else "; BAYESINDENT_TRACE=1 shows where")
        )
        if os.environ.get("BAYESINDENT_TRACE"):
            raise
        return FAILED
    finally:
        for handler in open_logs():
            log.removeHandler(handler)
            # On a full disk the log cannot write its last lines.
            with suppress(OSError):
                handler.close()
        show_progress(False)
        call("file.end_command")


def fail_by_file(error: OSError) -> int:
    """Print which file could not be read or written, and why; return the exit status."""
    if not isinstance(error, BrokenPipeError):
        log.error("%s", error)
        # The error of a library that cannot be loaded has no number.
        tell(
            f"{error.filename or 'standard output'}: {REASONS.get(error.errno) or error.strerror}"
            if error.errno
            else str(error)
        )
    if error.filename is None:
        with suppress(OSError):
            os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
    return FAILED


class Parser(argparse.ArgumentParser):
    """A parser whose help ends with the namelist groups that the command reads, or with all their
    variables, and whose errors suggest the nearest option. A stated `page` is the whole help.
    """

    groups: tuple[str, ...] = ()
    full = False
    page = ""

    def __init__(self, *args: Any, **kwargs: Any):
        kwargs["formatter_class"] = argparse.RawDescriptionHelpFormatter
        super().__init__(*args, **kwargs)
        # Crystal classes such as -3m are values, no options.
        self._negative_number_matcher = re.compile("-[1346]")

    def format_help(self) -> str:
        """The help, and the groups of the namelist."""
        text = self.page or super().format_help()
        if self.groups and not self.full:
            text += f"\ngroups of the namelist ('{self.prog} --all' explains every variable):\n"
        return text + "".join(describe_group(name, self.full) for name in self.groups)

    def exit(self, status: int = 0, message: str | None = None) -> NoReturn:
        """End the process after standard output is written."""
        # argparse does not report a full disk behind standard output.
        print(end="", flush=status == 0)
        super().exit(status, message)

    def refuse(self, message: str, wrong: str, choices: Iterable[str]) -> NoReturn:
        """End with a message that suggests the nearest choice for the `wrong` word."""
        near = difflib.get_close_matches(wrong, choices, 1)
        self.error(message + (f". Did you mean '{near[0]}'?" if near else ""))


def parser(words: Sequence[str] | None = None) -> Parser:
    """The parser of all commands. Only commands among `words` (default: all) get their arguments;
    with '--all' among them the help lists every variable.
    """
    root = Parser(prog="bayesindent")
    root.page = overview()
    root.add_argument(
        "-V", "-v", "--version", action="version", version=f"bayesindent {__version__}"
    )
    subparsers = root.add_subparsers(title="commands", metavar="COMMAND", required=True)
    for name, (_, summary) in SUMMARIES.items():
        sub = subparsers.add_parser(name, help=summary)
        if words is not None and name not in words:
            continue
        command = command_of(name)
        sub.description = textwrap.fill(
            " ".join(f"{summary[0].upper()}{summary[1:]}. {HELP[name]}".split()), 100
        )
        sub.set_defaults(command=command, json=False, results=None, quiet=False, parser=sub)
        sub.groups, sub.full = command.groups, "--all" in (words or ())
        if command.groups:
            table = ", or a table of measurements" if name == "extract" else ""
            sub.add_argument("file", metavar="FILE.nml", type=Path, help=f"the namelist{table}")
            sub.add_argument(
                "--all", action="help", help="show this help with every variable of the namelist"
            )
            sub.add_argument("--seed", metavar="N", type=int, help="in place of &problem seed")
            if "execution" in command.groups:
                sub.add_argument(
                    "--scheduler",
                    metavar="ADDRESS",
                    help="simulate on the workers of this scheduler of Dask; who answers there "
                    "can run code here",
                )
            if "sampler" in command.groups:
                sub.add_argument(
                    "--samples", metavar="N", type=whole, help="in place of &sampler samples"
                )
        if command.show is not None:
            sub.add_argument(
                "--output",
                metavar="DIR",
                type=Path,
                help="folder of the results (default: runs/<stem of the file>)",
            )
            sub.add_argument(
                "--json",
                action="store_true",
                help="one JSON document on standard output, all else on standard error",
            )
            sub.add_argument(
                "--quiet",
                action="store_true",
                help="neither progress nor warnings nor hints on standard error",
            )
        if command.arguments is not None:
            command.arguments(sub)
    return root


def overview() -> str:
    """The help of the program, one screen: a line for each command, and the topics."""
    lines = [f"  {name:<10}{summary}" for name, (_, summary) in SUMMARIES.items()]
    return f"""{HELP["bayesindent"]} Commands:
{chr(10).join(lines)}

bayesindent help COMMAND explains a command, help TOPIC a topic:
{", ".join(TOPICS)}. Also: bayesindent version.
"""


def completion() -> str:
    """A script for bash and zsh that completes commands, options, and names of files."""
    cases = [f"help) words='{' '.join([*SUMMARIES, *TOPICS])}' ;;"]
    for action in parser()._actions:
        for name, sub in dict(action.choices or {}).items():
            cases.append(f"{name}) words='{' '.join(sub._option_string_actions)}' ;;")
    return f"""_bayesindent() {{
  local word=${{COMP_WORDS[COMP_CWORD]}} words=
  case ${{COMP_WORDS[1]}} in
  {chr(10).join(cases)}
  esac
  if [ "$COMP_CWORD" = 1 ]; then
    words='{" ".join([*SUMMARIES, "help", "version", "completion"])}'
  elif [ "${{COMP_WORDS[1]}}" != help ] && [ "${{word#-}}" = "$word" ]; then
    words=
  fi
  COMPREPLY=($(compgen -W "$words" -- "$word"))
}}
[ -z "${{ZSH_VERSION-}}" ] || {{ autoload -U +X bashcompinit && bashcompinit; }}
complete -o default -F _bayesindent bayesindent"""


def whole(text: str) -> int:
    """The whole number of a text such as 10000 or 1e4."""
    number = float(text)
    if not number.is_integer():
        raise ValueError
    return int(number)


def describe_group(name: str, full: bool) -> str:
    """The names of the variables of one namelist group, or their full descriptions."""
    from ..settings.problem import schema

    variables = [variable for variable in schema() if variable.group == name]
    if not full:
        words = (
            f"{f'  &{name}':<17}{variables[0].group_meaning} Variables: "
            f"{', '.join(variable.name for variable in variables)}."
        )
        return textwrap.fill(words, 79, subsequent_indent=17 * " ") + "\n"
    lines = [f"\n&{name}: {variables[0].group_meaning}"]
    for variable in variables:
        default = (
            "required" if variable.default == "*" else f"default: {variable.default or 'none'}"
        )
        allowed = f"one of {variable.allowed}" if variable.kind == "choice" else variable.allowed
        details = ", ".join(filter(None, [variable.unit, allowed, default]))
        lines += textwrap.wrap(
            f"{variable.meaning} ({details})",
            110,
            initial_indent=f"  {variable.name:<22}",
            subsequent_indent=" " * 24,
        )
    return "\n".join(lines) + "\n"


def finish(arguments: argparse.Namespace, document: dict) -> int:
    """Print why the result cannot be used, the warnings on standard error, and the document on
    standard output, as JSON or as tables. Return the exit status.
    """
    from ..common.diagnostics import distinct, is_unusable, labelled, message
    from ..common.result_files import plain

    document["warnings"] = warnings = distinct(document["warnings"])
    reasons = list(filter(is_unusable, warnings))
    for reason in reasons:
        log.error("%s", labelled(reason))
        print(
            f"The result cannot be used: {message(reason)}",
            file=sys.stderr if arguments.json else sys.stdout,
            flush=True,
        )
    say = (lambda text: None) if arguments.quiet else tell
    rest = [labelled(warning) for warning in warnings if not is_unusable(warning)]
    for line in rest:
        log.warning("%s", line)
    for line in rest[:MOST_WARNINGS]:
        say(line)
    if (more := len(rest) - MOST_WARNINGS) > 0:
        results = arguments.results
        where = results / "run.log" if results else "the JSON document (--json)"
        say(f"{more} more warnings are in {where}")
    if arguments.results is not None:
        say(f"results are in {arguments.results}")
    if arguments.json:
        print(json.dumps(plain(document), allow_nan=False), flush=True)
    else:
        arguments.command.show(document)
    if arguments.command.then is not None:
        say(f"next: {arguments.command.then(arguments, document)}")
    return UNUSABLE if reasons else DONE


def tell(text: str) -> None:
    """Print a line on standard error. Texts of files do not control the terminal."""
    print(re.sub(r"[\x00-\x1f\x7f-\x9f]", "?", text), file=sys.stderr, flush=True)


def open_logs() -> list[logging.Handler]:
    """The log files of this command."""
    return [handler for handler in log.handlers if isinstance(handler, logging.FileHandler)]
