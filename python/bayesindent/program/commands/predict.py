"""`predict`: a surrogate on a table of crystals."""

import argparse
import os
import shutil
import sys
from pathlib import Path

from ...settings.problem import read_crystals
from ...surrogate.surrogate import Surrogate
from ..command import Command, output_folder

__all__ = ["COMMAND"]


def predict(arguments: argparse.Namespace) -> dict:
    """Mean and sd of the modulus for each row: predictions.csv and its rows."""
    model, table = Surrogate.load(arguments.surrogate), arguments.points
    points = read_crystals(table, arguments.symmetry or model.symmetry)
    mean, sd, outside = model.predict_table(points, len(os.sched_getaffinity(0)))
    file = output_folder(arguments, table) / "predictions.csv"
    points.write(file, {"modulus_gpa": mean, "sd_gpa": sd})
    # Many rows in a document take much more memory than in a file.
    wanted = range(len(points) if arguments.json else 0)
    crystals = [{"constants": points.constants[i], "euler_deg": points.euler_deg[i]} for i in wanted]
    results = [crystal | {"modulus_gpa": mean[i], "sd_gpa": sd[i]} for i, crystal in enumerate(crystals)]
    return {"results": results, "file": str(file), "warnings": [f"{table}: {outside}"] if outside else []}


def show(document: dict) -> None:
    sys.stdout.flush()
    with open(document["file"], "rb") as file:
        shutil.copyfileobj(file, sys.stdout.buffer)
    sys.stdout.buffer.flush()


def add_arguments(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("--surrogate", required=True, help="'halfspace', 'block', or a surrogate.txt")
    columns = "columns: the constants and phi1_deg, Phi_deg, phi2_deg"
    parser.add_argument("--symmetry", default="", help="class of the rows that do not say theirs (default: that of the surrogate)")
    parser.add_argument("--points", required=True, type=Path, metavar="points.csv", help=columns)


COMMAND = Command(
    "predict",
    "mean and sd of the modulus for each row of a table",
    "It prints them with modulus_gpa and sd_gpa.",
    action=predict,
    arguments=add_arguments,
    show=show,
    then=lambda arguments, document: f"the same rows are in {document['file']}",
)
