"""`python -m bayesindent` is the command-line program."""

import sys

from .program.cli import main

sys.exit(main())
