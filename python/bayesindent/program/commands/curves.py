"""`curves`: Step 0."""

from ...report.formatting import number, numbers
from ..command import namelist_command, report_of
from ..console import show_table

__all__ = ["COMMAND"]


def show(document: dict) -> None:
    """The tip, and the moduli of the grains."""
    radius, compliance = document["tip"]["radius_um"], document["frame"]["compliance_nm_mn"]
    print(f"Tip: radius {' ± '.join(numbers(radius, mean=3, sd=3))} um; frame: {' ± '.join(numbers(compliance, mean=4, sd=4))} nm/mN")
    rows = [
        [row["grain"], str(row["tests"]), number(row["effective_modulus_gpa"], 1), number(row["sd_gpa"], 1), number(row["own_sd_gpa"], 1)]
        for row in document["grains"]
    ]
    show_table("Effective moduli (GPa)", ["grain", "tests", "modulus", "sd", "of it its own"], rows)


COMMAND = namelist_command("curves", show=show, then=report_of)
