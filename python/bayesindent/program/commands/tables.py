"""Commands on tables: `table` shows how measurements are read, and `predict` evaluates a surrogate
for crystals.
"""

import argparse
import shutil
import sys
from pathlib import Path

from ...common.diagnostics import diagnostic
from ...core import cores
from ...settings.problem import Problem, read_crystals, schema
from ...surrogate.surrogate import Surrogate
from ..command import Command, output_folder, show_table


def table(arguments: argparse.Namespace) -> dict:
    """Write the canonical table, and return the columns and their meanings, the kind of modulus,
    the grains, and the rows left out.
    """
    path = arguments.table
    # The last class, triclinic, has no symmetry and thus fits every table.
    classes = next(variable.allowed for variable in schema() if variable.name == "symmetry")
    crystal = {
        "symmetry": arguments.symmetry or classes.split(", ")[-1].strip("'"),
        "lattice": arguments.lattice,
    }
    stated = {
        "sheet": arguments.sheet,
        "modulus_kind": arguments.modulus_kind,
        "columns": arguments.column,
        "scale": "inferred",
    }
    points = Problem.from_keywords(
        str(path), problem=crystal, measurements={"file": path.absolute()} | stated
    ).measurements
    read = points.problem.table
    written = output_folder(arguments, path) / "table.csv"
    points.problem._call("write_table", path=written)
    none = [None] * len(points)
    columns = [
        {"header": name, "read_as": meaning or None}
        for name, meaning in zip(read.names, read.meanings)
    ]
    grains = {
        "grain": points.names or none,
        "euler_deg": points.euler_deg,
        "modulus_gpa": points.modulus_gpa,
        "sd_gpa": none if points.sd_gpa is None else points.sd_gpa,
    }
    # A warning on the class matters only if the user stated the class.
    warnings = [
        found
        for found in points.problem.warnings
        if arguments.symmetry or found["code"] != "few_directions"
    ]
    return {
        "file": str(path),
        "table": str(written),
        "sheet": read.sheet or None,
        "columns": columns,
        "modulus_kind": points.modulus_kind,
        "grains": len(points),
        "left_out": {str(line): reason for line, reason in read.left_out.items()},
        "results": [dict(zip(grains, row)) for row in zip(*grains.values())],
        "words": read.words(len(points)),
        "warnings": warnings,
    }


def show_understood(document: dict) -> None:
    """Print how the table is read, and its first grains."""
    print("\n".join(document["words"]))
    rows, most = [], 100
    for number, row in enumerate(document["results"][:most], 1):
        sd = "" if row["sd_gpa"] is None else f"{row['sd_gpa']:.3g}"
        rows.append([row["grain"] or number, *row["euler_deg"], row["modulus_gpa"], sd])
    which = (
        "Grains"
        if len(rows) == document["grains"]
        else f"The first {most} of {document['grains']} grains, --json has all"
    )
    show_table(
        f"{which} (degrees, GPa)",
        ["grain", "phi1", "Phi", "phi2", document["modulus_kind"], "sd"],
        rows,
    )


def add_table_arguments(parser: argparse.ArgumentParser) -> None:
    """The table, and what its headers do not say."""
    parser.add_argument(
        "table", metavar="FILE", type=Path, help="a table of measurements: .csv, .txt, .xlsx"
    )
    parser.add_argument(
        "--symmetry", help="of the crystals, where it matters: directions by indices"
    )
    parser.add_argument(
        "--lattice",
        type=float,
        nargs="+",
        metavar="X",
        help="parameters of the unit cell, where indices need them",
    )
    parser.add_argument(
        "--sheet", default="", help="of a spreadsheet (default: the first one that has moduli)"
    )
    parser.add_argument(
        "--modulus-kind",
        metavar="KIND",
        help="as &measurements modulus_kind, where the header does not say it",
    )
    parser.add_argument(
        "--column",
        action="append",
        metavar="'NAME = HEADER'",
        help="as &measurements columns; may be repeated",
    )


def predict(arguments: argparse.Namespace) -> dict:
    """Write mean and sd of the modulus for each row to predictions.csv."""
    model, table = Surrogate.load(arguments.surrogate), arguments.points
    points = read_crystals(table, arguments.symmetry or model.symmetry)
    mean, sd, outside = model.predict_table(points, cores())
    file = output_folder(arguments, table) / "predictions.csv"
    points.write(file, {"modulus_gpa": mean, "sd_gpa": sd})
    # The document has the rows only for --json, since they take much more memory than in a file.
    rows = zip(points.constants, points.euler_deg, mean, sd) if arguments.json else ()
    names = ("constants", "euler_deg", "modulus_gpa", "sd_gpa")
    return {
        "results": [dict(zip(names, row)) for row in rows],
        "file": str(file),
        "warnings": [diagnostic("outside_domain", f"{table}: {outside}")] if outside else [],
    }


def show_predictions(document: dict) -> None:
    """Copy the file of predictions to standard output."""
    sys.stdout.flush()
    with open(document["file"], "rb") as file:
        shutil.copyfileobj(file, sys.stdout.buffer)
    sys.stdout.buffer.flush()


def add_predict_arguments(parser: argparse.ArgumentParser) -> None:
    """The surrogate and the crystals."""
    parser.add_argument(
        "--surrogate", required=True, help="'halfspace', 'block', or a surrogate.txt"
    )
    columns = "columns: the constants and phi1_deg, Phi_deg, phi2_deg"
    parser.add_argument(
        "--symmetry",
        default="",
        help="class of the rows that do not say theirs (default: that of the surrogate)",
    )
    parser.add_argument("--points", required=True, type=Path, metavar="points.csv", help=columns)


COMMANDS = (
    Command(
        "table",
        action=table,
        arguments=add_table_arguments,
        show=show_understood,
        then=lambda _, document: (
            f"&measurements file = '{document['table']}', technique = 'oliver_pharr' or "
            "'elastic_sphere' in a namelist (bayesindent init writes one)"
        ),
    ),
    Command(
        "predict",
        action=predict,
        arguments=add_predict_arguments,
        show=show_predictions,
        then=lambda _, document: f"the same rows are in {document['file']}",
    ),
)
