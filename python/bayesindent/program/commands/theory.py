"""`theory`: the exact half-space theory of the crystals of a namelist."""

from ..command import namelist_command, report_of
from ..console import show_moduli

__all__ = ["COMMAND"]

COMMAND = namelist_command("theory", show=show_moduli, then=report_of)
