"""Where the tests find the source tree and its reference values."""

import os
from pathlib import Path

SOURCE = Path(os.environ.get("BAYESINDENT_SOURCE", Path(__file__).parents[2]))
REFERENCE = SOURCE / "tests" / "reference"
