"""`extract`: Step 2."""

from ...pipeline.step_2 import extract_stage
from ...report.words import number
from ..command import namelist_command
from ..console import show_table

__all__ = ["COMMAND"]


def show(document: dict) -> None:
    """The constants."""
    rows = []
    for name, item in document["parameters"].items():
        low, high = item["hdi_95"]
        values = [number(item["mean"]), number(item["sd"]), number(item["map"]), f"{low:.1f} .. {high:.1f}"]
        rows.append([name, *values, number(item["r_hat"], 3), number(item["ess_bulk"], 0), number(item["ess_tail"], 0)])
    header = ["constant", "mean", "sd", "most probable", "95 %", "R-hat", "ESS bulk", "ESS tail"]
    show_table("Elastic constants (GPa)", header, rows)


COMMAND = namelist_command("extract", stage=extract_stage, show=show)
