"""What stands first in the report: what was asked, in words, and what is well known now."""

from markupsafe import Markup

from .results import Results
from .words import listed, number, powers_as_html, quantity_in_words

__all__ = ["DECIDED", "asked", "well_known"]

#: Contraction from which on the data decided: they halved the sd of the prior, as warnings count it too.
DECIDED = 0.75

#: Relative sd below which a quantity is well known, and how many are named.
WELL, MOST = 0.05, 6


def asked(results: Results) -> list[tuple[str, str]]:
    """Terms and words: grains, kind of modulus, indenter, specimen, surrogate with its error, prior in effect."""
    document, simulated = results.documents["extract"], len(results.simulations)
    if not any(results.documents.values()):
        return []
    rows = []
    if results.symmetry:
        rows.append(("Crystal", f"{results.symmetry}; constants {', '.join(results.constants)}"))
    if document:
        rows += [("Grains", grains(document["predicted"])), ("Modulus", kind(results))]
    if simulated:
        rows.append(("Simulations", f"indentation moduli of {counted(simulated, 'crystal')} by finite elements"))
    if specimen := specimen_in_words(results):
        rows.append(("Specimen", specimen))
    rows.append(("Indenter", indenter(results)))
    if document:
        words = [in_plain_words(line, document["prior"]["knowledge"]) for line in document["prior"]["words"]]
        rows.append(("Surrogate", words.pop().removeprefix("surrogate: ")))
        rows.append(("Prior in effect", "; ".join(words)))
    elif build := results.documents["build"]:
        rows.append(("Surrogate", f"from {build['simulations']} simulations; {build['domain']['words']}"))
    return rows


def in_plain_words(line: str, knowledge: list[dict]) -> str:
    """A line on the prior with what is known by the names that people use."""
    for item in knowledge:
        line = line.replace(f"{item['name']} =", f"{quantity_in_words(item['name'])} =")
    return line


def counted(count: int, word: str) -> str:
    """Such as 'one grain' or '11 grains'."""
    return f"one {word}" if count == 1 else f"{count} {word}s"


def grains(predicted: list[dict]) -> str:
    """How many there are, their moduli and sds."""
    moduli, sds = ([item[name] for item in predicted if item.get(name)] for name in ("measured", "measured_sd"))
    words = f"{counted(len(predicted), 'grain')}, {span(moduli)} GPa"
    return f"{words}, standard deviations {span(sds)} GPa" if sds else f"{words}; their scatter is inferred"


def span(values: list[float]) -> str:
    """From the least to the largest."""
    low, high = number(min(values)), number(max(values))
    return low if low == high else f"{low} to {high}"


def kind(results: Results) -> str:
    """The kind of modulus, and what it depends on."""
    measured = results.group("measurements")
    names = {"effective modulus": ("indenter_modulus_gpa", "indenter_nu"), "sample modulus": ("sample_nu",)}
    signs = {"indenter_modulus_gpa": "E = {:g} GPa of the indenter", "indenter_nu": "ν = {:g} of the indenter", "sample_nu": "ν = {:g}"}
    stated = [signs[name].format(measured[name]) for name in names.get(results.kind, ()) if name in measured]
    return results.kind + (f", with {' and '.join(stated)}" if stated else "")


def indenter(results: Results) -> str:
    """The shape of the indenter and its last point."""
    group = results.group("indenter")
    shape = group.get("shape", "paraboloid")
    size = f"half angle {group['half_angle_deg']:g}°" if shape == "cone" else f"radius {group.get('radius_um', 16.0):g} µm"
    last = f"depth {group['depth_um']:g} µm" if group.get("depth_um") else f"contact radius {group.get('contact_radius_um', 0.5):g} µm"
    return f"rigid {shape}, {size}, up to a {last}"


def specimen_in_words(results: Results) -> str:
    """What is indented, where a surrogate or simulations depend on it."""
    group = results.group("specimen")
    if not (results.documents["build"] or results.simulations) or not group:
        return ""
    substrate = f" on a substrate of E = {group['substrate_young_gpa']:g} GPa" if group.get("substrate_young_gpa") else ""
    return {
        "halfspace": "half-space",
        "block": f"block, {group.get('width_um', 0):g} µm wide and {group.get('height_um', 0):g} µm high",
        "film": f"film of {group.get('thickness_um', 0):g} µm{substrate}",
        "grain": f"grain of radius {group.get('grain_radius_um') or 0:g} µm among others",
    }.get(group["geometry"], group["geometry"])


def well_known(results: Results) -> list[str | Markup]:
    """Sentences: combinations that the data decided, quantities that are well known, constants that are not."""
    document = results.documents["extract"]
    rows = document.get("identifiability", [])
    if not rows:
        return []
    combinations = [row for row in rows if row["kind"] == "combination"]
    decided = [row for row in combinations if row["contraction"] >= DECIDED]
    sentences: list[str | Markup] = []
    if decided:
        products = Markup(", ").join(
            Markup("{} (to {} %)").format(powers_as_html(row["exponents"]), number(100 * row["sd"])) for row in decided
        )
        sentences.append(
            Markup("The measurements decided {} of {} combinations of the constants: {}.").format(len(decided), len(combinations), products)
        )
    else:
        sentences.append(f"The measurements decided none of the {len(combinations)} combinations of the constants.")
    quantities = [row for row in rows if row["kind"] == "quantity" and row["mean"]]
    near = sorted((row for row in quantities if row["sd"] <= WELL * abs(row["mean"])), key=lambda row: row["sd"] / abs(row["mean"]))
    for source, words in ((True, "Well known, by the measurements"), (False, "Well known, by the prior and what else was known")):
        chosen = [row for row in near if (row["contraction"] >= DECIDED) is source][:MOST]
        if chosen:
            sentences.append(f"{words}: {listed([in_words(row) for row in chosen])}.")
    open_ = [row for row in quantities if row["name"] in document["parameters"] and row["contraction"] < DECIDED]
    if open_:
        sentences.append(f"Left to the prior: {listed([in_words(row) for row in open_])}.")
    return sentences


def in_words(row: dict) -> str:
    """A quantity with its sd."""
    unit, digits = ("", 3) if row["unit"] == "1" else (f" {row['unit']}", 1)
    return f"{quantity_in_words(row['name'])} {number(row['mean'], digits)} ± {number(row['sd'], digits)}{unit}"
