"""Names of columns as laboratories write them, with their units."""

import re
from collections.abc import Collection, Iterable, Sequence
from dataclasses import dataclass
from difflib import get_close_matches

from ..core import InputError

#: Units of angles in degrees, and in radians.
DEGREES, RADIANS = ("deg", "degrees", "degree", "°"), ("rad", "radians")
#: Units of lengths, and what they are in um.
LENGTHS = {"um": 1.0, "µm": 1.0, "μm": 1.0, "nm": 1e-3, "mm": 1e3}
ANGLES = ("phi1_deg", "Phi_deg", "phi2_deg")
#: Kinds of modulus; the column of a kind is named '<kind>_gpa'.
KINDS = ("indentation_modulus", "effective_modulus", "sample_modulus")
#: Columns of moduli, the most specific first; the last one does not say its kind.
MODULI = (*(f"{kind}_gpa" for kind in KINDS), "modulus_gpa")
#: Columns that state the indented direction instead of angles, see docs/measurements.md.
WAYS = tuple(map(str.split, ("q0 q1 q2 q3", "u v t w", "h k i l", "u v w", "h k l")))
DIRECTIONS = {name for way in WAYS for name in way}
#: Columns whose cells are names, not numbers.
NAME_COLUMNS = ("grain", "group", "test", "reference", "session")


@dataclass(frozen=True)
class Column:
    """A canonical column, its other names without their units, separated by blanks, and the units
    that it may have.
    """

    name: str
    others: str = ""
    units: Collection[str] = ()


#: An earlier column takes a name that several have.
COLUMNS = (
    Column("phi1_deg", "phi1 phi_1 φ1 euler1 euler_1 euler_angle_1", DEGREES + RADIANS),
    Column("Phi_deg", "phi φ euler2 euler_2 euler_angle_2", DEGREES + RADIANS),
    Column("phi2_deg", "phi2 phi_2 φ2 euler3 euler_3 euler_angle_3", DEGREES + RADIANS),
    Column("modulus_gpa", "modulus e e* youngs_modulus young_modulus elastic_modulus", ["gpa"]),
    Column("indentation_modulus_gpa", "indentation_modulus plane_strain_modulus m", ["gpa"]),
    Column(
        "effective_modulus_gpa",
        "effective_modulus reduced_modulus er e_r eeff e_eff ereduced e_reduced modulusred",
        ["gpa"],
    ),
    Column(
        "sample_modulus_gpa",
        "sample_modulus es e_s eit e_it modulus_at_max_load modulus_from_unload "
        "modulus_over_defined_range e_over_defined_range",
        ["gpa"],
    ),
    Column("sample_nu", "sample_nu poissons_ratio poisson_ratio nu nu_s ns ν ν_s", ["-"]),
    Column(
        "sd_gpa",
        "sd std stdev st_dev std_dev stddev standard_deviation sigma error err "
        "uncertainty standard_error std_error std_err se sem ±",
        ["gpa"],
    ),
    Column("orientation_sd_deg", "orientation_sd", DEGREES),
    Column("depth_um", "depth", LENGTHS),
    Column("contact_radius_um", "contact_radius", LENGTHS),
    Column("zero_sd_nm", "zero_sd", ["nm"]),
    Column("grain_radius_um", "grain_radius", LENGTHS),
    Column("x_um", "x x_test_position", LENGTHS),
    Column("y_um", "y y_test_position", LENGTHS),
    Column("group"),
    Column("grain", "grain_id grain_number grain_no"),
    Column("test", "test_id test_number"),
    Column("reference"),
    Column("session"),
    Column("time_s", "time", ["s"]),
    Column("row"),
)
BY_NAME = {column.name: column for column in COLUMNS}
#: Words that are units at the end of a name.
UNIT_WORDS = {*DEGREES, *RADIANS, "gpa", "mpa", "kpa", "pa", "um", "nm", "mm", "%", "mn", "un"}
SHARED = re.compile(r"shared_\d+")
#: Names of a standard deviation of single tests. A standard error, an error and an uncertainty are
#: those of the value itself, and so is the canonical `sd_gpa`.
DEVIATIONS = {"sd", "std", "stdev", "st_dev", "std_dev", "stddev", "standard_deviation", "sigma"}
#: Headers of a hardness, such as "H (GPa)".
HARDNESS = re.compile(r"(h|h_?it|.*hardness)\s*([\[(/].*)?", re.I)
#: Fischer's name of the plane strain modulus, depths over which NanoSuite takes means, and Anton
#: Paar's mark of Oliver and Pharr's method.
PLANE_STRAIN = re.compile(r"e_?it ?/ ?\(1 ?- ?[vν]_?s?_?\^?2_?s?\)")
DEPTHS = re.compile(r"\[\d+ ?- ?\d+ ?nm\]")
METHOD = re.compile(r" ?\(o ?& ?p\)")
#: Names that are read with a unit alone.
NEED_UNIT = ("depth", "contact_radius", "grain_radius")
#: Names of columns that a message lists at most.
MOST_NAMES = 30
#: Shorter headers are near to every name.
LEAST_LETTERS = 4


def split_name(header: str) -> tuple[str, str]:
    """Word and unit of a header: 'reduced_modulus' and 'gpa' of 'Reduced modulus (GPa)',
    'reduced-modulus / GPa' or 'reduced_modulus_GPa'.
    """
    word, unit = PLANE_STRAIN.sub("plane_strain_modulus", METHOD.sub("", header.lower())), ""
    word = DEPTHS.sub("over_defined_range", word)
    if found := re.search(r"[(\[/](?!.*[(\[/])", word):
        word, unit = word[: found.start()].rstrip(), word[found.end() :]
        # A word may follow, such as the sd of 'Er (GPa) sd'.
        if end := re.search(r"[)\]]", unit):
            word, unit = word + unit[end.end() :], unit[: end.start()]
        unit = unit.strip()
    word = re.sub("_+", "_", re.sub("[ .-]", "_", word.strip()).replace("'", "", 1)).rstrip("_")
    before, _, last = word.rpartition("_")
    return (before, last) if before and not unit and last in UNIT_WORDS else (word, unit)


def split_deviation(header: str) -> tuple[str, str]:
    """The word of a header of an sd, and the column of the modulus that it names: 'sd' and
    'effective_modulus_gpa' of 'Er sd (GPa)', 'SD Er (GPa)' or 'DEr'.
    """
    word = split_name(header)[0]
    for kind in MODULI:
        for name in BY_NAME[kind].others.split():
            if word in ("der", "deit") and word == f"d{name}":
                return "sd", kind
            if word.startswith(f"{name}_") or word.endswith(f"_{name}"):
                return word.removeprefix(f"{name}_").removesuffix(f"_{name}"), kind
    return word, ""


def meaning_of(header: str) -> str:
    """The canonical name of a header; '' if it is not read."""
    # Without a word for the mean: 'Er (GPa)' of 'Mean Er (GPa)'.
    header = re.sub(r"\b[ _]*(mean|average|avg)[ _]*\b", " ", header, flags=re.I).strip() or header
    lowered, (word, unit) = header.lower(), split_name(header)
    if lowered in DIRECTIONS or SHARED.fullmatch(lowered):
        return lowered
    # The exponent of the unloading is m.
    if word == "m" and header[0] == "m":
        return ""
    for column in COLUMNS:
        named = split_deviation(header)[0] if column.name == "sd_gpa" else word
        if lowered == column.name.lower() or (
            named in column.others.split() and (word not in NEED_UNIT or unit in column.units)
        ):
            return column.name
    return ""


def stated_columns(stated: Iterable[str], names: Sequence[str]) -> dict[str, str]:
    """The canonical name of each header that `&measurements columns` names; each statement is a
    canonical name, = and a header of the table.
    """
    known = {name.lower(): name for name in (*BY_NAME, *sorted(DIRECTIONS))}
    headers = {name.lower(): name for name in reversed(names)} | {name: name for name in names}
    found: dict[str, str] = {}
    for words in stated:
        name, _, header = (part.strip() for part in words.partition("="))
        begin = f"columns: '{words.strip()}': "
        canonical = known.get(name.lower())
        if not name or not header:
            raise InputError(
                f"{begin}a name, = and the header of its column are needed, such as "
                "'modulus_gpa = E (raw)'"
            )
        if not canonical:
            allowed = known.values()
            raise InputError(
                f"{begin}no column {name} is read{near(name, allowed)}; allowed "
                f"{', '.join(allowed)}"
            )
        own = headers.get(header, headers.get(header.lower()))
        if own is None:
            raise InputError(
                f"{begin}the table has no column {header}{near(header, names)}; the columns are "
                f"{listed(names)}"
            )
        if own in found or canonical in found.values():
            raise InputError(f"{begin}the name or the column is there twice; each is allowed once")
        found[own] = canonical
    return found


def listed(names: Sequence[str]) -> str:
    """Names of columns for a message. A file with one may be no table, and is not quoted."""
    if len(names) == 1:
        return "one, without a comma, semicolon or tab"
    return abridged(names, MOST_NAMES)


def abridged(words: Iterable, most: int = 10, mark: str = ", ") -> str:
    """The first words of a list with a `mark` between them; '..' stands for the others."""
    words = list(map(str, words))
    return mark.join(words[:most] + [".."] * (len(words) > most))


def near(written: str, allowed: Iterable[str]) -> str:
    """', did you mean X?' for the allowed name that is nearest to a written one, if it is near."""
    found = get_close_matches(written, [*allowed], 1, 0.7)
    return f", did you mean {found[0]}?" if found else ""


def hint_of(header: str, allowed: Iterable[str] = BY_NAME) -> str:
    """', did you mean X?' for a header that is not read but near to a name that is."""
    is_read = len(header) < LEAST_LETTERS or meaning_of(header)
    return "" if is_read else near(header, allowed)


def nearest_to(names: Sequence[str], headers: Iterable[str]) -> str:
    """'; X: did you mean Y?' for the header that is near to one of the canonical `names` or their
    other names; '' if none is.
    """
    allowed = [*names, *" ".join(BY_NAME[name].others for name in names).split()]
    hints = (f"; {header}:{hint[1:]}" for header in headers if (hint := hint_of(header, allowed)))
    return next(hints, "")
