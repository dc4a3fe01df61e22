"""Stiffnesses as databases and programs write them: a matrix of numbers, or JSON."""

import json
import re
from pathlib import Path
from typing import Any

import numpy as np

from ..core import InputError
from ..crystal.elasticity import constant_names, stiffness_rows, stiffness_table
from .other_files import decoded
from .reading import MOST_BYTES

#: Keys of a stiffness in GPa, the first of them that a document has: those of Materials Project
#: (the tensor in IEEE axes) and of pymatgen's ElasticTensor.
KEYS = ("ieee_format", "elastic_tensor", "input_array", "stiffness")
#: Rows and columns of Voigt's order 11, 22, 33, 23, 13, 12.
FIRST, SECOND = (0, 1, 2, 1, 0, 0), (0, 1, 2, 2, 2, 1)
#: Numbers are between blanks, commas, bars and brackets.
words_of = re.compile(r"[^\s,\[\]()|]+").findall
#: Share of the largest entry by which an entry may differ from its value by symmetry.
TOLERANCE = 0.01
#: Share of the largest constant at which smaller ones have the same sd: they may be 0.
LEAST_SHARE = 0.05


def known_stiffness(path: Path, symmetry: str | None, relative_sd: float | None) -> dict[str, list]:
    """The table of a matrix: 6 x 6 numbers, 21 of a triangle, or a document. The constants have one
    relative sd, the least ones a larger one; of entries that are equal by symmetry those of the
    constants count.
    """
    if not (symmetry and relative_sd):
        raise InputError("a matrix needs stiffness_relative_sd, and &problem symmetry")
    if path.stat().st_size > MOST_BYTES:
        raise InputError(f"more than {MOST_BYTES} bytes")
    text = matrix_of_json(path) or re.sub("#.*", "", decoded(path.read_bytes())[0])
    text = "\n".join(filter(str.strip, text.splitlines()))
    words = words_of(text)
    try:
        entries = np.array(words, dtype=float)
        if len(entries) == 36:
            values = entries.reshape(6, 6)
        else:
            values = np.zeros((6, 6))
            # The first two lines of a lower triangle have three numbers.
            lower = len(words_of("\n".join(text.split("\n")[:2]))) == 3
            values[np.tril_indices(6) if lower else np.triu_indices(6)] = entries
            values = np.where(values, values, values.T)
    except ValueError:
        raise InputError(
            f"{len(words)} numbers or words; a matrix has 36 numbers, or 21 in a triangle; for a "
            "table leave stiffness_relative_sd out"
        ) from None
    names = constant_names(symmetry)
    mean = np.array([values[int(name[1]) - 1, int(name[2]) - 1] for name in names])
    implied = stiffness_rows(symmetry, mean)
    last_digit = 10.0 ** -max(len(word.partition(".")[2]) for word in words)
    most = TOLERANCE * np.abs(implied).max() + last_digit
    for i, j in np.argwhere(~(np.abs(values - implied) <= most)):
        raise InputError(
            f"C{i + 1}{j + 1} is {values[i, j]:.6g} GPa; by the symmetry of a {symmetry} crystal "
            f"it is {implied[i, j]:.6g} GPa"
        )
    sd = relative_sd * np.maximum(np.abs(mean), LEAST_SHARE * np.abs(mean).max())
    return stiffness_table(symmetry, mean, np.diag(sd**2))


def matrix_of_json(path: Path) -> str | None:
    """The 6 x 6 matrix of a document as a text; None for another file."""
    if path.suffix.lower() != ".json":
        return None
    try:
        values = np.array(stiffness_in(json.loads(path.read_text(encoding="utf-8"))), dtype=float)
    except (ValueError, TypeError, RecursionError):
        raise InputError("is no document with a stiffness of numbers") from None
    if values.shape == (3, 3, 3, 3):
        values = values[FIRST, SECOND][:, FIRST, SECOND]
    if values.shape != (6, 6):
        raise InputError(
            f"no stiffness is in it; allowed the keys {', '.join(KEYS)}, with 6 x 6 or 3 x 3 x 3 x "
            "3 numbers in GPa"
        )
    return "\n".join(" ".join(map(repr, row)) for row in values.tolist())


def stiffness_in(document: Any) -> Any:
    """The numbers under the first key that is there, at any depth; [] if none is."""
    if isinstance(document, list) and document and isinstance(document[0], dict):
        document = document[0]
    if not isinstance(document, dict):
        return document
    inner = [document[key] for key in KEYS if key in document]
    inner += [value for value in document.values() if isinstance(value, dict)]
    return next(filter(len, map(stiffness_in, inner)), [])
