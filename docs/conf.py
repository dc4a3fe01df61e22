"""The site of the documentation. `./bayesindent dev docs` puts docs/ and tests/ on the path of
Python.
"""

from pathlib import Path

from bayesindent.version import __version__

from tools import house

ROOT = Path(__file__).parents[1]
house.draw(ROOT, ROOT / "docs" / "figures" / "house.svg")

project = "bayesindent"
author = "The bayesindent developers"
version = release = __version__
project_copyright = "the bayesindent developers, GPL-3.0-or-later"

extensions = ["fortran_sources", "myst_parser", "sphinx.ext.autodoc", "sphinx.ext.napoleon"]
myst_enable_extensions = ["attrs_inline", "deflist", "dollarmath"]
myst_heading_anchors = 3

autodoc_member_order = "bysource"
autodoc_typehints = "none"

html_theme = "furo"
html_title = f"bayesindent {__version__}"
html_show_sourcelink = False
html_search_scorer = str(ROOT / "docs" / "scorer.js")
