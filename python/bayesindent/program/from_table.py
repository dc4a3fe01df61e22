"""The namelist that `extract TABLE` amounts to."""

import argparse
import os
from pathlib import Path

from ..common.result_files import write_text
from ..core import InputError
from ..settings.problem import namelist_of, schema

#: Endings of tables. A text of another ending, or with a group of a namelist, is a namelist.
ENDINGS = (".csv", ".tsv", ".txt", ".dat", ".xlsx", ".xlsm", ".xls")
#: Options of `extract` that a namelist states itself.
OPTIONS = ("symmetry", "orientations", "by_order", "knowledge", "modulus_kind")


def is_table(path: Path) -> bool:
    """Whether a file is a table, no namelist."""
    if path.suffix.lower() not in ENDINGS or not path.is_file():
        return False
    with path.open("rb") as file:
        return not any(line.lstrip().startswith(b"&") for line in file.readlines(100_000))


def add_table_options(parser: argparse.ArgumentParser) -> None:
    """What a table does not say."""
    of_table = parser.add_argument_group("instead of a namelist, for a table")
    of_table.add_argument("--symmetry", metavar="CLASS", help="the crystal class")
    of_table.add_argument(
        "--orientations",
        metavar="FILE",
        type=Path,
        help="the orientations of the grains, where the table has moduli alone; joined by name",
    )
    of_table.add_argument(
        "--by-order", action="store_true", help="join them by the order of the rows"
    )
    of_table.add_argument(
        "--knowledge",
        metavar="NAME=VALUE,SD",
        action="append",
        help="a quantity that is known, such as bulk_modulus=184,5; may be repeated",
    )
    of_table.add_argument(
        "--modulus-kind", metavar="KIND", help="which modulus was measured, as in &measurements"
    )


def namelist_for(arguments: argparse.Namespace, table: Path) -> Path:
    """Write the namelist of these options beside the results; return its path."""
    if not arguments.symmetry:
        classes = next(variable.allowed for variable in schema() if variable.name == "symmetry")
        raise InputError(f"{table}: the crystal class is missing; state --symmetry: {classes}")
    output = arguments.output = arguments.output or Path("runs") / table.stem
    output.mkdir(parents=True, exist_ok=True)
    orientations = arguments.orientations
    measured = {
        "file": os.path.relpath(table, output),
        "modulus_kind": arguments.modulus_kind,
        "orientations_file": orientations and os.path.relpath(orientations, output),
        "orientations_by": "order" if arguments.by_order else None,
    }
    groups = {
        "problem": {"symmetry": arguments.symmetry},
        "measurements": measured,
        "knowledge": arguments.knowledge and knowledge_of(arguments.knowledge),
    }
    text = f"! Written by bayesindent extract {table}; change it and run it again.\n"
    path = output / "extract.nml"
    write_text(path, text + namelist_of(str(table), groups))
    return path


def knowledge_of(stated: list[str]) -> dict[str, tuple]:
    """The variables of &knowledge of statements such as 'bulk_modulus=184,5'."""
    found = []
    for words in stated:
        try:
            name, numbers = words.split("=")
            mean, sd = map(float, numbers.split(","))
        except ValueError:
            raise InputError(
                f"--knowledge {words}: a name, a value and its sd are needed, such as "
                "bulk_modulus=184,5"
            ) from None
        found.append((name.strip(), mean, sd))
    return dict(zip(("quantity", "mean", "sd"), zip(*found)))
