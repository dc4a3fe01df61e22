"""The sections of the report: a title, a text, tables before and after the figures."""

import hashlib
import platform
from collections.abc import Sequence
from dataclasses import dataclass
from importlib import metadata

from markupsafe import Markup

from ..version import __version__
from .formatting import best_first, number, numbers, orientation, product_html, quantities_label, quantity_format, quantity_label
from .results import Results, present

__all__ = ["SECTIONS", "Section", "Table", "constants_table", "identifiability_cells"]

#: Shift of a mean, in sds, from which on it is reported.
LEAST_SHIFT = 0.1
#: Rows of a table of simulations that are shown at most.
MOST_ROWS = 40

ANGLES = "φ₁, Φ, φ₂ (degrees)"


@dataclass(frozen=True)
class Table:
    """A table: texts, or what is HTML already; `prose`: more text than numbers."""

    caption: str
    header: Sequence[str]
    rows: Sequence[Sequence]
    prose: bool = False


@dataclass(frozen=True)
class Section:
    """A part of the report: its figures stand between the tables before and those after."""

    title: str
    text: str = ""
    before: Sequence[Table] = ()
    after: Sequence[Table] = ()
    fold: str = ""


def simulation(results: Results) -> Section:
    """Simulated indentations and the theory."""
    simulated, theory = present(results.simulations), results.theory_moduli
    header, rows = [ANGLES, "M (GPa)", "elements", "seconds"], []
    for row in simulated[:MOST_ROWS]:
        modulus, *cost = numbers(row, indentation_modulus_gpa=2, elements=0, seconds=2)
        rows.append([orientation(row["euler_deg"]), modulus, *cost])
    if theory is not None:
        header[2:2] = ["theory (GPa)", "difference (%)"]
        for cells, row, exact in zip(rows, simulated, theory.tolist()):
            cells[2:2] = [number(exact, 2), number(100 * (row["indentation_modulus_gpa"] / exact - 1), 2)]
    caption = "Indentation moduli" + (f", the first {MOST_ROWS}" if len(simulated) > MOST_ROWS else "")
    return Section("Simulated indentations", after=[Table(caption, header, rows)])


def size(results: Results) -> Section:
    """How thick a film or how large a grain must be."""
    document = present(results.documents["size"])
    name = document["variable"].removesuffix("_um").replace("_", " ")
    rows = [[orientation(row["euler_deg"]), row["surroundings"], *numbers(row, young_gpa=0, smallest_um=3)] for row in document["results"]]
    table = Table(f"Least {name}", [ANGLES, "surroundings", "Young's modulus (GPa)", f"least {name} (µm)"], rows)
    limits = f"Contact radius {document['contact_radius_um']:g} µm; the bias of the modulus stays below {100 * document['limit']:g} %"
    return Section("How far is far enough", f"{limits} from the least {name} on.", after=[table])


def surrogate(results: Results) -> Section:
    """How the surrogate was trained, and how well it predicts the simulations."""
    build = present(results.documents["build"])
    sds = [number(share and 100 * share, 2) for share in map(build.get("domain", {}).get, ("mean_relative_sd", "largest_relative_sd"))]
    rows = [
        ["simulations in all", build["simulations"]],
        ["of them failed", build["failed"]],
        ["terms of the basis", build["terms"]],
        ["mean error of a simulation left out (GPa)", number(build["loocv_gpa"], 3)],
        ["mean error of a crystal left out (GPa)", number(build.get("leave_crystal_out_gpa"), 3)],
        ["precision of the coefficients, α", f"{build['alpha']:.4g}"],
        ["precision of the simulations, β", f"{build['beta']:.4g}"],
        ["sd of a modulus in the domain, mean (%)", sds[0]],
        ["the same at its largest (%)", sds[1]],
        ["stopped because", build.get("stopped", "–")],
    ]
    return Section("Step 1: the surrogate", before=[Table("The surrogate of the indentation modulus", ["", "value"], rows, prose=True)])


def unbroken(text: str) -> Markup:
    """A text that stays in one line."""
    return Markup('<span class="whole">{}</span>').format(text)


def posterior(results: Results) -> Section:
    """The posterior of the constants."""
    document = present(results.documents["extract"])
    tables = []
    if theory := document.get("theory_alone"):
        rows = [[name, *numbers(document["parameters"][name], mean=1, sd=1), *numbers(item, mean=1, sd=1)] for name, item in theory.items()]
        caption = "Constants (GPa) with the correction of the specimen, and as theory of the half-space alone would have them"
        tables.append(Table(caption, ["constant", "mean", "sd", "theory alone, mean", "sd"], rows))
    rows = [[name, *numbers(item, r_hat=3, ess_bulk=0, ess_tail=0)] for name, item, _ in best_first(document)]
    caption = f"Convergence of {document['chains']} chains of {document['samples']} samples; R-hat should be below 1.01"
    tables.append(Table(caption, ["constant", "R-hat", "effective samples, bulk", "tail"], rows))
    return Section("Step 2: the elastic constants", after=tables)


def identifiability_cells(row: dict) -> list[str]:
    """Mean of a quantity, its sds in posterior and prior, and contraction; of a combination, which has no mean, the sds are in per cent."""
    digits = quantity_format(row)[1] if row["kind"] == "quantity" else 0
    relative = [number(100 * row[name], 2) for name in ("sd", "prior_sd")]
    values = numbers(row, mean=digits, sd=digits, prior_sd=digits) if digits else relative
    return [*values, number(row["contraction"], 3)]


def identifiability(results: Results) -> Section:
    """What the data determined and what the prior did."""
    document = results.documents["extract"]
    present(document.get("identifiability"))
    combinations = [[product_html(row["exponents"]), *identifiability_cells(row)] for row in results.identifiability("combination")]
    ordered = sorted(results.identifiability("quantity"), key=lambda row: -row["contraction"])
    quantities = [[quantity_label(row), *identifiability_cells(row)] for row in ordered]
    further = []
    for row in results.identifiability("knowledge"):
        sds = [f"{name} {number(document['parameters'][name]['sd'])} → {number(sd)}" for name, sd in row["sd_then"].items()]
        further.append([f"{quantities_label(row)} to {100 * row['relative_sd']:.0f} %", ", ".join(sds)])
    tables = [
        Table(
            "Combinations of the constants; sd is relative", ["combination", "sd (%)", "sd of the prior (%)", "contraction"], combinations
        ),
        Table("Quantities of the crystal", ["", "mean", "sd", "sd of the prior", "contraction"], quantities),
        Table("What else to measure or look up, and what it would bring", ["known", "sd of the constants, GPa"], further, prose=True),
        Table("The prior that was in effect", ["", ""], prior_rows(document.get("prior", {})), prose=True),
    ]
    text = (
        "Indentation sees some combinations of the constants sharply and others hardly at all. The contraction is the share of the "
        "prior's variance that the data removed: where it is near 1 the data decided, where it is near 0 the result repeats the prior, "
        "however narrow its sd may look."
    )
    return Section("What the data decided, and what the prior did", text, after=tables)


def prior_rows(prior: dict) -> list[list[str]]:
    """What the document of `extract` says of its prior."""
    if not prior:
        return []
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


def checks(results: Results) -> Section:
    """Whether the model could have given the measurements, and how much of the result is the prior's."""
    document = results.documents["extract"]
    chi_square, worst = (present(document.get("checks"))[name] for name in ("chi_square", "extreme_grain"))
    found = {
        f"χ² about a draw of the posterior, {number(chi_square['mean'])} on average for {len(results.predicted)} grains": chi_square["p"],
        f"grain {worst['grain']}, the furthest off, by {number(worst['residual_sd'])} sds": worst["p"],
    }
    rows = [[text, unbroken(f"p = {p:.3f}")] for text, p in found.items()]
    if evidence := document.get("evidence"):
        rows.append(["evidence, log Z; it depends on the bounds", " ± ".join(numbers(evidence, log_z=2, sd=2))])
    text = (
        "Each p is the share of data sets, drawn from the posterior, that are further off than the measurements: near 0 something is "
        "missing, near 1 the stated sds are too large."
    )
    moved = list(filter(None, map(sensitivity_row, document["sensitivity"])))
    if not moved:
        text += f" No limit of the prior, moved by a tenth, shifts a constant by more than {LEAST_SHIFT:g} sd, nor does the other measure."
    caption = "What moves if the prior is another (shifts of the mean in sds; 'about': an estimate, another run tells)"
    before, after = Table("Model and data", ["", ""], rows, prose=True), Table(caption, ["", "shifts"], moved, prose=True)
    return Section("Does the model fit, and how much is the prior's", text, before=[before], after=[after] if moved else [])


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


def next_grain(results: Results) -> Section:
    """Grains worth measuring next."""
    document = results.documents["next"]
    suggestions = present(document.get("suggestions"))
    rows = [
        [item.get("grain", rank), *map(number, item["euler_deg"]), item.get("uvw", ""), number(item["gain"], 3)]
        for rank, item in enumerate(suggestions, 1)
    ]
    gain = f"expected gain ({document['unit']})" if document.get("unit") else "expected gain"
    header = ["grain" if "grain" in suggestions[0] else "rank", "φ₁", "Φ", "φ₂ (degrees)", "[uvw] along z", gain]
    return Section("Which grain to measure next", after=[Table("Suggested orientations, each chosen given those above it", header, rows)])


def provenance(results: Results) -> Section:
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
    return Section("Provenance", before=[Table("What made these results", ["", ""], rows, prose=True)], fold=results.resolved)


def constants_table(results: Results) -> Table:
    """The answer."""
    rows = [
        [name, *numbers(item, mean=1, sd=1, map=1), unbroken(" to ".join(map(number, item["hdi_95"]))), number(contraction, 3)]
        for name, item, contraction in best_first(results.documents["extract"])
    ]
    header = ["constant", "mean", "sd", "most probable", "95 % interval", "contraction"]
    return Table("Elastic constants in GPa, the best known first", header, rows)


#: Sections by the name by which figures belong to them, in order.
SECTIONS = {
    "simulation": simulation,
    "size": size,
    "surrogate": surrogate,
    "posterior": posterior,
    "identifiability": identifiability,
    "checks": checks,
    "next": next_grain,
    "provenance": provenance,
}
