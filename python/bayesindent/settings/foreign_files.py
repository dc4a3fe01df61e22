"""Files that only other packages read: these may be missing, and so may the files."""

import sys
from importlib import import_module
from pathlib import Path
from types import ModuleType

from ..core import InputError

__all__ = ["reader_of"]


def reader_of(place: str, path: Path, kind: str, module: str, otherwise: str = "") -> ModuleType:
    """The `module` of another package that reads a file of this `kind`, which is there. `place` begins the message of a refusal; `otherwise`:
    what else can be done than to install the package."""
    package = module.partition(".")[0]
    try:
        import_module(package)
        found = import_module(module)
    except ImportError:
        raise InputError(
            f"{place}reading {kind} needs {package}, which is not installed: {sys.executable} -m pip install {package}{otherwise}"
        ) from None
    if not path.is_file():
        raise InputError(f"{place}the file does not exist")
    return found
