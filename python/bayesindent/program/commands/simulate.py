"""`simulate`: finite element indentation of the crystals of a namelist."""

from pathlib import Path

from ...common.progress import Progress
from ...common.result_files import cell, whole_file, write_csv, write_text
from ...core import BayesindentError
from ...fe.indentation import Indentation
from ...pipeline.campaign import Campaign
from ...pipeline.moduli import identified, write_moduli
from ...pipeline.simulator import Simulator, engine_of, other_mesh, physics_identity, resolution_warnings, simulate_into
from ..command import namelist_command
from ..console import show_moduli

__all__ = ["COMMAND", "simulate"]


def simulate(problem, output: Path, progress: Progress) -> dict:
    """Moduli.csv, curves.csv, and the document.

    Every simulation is a row of campaign.sqlite as soon as it is done; those that are there are not repeated.
    """
    points = problem.crystals
    rows, new = simulated_rows(problem, output, progress)
    write_moduli(output / "moduli.csv", problem, points, [row.modulus_gpa for row in rows])
    curves = [(number, row) for number, row in enumerate(rows, start=1) if row.depth_um]
    write_csv(
        output / "curves.csv",
        ["point", "depth_um", "force_mn"],
        [[number, cell(depth), cell(force)] for number, row in curves for depth, force in zip(row.depth_um, row.force_mn)],
    )
    write_fields(problem, rows, output, progress)
    results = [
        identified(points, i)
        | {"indentation_modulus_gpa": row.modulus_gpa, "elements": row.elements, "seconds": row.seconds}
        | {"depth_um": row.depth_um or [], "force_mn": row.force_mn or []}
        for i, row in enumerate(rows)
    ]
    failures = [f"crystal {i + 1} could not be simulated: {row.message}" for i, row in enumerate(rows) if row.modulus_gpa is None]
    if rows and len(failures) == len(rows):
        raise BayesindentError(f"every simulation failed: {failures[0]}")
    warnings = failures + resolution_warnings(problem, points.stiffness)
    document: dict = {"results": results, "new_simulations": new, "failed": len(failures), "warnings": warnings}
    if problem.settings.simulation.both_meshes:
        mesh = other_mesh(problem)
        rows, new = simulated_rows(problem, output, progress, mesh)
        document["other_mesh"] = {"mesh": mesh, "indentation_modulus_gpa": [row.modulus_gpa for row in rows]}
        document["new_simulations"] += new
    return document


def simulated_rows(problem, output: Path, progress: Progress, mesh: str = "") -> tuple[list, int]:
    """The campaign's row of each crystal of the file, on `mesh` or the problem's own, and how many were simulated now."""
    points = problem.crystals
    keys = [(points.symmetry[i], tuple(points.constants[i].values()), tuple(points.euler_deg[i])) for i in range(len(points))]
    with Campaign(output / "campaign.sqlite", physics_identity(problem, mesh)) as campaign:
        todo = list(dict.fromkeys(key for key in keys if campaign.find(*key) is None))
        if todo:
            with progress.bar(f"indentations, {mesh} mesh" if mesh else "indentations", len(todo)) as advance:
                simulate_into(campaign, Simulator(problem, mesh), todo, engine_of(problem), lambda success: advance(1))
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
                title = f"{problem.settings.problem.title or 'spherical indentation'}, crystal {i + 1}"
                write_text(stem.with_suffix(".inp"), indentation.deck(stiffness, euler_deg, title, rows[i].depth_um))
            advance(1)


COMMAND = namelist_command("simulate", stage=simulate, show=show_moduli)
