"""Where surrogates are looked for: the core finds them."""

import os
from pathlib import Path

__all__ = ["SHIPPED", "places"]

#: The folder of the surrogates that come with the package, and their names.
DATA = Path(os.environ.get("BAYESINDENT_DATA") or Path(__file__).parents[1] / "data")
SHIPPED = tuple(sorted(path.stem for path in DATA.glob("*.txt")))


def places(output: str | os.PathLike, folder: str | os.PathLike) -> dict[str, str]:
    """Folders of the results, the namelist and the package's data, and the names of the shipped surrogates, as the core takes them."""
    folders = {"output": output, "folder": folder, "data_folder": DATA}
    return {name: f"{place}/" if str(place) else "" for name, place in folders.items()} | {"shipped": ", ".join(SHIPPED)}
