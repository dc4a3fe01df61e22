"""The site of the documentation. `./bayesindent dev docs` puts docs/ and tests/ on the path of
Python.
"""

import logging
import warnings
from pathlib import Path

from bayesindent.version import __version__
from gallery_pictures import pictures
from sphinx_gallery.sorting import FileNameSortKey

from tools import house

ROOT = Path(__file__).parents[1]
for library in ("arviz", "fontTools"):
    logging.getLogger(library).setLevel(logging.WARNING)
house.draw(ROOT, ROOT / "docs" / "figures" / "house.svg")

# Warnings of scripts of the gallery would name files of this machine.
warnings.simplefilter("ignore", UserWarning)

project = "bayesindent"
author = "The bayesindent developers"
version = release = __version__
project_copyright = "the bayesindent developers, GPL-3.0-or-later"

extensions = [
    "fortran_sources",
    "myst_parser",
    "sphinx.ext.autodoc",
    "sphinx.ext.napoleon",
    "sphinx_gallery.gen_gallery",
    "warning_list",
]
myst_enable_extensions = ["attrs_inline", "deflist", "dollarmath"]
myst_heading_anchors = 3

autodoc_member_order = "bysource"
autodoc_typehints = "none"

html_theme = "furo"
html_title = f"bayesindent {__version__}"
html_show_sourcelink = False
html_search_scorer = str(ROOT / "docs" / "scorer.js")

# The gallery runs its scripts; -D plot_gallery=0 leaves that out.
exclude_patterns = ["gallery"]
sphinx_gallery_conf = {
    "examples_dirs": str(ROOT / "docs" / "gallery"),
    "gallery_dirs": str(ROOT / "docs" / "examples"),
    "filename_pattern": r"\.py$",
    "within_subsection_order": FileNameSortKey,
    "image_scrapers": (pictures,),
    "capture_repr": (),
    "download_all_examples": False,
    "min_reported_time": 1e9,
    "only_warn_on_example_error": False,
    "show_signature": False,
}
suppress_warnings = ["config.cache"]
