"""The rows of the report's tables; their captions, headers and the texts beside them are in its template."""

import hashlib
import platform
from importlib import metadata

from markupsafe import Markup

from ..version import __version__
from .formatting import best_first, number, numbers, orientation, percent, product_html, quantities_label, quantity_format, quantity_label
from .results import Results

__all__ = ["LEAST_SHIFT", "MOST_ROWS", "identifiability_cells", "report_rows"]

#: Shift of a mean, in sds, from which on it is reported.
LEAST_SHIFT = 0.1
#: Rows of a table of simulations that are shown at most.
MOST_ROWS = 40


def report_rows(results: Results) -> dict[str, list[list]]:
    """The rows of each table; none where the results have nothing of it."""
    document = results.documents["extract"]
    parameters = best_first(document) if document else []
    theory_alone = document.get("theory_alone", {})
    quantities = sorted(results.identifiability("quantity"), key=lambda row: -row["contraction"])
    return {
        "constants": [
            [name, *numbers(item, mean=1, sd=1, map=1), unbroken(" to ".join(map(number, item["hdi_95"]))), number(contraction, 3)]
            for name, item, contraction in parameters
        ],
        "convergence": [[name, *numbers(item, r_hat=3, ess_bulk=0, ess_tail=0)] for name, item, _ in parameters],
        "theory_alone": [
            [name, *numbers(document["parameters"][name], mean=1, sd=1), *numbers(item, mean=1, sd=1)]
            for name, item in theory_alone.items()
        ],
        "combinations": [[product_html(row["exponents"]), *identifiability_cells(row)] for row in results.identifiability("combination")],
        "quantities": [[quantity_label(row), *identifiability_cells(row)] for row in quantities],
        "knowledge": [knowledge_row(row, document["parameters"]) for row in results.identifiability("knowledge")],
        "prior": prior_rows(document["prior"]) if document.get("prior") else [],
        "checks": check_rows(results) if document.get("checks") else [],
        "sensitivity": [row for row in map(sensitivity_row, document.get("sensitivity", [])) if row],
        "simulations": simulation_rows(results),
        "size": [
            [orientation(row["euler_deg"]), row["surroundings"], *numbers(row, young_gpa=0, smallest_um=3)]
            for row in results.documents["size"].get("results", [])
        ],
        "suggestions": [
            [item.get("grain", rank), *map(number, item["euler_deg"]), item.get("uvw", ""), number(item["gain"], 3)]
            for rank, item in enumerate(results.documents["next"].get("suggestions", []), 1)
        ],
        "provenance": provenance_rows(results),
    }


def simulation_rows(results: Results) -> list[list]:
    """Simulated indentations and, where it is there, the theory."""
    rows, theory = [], results.theory_moduli
    for index, row in enumerate(results.simulations[:MOST_ROWS]):
        modulus, *cost = numbers(row, indentation_modulus_gpa=2, elements=0, seconds=2)
        exact = None if theory is None else float(theory[index])
        compared = [number(exact, 2), number(100 * (row["indentation_modulus_gpa"] / exact - 1), 2)] if exact else []
        rows.append([orientation(row["euler_deg"]), modulus, *compared, *cost])
    return rows


def unbroken(text: str) -> Markup:
    """A text that stays in one line."""
    return Markup('<span class="whole">{}</span>').format(text)


def identifiability_cells(row: dict) -> list[str]:
    """Mean of a quantity, its sds in posterior and prior, and contraction; of a combination, which has no mean, the sds are in per cent."""
    digits = quantity_format(row)[1] if row["kind"] == "quantity" else 0
    relative = [percent(row[name], 2) for name in ("sd", "prior_sd")]
    values = numbers(row, mean=digits, sd=digits, prior_sd=digits) if digits else relative
    return [*values, number(row["contraction"], 3)]


def knowledge_row(row: dict, parameters: dict) -> list[str]:
    """What a further piece of knowledge would bring."""
    sds = [f"{name} {number(parameters[name]['sd'])} → {number(sd)}" for name, sd in row["sd_then"].items()]
    return [f"{quantities_label(row)} to {100 * row['relative_sd']:.0f} %", ", ".join(sds)]


def prior_rows(prior: dict) -> list[list[str]]:
    """What the document of `extract` says of its prior."""
    rows = [["uniform in", {"constants": "the constants", "logarithms": "the logarithm of the stiffness"}[prior["measure"]]]]
    rows += [[f"{name} (GPa)", " .. ".join(map(number, bounds))] for name, bounds in prior["bounds"].items()]
    for name, text in {
        "poisson": "Poisson's ratio (Hill)",
        "young_gpa": "Young's modulus (Hill, GPa)",
        "anisotropy_cap": "anisotropy index (Eq. 14) up to",
        "log_anisotropy_max": "log-anisotropy up to",
    }.items():
        limits = prior[name] if isinstance(prior[name], list) else [prior[name]]
        if limits and limits != [None]:
            rows.append([text, " .. ".join(number(limit, 2) for limit in limits)])
    for item in prior["knowledge"]:
        value = f"{item['mean']:.4g} ± {item['sd']:.2g}, {item['conflict_sd']:.1f} sd from all else"
        rows.append([f"known: {quantity_label(item)}", value])
    rows.append(["surrogate", prior["words"][-1].removeprefix("surrogate: ")])
    return [*rows, ["share that the surrogate covers", f"{100 * prior['share_covered']:.0f} %"]]


def check_rows(results: Results) -> list[list]:
    """Whether the model could have given the measurements."""
    document = results.documents["extract"]
    chi_square, worst = (document["checks"][name] for name in ("chi_square", "extreme_grain"))
    found = {
        f"χ² about a draw of the posterior, {number(chi_square['mean'])} on average for {len(results.predicted)} grains": chi_square["p"],
        f"grain {worst['grain']}, the furthest off, by {number(worst['residual_sd'])} sds": worst["p"],
    }
    rows: list[list] = [[text, unbroken(f"p = {p:.3f}")] for text, p in found.items()]
    if evidence := document.get("evidence"):
        rows.append(["evidence, log Z; it depends on the bounds", " ± ".join(numbers(evidence, log_z=2, sd=2))])
    return rows


def sensitivity_row(change: dict) -> list[str] | None:
    """What a change of the prior shifts, where that matters."""
    shifts = {name: shift for name, shift in change["shift_sd"].items() if shift is not None and abs(shift) > LEAST_SHIFT}
    if not shifts:
        return None
    names = {
        "young": "Young's modulus (Hill)", "poisson": "Poisson's ratio (Hill)", "anisotropy_cap": "the anisotropy index",
        "log_anisotropy_max": "log-anisotropy", "measure": "the other measure of the prior",
    }  # fmt: skip
    text = names.get(change["name"], change["name"])
    if "side" in change:
        text = f"{change['side']} limit of {text} from {change['from']:.4g} to {change['to']:.4g}"
    shifted = ", ".join(f"{name} {shift:+.2f}" for name, shift in sorted(shifts.items(), key=lambda pair: -abs(pair[1])))
    return [text, shifted if change["exact"] else f"about {shifted}"]


def provenance_rows(results: Results) -> list[list]:
    """Versions, input and commands that made the results."""
    log = results.folder / "run.log"
    lines = log.read_text(encoding="utf-8", errors="replace").splitlines() if log.exists() else []
    commands = [line.split(": ", 1)[-1] for line in lines if f"INFO bayesindent {__version__[:1]}" in line]
    rows = [
        ["bayesindent", __version__],
        ["Python, system", f"{platform.python_version()}, {platform.system()} {platform.machine()}"],
        ["NumPy, SciPy, ArviZ", ", ".join(metadata.version(name) for name in ("numpy", "scipy", "arviz"))],
        ["seed", results.group("problem").get("seed", "–")],
        ["last command", commands[-1] if commands else "–"],
        ["SHA-256 of the resolved input", hashlib.sha256(results.resolved.encode()).hexdigest() if results.resolved else "–"],
    ]
    if results.outdated:
        rows.append(["left out, since made from other inputs", ", ".join(results.outdated)])
    return rows
