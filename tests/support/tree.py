"""Where the source tree, its reference values and its build are."""

import os
from pathlib import Path

__all__ = ["BUILD", "REFERENCE", "SOURCE"]

SOURCE = Path(os.environ.get("BAYESINDENT_SOURCE", Path(__file__).parents[2])).absolute()
#: Values that were computed elsewhere, never by this program.
REFERENCE = SOURCE / "tests" / "reference"
#: The folder of the build that is tested. It is None if an installed package is tested.
BUILD = Path(os.environ["BAYESINDENT_BUILD"]) if os.environ.get("BAYESINDENT_BUILD") else None
