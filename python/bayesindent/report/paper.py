"""The author's pack: what a paper takes from a run, in files that journals take."""

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from ..common.result_files import write_csv, write_text
from ..core import InputError
from ..crystal.elasticity import stiffness_rows
from ..fe.deck import elastic_constants
from ..version import __version__
from .methods import bibliography, methods
from .results import Results
from .words import best_first, latex, listed, number, orientation, quantity_in_words

__all__ = ["write_paper"]

#: GPa in MPa.
MPA = 1000.0

#: What a bare run of the two solvers needs beside the constants.
SOLVERS = {
    "abaqus": ("ANISOTROPIC", "*SOLID SECTION, ELSET=.., MATERIAL=CRYSTAL, ORIENTATION=.."),
    "calculix": ("ANISO", "*SOLID SECTION, ELSET=.., MATERIAL=CRYSTAL, ORIENTATION=.."),
}


def write_paper(results: Results) -> Path:
    """Write the texts, tables and cards of the pack into the folder `paper` of the results; return it. Figures are `drawing`'s."""
    if not results.documents["extract"] or not results.posterior:
        raise InputError(f"{results.folder}: there is no posterior of the present inputs to write of; run extract first")
    folder = results.folder / "paper"
    text, cited = methods(results)
    write_text(folder / "methods.tex", text)
    write_text(folder / "references.bib", bibliography(cited))
    for name, (caption, header, rows) in tables(results).items():
        write_csv(folder / f"{name}.csv", header, rows, mark(results) + caption)
        write_text(folder / f"{name}.tex", latex_table(name, mark(results) + caption, header, rows))
    write_posterior(results, folder / "posterior.csv")
    mean = [results.documents["extract"]["parameters"][name]["mean"] for name in results.constants]
    matrix = stiffness_rows(results.symmetry, [mean])[0]
    for solver in SOLVERS:
        write_text(folder / f"stiffness_{solver}.inp", card(results, matrix, solver))
    return folder


def mark(results: Results) -> str:
    """What every table of made-up data begins with."""
    return "Synthetic data. " if results.synthetic else ""


def tables(results: Results) -> dict[str, tuple[str, list[str], list[list[str]]]]:
    """Caption, header and rows of each table by the name of its files."""
    document = results.documents["extract"]
    constants = [
        [name, number(item["mean"]), number(item["sd"]), *map(number, item["hdi_95"]), number(share, 3)]
        for name, item, share in best_first(document)
    ]
    found = {
        "constants": (
            "Elastic constants in GPa: mean and standard deviation (sd) of the posterior, its 95 % interval of highest density, and the "
            "contraction, the share of the prior's variance that the data removed.",
            ["constant", "mean", "sd", "95 % from", "to", "contraction"],
            constants,
        )
    }
    rows = [row for row in document["identifiability"] if row["kind"] == "quantity" and row["name"] not in document["parameters"]]
    if rows:
        found["quantities"] = (
            "Quantities of the crystal that follow from its constants: mean and sd of the posterior, sd of the prior, contraction.",
            ["quantity", "unit", "mean", "sd", "sd of the prior", "contraction"],
            [
                [
                    quantity_in_words(row["name"]),
                    "" if row["unit"] == "1" else row["unit"],
                    *map(digits(row), ("mean", "sd", "prior_sd")),
                    number(row["contraction"], 3),
                ]
                for row in rows
            ],
        )
    combined = [row for row in document["identifiability"] if row["kind"] == "combination"]
    if combined:
        found["combinations"] = (
            "Products of powers of the constants, from the best to the worst identified: exponents, sds in per cent, contraction.",
            [*results.constants, "sd (%)", "sd of the prior (%)", "contraction"],
            [
                [
                    *(number(round(row["exponents"].get(name, 0.0), 2) + 0.0, 2) for name in results.constants),
                    number(100 * row["sd"], 2),
                    number(100 * row["prior_sd"], 2),
                    number(row["contraction"], 3),
                ]
                for row in combined
            ],
        )
    found["correlation"] = (
        "Correlation of the constants in the posterior.",
        ["", *document["parameters"]],
        [[name, *(number(value, 2) for value in row)] for name, row in zip(document["parameters"], document["correlation"])],
    )
    found["grains"] = (
        f"The {results.kind} of each grain in GPa: Bunge's angles, as measured, and as the posterior predicts it without the noise.",
        ["grain", "orientation", "measured", "sd measured", "predicted", "sd predicted"],
        [
            [
                str(row),
                orientation(item.get("euler_deg", ())),
                *(number(item.get(key)) for key in ("measured", "measured_sd", "mean", "sd")),
            ]
            for row, item in enumerate(document["predicted"], start=1)
        ],
    )
    return found


def digits(row: dict):
    """How a value of a row of quantities is written, by its key."""
    return lambda key: number(row[key], 3 if row["unit"] == "1" else 1)


def latex_table(label: str, caption: str, header: Sequence[str], rows: Sequence[Sequence[str]]) -> str:
    """A table in LaTeX without packages."""
    lines = [
        r"\begin{table}",
        rf"\caption{{{latex(caption)}}}",
        rf"\label{{tab:{label}}}",
        r"\begin{tabular}{l" + "r" * (len(header) - 1) + "}",
    ]
    lines += [r"\hline", " & ".join(map(latex, header)) + r" \\", r"\hline"]
    lines += [" & ".join(map(latex, row)) + r" \\" for row in rows]
    return "\n".join([*lines, r"\hline", r"\end{tabular}", r"\end{table}"]) + "\n"


def write_posterior(results: Results, file: Path) -> None:
    """Every draw: chain, draw, constants in GPa."""
    chains, draws = next(iter(results.samples.values())).shape
    index = np.stack(np.meshgrid(np.arange(chains), np.arange(draws), indexing="ij"), axis=-1).reshape(-1, 2)
    values = np.stack([chain.ravel() for chain in results.samples.values()], axis=1)
    rows = ([*map(int, place), *map(float, row)] for place, row in zip(index, values))
    names = [f"{name}_gpa" for name in results.constants]
    write_csv(file, ["chain", "draw", *names], rows, mark(results) + f"Draws of the posterior of a {results.symmetry} crystal")


def card(results: Results, matrix, solver: str) -> str:
    """The stiffness (6, 6) in GPa, crystal axes, as a material of Abaqus or CalculiX in MPa."""
    kind, section = SOLVERS[solver]
    parameters = results.documents["extract"]["parameters"]
    said = listed([f"{name} {number(parameters[name]['mean'])} +- {number(parameters[name]['sd'])}" for name in results.constants])
    lines = [
        f"** {mark(results)}{results.title}",
        f"** Mean of the posterior of a {results.symmetry} crystal, bayesindent {__version__}; in GPa: {said}",
        "** Units: MPa (mm, N, s). In crystal axes: give the element set a local system,",
        f"** {section}",
        "** D1111, D1122, D2222, D1133, D2233, D3333, D1112, D2212,",
        "** D3312, D1212, D1113, D2213, D3313, D1213, D1313, D1123,",
        "** D2223, D3323, D1223, D1323, D2323",
        "*MATERIAL, NAME=CRYSTAL",
        f"*ELASTIC, TYPE={kind}",
        *elastic_constants(MPA * np.asarray(matrix)),
    ]
    return "\n".join(lines) + "\n"
