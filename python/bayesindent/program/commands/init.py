"""`init`: a namelist and a table to begin with."""

import argparse
from pathlib import Path

from ...common.result_files import write_text
from ...core import InputError
from ...pipeline.template import metals, template
from ..command import Command

__all__ = ["COMMAND"]

#: Names of the two files.
NAMELIST, TABLE = "grains.nml", "grains.csv"


def init(arguments: argparse.Namespace) -> dict:
    """Write both; what is there is not replaced."""
    folder = arguments.output or Path()
    texts = dict(zip((NAMELIST, TABLE), template(arguments.symmetry, arguments.metal, TABLE), strict=True))
    there = [folder / name for name in texts if (folder / name).exists()]
    # One alone that is as it would be written is what a kill or a full disk left.
    if len(there) == len(texts) or any(path.read_bytes() != texts[path.name].encode() for path in there):
        raise InputError(f"{there[0]}: is there already; choose another folder with --output")
    for name, text in texts.items():
        write_text(folder / name, text)
    return {"files": [str(folder / name) for name in texts], "warnings": []}


def add_arguments(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("symmetry", nargs="?", metavar="SYMMETRY", help="a crystal class, such as fcc, hcp or mmm")
    parser.add_argument("--metal", metavar="SYMBOL", help=f"state what is known of a pure metal: {', '.join(metals())}")


COMMAND = Command(
    "init",
    "a namelist to begin with, every variable explained, and a table to fill in",
    f"It writes {NAMELIST} and {TABLE} into the current folder, or that of --output.",
    action=init,
    arguments=add_arguments,
    show=lambda document: print("Written:", *document["files"]),
    then=lambda arguments, document: f"fill in {document['files'][1]}, then bayesindent run {document['files'][0]}",
)
