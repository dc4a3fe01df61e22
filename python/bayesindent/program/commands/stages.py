"""The commands of stages, each with the core's stage of its name and the tables of its document;
and `run`, which performs all stages of a namelist.
"""

import argparse
import sys
from pathlib import Path

from ...common.progress import progress_bar
from ...common.result_files import as_csv, whole_file, write_groups, write_text
from ...core import InputError
from ...fe.indentation import Indentation
from ...inference.arviz_groups import groups_of
from ...report.formatting import (
    SHARES,
    cells,
    digits_of,
    number,
    numbers,
    orientation,
    plus_minus,
    region,
    share_cells,
    suggested_grains,
    unknowns_of,
)
from ...settings.problem import Problem, read_crystals, spelled
from ...stages.build import ask, tell
from ...stages.results_folder import read_posterior
from ...stages.stage import run_stage
from ...surrogate.basis import Basis
from ...surrogate.surrogate import places
from ..command import (
    PATIENCE_S,
    namelist_command,
    perform,
    perform_stage,
    prepare,
    quoted,
    report_of,
    show_table,
)
from ..from_table import OPTIONS, add_table_options, is_table, namelist_for
from . import SUMMARIES, command_of, report


def show_moduli(document: dict) -> None:
    """Print moduli of crystals, from simulations or the theory."""
    simulated = any(row.get("elements") for row in document["results"])
    header = ["constants (GPa)", "phi1", "Phi", "phi2", "M (GPa)"]
    header += ["elements", "seconds"] * simulated
    if waves := any("rayleigh_velocity_m_s" in row for row in document["results"]):
        header += ["along", "Rayleigh (m/s)"]
    rows = []
    for row in document["results"]:
        modulus = row["indentation_modulus_gpa"]
        texts = [
            ", ".join(f"{name} {value:g}" for name, value in row["constants"].items()),
            *(f"{angle:g}" for angle in row["euler_deg"]),
            "failed" if modulus is None else f"{modulus:.3f}",
        ]
        if simulated:
            texts += [row["elements"], f"{row['seconds']:.2f}"] if row["elements"] else ["–", "–"]
        if waves:
            texts += [
                f"{row['propagation_deg']:g}",
                f"{row['rayleigh_velocity_m_s']:.1f}" + " weak" * (not row["rayleigh_detected"]),
            ]
        rows.append(texts)
    show_table("Finite elements" if simulated else "Exact theory", header, rows)


def show_plan(document: dict) -> None:
    """Print the expected sds."""
    rows = []
    for row in document["results"]:
        sds = [f"{sd:.3g}" for sd in row["sd"].values()]
        rows.append([f"{row['grains']:g}", f"{100 * row['noise']:g} %", *sds])
    show_table(
        "Expected sds of the constants (GPa)", ["grains", "noise", *document["constants"]], rows
    )


def show_curves(document: dict) -> None:
    """Print the tip and the moduli of the grains."""
    radius, compliance = document["tip"]["radius_um"], document["frame"]["compliance_nm_mn"]
    print(
        f"Tip: radius {' ± '.join(numbers(radius, mean=3, sd=3))} um; frame: "
        f"{' ± '.join(numbers(compliance, mean=4, sd=4))} nm/mN"
    )
    print(
        "Not determined by the curves:",
        ", ".join(
            name for name, item in unknowns_of(document).items() if item["decided_by"] == "prior"
        )
        or "none",
    )
    grains = document["grains"]
    rows = cells(grains, "grain", "tests", effective_modulus_gpa=1, sd_gpa=1, own_sd_gpa=1)
    show_table("Effective moduli (GPa)", ["grain", "tests", "modulus", "sd", "of it its own"], rows)


def simulate(problem: Problem, output: Path) -> dict:
    """Perform the stage, then write the files of &simulation for each simulated crystal, named by
    its row from 1: fields for ParaView (vtu) and a deck (inp).

    Existing files are written again, since the crystal of a row may have changed. Fields cost one
    solution.
    """
    document = run_stage(problem, "simulate", output)
    settings, points = problem.settings.simulation, problem.crystals
    chosen = [i for i, row in enumerate(document["results"]) if row["depth_um"]]
    if not chosen or not (settings.vtu or settings.inp):
        return document
    indentation = Indentation.of_problem(problem)
    with progress_bar("fields and decks", len(chosen)) as advance:
        for i in chosen:
            stiffness, euler_deg = points.stiffness[i], points.euler_deg[i]
            stem = output / f"crystal_{i + 1:04d}"
            if settings.vtu:
                with whole_file(stem.with_suffix(".vtu")) as file:
                    indentation.write_vtu(file, stiffness, euler_deg)
            if settings.inp:
                title = f"{problem.settings.problem.title or 'indentation'}, crystal {i + 1}"
                write_text(stem.with_suffix(".inp"), indentation.deck(stiffness, euler_deg, title))
            advance(1)
    return document


def build(arguments: argparse.Namespace) -> dict:
    """Build a surrogate; or list the next crystals (--ask), or import moduli (--tell)."""
    problem, output = prepare(
        arguments, PATIENCE_S if (arguments.ask, arguments.tell) != (None, None) else 0
    )
    if arguments.ask is not None:
        arguments.results = None
        return ask(within_its_class(problem), output, arguments.ask)
    if arguments.tell is not None:
        points = read_crystals(
            arguments.tell, problem.settings.problem.symmetry or Basis(problem).symmetry
        )
        return tell(problem, output, points, str(arguments.tell))
    return perform(arguments.command, problem, output)


def within_its_class(problem: Problem) -> Problem:
    """The problem with training crystals of its stated class alone, unless &domain says otherwise:
    for that class they leave a quarter of the error (docs/verification/learning.md).
    """
    symmetry, domain = problem.settings.problem.symmetry, problem.settings.domain
    if not symmetry or domain.classes or domain.c_min is not None:
        return problem
    make, (path, command, changes) = problem._made_of
    return make(path, command, f"{changes}\n&domain classes = '{symmetry}' /")


def add_build_arguments(parser: argparse.ArgumentParser) -> None:
    """The two ways to simulate elsewhere."""
    either = parser.add_mutually_exclusive_group()
    either.add_argument(
        "--ask",
        metavar="N",
        type=int,
        help="print the next N crystals, of the stated class, instead of simulating them",
    )
    either.add_argument(
        "--tell",
        metavar="RESULTS.csv",
        type=Path,
        help="take rows with modulus_gpa that were computed elsewhere",
    )


def show_build(document: dict) -> None:
    """Print the points as CSV, for pipes, or one line on the campaign or the surrogate."""
    if "points" in document:
        points = document["points"]
        print(as_csv(points[0], map(dict.values, points)), end="", flush=True)
    elif "imported" in document:
        print(
            f"Campaign: {document['imported']} results imported, {document['simulations']} "
            f"simulations in all, {document['failed']} failed"
        )
    else:
        print(
            f"Surrogate: {document['simulations']} simulations ({document['new_simulations']} "
            f"new, {document['failed']} failed), "
            f"{document['terms']} terms, leave-one-out error "
            f"{number(document['loocv_gpa'], 2)} GPa; {document['domain']['words']}"
        )


def after_build(arguments: argparse.Namespace, document: dict) -> str:
    """The next step."""
    if "points" in document:
        return (
            "simulate these, add a column modulus_gpa (or the cause of a failure as reason), and "
            f"bayesindent build {quoted(arguments.file)} --tell RESULTS.csv"
        )
    if "imported" in document:
        return f"bayesindent build {quoted(arguments.file)}, which trains the surrogate on them"
    return (
        f"bayesindent extract {quoted(arguments.file)} if it has measurements, or bayesindent "
        f"predict --surrogate {document['file']} --points POINTS.csv"
    )


def begin_extract(arguments: argparse.Namespace) -> dict:
    """Perform the stage for a namelist, or for a table with options in its place."""
    if is_table(arguments.file):
        arguments.file = namelist_for(arguments, arguments.file)
    elif stated := [name for name in OPTIONS if getattr(arguments, name)]:
        option = stated[0].replace("_", "-")
        raise InputError(
            f"--{option} goes with a table; {arguments.file} is a namelist, state it there"
        )
    return perform_stage(arguments)


def extract(problem: Problem, output: Path) -> dict:
    """Perform the stage and write its numbers in ArviZ' schema to posterior.nc."""
    document = run_stage(problem, "extract", output)
    write_groups(output / "posterior.nc", groups_of(read_posterior(output)))
    return document


def interval_of(name: str, item: dict) -> str:
    """The 95 % interval of a parameter."""
    return " .. ".join(number(value, digits_of(name)) for value in item["hdi_95"])


def show_extract(document: dict) -> None:
    """Print what the constants follow from, and their table."""
    rows = [
        [
            name,
            *values_of(name, item),
            interval_of(name, item),
            *share_cells(item),
        ]
        for name, item in document["parameters"].items()
    ]
    print("Measurements, prior and surrogate:", *document["prior"]["words"], sep="\n  ")
    if beside := document.get("theory_alone"):
        constants = ", ".join(
            f"{name} {' ± '.join(numbers(item, mean=1, sd=1))}" for name, item in beside.items()
        )
        print(f"Theory of the half-space without the specimen: {constants}")
    rivals = document.get("diagnosis")
    if rivals and (best := rivals[0])["log_odds"] > 0:
        print(f"Best other model: {best['explanation']} (log odds {best['log_odds']:.1f})")
    header = ["constant", "mean", "sd", "95 %", *SHARES.values(), "verdict"]
    show_table("Elastic constants (GPa), and shares of their variance (%)", header, rows)


def values_of(name: str, item: dict) -> list[str]:
    """Mean and sd; of a constant that is not determined, the median alone."""
    if item["verdict"] == "not_determined":
        return [*numbers(item, median=digits_of(name)), "median"]
    return numbers(item, **dict.fromkeys(("mean", "sd"), digits_of(name)))


def after_extract(arguments: argparse.Namespace, document: dict) -> str:
    """The next step."""
    more = (
        f", and bayesindent next {quoted(arguments.file)} for the grain to measure next"
        if document["usable"]
        else ""
    )
    return f"{report_of(arguments, document)}{more}"


def along_z(item: dict) -> str:
    """The direction of a suggestion along the indenter."""
    return item.get("uvw") or " ".join(f"{component:.2f}" for component in item["direction"])


def show_next(document: dict) -> None:
    """Print the suggested orientations or grains and their directions along the indenter."""
    suggestions = document["suggestions"]
    grains = any("grain" in item for item in suggestions)
    rows, header = [], ["phi1", "Phi", "phi2", "along z", f"expected gain ({document['unit']})"]
    for name, item in zip(suggested_grains(suggestions), suggestions):
        rows.append(
            [
                *[name] * grains,
                *(f"{angle:.1f}" for angle in item["euler_deg"]),
                region(item, along_z(item)),
                f"{item['gain']:.3g}",
            ]
        )
    show_table(
        f"{'Grains' if grains else 'Orientations'} worth measuring next (degrees)",
        ["grain", *header] if grains else header,
        rows,
    )


def tensor(arguments: argparse.Namespace) -> dict:
    """Perform the stage with the tensor as `&knowledge stiffness_file`."""
    path, sd = arguments.tensor, arguments.relative_sd
    more = f", stiffness_relative_sd = {sd}" if sd is not None else ""
    arguments.stated = {"&knowledge stiffness_file": spelled(path.resolve()) + more}
    # The folder of extract remains that of its own inputs.
    arguments.output = arguments.output or Path("runs") / f"{arguments.file.stem}-{path.stem}"
    return perform_stage(arguments)


def add_tensor_arguments(parser: argparse.ArgumentParser) -> None:
    """The tensor and its uncertainty."""
    parser.add_argument(
        "tensor",
        metavar="TENSOR",
        type=Path,
        help="JSON of Materials Project or pymatgen, 6 x 6 numbers (GPa), or means and covariance",
    )
    parser.add_argument(
        "--relative-sd", metavar="X", type=float, help="of each constant, such as 0.05"
    )


def show_tensor(document: dict) -> None:
    """Print whether the measurements agree with the tensor."""
    worst = max(document["predicted"], key=lambda grain: abs(grain["deviation"]))
    print(
        f"Predictive p of the tensor: {number(document['predictive_p'], 4)} "
        f"(chi-square {number(document['chi_square'])} for {document['freedom']:.0f})\n"
        f"Log odds over a free crystal: {number(document['log_odds'])}\n"
        f"Largest deviation: {worst.get('grain') or orientation(worst['euler_deg'])}, measured "
        f"{worst['measured']:.1f}, the tensor gives {plus_minus(worst)} "
        f"({worst['deviation']:.1f} sds)"
    )
    for face in document.get("suggestions", ()):
        print(
            f"Face that would refute it soonest: {face.get('grain', '')} {along_z(face)} (expected "
            f"growth of the log odds if another crystal is right: {face['gain']:.2g})"
        )


def run(arguments: argparse.Namespace) -> dict:
    """Perform the stages of the file in order, then write a report; with --check only name the
    stages. The stage `next` is skipped if the result cannot be used.
    """
    problem, output = prepare(arguments, None if arguments.check else 0)
    # The surrogate must exist if no earlier stage builds it, and be valid for the prior's crystals;
    # the reader of the namelist cannot check this.
    problem._call("check_stages", **places(output, problem.folder))
    if arguments.check:
        return {"file": str(arguments.file), "stages": problem.stages, "warnings": problem.warnings}
    if problem.table and not arguments.quiet:
        # Measured speeds of waves follow the moduli in the list of measurements.
        print(
            *problem.table.words(min(len(problem.measurements), len(problem.table.cells))),
            sep="\n",
            file=sys.stderr,
        )
    documents: dict[str, dict] = {}
    for name in problem.stages:
        if name != "next" or documents.get("extract", {}).get("usable", True):
            documents[name] = perform(command_of(name), problem, output)
    documents["report"] = report.make(output, output)
    return documents | {
        "warnings": [
            *problem.warnings,
            *(line for document in documents.values() for line in document["warnings"]),
        ]
    }


def show_run(document: dict) -> None:
    """Print the tables of all stages, or, with --check, the stages."""
    if "stages" in document:
        print(f"{document['file']}: right; it asks for {', '.join(document['stages'])}")
    # The constants come last, since a terminal shows the end.
    for name in sorted(filter(SUMMARIES.get, document), key="extract".__eq__):
        if show := command_of(name).show:
            show(document[name])


def after_run(arguments: argparse.Namespace, document: dict) -> str:
    """The next step."""
    if arguments.check:
        return f"bayesindent run {quoted(arguments.file)}"
    more = (
        f"; bayesindent report {quoted(arguments.results)} --paper for a paper"
        if "extract" in document
        else ""
    )
    return f"open {document['report']['file']} in a browser{more}"


COMMANDS = (
    namelist_command("simulate", stage=simulate, show=show_moduli, resumes=True, then=report_of),
    namelist_command("theory", show=show_moduli, then=report_of),
    namelist_command(
        "build",
        action=build,
        arguments=add_build_arguments,
        show=show_build,
        resumes=True,
        then=after_build,
    ),
    namelist_command("plan", show=show_plan, then=report_of),
    namelist_command("curves", show=show_curves, then=report_of),
    namelist_command(
        "extract",
        action=begin_extract,
        stage=extract,
        arguments=add_table_options,
        show=show_extract,
        resumes=True,
        then=after_extract,
    ),
    namelist_command(
        "next",
        show=show_next,
        resumes=True,
        then=lambda arguments, _: (
            f"measure such grains, add them to the measurements of {arguments.file}, and "
            "bayesindent run it again"
        ),
    ),
    namelist_command(
        "tensor", action=tensor, arguments=add_tensor_arguments, show=show_tensor, resumes=True
    ),
    namelist_command(
        "run",
        action=run,
        arguments=lambda parser: parser.add_argument(
            "--check", action="store_true", help="only validate the file and what it names"
        ),
        show=show_run,
        resumes=True,
        then=after_run,
    ),
)
