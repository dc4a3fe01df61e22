"""Where a surrogate is that a namelist names, and where a new one may be: as the core says."""

import os
from pathlib import Path

from ..core import InputError, check, native

__all__ = ["SHIPPED", "check_replaceable", "find_surrogate", "places"]

#: The folder of the surrogates that come with the package, and their names.
DATA = Path(os.environ.get("BAYESINDENT_DATA") or Path(__file__).parents[1] / "data")
SHIPPED = tuple(sorted(path.stem for path in DATA.glob("*.txt")))


def places(output, folder) -> tuple[str, str, str, str]:
    """Folders of the results, the namelist and the package's data as the core takes them, and the names of the shipped surrogates."""
    return (*(f"{place}/" if str(place) else "" for place in (output, folder, DATA)), ", ".join(SHIPPED))


def find_surrogate(name: str, output, folder) -> Path | None:
    """The file of a surrogate: in the output folder, beside the namelist, or one that comes with the package; the theory has none."""
    path, status, message = native.surrogate_path(name, *places(output, folder))
    check(status, message)
    return Path(path) if path else None


def check_replaceable(problem, output) -> None:
    """Refuse to build where something is that is not a surrogate."""
    try:
        check(*native.surrogate_check_replaceable(f"{output}/{problem.settings.surrogate.file}"))
    except InputError as error:
        raise InputError(f"{problem.path}: &surrogate file: {error}") from None
