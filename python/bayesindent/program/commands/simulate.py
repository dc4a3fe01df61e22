"""`simulate`: finite element indentation of the crystals of a namelist."""

from pathlib import Path

from ...common.progress import Progress
from ...common.result_files import whole_file, write_text
from ...fe.indentation import Indentation
from ...pipeline.stage import run_stage
from ...settings.problem import Problem
from ..command import namelist_command, report_of
from ..console import show_moduli

__all__ = ["COMMAND"]


def simulate(problem: Problem, output: Path, progress: Progress) -> dict:
    """Moduli.csv, curves.csv, and the document; fields and decks where they are asked for."""
    document = run_stage(problem, "simulate", output, progress)
    write_fields(problem, document["results"], output, progress)
    return document


def write_fields(problem: Problem, results: list[dict], output: Path, progress: Progress) -> None:
    """Of the crystals that were simulated the files that &simulation asks for, one a crystal by its row from 1: fields for ParaView (vtu),
    a deck (inp).

    A file that is there is written again, since the crystal of its row may have changed; fields cost one solution.
    """
    settings, points = problem.settings.simulation, problem.crystals
    chosen = [i for i, row in enumerate(results) if row["depth_um"]]
    if not chosen or not (settings.vtu or settings.inp):
        return
    indentation = Indentation.of_problem(problem)
    with progress.bar("fields and decks", len(chosen)) as advance:
        for i in chosen:
            stiffness, euler_deg = points.stiffness[i], points.euler_deg[i]
            stem = output / f"crystal_{i + 1:04d}"
            if settings.vtu:
                with whole_file(stem.with_suffix(".vtu")) as file:
                    indentation.write_vtu(file, stiffness, euler_deg)
            if settings.inp:
                title = f"{problem.settings.problem.title or 'indentation'}, crystal {i + 1}"
                write_text(stem.with_suffix(".inp"), indentation.deck(stiffness, euler_deg, title))
            advance(1)


COMMAND = namelist_command("simulate", stage=simulate, show=show_moduli, resumes=True, then=report_of)
