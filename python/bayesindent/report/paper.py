"""The author's pack: what a paper takes from a run, in files that journals take."""

from collections.abc import Sequence
from pathlib import Path

import numpy as np
from markupsafe import Markup

from ..common.result_files import write_csv, write_text
from ..core import InputError
from ..crystal.elasticity import stiffness_rows
from ..crystal.metals import known_of
from ..fe.deck import elastic_constants
from ..version import __version__
from .formatting import SHARE_HEADER, enumeration, latex, number, numbers, share_cells
from .results import Results
from .sections import compared_cells, grain_cells, identifiability_cells, report_rows
from .templates import read_data, render


def methods(results: Results) -> tuple[str, str]:
    """The paragraph in LaTeX, and the works that it cites in BibTeX."""
    parameters = results.extracted["parameters"]
    constants = [
        rf"${name[0]}_{{{name[1:]}}} = {item['mean']:.1f} \pm {item['sd']:.1f}$~GPa"
        if name in results.constants
        else latex(f"{name} {item['mean']:.3g}")
        for name, item in parameters.items()
    ]
    text = render(
        "methods.tex.j2",
        results=results,
        constants=Markup(enumeration(constants)),
        known=known_of(results.metal) if results.metal else {},
    )
    works = read_data("references.bib").replace("@VERSION@", __version__).rstrip().split("\n\n")
    cited = [work for work in works if work.partition("{")[2].partition(",")[0] in text]
    return text, "\n\n".join(cited) + "\n"


#: Headers of Bunge's angles.
ANGLES = ("φ₁ (°)", "Φ (°)", "φ₂ (°)")

#: What the solvers call an anisotropic material.
SOLVERS = {"abaqus": "ANISOTROPIC", "calculix": "ANISO"}


def write_paper(results: Results) -> Path:
    """Write the texts, tables and cards of the pack into the folder `paper` of the results; return
    it. Figures are `drawing`'s.
    """
    if not results.extracted or not results.posterior:
        raise InputError(
            f"{results.folder}: there is no posterior of the present inputs to write of; run "
            "extract first"
        )
    folder = results.folder / "paper"
    text, works = methods(results)
    write_text(folder / "methods.tex", text)
    write_text(folder / "references.bib", works)
    for name, (words, header, rows) in tables(results).items():
        caption = mark(results) + words
        write_csv(folder / f"{name}.csv", header, rows, caption)
        write_text(folder / f"{name}.tex", latex_table(name, caption, header, rows))
    write_posterior(results, folder / "posterior.csv")
    matrix = stiffness_rows(
        results.symmetry,
        [[results.extracted["parameters"][name]["mean"] for name in results.constants]],
    )[0]
    for solver in SOLVERS:
        write_text(folder / f"stiffness_{solver}.inp", card(results, matrix, solver))
    return folder


def mark(results: Results) -> str:
    """What every table of made-up data begins with."""
    return "Synthetic data. " if results.synthetic else ""


def tables(results: Results) -> dict[str, tuple[str, list[str], list[list[str]]]]:
    """Caption, header and rows of the tables that have rows, by the name of their files."""
    parameters, rows = results.extracted["parameters"], report_rows(results)
    rows["constants"] = [
        [name, *numbers(item, mean=1, sd=1), *map(number, item["hdi_95"]), *share_cells(item)]
        for name, item in parameters.items()
    ]
    rows["combinations"] = [
        [*exponent_cells(results, row), *identifiability_cells(row)]
        for row in results.identifiability("combination")
    ]
    rows["velocities"] = [
        [*grain_cells(row, item), *wave_cells(item)]
        for row, item in enumerate(results.velocities, start=1)
    ]
    measured = ["measured", "sd measured", "predicted", "sd predicted"]
    headings = {
        "constants": (
            "Elastic constants in GPa: mean and standard deviation (sd) of the posterior, its "
            "95 % interval of highest density, and the "
            "shares of its variance that are due to the measurements, to what else was known "
            "and to the prior.",
            ["constant", "mean", "sd", "95 % from", "to", *SHARE_HEADER],
        ),
        "quantities": (
            "Quantities of the crystal that follow from its constants: mean and sd of the "
            "posterior, sd of the prior, shares.",
            ["quantity", "mean", "sd", "sd of the prior", *SHARE_HEADER],
        ),
        "combinations": (
            "Products of powers of the constants, from the best to the worst identified: "
            "exponents, sds in per cent, shares.",
            [*results.constants, "sd (%)", "sd of the prior (%)", *SHARE_HEADER],
        ),
        "correlation": (
            "Correlation of the constants in the posterior.",
            ["", *parameters],
        ),
        "grains": (
            f"The {results.kind} of each grain in GPa: Bunge's angles, as measured, and as the "
            "posterior predicts it without the noise.",
            ["grain", *ANGLES, *measured, "residual (sd)"],
        ),
        "velocities": (
            f"The {results.speed} in m/s: Bunge's angles of the grain and the direction of "
            "propagation from x, as measured, and as the posterior predicts it without the noise.",
            ["grain", *ANGLES, "direction", "wave", *measured],
        ),
    }
    return {name: (*heading, rows[name]) for name, heading in headings.items() if rows[name]}


def exponent_cells(results: Results, row: dict) -> list[str]:
    """The exponent of each constant in a combination; -0.0 is written as 0."""
    exponents = row["exponents"]
    return [number(round(exponents.get(name, 0.0), 2) + 0.0, 2) for name in results.constants]


def wave_cells(item: dict) -> list[str]:
    """The direction and the kind of a wave, and its measured and predicted speed."""
    direction = "normal" if "inclination_deg" in item else number(item["propagation_deg"])
    wave = item.get("wave", "rayleigh").replace("_", " ")
    return [direction, wave, *compared_cells(item)]


def latex_table(
    label: str, caption: str, header: Sequence[str], rows: Sequence[Sequence[str]]
) -> str:
    """A table in LaTeX without packages."""
    head, *body = (" & ".join(map(latex, row)) + r" \\" for row in [header, *rows])
    lines = [
        r"\begin{table}",
        rf"\caption{{{latex(caption)}}}",
        rf"\label{{tab:{label}}}",
        rf"\begin{{tabular}}{{l{'r' * (len(header) - 1)}}}",
        *(r"\hline", head, r"\hline", *body, r"\hline"),
        *(r"\end{tabular}", r"\end{table}", ""),
    ]
    return "\n".join(lines)


def write_posterior(results: Results, file: Path) -> None:
    """Every draw: chain, draw, constants in GPa."""
    draws = results.posterior["draws"][..., : len(results.constants)]
    header = ["chain", "draw", *(f"{name}_gpa" for name in results.constants)]
    rows = ([*place, *draws[place].tolist()] for place in np.ndindex(draws.shape[:2]))
    caption = f"{mark(results)}Draws of the posterior of a {results.symmetry} crystal"
    write_csv(file, header, rows, caption)


def card(results: Results, matrix: np.ndarray, solver: str) -> str:
    """The stiffness (6, 6) in GPa, crystal axes, as a material of Abaqus or CalculiX in MPa."""
    parameters = results.extracted["parameters"]
    constants = [
        f"{name} {' +- '.join(numbers(parameters[name], mean=1, sd=1))}"
        for name in results.constants
    ]
    text = render(
        "stiffness.inp.j2",
        mark=mark(results),
        title=results.title,
        symmetry=results.symmetry,
        version=__version__,
        constants=enumeration(constants),
        type=SOLVERS[solver],
        stiffness="\n".join(elastic_constants(1000 * matrix)),
    )
    return text + "\n"
