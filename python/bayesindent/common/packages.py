"""Packages that some inputs need, and how they are installed."""

import os
import sys

#: The extra of each package, see pyproject.toml.
EXTRAS = {
    "dask_jobqueue": "dask",
    "distributed": "dask",
    "micromechanics": "curves",
    "nanodent": "curves",
    "openpyxl": "xlsx",
    "orix": "ebsd",
}


def installation(package: str) -> str:
    """The command that installs a package: of the launcher, which names its source tree, or pip."""
    if package in EXTRAS and "BAYESINDENT_SOURCE" in os.environ:
        return f"./bayesindent setup --with {EXTRAS[package]}"
    return f"{sys.executable} -m pip install {package}"
