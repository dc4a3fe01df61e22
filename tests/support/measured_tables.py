"""Tables of measurements, read as `&measurements` reads them."""

import os
from pathlib import Path

from bayesindent.settings.problem import Points, Problem

__all__ = ["read_measurements"]


def read_measurements(path: str | os.PathLike, symmetry: str, **asked) -> Points:
    """A CSV of orientations and moduli of grains of a `symmetry`, with the variables `asked` of
    &measurements.
    """
    asked = {"file": Path(path).absolute()} | asked
    return Problem.from_keywords(
        os.fspath(path), problem={"symmetry": symmetry}, measurements=asked
    ).measurements
