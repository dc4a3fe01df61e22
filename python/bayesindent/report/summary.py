"""The first texts of the report: constants, usability, advice, what is determined, inputs."""

from markupsafe import Markup

from ..common.diagnostics import is_unusable
from .formatting import (
    enumeration,
    median_and_range,
    number,
    percent,
    plus_minus,
    product_html,
    quantity_format,
    quantity_name,
    subscript,
)
from .results import Results

#: Most quantities that are listed.
MOST = 6

#: The headings of diagnostics by their consequence, in order.
CONSEQUENCES = {
    "undetermined": "Some constants are not determined by the measurements",
    "biased": "The constants may be biased",
    "draws": "There are too few draws",
    "surrogate": "The surrogate is uncertain",
    "inputs": "Check the inputs",
}


def answer(results: Results) -> list[str]:
    """A line with the constants and their sds, and whether they can be used."""
    document = results.extracted
    stated, vague = [], []
    for name in results.constants:
        item = document["parameters"][name]
        # Use blanks that do not break the line.
        value = plus_minus(item)
        if item["verdict"] == "not_determined" and "quantiles" in item:
            value = median_and_range(item)
        stated.append(f"{subscript(name)} = {value}".replace(" ", "\u00a0"))
        if item["verdict"] == "not_determined":
            vague.append(subscript(name))
    usable = "Usable" if document["usable"] else f"Not usable: {document['reasons'][0]}"
    if document["usable"] and vague:
        usable += f", but the measurements do not determine {enumeration(vague)}"
    return [f"{', '.join(stated)}\u00a0GPa.", f"{usable}."]


def advice(results: Results) -> dict[str, list[str]]:
    """The warnings by the headings of their consequences; those with the same remedy are joined."""
    found: dict[str, list[str]] = {}
    for consequence, heading in CONSEQUENCES.items():
        remedies: dict[str, list[str]] = {}
        for warning in results.warnings:
            if warning["consequence"] == consequence and not is_unusable(warning):
                remedies.setdefault(warning["remedy"] or warning["text"], []).append(
                    warning["text"]
                )
        for remedy, parts in remedies.items():
            line = "; ".join(parts)
            if remedy not in parts:
                line += f". {remedy}"
            found.setdefault(heading, []).append(line[:1].upper() + line[1:].rstrip(".") + ".")
    return found


def inputs_summary(results: Results) -> list[tuple[str, str]]:
    """Terms and texts on crystal, grains, modulus, simulations, specimen and indenter."""
    document, simulated = results.extracted, len(results.simulations)
    if not any(results.documents.values()):
        return []
    rows = [
        (
            "Crystal",
            results.symmetry and f"{results.symmetry}; constants {', '.join(results.constants)}",
        )
    ]
    if results.predicted:
        moduli, sds = measured_ranges(results)
        scatter = f", standard deviations {sds} GPa" if sds else "; their scatter is inferred"
        grains = (
            with_count(len(results.predicted), "grain")
            + " of unknown orientation" * results.without_orientations
        )
        rows += [
            ("Grains", f"{grains}, {moduli} GPa{scatter}"),
            ("Modulus", modulus_kind(results)),
        ]
    if results.velocities:
        directions = with_count(len(results.velocities), "direction")
        rows += [("Velocities", f"{results.speed} in {directions}")]
    if simulated:
        crystals = with_count(simulated, "crystal")
        rows += [("Simulations", f"indentation moduli of {crystals} by finite elements")]
    rows += [("Specimen", specimen(results)), ("Indenter", indenter(results))]
    if not document and (build := results.built):
        words = f"from {build['simulations']} simulations; {build['domain']['words']}"
        rows += [("Surrogate", words)]
    return [row for row in rows if row[1]]


def with_count(count: int, word: str) -> str:
    """Such as 'one grain' or '11 grains'."""
    return f"one {word}" if count == 1 else f"{count} {word}s"


def measured_ranges(results: Results) -> list[str]:
    """The ranges of the measured moduli and of their sds in GPa; '' if there are none."""
    ranges = []
    for name in ("measured", "measured_sd"):
        values = [item[name] for item in results.predicted if item.get(name)]
        ends = [number(min(values)), number(max(values))] if values else []
        ranges.append(" to ".join(dict.fromkeys(ends)))
    return ranges


def modulus_kind(results: Results) -> str:
    """The kind of modulus, and the constants that define it."""
    words = {
        "effective modulus": (
            ", with E = {indenter_modulus_gpa:g} GPa of the indenter and ν = {indenter_nu:g} of "
            "the indenter"
        ),
        "sample modulus": ", with ν = {sample_nu:g}",
    }.get(results.kind, "")
    return results.kind + words.format(**results.settings["measurements"])


def indenter(results: Results) -> str:
    """The shape of the indenter and its last depth; '' if it is not known."""
    group = results.settings["indenter"]
    if not group:
        return ""
    size = (
        "half angle {half_angle_deg:g}°" if group["shape"] == "cone" else "radius {radius_um:g} µm"
    )
    last = (
        "depth of {depth_um:g} µm"
        if "depth_um" in group
        else "contact radius of {contact_radius_um:g} µm"
    )
    return f"rigid {{shape}}, {size}, up to a {last}".format(**group)


def specimen(results: Results) -> str:
    """The specimen; '' if no simulation depends on it."""
    group = results.settings["specimen"]
    if not (results.built or results.simulations) or not group:
        return ""
    words = {
        "halfspace": "half-space",
        "block": "block, {width_um:g} µm wide and {height_um:g} µm high",
        "film": "film of {thickness_um:g} µm",
        "grain": "grain of radius {grain_radius_um:g} µm among others",
    }.get(group["geometry"], group["geometry"])
    if group["geometry"] == "film" and "substrate_young_gpa" in group:
        words += " on a substrate of E = {substrate_young_gpa:g} GPa"
    return words.format(**group)


def findings(results: Results) -> list[str | Markup]:
    """Sentences on combinations that are determined, and on quantities by their verdict."""
    combinations = results.identifiability("combination")
    if not combinations:
        return []
    found = with_verdict(combinations, "determined")
    products = [
        Markup("{} (to {} %)").format(product_html(row["exponents"]), percent(row["sd"], 1))
        for row in found
    ]
    start = Markup("{} of {} combinations of the constants are determined{}{}.")
    sentences: list[str | Markup] = [
        start.format(len(found), len(combinations), ": " * bool(found), Markup(", ").join(products))
    ]
    quantities = [
        row
        for row in results.identifiability("quantity")
        if row["mean"] and row["name"] not in results.extracted["parameters"]
    ]
    derived = sorted(quantities, key=lambda row: row["sd"] / abs(row["mean"]))
    rest = {
        "Determined, too": with_verdict(derived, "determined")[:MOST],
        "Not determined": with_verdict(derived, "not_determined"),
    }
    for start_of_sentence, rows in rest.items():
        if rows:
            names = enumeration([with_sd(row, results.symmetry) for row in rows])
            sentences.append(f"{start_of_sentence}: {names}.")
    return sentences


def with_verdict(rows: list[dict], verdict: str) -> list[dict]:
    """The rows with this verdict."""
    return [row for row in rows if row["verdict"] == verdict]


def with_sd(row: dict, symmetry: str) -> str:
    """The name of a quantity, its mean, its sd and its unit."""
    name, unit = quantity_name(row["name"], symmetry), quantity_format(row)[0]
    return f"{name} {plus_minus(row)} {unit}".rstrip()
