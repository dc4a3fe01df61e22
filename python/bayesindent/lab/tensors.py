"""Stiffnesses as databases and programs write them, in JSON."""

import json
from pathlib import Path
from typing import Any

import numpy as np

from ..core import InputError
from .reading import MOST_BYTES

#: Keys of a stiffness in GPa, the first of them that a document has: those of Materials Project
#: (the tensor in IEEE axes) and of pymatgen's ElasticTensor.
KEYS = ("ieee_format", "elastic_tensor", "input_array", "stiffness")
#: Rows and columns of Voigt's order 11, 22, 33, 23, 13, 12.
FIRST, SECOND = (0, 1, 2, 1, 0, 0), (0, 1, 2, 2, 2, 1)


def matrix_of_json(path: Path) -> str | None:
    """The 6 x 6 matrix of a document as a text; None for another file."""
    if path.suffix.lower() != ".json" or not path.is_file():
        return None
    if path.stat().st_size > MOST_BYTES:
        raise InputError(f"more than {MOST_BYTES} bytes")
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
