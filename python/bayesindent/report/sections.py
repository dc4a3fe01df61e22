"""The rows of the report's tables; their captions, headers and the texts beside them are in its
template.
"""

import hashlib
import platform
from importlib import metadata
from itertools import repeat

import numpy as np
from markupsafe import Markup

from ..version import __version__

from .formatting import (  # isort: skip
    digits_of,
    direction_name,
    has_four_indices,
    limit_name,
    number,
    numbers,
    orientation,
    percent,
    plus_minus,
    product_html,
    quantity_format,
    quantity_label,
    region,
    share_cells,
    subscript,
    suggested_grains,
)
from .results import Results, residual

#: Rows of a table of simulations that are shown at most.
MOST_ROWS = 40
#: Draws behind mean and sd of a compliance.
DRAWS = 4000


def report_rows(results: Results) -> dict[str, list[list]]:
    """The rows of each table; none where the results have nothing of it."""
    document = results.extracted
    parameters = document.get("parameters", {})
    suggestions = results.documents["next"].get("suggestions", [])
    return {
        "constants": [
            constant_row(name, item, results.reference[1]) for name, item in parameters.items()
        ],
        "grains": [
            [*grain_cells(row, item), *compared_cells(item), number(rounded_residual(item))]
            for row, item in enumerate(results.predicted, start=1)
        ],
        "compliances": compliance_rows(results) if results.samples else [],
        "correlation": [
            [name, *map(number, row, repeat(2))]
            for name, row in zip(parameters, document.get("correlation", []))
        ],
        "assumptions": [
            [
                row["assumption"],
                "yes" if row["included"] else "no",
                *numbers(row["shift"], **dict.fromkeys(results.constants, 1)),
                row.get("text", ""),
            ]
            for row in document.get("assumptions", [])
        ],
        "limits": [
            [
                limit_name(row["name"], row["side"]),
                f"{row['value']:.4g}",
                percent(row["share"]),
                "yes" if row["stated"] else "no",
            ]
            for row in document.get("limits", [])
        ],
        "combinations": [
            [product_html(row["exponents"]), *identifiability_cells(row)]
            for row in results.identifiability("combination")
        ],
        "quantities": [
            [quantity_label(row, results.symmetry), *identifiability_cells(row)]
            for row in results.identifiability("quantity")
            if row["name"] not in parameters
        ],
        "prior": prior_rows(results) if document.get("prior") else [],
        "diagnosis": list(map(rival_row, document.get("diagnosis", []))),
        "simulations": simulation_rows(results),
        "suggestions": [
            [
                name,
                *angles_of(item),
                region(item, item.get("uvw") or direction(item, results.symmetry)),
                number(item["gain"], 3),
            ]
            for name, item in zip(suggested_grains(suggestions), suggestions)
        ],
        "provenance": provenance_rows(results),
    }


def angles_of(item: dict) -> list[str]:
    """Bunge's angles as cells."""
    return [number(angle) for angle in item.get("euler_deg", [None] * 3)]


def grain_cells(row: int, item: dict) -> list[str]:
    """The name of a grain, or its row, and its angles."""
    return [str(item.get("grain", row)), *angles_of(item)]


def compared_cells(item: dict) -> list[str]:
    """The measured value with its sd, and the predicted one."""
    return numbers(item, measured=1, measured_sd=1, mean=1, sd=1)


def rounded_residual(item: dict) -> float | None:
    """The residual, see `residual`, with one decimal; -0.0 becomes 0."""
    return round(residual(item), 1) + 0.0 if item.get("measured_sd") else None


def constant_row(name: str, item: dict, reference: dict[str, float]) -> list:
    """Mean, sds, 95 % interval, what it is compared with, if anything, and shares of a constant."""
    compared = [number(reference.get(name))] if reference else []
    interval = unbroken(" to ".join(number(value, digits_of(name)) for value in item["hdi_95"]))
    return [
        name,
        *numbers(item, **dict.fromkeys(("mean", "sd"), digits_of(name))),
        relative_sd(item),
        interval,
        *compared,
        *share_cells(item),
    ]


def relative_sd(item: dict) -> str:
    """Sd of the mean in per cent."""
    return number(100 * item["sd"] / abs(item["mean"]) if item["mean"] else None)


def direction(item: dict, symmetry: str) -> str:
    """The direction along the indenter, where its indices are not known."""
    if has_four_indices(symmetry):
        return direction_name([round(value, 9) for value in item["direction"]], True)
    return "[" + " ".join(f"{value:.2f}" for value in item["direction"]) + "]"


def compliance_rows(results: Results) -> list[list[str]]:
    """Of cubic crystals the Zener ratio; compliances by the names of the constants."""
    stiffness = results.draws(DRAWS)
    compliance = 1000 * np.linalg.inv(stiffness)
    places = {name: (int(name[1]) - 1, int(name[2]) - 1) for name in results.constants}
    found = {
        f"{subscript('C' + name[1:]).replace('C', 'S')} (1/TPa)": compliance[:, i, j]
        for name, (i, j) in places.items()
    }
    if "C44" in places and "C33" not in places:
        found["Zener ratio"] = 2 * stiffness[:, 3, 3] / (stiffness[:, 0, 0] - stiffness[:, 0, 1])
    items = {name: {"mean": values.mean(), "sd": values.std()} for name, values in found.items()}
    return [
        [name, *plus_minus(item).split(" ± "), relative_sd(item)] for name, item in items.items()
    ]


def simulation_rows(results: Results) -> list[list]:
    """Simulated indentations and, where it is there, the theory."""
    rows, theory = [], results.theory_moduli
    for index, row in enumerate(results.simulations[:MOST_ROWS]):
        modulus, *cost = numbers(row, indentation_modulus_gpa=2, elements=0, seconds=2)
        compared = []
        if theory is not None:
            ratio = row["indentation_modulus_gpa"] / theory[index]
            compared = [number(theory[index], 2), number(100 * (ratio - 1), 2)]
        rows.append([orientation(row["euler_deg"]), modulus, *compared, *cost])
    return rows


def unbroken(text: str) -> Markup:
    """A text that stays in one line."""
    return Markup('<span class="whole">{}</span>').format(text)


def identifiability_cells(row: dict) -> list[str]:
    """Mean of a quantity, its sds in posterior and prior, and shares; of a combination, which has
    no mean, the sds are in per cent.
    """
    if row["kind"] == "quantity":
        digits = quantity_format(row)[1]
        found = numbers(row, mean=digits, sd=digits, prior_sd=digits)
    else:
        found = [percent(row["sd"], 2), percent(row["prior_sd"], 2)]
    return found + share_cells(row)


def prior_rows(results: Results) -> list[list[str]]:
    """The density, the bounds, what else is known, and the surrogate."""
    prior = results.extracted["prior"]
    rows = [["density", prior["density"][0]]]
    for name, bounds in prior["bounds"].items():
        rows.append([f"{name} (GPa)", " .. ".join(map(number, bounds))])
    for item in prior["knowledge"]:
        value = f"{item['mean']:.4g} ± {item['sd']:.2g}, {item['conflict_sd']:.1f} sd from all else"
        rows.append([f"known: {quantity_label(item, results.symmetry)}", value])
    return [*rows, ["surrogate", prior["surrogate"]]]


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


def provenance_rows(results: Results) -> list[list]:
    """Versions, input and stages that made the results."""
    system = f"{platform.python_version()}, {platform.system()} {platform.machine()}"
    digest = hashlib.sha256(results.resolved.encode()).hexdigest()
    rows = [
        ["bayesindent", __version__],
        ["Python, system", system],
        ["NumPy, SciPy, ArviZ", ", ".join(map(metadata.version, ("numpy", "scipy", "arviz")))],
        ["seed", results.settings["problem"].get("seed", "–")],
        ["stages", ", ".join(name for name, found in results.documents.items() if found)],
        ["SHA-256 of the resolved input", digest if results.resolved else "–"],
    ]
    if results.outdated:
        rows.append(["left out, since made from other inputs", ", ".join(results.outdated)])
    return rows
