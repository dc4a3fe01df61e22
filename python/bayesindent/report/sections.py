"""The sections of the report: a title, words, tables before and after the figures."""

import hashlib
import platform
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from importlib import metadata

from markupsafe import Markup

from ..version import __version__
from .results import Results
from .words import best_first, number, orientation, powers_as_html, quantity_in_words

__all__ = ["SECTIONS", "Section", "Table"]

#: Shift of a mean, in sds, from which on it is told.
MATTERS = 0.1
#: Rows of a table of simulations that are shown at most.
MOST_ROWS = 40


@dataclass(frozen=True)
class Table:
    """A table: texts, or what is HTML already; `prose`: more words than numbers."""

    caption: str
    header: Sequence[str]
    rows: Iterable[Sequence]
    prose: bool = False


@dataclass(frozen=True)
class Section:
    """A part of the report: its figures stand between the tables before and those after."""

    title: str
    words: str = ""
    before: Sequence[Table] = ()
    after: Sequence[Table] = ()
    fold: str = ""


def simulation(results: Results) -> Section | None:
    """Simulated indentations and the theory."""
    simulated, theory = results.simulations, results.theory_moduli
    if not simulated:
        return None
    compared = ["theory (GPa)", "difference (%)"] if theory is not None else []
    rows = []
    for index, row in enumerate(simulated[:MOST_ROWS]):
        modulus = row["indentation_modulus_gpa"]
        beside = [number(theory[index], 2), number(100 * (modulus / theory[index] - 1), 2)] if theory is not None else []
        rows.append([orientation(row["euler_deg"]), number(modulus, 2), *beside, row["elements"], number(row["seconds"], 2)])
    caption = "Indentation moduli" + (f", the first {MOST_ROWS}" if len(simulated) > MOST_ROWS else "")
    return Section(
        "Simulated indentations", after=[Table(caption, ["φ₁, Φ, φ₂ (degrees)", "M (GPa)", *compared, "elements", "seconds"], rows)]
    )


def size(results: Results) -> Section | None:
    """How thick a film or how large a grain must be."""
    document = results.documents["size"]
    if not document:
        return None
    name = document["variable"].removesuffix("_um").replace("_", " ")
    rows = [
        [orientation(row["euler_deg"]), row["surroundings"], number(row["young_gpa"], 0), number(row["smallest_um"], 3)]
        for row in document["results"]
    ]
    header = ["φ₁, Φ, φ₂ (degrees)", "surroundings", "Young's modulus (GPa)", f"least {name} (µm)"]
    words = f"Contact radius {document['contact_radius_um']:g} µm; the bias of the modulus stays below {100 * document['limit']:g} % from the least {name} on."
    return Section("How far is far enough", words, after=[Table(f"Least {name}", header, rows)])


def surrogate(results: Results) -> Section | None:
    """How the surrogate was taught, and how well it knows the simulations."""
    build = results.documents["build"]
    if not build:
        return None
    facts = [
        ["simulations in all", build["simulations"]],
        ["of them failed", build["failed"]],
        ["terms of the basis", build["terms"]],
        ["mean error of a simulation left out (GPa)", number(build["loocv_gpa"], 3)],
        ["mean error of a crystal left out (GPa)", number(build.get("leave_crystal_out_gpa"), 3)],
        ["precision of the coefficients, α", f"{build['alpha']:.4g}"],
        ["precision of the simulations, β", f"{build['beta']:.4g}"],
        ["sd of a modulus in the domain, mean (%)", number(percent(build, "mean_relative_sd"), 2)],
        ["the same at its largest (%)", number(percent(build, "largest_relative_sd"), 2)],
        ["stopped because", build.get("stopped", "–")],
    ]
    return Section("Step 1: the surrogate", before=[Table("The surrogate of the indentation modulus", ["", "value"], facts, prose=True)])


def whole(text: str) -> Markup:
    """A text that stays in one line."""
    return Markup('<span class="whole">{}</span>').format(text)


def percent(build: dict, name: str) -> float | None:
    """A share of the domain's document as a percentage."""
    share = build.get("domain", {}).get(name)
    return None if share is None else 100 * share


def posterior(results: Results) -> Section | None:
    """The posterior of the constants."""
    document = results.documents["extract"]
    if not document:
        return None
    rows = [
        [name, number(item["r_hat"], 3), number(item["ess_bulk"], 0), number(item["ess_tail"], 0)] for name, item, _ in best_first(document)
    ]
    beside = [
        [name, *(number(document["parameters"][name][key], 1) for key in ("mean", "sd")), *(number(item[key], 1) for key in ("mean", "sd"))]
        for name, item in document.get("theory_alone", {}).items()
    ]
    title = "Constants (GPa) with the correction of the specimen, and as theory of the half-space alone would have them"
    compared = [Table(title, ["constant", "mean", "sd", "theory alone, mean", "sd"], beside)] if beside else []
    caption = f"Convergence of {document['chains']} chains of {document['samples']} samples; R-hat should be below 1.01"
    mixing = Table(caption, ["constant", "R-hat", "effective samples, bulk", "tail"], rows)
    return Section("Step 2: the elastic constants", after=[*compared, mixing])


def identifiability(results: Results) -> Section | None:
    """What the data decided and what the prior did."""
    rows = results.documents["extract"].get("identifiability", [])
    if not rows:
        return None
    combinations, quantities, further = [], [], []
    now = {name: item["sd"] for name, item in results.documents["extract"]["parameters"].items()}
    for row in rows:
        if row["kind"] == "knowledge":
            then = ", ".join(f"{name} {number(now[name], 1)} → {number(sd, 1)}" for name, sd in row["sd_then"].items())
            further.append([f"{' and '.join(map(quantity_in_words, row['name'].split(', ')))} to {100 * row['relative_sd']:.0f} %", then])
            continue
        share = number(row["contraction"], 3)
        if row["kind"] == "combination":
            sds = [number(100 * row[name], 2) for name in ("sd", "prior_sd")]
            combinations.append([powers_as_html(row["exponents"]), *sds, share])
        else:
            unit, digits = ("", 3) if row["unit"] == "1" else (f" ({row['unit']})", 1)
            values = [number(row[name], digits) for name in ("mean", "sd", "prior_sd")]
            quantities.append((row["contraction"], [quantity_in_words(row["name"]) + unit, *values, share]))
    ordered = [row for _, row in sorted(quantities, key=lambda pair: -pair[0])]
    return Section(
        "What the data decided, and what the prior did",
        "Indentation sees some combinations of the constants sharply and others hardly at all. The contraction is the share of the "
        "prior's variance that the data removed: where it is near 1 the data decided, where it is near 0 the result repeats the prior, "
        "however narrow its sd may look.",
        after=[
            Table(
                "Combinations of the constants; sd is relative",
                ["combination", "sd (%)", "sd of the prior (%)", "contraction"],
                combinations,
            ),
            Table("Quantities of the crystal", ["", "mean", "sd", "sd of the prior", "contraction"], ordered),
            Table("What else to measure or look up, and what it would bring", ["known", "sd of the constants, GPa"], further, prose=True),
            Table("The prior that was in effect", ["", ""], prior_rows(results.documents["extract"].get("prior", {})), prose=True),
        ],
    )


def prior_rows(prior: dict) -> list[list[str]]:
    """What the document of `extract` says of its prior, in words."""
    if not prior:
        return []
    rows = [["uniform in", {"constants": "the constants", "logarithms": "the logarithm of the stiffness"}[prior["measure"]]]]
    rows += [[f"{name} (GPa)", f"{number(low)} .. {number(high)}"] for name, (low, high) in prior["bounds"].items()]
    names = {"poisson": "Poisson's ratio (Hill)", "young_gpa": "Young's modulus (Hill, GPa)"}
    rows += [[words, f"{number(prior[name][0], 2)} .. {number(prior[name][1], 2)}"] for name, words in names.items() if prior[name]]
    names = {"anisotropy_cap": "anisotropy index (Eq. 14) up to", "log_anisotropy_max": "log-anisotropy up to"}
    rows += [[words, number(prior[name], 2)] for name, words in names.items() if prior[name] is not None]
    for item in prior["knowledge"]:
        unit = "" if item["unit"] == "1" else f" ({item['unit']})"
        rows.append(
            [
                f"known: {quantity_in_words(item['name'])}{unit}",
                f"{item['mean']:.4g} ± {item['sd']:.2g}, {item['conflict_sd']:.1f} sd from all else",
            ]
        )
    rows.append(["surrogate", prior["words"][-1].removeprefix("surrogate: ")])
    return [*rows, ["share that the surrogate covers", f"{100 * prior['share_covered']:.0f} %"]]


def checks(results: Results) -> Section | None:
    """Whether the model could have given the measurements, and how much of the result is the prior's."""
    document = results.documents["extract"]
    if not document.get("checks"):
        return None
    chi_square, worst = document["checks"]["chi_square"], document["checks"]["extreme_grain"]
    rows = [
        [
            f"χ² about a draw of the posterior, {number(chi_square['mean'])} on average for {len(document['predicted'])} grains",
            whole(f"p = {chi_square['p']:.3f}"),
        ],
        [f"grain {worst['grain']}, the furthest off, by {number(worst['residual_sd'])} sds", whole(f"p = {worst['p']:.3f}")],
    ]
    if evidence := document.get("evidence"):
        rows.append(["evidence, log Z; it depends on the bounds", f"{number(evidence['log_z'], 2)} ± {number(evidence['sd'], 2)}"])
    moved = [row for row in map(sensitivity_row, document["sensitivity"]) if row]
    words = "Each p is the share of data sets, drawn from the posterior, that are further off than the measurements: near 0 something is missing, near 1 the stated sds are too large."
    if not moved:
        words += f" No limit of the prior, moved by a tenth, shifts a constant by more than {MATTERS:g} sd, nor does the other measure."
    caption = "What moves if the prior is another (shifts of the mean in sds; 'about': an estimate, another run tells)"
    after = [Table(caption, ["", "shifts"], moved, prose=True)] if moved else []
    return Section(
        "Does the model fit, and how much is the prior's", words, before=[Table("Model and data", ["", ""], rows, prose=True)], after=after
    )


def sensitivity_row(change: dict) -> list[str] | None:
    """What a change of the prior shifts, where that matters."""
    shifts = {name: shift for name, shift in change["shift_sd"].items() if shift is not None and abs(shift) > MATTERS}
    if not shifts:
        return None
    names = {
        "young": "Young's modulus (Hill)", "poisson": "Poisson's ratio (Hill)", "anisotropy_cap": "the anisotropy index",
        "log_anisotropy_max": "log-anisotropy", "measure": "the other measure of the prior",
    }  # fmt: skip
    words = names.get(change["name"], change["name"])
    if "side" in change:
        words = f"{change['side']} limit of {words} from {change['from']:.4g} to {change['to']:.4g}"
    told = ", ".join(f"{name} {shift:+.2f}" for name, shift in sorted(shifts.items(), key=lambda pair: -abs(pair[1])))
    return [words, told if change["exact"] else f"about {told}"]


def next_grain(results: Results) -> Section | None:
    """Grains worth measuring next."""
    suggestions = results.documents["next"].get("suggestions", [])
    if not suggestions:
        return None
    unit = f" ({results.documents['next']['unit']})" if results.documents["next"].get("unit") else ""
    rows = [
        [item.get("grain", rank), *(number(angle) for angle in item["euler_deg"]), item.get("uvw", ""), f"{item['gain']:.3f}"]
        for rank, item in enumerate(suggestions, 1)
    ]
    header = ["grain" if "grain" in suggestions[0] else "rank", "φ₁", "Φ", "φ₂ (degrees)", "[uvw] along z", f"expected gain{unit}"]
    return Section("Which grain to measure next", after=[Table("Suggested orientations, each chosen given those above it", header, rows)])


def provenance(results: Results) -> Section:
    """Versions, input and commands that made the results."""
    log = results.folder / "run.log"
    commands = (
        [line for line in log.read_text(encoding="utf-8", errors="replace").splitlines() if f"INFO bayesindent {__version__[:1]}" in line]
        if log.exists()
        else []
    )
    rows = [
        ["bayesindent", __version__],
        ["Python, system", f"{platform.python_version()}, {platform.system()} {platform.machine()}"],
        ["NumPy, SciPy, ArviZ", ", ".join(metadata.version(name) for name in ("numpy", "scipy", "arviz"))],
        ["seed", results.group("problem").get("seed", "–")],
        ["last command", commands[-1].split(": ", 1)[-1] if commands else "–"],
        ["SHA-256 of the resolved input", hashlib.sha256(results.resolved.encode()).hexdigest() if results.resolved else "–"],
    ]
    if results.outdated:
        rows.append(["left out, since made from other inputs", ", ".join(results.outdated)])
    return Section("Provenance", before=[Table("What made these results", ["", ""], rows, prose=True)], fold=results.resolved)


def constants_table(results: Results) -> Table | None:
    """The answer."""
    document = results.documents["extract"]
    if not document:
        return None
    rows = []
    for name, item, contraction in best_first(document):
        low, high = item["hdi_95"]
        rows.append(
            [
                name,
                number(item["mean"]),
                number(item["sd"]),
                number(item["map"]),
                whole(f"{number(low)} to {number(high)}"),
                number(contraction, 3),
            ]
        )
    return Table(
        "Elastic constants in GPa, the best known first", ["constant", "mean", "sd", "most probable", "95 % interval", "contraction"], rows
    )


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
