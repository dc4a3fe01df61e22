"""The author's pack: what a paper takes from a run, in files that journals take."""

import json
from collections.abc import Sequence

import numpy as np
from markupsafe import Markup

from ..common.result_files import write_csv, write_text
from ..core import InputError
from ..crystal.elasticity import stiffness_rows
from ..fe.deck import elastic_constants
from ..version import __version__
from .formatting import enumeration, latex, numbers
from .results import Results
from .sections import Table
from .templates import read_data, render

#: The tables of the report that a paper takes.
TABLES = ("constants", "quantities", "combinations", "correlation", "grains", "velocities")

#: What the solvers call an anisotropic material.
SOLVERS = {"abaqus": "ANISOTROPIC", "calculix": "ANISO"}


def write_paper(results: Results, tables: dict[str, Table]) -> None:
    """Write the texts, tables and cards of the pack into the folder `paper` of the results. Figures
    are `drawing`'s.
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
    mark = "Synthetic data. " if results.synthetic else ""
    for name in TABLES:
        caption, header, rows, _ = tables[name]
        if rows:
            write_csv(folder / f"{name}.csv", header, rows, mark + caption)
            text = latex_table(name, f"{mark}{caption}.", header, rows)
            write_text(folder / f"{name}.tex", text)
    # Every draw: chain, draw, constants in GPa.
    draws = results.posterior["draws"][..., : len(results.constants)]
    write_csv(
        folder / "posterior.csv",
        ["chain", "draw", *(f"{name}_gpa" for name in results.constants)],
        ([*place, *draws[place].tolist()] for place in np.ndindex(draws.shape[:2])),
        f"{mark}Draws of the posterior of a {results.symmetry} crystal",
    )
    means = [results.extracted["parameters"][name]["mean"] for name in results.constants]
    matrix = stiffness_rows(results.symmetry, [means])[0]
    covariance = np.cov(draws.reshape(-1, len(means)), rowvar=False)
    write_csv(
        folder / "stiffness.csv",
        ["row", *results.constants],
        zip(["mean", *results.constants], *np.vstack([means, covariance]).T.tolist()),
    )
    tensor = {"elastic_tensor": {"ieee_format": matrix.tolist()}}
    write_text(folder / "stiffness.json", json.dumps(tensor))
    for solver in SOLVERS:
        write_text(folder / f"stiffness_{solver}.inp", card(results, matrix, solver))


def methods(results: Results) -> tuple[str, str]:
    """The paragraph in LaTeX, and the works that it cites in BibTeX."""
    parameters = results.extracted["parameters"]
    constants = [
        rf"${name[0]}_{{{name[1:]}}} = {item['mean']:.1f} \pm {item['sd']:.1f}$~GPa"
        if name in results.constants
        else latex(f"{name} {item['mean']:.3g}")
        for name, item in parameters.items()
    ]
    text = render("methods.tex.j2", results=results, constants=Markup(enumeration(constants)))
    works = read_data("references.bib").replace("@VERSION@", __version__).rstrip().split("\n\n")
    cited = [work for work in works if work.partition("{")[2].partition(",")[0] in text]
    return text, "\n\n".join(cited) + "\n"


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


def card(results: Results, matrix: np.ndarray, solver: str) -> str:
    """The stiffness (6, 6) in GPa, crystal axes, as a material of Abaqus or CalculiX in MPa."""
    parameters = results.extracted["parameters"]
    constants = [
        f"{name} {' +- '.join(numbers(parameters[name], mean=1, sd=1))}"
        for name in results.constants
    ]
    text = render(
        "stiffness.inp.j2",
        results=results,
        version=__version__,
        constants=enumeration(constants),
        type=SOLVERS[solver],
        stiffness="\n".join(elastic_constants(1000 * matrix)),
    )
    return text + "\n"
