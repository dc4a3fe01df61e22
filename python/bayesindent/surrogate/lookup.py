"""Where a surrogate is that a namelist names."""

from importlib import resources
from pathlib import Path

__all__ = ["find_surrogate"]


def find_surrogate(name: str, *folders: Path) -> Path | None:
    """The file of a surrogate: the first of these folders that has it, or among those that come with the package."""
    places = [Path(folder) / name for folder in folders]
    places.append(Path(str(resources.files("bayesindent") / "data" / f"{name}.nc")))
    return next((place for place in places if place.is_file()), None)
