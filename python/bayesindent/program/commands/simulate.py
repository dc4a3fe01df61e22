"""`simulate`: finite element indentation of the crystals of a namelist."""

from pathlib import Path

from ...common.progress import Progress
from ...common.result_files import cell, whole_file, write_csv, write_text
from ...core import BayesindentError
from ...fe.indentation import Indentation, moduli_by_depth
from ...pipeline.campaign import Campaign
from ...pipeline.moduli import identified, write_moduli
from ...pipeline.simulator import Simulator, engine_of, resolution_warnings, simulate_into
from ..command import namelist_command, report_of
from ..console import show_moduli

__all__ = ["COMMAND", "simulate"]


def simulate(problem, output: Path, progress: Progress) -> dict:
    """Moduli.csv, curves.csv, and the document.

    Every simulation is a row of campaign.sqlite as soon as it is done; those that are there are not repeated.
    """
    points = problem.crystals
    rows, new = simulated_rows(problem, output, progress)
    write_moduli(output / "moduli.csv", problem, points, [row.modulus_gpa for row in rows])
    results = [
        identified(points, i)
        | {"indentation_modulus_gpa": row.modulus_gpa, "elements": row.elements, "seconds": row.seconds}
        | {"depth_um": row.depth_um or [], "force_mn": row.force_mn or []}
        | {"modulus_by_depth_gpa": moduli_by_depth(problem, row.depth_um, row.force_mn) if row.depth_um else []}
        for i, row in enumerate(rows)
    ]
    curves = ("depth_um", "force_mn", "modulus_by_depth_gpa")
    write_csv(
        output / "curves.csv",
        ["point", "depth_um", "force_mn", "modulus_gpa"],
        [[number, *map(cell, point)] for number, result in enumerate(results, 1) for point in zip(*(result[name] for name in curves))],
    )
    write_fields(problem, rows, output, progress)
    failures = [f"crystal {i + 1} could not be simulated: {row.message}" for i, row in enumerate(rows) if row.modulus_gpa is None]
    if rows and len(failures) == len(rows):
        raise BayesindentError(f"every simulation failed: {failures[0]}")
    warnings = failures + resolution_warnings(problem, points.stiffness)
    return {"results": results, "new_simulations": new, "failed": len(failures), "warnings": warnings}


def simulated_rows(problem, output: Path, progress: Progress) -> tuple[list, int]:
    """The campaign's row of each crystal of the file, and how many were simulated now."""
    points = problem.crystals
    keys = [(points.symmetry[i], tuple(points.constants[i].values()), tuple(points.euler_deg[i])) for i in range(len(points))]
    with Campaign(output / "campaign.sqlite", problem.physics) as campaign:
        todo = list(dict.fromkeys(key for key in keys if campaign.find(*key) is None))
        if todo:
            with progress.bar("indentations", len(todo)) as advance, engine_of(problem) as engine:
                simulate_into(campaign, Simulator(problem), todo, engine, lambda success: advance(1))
        return [campaign.find(*key) for key in keys], len(todo)


def write_fields(problem, rows: list, output: Path, progress: Progress) -> None:
    """Of the crystals that were simulated the files that &simulation asks for, one a crystal by its row from 1: fields for ParaView (vtu),
    a deck (inp).

    A file that is there is written again, since the crystal of its row may have changed; fields cost one solution.
    """
    settings, points = problem.settings.simulation, problem.crystals
    chosen = [i for i, row in enumerate(rows) if row.depth_um]
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
                write_text(stem.with_suffix(".inp"), indentation.deck(stiffness, euler_deg, title, rows[i].depth_um))
            advance(1)


COMMAND = namelist_command("simulate", stage=simulate, show=show_moduli, resumes=True, then=report_of)
