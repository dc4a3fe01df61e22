"""The tables of the report, and of a paper."""

from collections.abc import Sequence
from itertools import repeat
from operator import itemgetter
from typing import NamedTuple

import numpy as np

from ..version import __version__

from .formatting import (  # isort: skip
    SHARE_HEADER,
    cells,
    digits_of,
    direction_name,
    has_four_indices,
    named,
    number,
    numbers,
    orientation,
    percent,
    plus_minus,
    quantity_format,
    quantity_label,
    region,
    share_cells,
    subscript,
    suggested_grains,
    unknowns_of,
)
from .results import Results

#: Draws behind mean and sd of a compliance.
DRAWS = 4000
#: Headers of Bunge's angles, and of what is measured.
ANGLES = ("φ₁ (°)", "Φ (°)", "φ₂ (°)")
COMPARED = ("measured", "sd", "predicted", "sd")


class Table(NamedTuple):
    """A table, which is left out without rows. The cells of `prose` are sentences."""

    caption: str
    header: Sequence[str]
    rows: list[list[str]]
    prose: bool = False


def tables(results: Results) -> dict[str, Table]:
    """All tables by name."""
    return (
        tables_of_result(results)
        | tables_of_crystal(results)
        | tables_of_checks(results)
        | tables_of_stages(results)
    )


def tables_of_result(results: Results) -> dict[str, Table]:
    """The constants, and what else they rest on or would determine them."""
    document, constants = results.extracted, results.constants
    parameters, (label, reference) = document.get("parameters", {}), results.reference
    return {
        "constants": Table(
            "Elastic constants in GPa: mean and standard deviation (sd), 95 % interval of highest "
            "density, and the shares of the variance that are due to the measurements, to what "
            "else was known and to the prior",
            [
                *("constant", "mean", "sd", "sd (%)", "95 % interval"),
                *([label] * bool(reference)),
                *SHARE_HEADER,
            ],
            [constant_row(name, item, reference) for name, item in parameters.items()],
        ),
        "assumptions": Table(
            "What no measurement can refute: the change of each constant in GPa if an assumption "
            "is wrong by its usual size",
            ["assumption", *constants, "in the sd"],
            [
                [
                    row.get("text", row["assumption"]),
                    *numbers(row["shift"], **dict.fromkeys(constants, 1)),
                    "yes" if row["included"] else "no",
                ]
                for row in document.get("assumptions", [])
            ],
            prose=True,
        ),
        "knowledge": Table(
            "What else to measure or to look up: the sd of each constant in GPa, now and with one "
            "more quantity known",
            ["known", *constants],
            knowledge_rows(results),
        ),
    }


def tables_of_crystal(results: Results) -> dict[str, Table]:
    """The measurements, and what follows from the constants."""
    document, constants = results.extracted, results.constants
    parameters, budget = document.get("parameters", {}), document.get("error_budget", {})
    return {
        "grains": Table(
            f"The {results.kind} of each grain in GPa, measured and as the posterior predicts it "
            "without the noise; the residual in sds, without the factor that all grains share",
            ["grain", *ANGLES, *COMPARED, "residual"],
            [
                [
                    *grain_cells(row, item),
                    *compared_cells(item),
                    number(results.residual(item) if item.get("measured_sd") else None),
                ]
                for row, item in enumerate(results.predicted, start=1)
            ],
        ),
        "velocities": Table(
            f"The {results.speed} in m/s, measured and as the posterior predicts it without the "
            "noise; the direction of propagation in degrees from x",
            ["grain", *ANGLES, "direction", "wave", *COMPARED],
            [
                [*grain_cells(row, item), *wave_cells(item)]
                for row, item in enumerate(results.velocities, start=1)
            ],
        ),
        "compliances": Table(
            "Compliances" + " and Zener ratio" * is_cubic(constants),
            ["", "mean ± sd"],
            compliance_rows(results) if results.samples else [],
        ),
        "correlation": Table(
            "Correlation of the constants in the posterior",
            ["", *parameters],
            [
                [name, *map(number, row, repeat(2))]
                for name, row in zip(parameters, document.get("correlation", []))
            ],
        ),
        "quantities": Table(
            "Quantities of the crystal: mean and sd, sd of the prior, and shares of the variance",
            ["quantity", "mean", "sd", "sd of the prior", *SHARE_HEADER],
            [
                [
                    quantity_label(row, results.symmetry),
                    *numbers(
                        row, **dict.fromkeys(("mean", "sd", "prior_sd"), quantity_format(row)[1])
                    ),
                    *share_cells(row),
                ]
                for row in results.identifiability("quantity")
                if row["name"] not in parameters
            ],
        ),
        "combinations": Table(
            "Products of powers of the constants, from the best to the worst determined: "
            "exponents, relative sds and shares of the variance",
            [*constants, "sd (%)", "sd of the prior (%)", *SHARE_HEADER],
            [
                [
                    *numbers(row["exponents"], **dict.fromkeys(constants, 2)),
                    percent(row["sd"], 2),
                    percent(row["prior_sd"], 2),
                    *share_cells(row),
                ]
                for row in results.identifiability("combination")
            ],
        ),
        "error_budget": Table(
            "Error budget: the sources of the variance of each constant in per cent. Calibration: "
            "what moduli share",
            ["source", *parameters],
            [
                [source.replace("_", " "), *map(percent, map(itemgetter(source), budget.values()))]
                for source in next(iter(budget.values()), {})
            ],
        ),
        "theory_alone": Table(
            "Constants in GPa with theory of the half-space alone, without the specimen",
            ["constant", "mean", "sd"],
            named(document.get("theory_alone", {}), mean=1, sd=1),
        ),
    }


def tables_of_checks(results: Results) -> dict[str, Table]:
    """Diagnostics of the posterior, and what made it."""
    document = results.extracted
    misfit = document.get("checks", {}).get("misfit", {})
    return {
        "convergence": Table(
            "Convergence of {chains} chains of {samples} samples; R-hat should be below "
            "1.01".format(**{"chains": 0, "samples": 0} | document),
            ["constant", "R-hat", "effective samples, bulk", "tail"],
            named(document.get("parameters", {}), r_hat=3, ess_bulk=0, ess_tail=0),
        ),
        "checks": Table(
            "Do the measurements agree with the model? A p near 0: something is missing; near 1: "
            "the stated sds are too large",
            ["chi-square", "degrees of freedom", "p"],
            [numbers(misfit, chi_square=1, freedom=0, p=3)] if misfit.get("p") is not None else [],
        ),
        "diagnosis": Table(
            "Other models of the measurements; log odds over the stated one",
            ["explanation", "group", "log odds", "constants (GPa)", "remedy"],
            list(map(rival_row, document.get("diagnosis", []))),
            prose=True,
        ),
        "provenance": Table(
            "What made these results",
            ["", ""],
            [
                ["bayesindent", __version__],
                ["seed", results.settings["problem"].get("seed", "–")],
                ["stages", ", ".join(name for name, found in results.documents.items() if found)],
                *[["left out, since made from other inputs", ", ".join(results.outdated)]]
                * bool(results.outdated),
            ],
            prose=True,
        ),
    }


def tables_of_stages(results: Results) -> dict[str, Table]:
    """The tables of the other stages than `extract`."""
    following, curves, build = (results.documents[name] for name in ("next", "curves", "build"))
    suggestions, theory = following.get("suggestions", []), results.theory_moduli
    return {
        "suggestions": Table(
            "Which grain to measure next, each chosen given those above it",
            ["grain", *ANGLES, "direction along z", f"expected gain ({following.get('unit')})"],
            [
                [
                    name,
                    *angles_of(item),
                    region(item, item.get("uvw") or direction(item, results.symmetry)),
                    number(item["gain"], 3),
                ]
                for name, item in zip(suggested_grains(suggestions), suggestions)
            ],
        ),
        "tip": Table(
            "What tests share: tip, frame, and factors of sessions",
            ["", "mean", "sd", "sd of the prior", "determined by"],
            [
                [name, *numbers(item, mean=4, sd=4, prior_sd=4), item["decided_by"]]
                for name, item in unknowns_of(curves).items()
            ],
        ),
        "errors": Table(
            "Sources of error of a grain's modulus, median. Radius, beta, compliance and session "
            "are shared: more grains do not reduce them",
            ["source", "sd (%)"],
            [
                [name.replace("_", " "), percent(share, 2)]
                for name, share in curves.get("error_budget", {}).items()
            ],
        ),
        "moduli": Table(
            "Effective moduli of the grains in GPa: sd of all errors, and of those that grains do "
            "not share",
            ["grain", "tests", "modulus", "sd", "own sd"],
            cells(
                curves.get("grains", []),
                *("grain", "tests"),
                effective_modulus_gpa=1,
                sd_gpa=1,
                own_sd_gpa=1,
            ),
        ),
        "tests": Table(
            "Tests: elastic window and drift; why a test was left out",
            ["test", "left out since", "modulus (GPa)", "from (mN)", "to (mN)", "drift (nm/s)"],
            cells(
                curves.get("tests", []),
                *("test", "reason"),
                effective_modulus_gpa=1,
                elastic_from_mn=1,
                elastic_to_mn=1,
                drift_nm_s=3,
            ),
        ),
        "simulations": Table(
            "Simulated indentation moduli M" + " beside those of theory" * (theory is not None),
            ["φ₁, Φ, φ₂ (degrees)", "M (GPa)", "elements", "seconds"]
            + ["theory (GPa)", "difference (%)"] * (theory is not None),
            [
                [
                    orientation(row["euler_deg"]),
                    *numbers(row, indentation_modulus_gpa=2, elements=0, seconds=2),
                    *([] if exact is None else theory_cells(row, exact)),
                ]
                for row, exact in zip(
                    results.simulations, repeat(None) if theory is None else theory
                )
            ],
        ),
        "surrogate": Table(
            "The surrogate of the indentation modulus",
            ["", ""],
            [
                ["simulations", build["simulations"]],
                ["of them failed", build["failed"]],
                ["terms of the basis", build["terms"]],
                ["mean error of a simulation left out (GPa)", number(build["loocv_gpa"], 3)],
                [
                    "mean error of a crystal left out (GPa)",
                    number(build["leave_crystal_out_gpa"], 3),
                ],
                ["domain", build["domain"]["words"]],
                ["stopped because", build["stopped"]],
            ]
            if build
            else [],
            prose=True,
        ),
    }


def theory_cells(row: dict, exact: float) -> list[str]:
    """The modulus of theory in GPa, and by how much the simulation is above it in per cent."""
    return [number(exact, 2), percent(row["indentation_modulus_gpa"] / exact - 1, 2)]


def angles_of(item: dict) -> list[str]:
    """Bunge's angles as cells."""
    return [number(angle) for angle in item.get("euler_deg", [None] * 3)]


def constant_row(name: str, item: dict, reference: dict[str, float]) -> list[str]:
    """Mean, sds, interval, what it is compared with, if anything, and shares of a constant."""
    digits = digits_of(name)
    return [
        name,
        *numbers(item, mean=digits, sd=digits),
        percent(item["sd"] / abs(item["mean"]) if item["mean"] else None, 1),
        " to ".join(number(value, digits) for value in item["hdi_95"]),
        *([number(reference.get(name))] * bool(reference)),
        *share_cells(item),
    ]


def grain_cells(row: int, item: dict) -> list[str]:
    """The name of a grain, or its row, and its angles."""
    return [str(item.get("grain", row)), *angles_of(item)]


def compared_cells(item: dict) -> list[str]:
    """The measured value with its sd, and the predicted one."""
    return numbers(item, measured=1, measured_sd=1, mean=1, sd=1)


def wave_cells(item: dict) -> list[str]:
    """The direction and the kind of a wave, and its measured and predicted speed."""
    along = "normal" if "inclination_deg" in item else number(item["propagation_deg"])
    wave = item.get("wave", "rayleigh").replace("_", " ")
    return [along, wave, *compared_cells(item)]


def knowledge_rows(results: Results) -> list[list[str]]:
    """The sd of each constant, and the expected ones with further knowledge."""
    rows = results.identifiability("knowledge")
    now = {name: results.extracted["parameters"][name]["sd"] for name in results.constants if rows}
    found = {"nothing further": now} | {
        f"{quantity_label(row, results.symmetry)} to {percent(row['relative_sd'])} %": row[
            "sd_then"
        ]
        for row in rows
    }
    return named(found, **dict.fromkeys(results.constants, 1)) if rows else []


def direction(item: dict, symmetry: str) -> str:
    """The direction along the indenter, where its indices are not known."""
    if has_four_indices(symmetry):
        return direction_name([round(value, 9) for value in item["direction"]], True)
    return "[" + " ".join(f"{value:.2f}" for value in item["direction"]) + "]"


def is_cubic(constants: Sequence[str]) -> bool:
    """Whether a crystal class with these constants is cubic."""
    return "C44" in constants and "C33" not in constants


def compliance_rows(results: Results) -> list[list[str]]:
    """Compliances by the names of the constants; of cubic crystals the Zener ratio."""
    stiffness = results.draws(DRAWS)
    compliance = 1000 * np.linalg.inv(stiffness)
    found = {
        f"{subscript(name).replace('C', 'S')} (1/TPa)": compliance[
            :, int(name[1]) - 1, int(name[2]) - 1
        ]
        for name in results.constants
    }
    if is_cubic(results.constants):
        found["Zener ratio"] = 2 * stiffness[:, 3, 3] / (stiffness[:, 0, 0] - stiffness[:, 0, 1])
    return [
        [name, plus_minus({"mean": values.mean(), "sd": values.std()})]
        for name, values in found.items()
    ]


def rival_row(rival: dict) -> list[str]:
    """Another model of the measurements."""
    constants = [
        f"{name} {plus_minus(item)}"
        for name, item in rival["constants"].items()
        if item["mean"] is not None
    ]
    return [
        rival["explanation"],
        rival["group"],
        number(rival["log_odds"]),
        ", ".join(constants),
        rival["remedy"],
    ]
