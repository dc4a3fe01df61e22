"""The command line: what was asked, to which stage, in which words, with which exit status."""

import argparse
import csv
import io
import json
import logging
import os
import sys
import textwrap
import warnings
from collections.abc import Sequence
from pathlib import Path

from ..common.progress import Progress
from ..core import BayesindentError, InputError
from ..version import __version__

__all__ = ["main"]

DONE, FAILED, BAD_INPUT, INTERRUPTED = 0, 1, 2, 130

log = logging.getLogger("bayesindent")
# Without a handler of its own the library would print errors, which `tell` does.
log.addHandler(logging.NullHandler())

DESCRIPTION = """\
Single-crystal elastic constants, with honest uncertainty, from spherical indentation of grains of known orientation.

A namelist FILE.nml says what is wanted. Step 1 (build) teaches a surrogate the indentation modulus of any crystal of a class by finite
element simulations, each where the surrogate knows least. Step 2 (extract) samples the constants that explain measured moduli."""

EXAMPLES = """\
examples:
  bayesindent run inputs/quickstart.nml           everything the file asks for, with a report; rerun it to go on
  bayesindent run inputs/quickstart.nml --check   only say whether the file is right
  bayesindent theory inputs/zinc.nml --json       exact half-space moduli of the crystals in a file
  bayesindent predict --surrogate cubic --points points.csv
  bayesindent build FILE.nml --ask 20 > points.csv   the next 20 crystals, to be simulated elsewhere
  bayesindent build FILE.nml --tell results.csv      and their moduli back

units: GPa, um, mN, degrees (Bunge-Euler angles phi1, Phi, phi2). An uncertainty is a standard deviation, sd.
exit status: 0 done, perhaps with warnings; 2 bad input; 1 anything else; 130 interrupted (run again to go on).
'bayesindent COMMAND --help' tells more, such as the variables of the namelist."""

#: Command: its one line, the groups of the namelist that its help explains, and more words.
NAMELIST_COMMANDS = {
    "run": (
        "all that the groups of a namelist ask for, in order, resuming what is done",
        ("problem", "crystals", "simulation", "domain", "surrogate", "design", "measurements", "prior", "sampler", "next", "execution"),
        """&crystals asks for simulate and theory, &design for build, &measurements for extract, &next for next; a report ends it.
        Nothing that is already in the output folder is simulated again.""",
    ),
    "simulate": (
        "finite element indentation of the crystals in a namelist",
        ("problem", "crystals", "simulation", "execution"),
        """Writes moduli.csv (the three kinds of modulus), curves.csv (force and depth), and with vtu or inp the fields for ParaView or
        the same problem as a deck for Abaqus or CalculiX. Crystals that are done already are not simulated again.""",
    ),
    "theory": (
        "exact half-space theory of the same crystals",
        ("problem", "crystals"),
        """Willis' elliptical contact on the anisotropic half-space. Writes theory.csv.""",
    ),
    "build": (
        "step 1: a surrogate, taught by simulations chosen one after another",
        ("problem", "simulation", "domain", "surrogate", "design", "execution"),
        """Writes surrogate.nc. Every simulation is kept in campaign.sqlite as soon as it is done, so that the command may be interrupted
        and run again, with a larger budget too. With --ask it only prints the next crystals; --tell takes their moduli.""",
    ),
    "extract": (
        "step 2: the constants behind measured moduli",
        ("problem", "surrogate", "measurements", "prior", "sampler"),
        """Writes posterior.nc and summary.json, and says what the data decided and what the prior did. Needs no simulation: a shipped
        surrogate ('cubic', 'hexagonal') or one made by build serves.""",
    ),
    "next": (
        "the grain orientations worth measuring next",
        ("problem", "surrogate", "measurements", "prior", "next"),
        """Ranks orientations by what one more measurement there is expected to teach, given the posterior of extract.""",
    ),
}


def main(argv: Sequence[str] | None = None) -> int:
    """Run the command of these arguments (default: the process's own); return its exit status."""
    arguments = parser().parse_args(argv)
    # ArviZ announces its next version at every import.
    warnings.filterwarnings("ignore", category=FutureWarning, module="arviz")
    try:
        return arguments.action(arguments)
    except KeyboardInterrupt:
        log.warning("interrupted")
        tell("interrupted; what is done is kept, and the same command goes on from there")
        return INTERRUPTED
    except InputError as error:
        log.error("%s", error)
        tell(str(error))
        return BAD_INPUT
    except BayesindentError as error:
        log.error("%s", error)
        tell(str(error))
        return FAILED
    except BrokenPipeError:
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        return FAILED
    except Exception as error:
        log.exception("unexpected")
        tell(f"{type(error).__name__}: {error}" + ("" if open_logs() else "; BAYESINDENT_TRACE=1 shows where"))
        if os.environ.get("BAYESINDENT_TRACE"):
            raise
        return FAILED
    finally:
        close_log()


class Parser(argparse.ArgumentParser):
    """A parser whose help ends with the variables of the namelist groups that the command reads."""

    def __init__(self, *args, **kwargs):
        super().__init__(*args, **(kwargs | {"formatter_class": argparse.RawDescriptionHelpFormatter}))
        self.groups: tuple[str, ...] = ()

    def format_help(self) -> str:
        return super().format_help() + "".join(f"\n{describe_group(name)}" for name in self.groups)


def parser() -> argparse.ArgumentParser:
    """The parser of all commands."""
    root = Parser(prog="bayesindent", description=DESCRIPTION, epilog=EXAMPLES)
    root.add_argument("--version", action="version", version=f"bayesindent {__version__}")
    commands = root.add_subparsers(title="commands", metavar="COMMAND", required=True)

    output = argparse.ArgumentParser(add_help=False)
    output.add_argument("--output", metavar="DIR", type=Path, help="folder of the results (default: runs/<stem of the file>)")
    output.add_argument("--json", action="store_true", help="one JSON document on standard output, all else on standard error")

    def add(name: str, summary: str, action, description: str = "", parents=(output,)) -> Parser:
        words = textwrap.fill(" ".join(f"{summary[0].upper()}{summary[1:]}. {description}".split()), 100)
        command = commands.add_parser(name, help=summary, description=words, parents=parents)
        command.set_defaults(action=action, command=name)
        return command

    for name, (summary, groups, description) in NAMELIST_COMMANDS.items():
        command = add(name, summary, run_stage, description)
        command.groups = groups
        command.add_argument("file", metavar="FILE.nml", type=Path, help="the namelist")
        if name == "run":
            command.add_argument("--check", action="store_true", help="only validate the file and what it names")
        if name == "build":
            either = command.add_mutually_exclusive_group()
            either.add_argument("--ask", metavar="N", type=int, help="print the next N crystals as CSV instead of simulating them")
            either.add_argument("--tell", metavar="RESULTS.csv", type=Path, help="take rows with modulus_gpa that were computed elsewhere")

    command = add("predict", "mean and sd of the modulus for each row of a table", predict, "It prints them with modulus_gpa and sd_gpa.")
    command.add_argument("--surrogate", required=True, help="'cubic', 'hexagonal', or a surrogate.nc")
    command.add_argument(
        "--points", required=True, type=Path, metavar="points.csv", help="columns: the constants and phi1_deg, Phi_deg, phi2_deg"
    )

    command = add("report", "report.html from what a folder holds", report)
    command.add_argument("folder", metavar="DIR", type=Path, help="the output folder of other commands")
    command.add_argument("--figures", choices=("png", "pdf", "svg"), default="", help="every figure as a file in DIR/figures, too")

    names = "NAME is simulate, build or extract (against peers), or learning, coverage, paper, shipped or studies (accuracy); NAME --help says more."
    command = add("bench", "benchmarks against peers, and studies of accuracy, from a source tree", bench, names, parents=())
    command.add_argument("name", metavar="NAME")
    command.add_argument("arguments", nargs=argparse.REMAINDER, help="what the benchmark takes")

    command = add("test", "build and run the tests of a source tree", test, "The last line counts the cases.", parents=())
    command.add_argument("names", nargs="*", metavar="NAME", help="a suite (unit, python, cli), a unit test, or part of a case's name")
    command.add_argument("--sanitize", action="store_true", help="of a build that checks addresses, undefined behaviour and bounds")

    command = add("lint", "formatters, linters and type checker of a source tree", tool, parents=())
    command.add_argument("--fix", dest="arguments", action="store_const", const=["--fix"], default=[], help="format and mend first")
    command = add("lines", "code lines of a source tree by folder, and its largest parts", tool, parents=())
    command.add_argument("arguments", nargs="*", metavar="ROOT", help="other source trees, beside it")
    return root


def describe_group(name: str) -> str:
    """The variables of one namelist group, as the core's reader knows them."""
    from ..settings.problem import schema

    variables = [variable for variable in schema() if variable.group == name]
    lines = [f"&{name}: {variables[0].group_meaning}"]
    for variable in variables:
        default = "required" if variable.default == "*" else f"default: {variable.default or 'none'}"
        details = ", ".join(
            filter(None, [variable.unit, f"one of {variable.allowed}" if variable.kind == "choice" else variable.allowed, default])
        )
        lines += textwrap.wrap(f"{variable.meaning} ({details})", 110, initial_indent=f"  {variable.name:<22}", subsequent_indent=" " * 24)
    return "\n".join(lines) + "\n"


def run_stage(arguments: argparse.Namespace) -> int:
    """Run a command that reads a namelist."""
    from ..pipeline import stages
    from ..settings.problem import Problem

    problem = Problem(arguments.file, arguments.command)
    output = output_folder(arguments, arguments.file)
    if getattr(arguments, "check", False):
        stages.check(problem, output)
        return finish(arguments, {"file": str(arguments.file), "stages": stages.asked(problem), "warnings": problem.warnings})
    output.mkdir(parents=True, exist_ok=True)
    open_log(output, arguments)
    (output / "resolved.nml").write_text(problem.resolved)
    if getattr(arguments, "ask", None) is not None or getattr(arguments, "tell", None) is not None:
        return ask_or_tell(arguments, problem, output)
    document = stages.perform(arguments.command, problem, output, Progress(True))
    document["warnings"] = list(dict.fromkeys([*problem.warnings, *document["warnings"]]))
    return finish(arguments, document, output)


def ask_or_tell(arguments: argparse.Namespace, problem, output: Path) -> int:
    """Serve `build --ask` and `build --tell`."""
    from ..pipeline.import_export import ask
    from ..pipeline.import_export import tell as tell_results
    from ..settings.problem import read_crystals

    if arguments.ask is not None:
        table = ask(problem, output, arguments.ask)
        if arguments.json:
            rows = [{name: float(value) for name, value in row.items()} for row in csv.DictReader(io.StringIO(table))]
            return finish(arguments, {"points": rows, "warnings": problem.warnings})
        print(table, end="", flush=True)
        return DONE
    points = read_crystals(arguments.tell, problem.symmetry)
    document = tell_results(problem, output, points, str(arguments.tell))
    document["warnings"] = [*problem.warnings, *document["warnings"]]
    return finish(arguments, document, output)


def predict(arguments: argparse.Namespace) -> int:
    """Predict the rows of a table."""
    from ..pipeline import stages

    document = stages.predict(arguments.surrogate, arguments.points, output_folder(arguments, arguments.points))
    return finish(arguments, document)


def report(arguments: argparse.Namespace) -> int:
    """Write the report of a folder."""
    from ..pipeline import stages

    return finish(arguments, stages.report(arguments.folder, arguments.output or arguments.folder, arguments.figures))


def bench(arguments: argparse.Namespace) -> int:
    """Run a benchmark of the source tree."""
    from ..program.source_tree import run_benchmark

    return run_benchmark(arguments.name, arguments.arguments)


def test(arguments: argparse.Namespace) -> int:
    """Run the tests of the source tree."""
    from ..program.source_tree import run_tests

    return run_tests(arguments.names, arguments.sanitize)


def tool(arguments: argparse.Namespace) -> int:
    """Run a tool of the source tree."""
    from ..program.source_tree import run_tool

    return run_tool(arguments.command, arguments.arguments)


def output_folder(arguments: argparse.Namespace, source: Path) -> Path:
    """Where the results go."""
    return arguments.output or Path("runs") / source.stem


def finish(arguments: argparse.Namespace, document: dict, output: Path | None = None) -> int:
    """Tell the warnings on standard error and the document on standard output, as JSON or in words."""
    from ..inference.extract import plain

    for warning in document["warnings"]:
        log.warning("%s", warning)
        tell(f"warning: {warning}")
    if arguments.json:
        print(json.dumps(plain(document), allow_nan=False), flush=True)
    else:
        from ..program.console import show

        show(arguments.command, document)
    if output is not None:
        tell(f"results are in {output}")
    return DONE


def tell(text: str) -> None:
    """One line on standard error."""
    print(text, file=sys.stderr, flush=True)


def open_log(output: Path, arguments: argparse.Namespace) -> None:
    """Append to run.log from now on."""
    handler = logging.FileHandler(output / "run.log", encoding="utf-8")
    handler.setFormatter(logging.Formatter("%(asctime)s %(levelname)s %(message)s"))
    log.addHandler(handler)
    log.setLevel(logging.INFO)
    log.info("bayesindent %s: %s %s", __version__, arguments.command, arguments.file)


def open_logs() -> list[logging.Handler]:
    """Every run.log that is open."""
    return [handler for handler in log.handlers if isinstance(handler, logging.FileHandler)]


def close_log() -> None:
    """End run.log."""
    for handler in open_logs():
        log.removeHandler(handler)
        handler.close()
