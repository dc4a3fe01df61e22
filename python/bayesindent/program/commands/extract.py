"""`extract`: Step 2."""

from pathlib import Path

from ...common.progress import Progress
from ..command import Command
from ..console import show_table

__all__ = ["COMMAND"]


def extract(problem, output: Path, progress: Progress) -> dict:
    """The posterior of the constants."""
    from ...inference.extract import extract_stage

    return extract_stage(problem, output, progress)


def show(document: dict) -> None:
    """The constants."""
    rows = []
    for name, item in document["parameters"].items():
        low, high = item["hdi_95"]
        r_hat = "–" if item["r_hat"] is None else f"{item['r_hat']:.3f}"
        quality = [r_hat, f"{item['ess_bulk']:.0f}", f"{item['ess_tail']:.0f}"]
        rows.append([name, f"{item['mean']:.1f}", f"{item['sd']:.1f}", f"{item['map']:.1f}", f"{low:.1f} .. {high:.1f}", *quality])
    header = ["constant", "mean", "sd", "most probable", "95 %", "R-hat", "ESS bulk", "ESS tail"]
    show_table("Elastic constants (GPa)", header, rows)


COMMAND = Command(
    "extract",
    "step 2: the constants behind measured moduli",
    """Writes posterior.nc and summary.json, and says what the data decided and what the prior did. Needs no simulation: a shipped
    surrogate ('cubic', 'hexagonal') or one made by build serves.""",
    groups=("problem", "surrogate", "measurements", "prior", "sampler"),
    stage=extract,
    show=show,
    file="summary.json",
)
