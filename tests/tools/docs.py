"""The documentation as a site in build-docs/, from docs/ and the comments of the sources; any warning is a failure."""

import argparse
import subprocess
import sys
from pathlib import Path

ROOT = Path(__file__).parents[2]
SITE = ROOT / "build-docs"


def main(argv=None) -> int:
    """Build the site; an exit status."""
    argparse.ArgumentParser(prog="bayesindent docs", description=__doc__).parse_args(argv)
    command = [sys.executable, "-m", "sphinx", "--fail-on-warning", "--keep-going", "--quiet", "--builder", "html"]
    done = subprocess.run([*command, str(ROOT / "docs"), str(SITE)])
    if done.returncode == 0:
        print(SITE / "index.html", flush=True)
    return done.returncode
