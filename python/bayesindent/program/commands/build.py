"""`build`: Step 1, and its simulations made elsewhere."""

import argparse
from pathlib import Path

from ...common.progress import Progress
from ...common.result_files import as_csv
from ...pipeline.build import ask, tell
from ...settings.problem import read_crystals
from ...surrogate.basis import Basis
from ..command import PATIENCE_S, namelist_command, perform, prepare, with_warnings

__all__ = ["COMMAND"]


def action(arguments: argparse.Namespace) -> dict:
    """Build; or with --ask the next crystals, with --tell the moduli of others."""
    problem, output = prepare(arguments, PATIENCE_S if (arguments.ask, arguments.tell) != (None, None) else 0)
    if arguments.ask is not None:
        arguments.results = None
        return with_warnings(problem, ask(problem, output, arguments.ask))
    if arguments.tell is not None:
        points = read_crystals(arguments.tell, problem.settings.problem.symmetry or Basis(problem).symmetry)
        return with_warnings(problem, tell(problem, output, points, str(arguments.tell)))
    return with_warnings(problem, perform(COMMAND, problem, output, Progress(not arguments.quiet)))


def show(document: dict) -> None:
    """The points as CSV, for pipes; or what was imported or built."""
    if "points" in document:
        points = document["points"]
        print(as_csv(list(points[0]), [list(point.values()) for point in points]), end="", flush=True)
    elif "imported" in document:
        print(f"Campaign: {document['imported']} results imported, {document['simulations']} simulations in all")
    else:
        print(
            f"Surrogate: {document['simulations']} simulations ({document['new_simulations']} new, {document['failed']} failed), "
            f"{document['terms']} terms, leave-one-out error {document['loocv_gpa']:.3g} GPa; {document['domain']['words']}"
        )


def then(arguments: argparse.Namespace, document: dict) -> str:
    if "points" in document:
        return f"simulate these, add a column modulus_gpa, and bayesindent build {arguments.file} --tell RESULTS.csv"
    if "imported" in document:
        return f"bayesindent build {arguments.file}, which trains the surrogate on them"
    return f"bayesindent extract {arguments.file} if it has measurements, or bayesindent predict --surrogate {document['file']} --points POINTS.csv"


def add_arguments(parser: argparse.ArgumentParser) -> None:
    either = parser.add_mutually_exclusive_group()
    either.add_argument("--ask", metavar="N", type=int, help="print the next N crystals as CSV instead of simulating them")
    either.add_argument("--tell", metavar="RESULTS.csv", type=Path, help="take rows with modulus_gpa that were computed elsewhere")


COMMAND = namelist_command("build", action=action, arguments=add_arguments, show=show, resumes=True, then=then)
