"""The pictures of a gallery script are the PNG files that it writes into the current folder."""

import shutil
from pathlib import Path

from sphinx_gallery.scrapers import figure_rst


def pictures(block: tuple, names: dict, settings: dict) -> str:
    """Move the pictures that a block of a script has written; return their reStructuredText.

    `names` has the iterator of the paths to which they are moved.
    """
    moved = []
    for picture in sorted(Path(names["src_file"]).parent.glob("*.png")):
        moved.append(next(names["image_path_iterator"]))
        shutil.move(picture, moved[-1])
    return figure_rst(moved, settings["src_dir"])
