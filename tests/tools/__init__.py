"""Commands of a source tree: `./bayesindent NAME` runs `NAME.py`; other modules here serve
these.
"""
