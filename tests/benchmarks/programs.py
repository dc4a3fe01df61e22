"""Where the batch program is that tests and benchmarks run: in the build that BAYESINDENT_BUILD names, or beside this Python, where pip puts it."""

import os
import sys
from pathlib import Path

BUILD = os.environ.get("BAYESINDENT_BUILD")
BATCH = Path(BUILD, "fortran", "bayesindent-batch") if BUILD else Path(sys.executable).with_name("bayesindent-batch")
