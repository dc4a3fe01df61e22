"""Numbers and names of results as text, LaTeX and HTML."""

import math
import re
from collections.abc import Iterable, Mapping, Sequence

from ..crystal.elasticity import constant_names

SUBSCRIPTS = str.maketrans("0123456789", "₀₁₂₃₄₅₆₇₈₉")

#: Signs that LaTeX needs in another form.
LATEX = str.maketrans(
    {sign: f"\\{sign}" for sign in "{}$%_&#"}
    | {sign: f"${sign}$" for sign in "<>"}
    | {
        "\\": r"\textbackslash{}",
        "±": r"$\pm$",
        "–": "--",
        "°": r"$^\circ$",
        "²": "$^2$",
        "φ": r"$\varphi$",
        "Φ": r"$\Phi$",
        "₁": "$_1$",
        "₂": "$_2$",
        "ν": r"$\nu$",
        "χ": r"$\chi$",
        "µ": r"\textmu{}",
        "−": "$-$",
        "^": r"\^{}",
        "~": r"\~{}",
        "→": r"$\to$",
    }
)

#: Shares of a variance with their headers, and the headers of `share_cells`.
SHARES = {"measurements": "measured", "knowledge": "known", "prior": "prior"}
SHARE_HEADER = [*(f"{name} (%)" for name in SHARES.values()), "verdict"]

MODULI = {
    "bulk": "bulk modulus",
    "shear": "shear modulus",
    "young": "Young's modulus",
    "poisson": "Poisson's ratio",
}


def number(value: float | None, digits: int = 1) -> str:
    """A number as text; a dash for None and NaN, and 0 for -0."""
    return (
        "–"
        if value is None or not math.isfinite(value)
        else f"{round(value, digits) + 0.0:.{digits}f}"
    )


def digits_of(parameter: str) -> int:
    """Decimals of a parameter: of a constant in GPa, or of a number beside the constants."""
    return 1 if parameter.startswith("C") else 3


def percent(value: float | None, digits: int = 0) -> str:
    """A share in per cent as text; a dash for None and NaN."""
    return number(value and 100 * value, digits)


def cells(items: Iterable[Mapping], *texts: str, **digits: int) -> list[list]:
    """Rows of a table: for each item the values of `texts`, then the numbers."""
    return [list(map(item.__getitem__, texts)) + numbers(item, **digits) for item in items]


def named(items: Mapping[str, Mapping], **digits: int) -> list[list]:
    """Rows of a table: for each item its name, then the numbers."""
    return [[name, *numbers(item, **digits)] for name, item in items.items()]


def numbers(item: Mapping, **digits: int) -> list[str]:
    """The numbers of an item as texts, by name with a count of digits."""
    return [number(item.get(name), count) for name, count in digits.items()]


def unknowns_of(curves: Mapping) -> dict[str, Mapping]:
    """What tests share, by name, in the document of `curves`: of tip, frame and sessions."""
    rows = curves.get("sessions", [])
    factors = {f"session {row['session']}".strip(): row["factor"] for row in rows}
    return curves.get("tip", {}) | curves.get("frame", {}) | factors


def suggested_grains(items: Sequence[Mapping]) -> list[str]:
    """The grain of each suggestion, and the direction of a speed.

    Without names of grains these are ranks; 'new' stands for a grain without a name among named
    ones.
    """
    named, names = any("grain" in item for item in items), []
    for rank, item in enumerate(items, 1):
        speed = f", speed at {item['propagation_deg']:g}°" if "propagation_deg" in item else ""
        names.append(f"{item.get('grain', 'new' if named else rank)}{speed}")
    return names


def region(item: Mapping, direction: str) -> str:
    """The direction of a suggestion, and the angle within which gains are similar."""
    words = "{1}, within {0:.0f}°" if "° from" in direction else "within {0:.0f}° of {1}"
    return words.format(item["within_deg"], direction) if "within_deg" in item else direction


def share_cells(item: Mapping) -> list[str]:
    """The shares of the variance in per cent (see `SHARES`), and the verdict."""
    return [*(percent(item["share"][name]) for name in SHARES), item["verdict"].replace("_", " ")]


def orientation(euler_deg: Iterable[float]) -> str:
    """Bunge's angles as text."""
    return "(" + ", ".join(f"{round(angle, 1):g}" for angle in euler_deg) + ")°"


def plus_minus(item: Mapping) -> str:
    """Mean and sd with two digits of the sd, and at least all digits before the decimal point."""
    digits = 1 if not item["sd"] else min(4, max(0, 1 - math.floor(math.log10(item["sd"]))))
    return " ± ".join(numbers(item, mean=digits, sd=digits))


def median_and_range(item: Mapping) -> str:
    """Median and interval of 68 %, for a distribution that a mean and an sd do not describe."""
    low, median, high = item["quantiles"][1:4]
    return f"{number(median, 0)} (68 %: {number(low, 0)} to {number(high, 0)})"


def has_four_indices(symmetry: str) -> bool:
    """Whether directions of the crystal class have four indices: C33 and C66 = (C11 - C12)/2."""
    constants = constant_names(symmetry) if symmetry else ()
    return "C33" in constants and "C66" not in constants


def direction_name(direction: Sequence[float], four: bool) -> str:
    """The name of a direction with components along the Cartesian crystal axes.

    With four indices x is [2-1-10] and y is [01-10]; other directions are angles to an axis, in the
    plane with another one.
    """
    x, y, z = direction
    along_c, along_x, along_y = "[0001]", "[21\u03051\u03050]", "[011\u03050]"
    if not four:
        digits = (f"{abs(round(index))}" + "\u0305" * (index < 0) for index in direction)
        return f"[{''.join(digits)}]"
    if not (x or y):
        return along_c
    in_plane = math.degrees(math.atan2(y, x))
    axes = {0: along_x, 90: along_y}
    towards = axes.get(round(in_plane), f"{in_plane:.0f}° from {along_x}")
    if not z:
        return towards
    return f"{math.degrees(math.atan2(math.hypot(x, y), z)):.0f}° from {along_c} to {towards}"


def quantity_name(name: str, symmetry: str = "") -> str:
    """The name of a quantity in reports; directions have four indices if the class has them."""
    word, _, direction = name.partition("[")
    if direction:
        short = re.fullmatch(r"((?:-?\d){3})\]", direction) if has_four_indices(symmetry) else None
        named = (
            direction_name([int(index) for index in re.findall(r"-?\d", short[1])], True)
            if short
            else f"[{direction}"
        )
        return f"{MODULI.get(word, word)} {'at' if '°' in named else 'along'} {named}"
    if word.startswith("polycrystal_"):
        return f"{MODULI[word.removeprefix('polycrystal_')]} of the polycrystal"
    return word.replace("_", " ")


def quantity_format(row: Mapping) -> tuple[str, int]:
    """The unit of a quantity ('' for ratios), and the digits of its values."""
    return ("", 3) if row["unit"] == "1" else (row["unit"], 1)


def quantity_label(row: Mapping, symmetry: str) -> str:
    """The names of quantities that are known together, with their unit if it is stated."""
    names = " and ".join(quantity_name(name, symmetry) for name in row["name"].split(", "))
    unit = quantity_format(row)[0] if "unit" in row else ""
    return names + (f" ({unit})" if unit else "")


def latex(text: str) -> str:
    """A text in LaTeX, with subscripts of constants."""
    return re.sub(r"\b([CS])([1-6][1-6])\b", r"$\1_{\2}$", text.translate(LATEX)).replace("$$", "")


def enumeration(parts: Sequence[str]) -> str:
    """Such as 'a, b and c'."""
    return " and ".join(filter(None, [", ".join(parts[:-1]), *parts[-1:]]))


def subscript(name: str) -> str:
    """A constant such as C11 with its subscript in Unicode.

    Formulas of matplotlib are slow, and are not text in its files.
    """
    return "C" + name[1:].translate(SUBSCRIPTS) if name[:1] == "C" and name[1:].isdigit() else name
