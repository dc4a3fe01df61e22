"""The documentation as a site in build-docs/, from docs/ and the comments of the sources; any
warning is a failure. The scripts of the gallery are run, unless `--no-gallery` is stated.
"""

import argparse
import os
import subprocess
import sys
from pathlib import Path

ROOT = Path(__file__).parents[2]
SITE = ROOT / "build-docs"


def main(argv=None) -> int:
    """Build the site; return an exit status."""
    parser = argparse.ArgumentParser(prog="bayesindent dev docs", description=__doc__)
    parser.add_argument("--no-gallery", action="store_true", help="run no script of the gallery")
    done = build(SITE, not parser.parse_args(argv).no_gallery)
    if done.returncode == 0:
        print(SITE / "index.html", flush=True)
    return done.returncode


def build(folder: Path, gallery: bool, **options) -> subprocess.CompletedProcess:
    """Run Sphinx, and with it the scripts of the `gallery`; docs/conf.py imports from docs/ and
    tests/.
    """
    command = [sys.executable, "-m", "sphinx", "--fail-on-warning", "--keep-going", "--quiet"]
    command.append(f"--define=plot_gallery={int(gallery)}")
    paths = [str(ROOT / "docs"), str(ROOT / "tests"), os.environ.get("PYTHONPATH", "")]
    environment = os.environ | {"PYTHONPATH": os.pathsep.join(filter(None, paths))}
    return subprocess.run([*command, ROOT / "docs", folder], env=environment, **options)


if __name__ == "__main__":
    sys.exit(main())
