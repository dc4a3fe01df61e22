"""Texts on a result: its constants, whether they can be used, and advice."""

import re

from ..common.diagnostics import is_unusable
from .formatting import enumeration, median_and_range, plus_minus, subscript
from .results import Results

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
        value = plus_minus(item)
        if item["verdict"] == "not_determined":
            vague.append(subscript(name))
            value = median_and_range(item)
        # Use blanks that do not break the line.
        stated.append(f"{subscript(name)} = {value}".replace(" ", "\u00a0"))
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
            # Names such as bulk_modulus stay as they are.
            if not re.match(r"\w*[_\[]", line):
                line = line[:1].upper() + line[1:]
            found.setdefault(heading, []).append(line.rstrip(".") + ".")
    return found


def with_count(count: int, word: str) -> str:
    """Such as 'one grain' or '11 grains'."""
    return f"one {word}" if count == 1 else f"{count} {word}s"
