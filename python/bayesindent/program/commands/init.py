"""`init`: write a namelist and a table of measurements to begin with. The namelist explains every
variable of Step 2 and states known quantities of a metal.
"""

import argparse
import textwrap
from pathlib import Path
from types import SimpleNamespace

from ...common.result_files import write_text
from ...core import InputError
from ...crystal.elasticity import class_name, constant_names
from ...crystal.metals import known_of, metals
from ...settings.problem import Variable, schema, spelled
from ..command import Command, quoted

#: Names of the two files.
NAMELIST, TABLE = "grains.nml", "grains.csv"

#: Variables of &surrogate that only `build` reads.
FOR_BUILDING = ("model", "degree", "bandlimit", "truncation", "prior_sd", "scan")
#: What most people change, in the groups; a list after them explains all other variables.
FIRST = (
    *("symmetry", "title", "file", "modulus_kind", "technique", "calibration_sd"),
    *("quantity", "mean", "sd", "samples", "count"),
)

#: Lines of modulus_kind, the variable without a default.
KINDS = (
    "  ! Which modulus the instrument reported. Remove the ! of one line:",
    "  ! modulus_kind = 'effective_modulus'     ! Er, the reduced modulus of specimen and tip: "
    "1/Er = 1/M + (1 - nu_i^2)/E_i",
    "  ! modulus_kind = 'indentation_modulus'   ! M = E/(1 - nu^2) of the specimen alone; "
    "the deformation of the tip is removed",
    "  ! modulus_kind = 'sample_modulus'        ! Es = (1 - nu_s^2) M, often called E, EIT or "
    "Young's modulus, for an assumed sample_nu",
)


def template(symmetry: str | None, metal: str | None) -> dict[str, str]:
    """The texts of a namelist and of its table of measurements by the names of their files.

    `symmetry` is a crystal class and `metal` the symbol of a metal, which implies its class.
    """
    for symbol, each in metals().items():
        # The name of a metal stands for --metal.
        if symmetry and symmetry.casefold() in (symbol.casefold(), each.name):
            symmetry, metal = None, metal or symbol
    known = metals().get(metal[:1].upper() + metal[1:].lower()) if metal else None
    if metal and known is None:
        raise InputError(f"init: --metal: {metal} is not known; known are {', '.join(metals())}")
    if symmetry is None:
        if known is None:
            raise InputError(
                "init: the crystal class is missing; state one, such "
                "as fcc, hcp or mmm, or a --metal"
            )
        symmetry = known.structure
    word, stated = class_name(symmetry), symmetry.lower()
    others = {metal.structure for metal in metals().values()} - {known.structure if known else ""}
    if known and (word != known.symmetry or stated in others):
        raise InputError(
            f"init: --metal: {known.name} is {known.structure} ({known.symmetry}), not {symmetry}"
        )
    constants = ", ".join(constant_names(word))
    lines = [
        f"! Elastic constants of a {word} crystal ({constants}) from indentation moduli of "
        "single grains.",
        f"! Fill in {TABLE}, look through this file, and run it: bayesindent run {NAMELIST}",
        "! What starts with ! is a comment: take the ! away where you want another value than "
        "the default.",
    ]
    rest = ["", "! Every other variable with its default: copy a line into its group."]
    # These variables are set.
    problem = {"symmetry": word, "title": known.name.capitalize() if known else ""}
    stated_of = {
        "problem": problem,
        "surrogate": {"file": "halfspace"},
        "measurements": {"file": TABLE},
        "next": {"count": "3"},
    }
    for group in ("problem", "surrogate", "measurements", "prior", "knowledge", "sampler", "next"):
        of_metal = known if group == "knowledge" else None
        without = ("quantity", "mean", "sd") if of_metal else FOR_BUILDING
        variables = [
            variable
            for variable in schema()
            if variable.group == group and variable.name not in without
        ]
        first = [variable for variable in variables if variable.name in FIRST]
        lines += ["", f"&{group}"]
        if of_metal:
            lines += knowledge(of_metal)
        for variable in first:
            lines += (
                KINDS
                if variable.name == "modulus_kind"
                else explained(variable, stated_of.get(group, {}).get(variable.name))
            )
        lines += ["/"]
        rest += ["", f"! &{group}: {variables[0].group_meaning}"]
        if group == "prior":
            rest += [f"! The constants are in the order {constants}."]
        for variable in variables:
            if variable not in first:
                rest += [line.strip() for line in explained(variable, None)]
    return {
        NAMELIST: "\n".join(lines + rest) + "\n",
        TABLE: Path(__file__).with_name(TABLE).read_text(encoding="utf-8"),
    }


def knowledge(metal: SimpleNamespace) -> list[str]:
    """The lines of &knowledge that state what is known of a pure metal."""
    known = known_of(metal)
    stated = ", ".join(f"{name} {value:g}" for name, value in metal.constants.items())
    said = (
        f"Of pure {metal.name} at room temperature, by its constants {stated} GPa "
        f"({metal.source}). Of an alloy take its own, or a larger sd."
    )
    units = "GPa" if "bulk_modulus" in known else "1/TPa"
    return [
        *(f"  ! {line}" for line in textwrap.wrap(said, 120)),
        f"  quantity = {', '.join(spelled(name) for name in known)}",
        f"  mean = {', '.join(f'{mean:.4g}' for mean, _ in known.values())}   ! {units}",
        f"  sd = {', '.join(f'{sd:.2g}' for _, sd in known.values())}",
    ]


def explained(variable: Variable, value: str | None) -> list[str]:
    """The line of a variable under its meaning: its value, or its default in a comment."""
    allowed = (
        f"; {variable.allowed}"
        if variable.allowed and variable.kind != "logical" and len(variable.allowed) < 120
        else ""
    )
    unit = f", {variable.unit}" if variable.unit else ""
    meaning = textwrap.wrap(f"{variable.meaning}{unit}{allowed}", 120)
    stated = variable.default if value is None else value
    if variable.kind in ("text", "choice", "file") and stated not in ("*", "unset"):
        stated = spelled(stated)
    elif stated in ("unset", "*", ""):
        stated = ".."
    return [
        *(f"  ! {line}" for line in meaning),
        f"  {'! ' if value is None else ''}{variable.name} = {stated}",
    ]


def init(arguments: argparse.Namespace) -> dict:
    """Write both files; files that exist are not replaced."""
    folder = arguments.output or Path()
    texts = template(arguments.symmetry, arguments.metal)
    there = [folder / name for name in texts if (folder / name).exists()]
    # A single file with the same content is left from a command that was killed or filled the disk.
    if len(there) == len(texts) or any(
        path.read_bytes() != texts[path.name].encode() for path in there
    ):
        raise InputError(f"{there[0]}: is there already; choose another folder with --output")
    for name, text in texts.items():
        write_text(folder / name, text)
    return {"files": [str(folder / name) for name in texts], "warnings": []}


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """The crystal class and the metal."""
    parser.add_argument(
        "symmetry", nargs="?", metavar="SYMMETRY", help="a crystal class, such as fcc, hcp or mmm"
    )
    parser.add_argument(
        "--metal",
        metavar="SYMBOL",
        help=f"state what is known of a pure metal: {', '.join(metals())}",
    )


COMMANDS = (
    Command(
        "init",
        action=init,
        arguments=add_arguments,
        show=lambda document: print("Written:", *document["files"]),
        then=lambda _, document: (
            f"fill in {document['files'][1]}, then bayesindent run {quoted(document['files'][0])}"
        ),
    ),
)
