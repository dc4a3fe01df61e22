"""`size`: how thick a film or how large a grain must be for its modulus to be that of a half-space."""

from pathlib import Path

from ...common.progress import Progress
from ...common.result_files import whole_file
from ...pipeline.stage import run_stage
from ...settings.problem import Problem
from ..command import namelist_command, report_of
from ..console import show_table

__all__ = ["COMMAND"]


def size(problem: Problem, output: Path, progress: Progress) -> dict:
    """Size.png and the document."""
    # Not above: importing matplotlib is slow, and every command would.
    from ...report.figures.simulations import draw_bias
    from ...report.figures.style import house_style

    document = run_stage(problem, "size", output, progress)
    with house_style(), whole_file(output / "size.png") as file:
        draw_bias(document).savefig(file)
    return document | {"figure": str(output / "size.png")}


def show(document: dict) -> None:
    """The sizes from which on the bias is small."""
    rows = []
    for row in document["results"]:
        crystal = ", ".join(f"{name} {value:g}" for name, value in row["constants"].items())
        around = row["surroundings"] + (f" ({row['young_gpa']:.0f} GPa)" if row["young_gpa"] else "")
        smallest = "–" if row["smallest_um"] is None else f"{row['smallest_um']:.3g}"
        largest = "–" if not row["bias"] else f"{100 * row['bias'][0]:+.1f} % at {row['size_um'][0]:.3g}"
        rows.append([crystal, ", ".join(f"{angle:g}" for angle in row["euler_deg"]), around, largest, smallest])
    quantity = document["variable"].removesuffix("_um").replace("_", " ")
    header = ["constants (GPa)", "phi1, Phi, phi2", "surroundings", "bias", f"below {100 * document['limit']:g} % from (um)"]
    show_table(f"Smallest {quantity} (contact radius {document['contact_radius_um']:g} um)", header, rows)
    print(document["figure"])


COMMAND = namelist_command("size", stage=size, show=show, then=report_of)
