"""Numbers and names of results as people read them."""

import math
import re
from collections.abc import Sequence

from markupsafe import Markup, escape

__all__ = [
    "best_first",
    "latex",
    "listed",
    "number",
    "orientation",
    "power_label",
    "powers_as_html",
    "quantity_in_words",
    "subscript",
    "with_powers",
]

SUBSCRIPTS = str.maketrans("0123456789", "₀₁₂₃₄₅₆₇₈₉")


def number(value, digits: int = 1) -> str:
    """A number as text; a dash where there is none."""
    return "–" if value is None or not math.isfinite(value) else f"{value:.{digits}f}"


def best_first(document: dict) -> list[tuple[str, dict, float | None]]:
    """Name, entry and contraction of each parameter of the document of `extract`, those first that the data know best."""
    contraction = {row["name"]: row["contraction"] for row in document.get("identifiability", []) if row["kind"] == "quantity"}
    rows = [(name, item, contraction.get(name)) for name, item in document["parameters"].items()]
    return sorted(rows, key=lambda row: math.inf if row[2] is None else -row[2])


def orientation(euler_deg) -> str:
    """Angles in words."""
    return "(" + ", ".join(f"{round(angle, 1):g}" for angle in euler_deg) + ")°"


def quantity_in_words(name: str) -> str:
    """The name of a quantity of the crystal as people write it."""
    moduli = {"bulk": "bulk modulus", "shear": "shear modulus", "young": "Young's modulus", "poisson": "Poisson's ratio"}
    word, _, direction = name.partition("[")
    if direction:
        return f"{moduli.get(word, word)} along [{direction}"
    if word.startswith("polycrystal_"):
        return f"{moduli[word.removeprefix('polycrystal_')]} of the polycrystal"
    return word.replace("_", " ")


def latex(text: str) -> str:
    """A text as LaTeX has it."""
    signs = {
        "\\": r"\textbackslash{}",
        "%": r"\%",
        "_": r"\_",
        "&": r"\&",
        "#": r"\#",
        "±": r"$\pm$",
        "–": "--",
        "°": r"$^\circ$",
        "²": "$^2$",
    }
    signs |= {
        "ν": r"$\nu$",
        "χ": r"$\chi$",
        "µ": r"\textmu{}",
        "−": "$-$",
        "^": r"\^{}",
        "~": r"\~{}",
        "<": "$<$",
        ">": "$>$",
        "→": r"$\to$",
    }
    return "".join(signs.get(sign, sign) for sign in text)


def listed(words: Sequence[str]) -> str:
    """Such as 'a, b and c'."""
    return " and ".join(filter(None, [", ".join(words[:-1]), words[-1]]))


def subscript(name: str) -> str:
    """C11 as C with a subscript, of signs of the font: formulas of matplotlib are slow, and no text in its files."""
    return "C" + name[1:].translate(SUBSCRIPTS) if name[:1] == "C" and name[1:].isdigit() else name


def powers(exponents: dict[str, float]) -> list[tuple[str, str]]:
    """Indices and power of each factor of a product of powers of constants; powers that hardly count are left out, and that of 1."""
    kept = [(name[1:], power) for name, power in exponents.items() if abs(power) >= 0.05]
    return [(index, "" if abs(power - 1) < 0.005 else f"{power:.2f}") for index, power in kept]


def power_label(exponents: dict[str, float]) -> str:
    """A product of powers of constants for matplotlib."""
    return "$" + r"\,".join(f"C_{{{index}}}" + (f"^{{{power}}}" if power else "") for index, power in powers(exponents)) + "$"


def powers_as_html(exponents: dict[str, float]) -> Markup:
    """A product of powers of constants, such as C11^1 C44^0.77."""
    factors = [
        Markup('<span class="whole"><i>C</i><sub>{}</sub>').format(index)
        + (Markup("<sup>{}</sup>").format(power.replace("-", "−")) if power else "")
        + Markup("</span>")
        for index, power in powers(exponents)
    ]
    return Markup(" ").join(map(escape, factors))


def with_powers(text: str) -> Markup:
    """A text with its powers of constants, such as C11^1.00 C44^0.77, as HTML."""
    return Markup(re.sub(r"\b(C\d\d)\^(-?\d+\.\d+)", lambda found: powers_as_html({found[1]: float(found[2])}), str(escape(text))))
