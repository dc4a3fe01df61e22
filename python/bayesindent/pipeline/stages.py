"""Each command as a function of a problem, an output folder and a progress display; it returns the command's JSON document."""

import csv
import json
import logging
import math
from collections.abc import Callable
from pathlib import Path

import numpy as np

from ..common.progress import Progress
from ..core import InputError
from ..crystal.elasticity import halfspace_modulus
from ..inference.extract import plain
from ..pipeline.campaign import Campaign
from ..pipeline.simulator import engine_of, new_indentation, physics_identity, simulate_into, simulator_of
from ..settings.problem import Points, Problem, read_crystals, schema

__all__ = ["asked", "check", "moduli_of_three_kinds", "perform", "predict", "report"]

log = logging.getLogger("bayesindent")

#: The file of a stage's document, where it is not the stage's name.
DOCUMENTS = {"extract": "summary.json"}

Stage = Callable[[Problem, Path, Progress], dict]


def simulate(problem: Problem, output: Path, progress: Progress) -> dict:
    """Finite element indentation of the crystals: moduli.csv, curves.csv, and the document of `simulate`.

    Every simulation is a row of campaign.sqlite as soon as it is done; those that are there are not repeated.
    """
    points = problem.crystals
    rows, new = simulated_rows(problem, output, progress)
    moduli = [np.nan if row.modulus_gpa is None else row.modulus_gpa for row in rows]
    write_moduli(output / "moduli.csv", problem, points, moduli)
    write_curves(output / "curves.csv", rows)
    write_fields(problem, [i for i, row in enumerate(rows) if row.status == "done"], output, progress)
    results = [
        identified(points, i)
        | {"indentation_modulus_gpa": row.modulus_gpa, "elements": row.elements, "seconds": row.seconds}
        | {"depth_um": row.depth_um or [], "force_mn": row.force_mn or []}
        for i, row in enumerate(rows)
    ]
    failures = [f"crystal {i + 1} could not be simulated: {row.message}" for i, row in enumerate(rows) if row.modulus_gpa is None]
    document = {"results": results, "new_simulations": new, "failed": len(failures), "warnings": failures}
    if problem["simulation"]["both_meshes"]:
        mesh = "paper" if problem["simulation"]["mesh"] == "halfspace" else "halfspace"
        rows, new = simulated_rows(problem, output, progress, mesh)
        document["other_mesh"] = {"mesh": mesh, "indentation_modulus_gpa": [row.modulus_gpa for row in rows]}
        document["new_simulations"] += new
    return document


def simulated_rows(problem: Problem, output: Path, progress: Progress, mesh: str = "") -> tuple[list, int]:
    """The campaign's row of each crystal of the file, on `mesh` or the problem's own, and how many were simulated now."""
    points = problem.crystals
    keys = [(points.symmetry[i], tuple(points.constants[i].values()), tuple(points.euler_deg[i])) for i in range(len(points))]
    with Campaign(output / "campaign.sqlite", physics_identity(problem, mesh)) as campaign:
        todo = list(dict.fromkeys(key for key in keys if campaign.find(*key) is None))
        if todo:
            label = f"indentations, {mesh} mesh" if mesh else "indentations"
            with progress.bar(label, len(todo)) as advance:
                simulate_into(campaign, simulator_of(problem, mesh), todo, engine_of(problem), lambda success: advance(1))
        return [campaign.find(*key) for key in keys], len(todo)


def theory(problem: Problem, output: Path, progress: Progress) -> dict:
    """Exact half-space theory of the crystals: theory.csv and the document of `theory`."""
    points = problem.crystals
    moduli = halfspace_modulus(points.stiffness, points.euler_deg)
    write_moduli(output / "theory.csv", problem, points, moduli)
    return {"results": [identified(points, i) | {"indentation_modulus_gpa": modulus} for i, modulus in enumerate(moduli)]}


def build(problem: Problem, output: Path, progress: Progress) -> dict:
    """Step 1: the surrogate."""
    from ..pipeline.build import build as build_surrogate

    return build_surrogate(problem, output, progress)


def extract(problem: Problem, output: Path, progress: Progress) -> dict:
    """Step 2: the posterior of the constants."""
    from ..inference.extract import extract_stage

    return extract_stage(problem, output, progress)


def next_grain(problem: Problem, output: Path, progress: Progress) -> dict:
    """The grains worth measuring next."""
    from ..inference.next_grain import next_stage

    return next_stage(problem, output, progress)


#: The stages, in the order in which `run` makes them.
STAGES: dict[str, Stage] = {"simulate": simulate, "theory": theory, "build": build, "extract": extract, "next": next_grain}


def asked(problem: Problem) -> list[str]:
    """What `run` does with a file, in order: the theory goes with every simulation of crystals."""
    return [stage for name in problem.stages for stage in ((name, "theory") if name == "simulate" else (name,))]


def check(problem: Problem, output: Path) -> None:
    """What the reader cannot see of a file: whether the surrogate is there, which no stage before builds, of the symmetry, and knows the
    crystals of the prior."""
    from ..inference.extract import check_stage

    needed = asked(problem)
    if "build" not in needed and {"extract", "next"} & set(needed):
        check_stage(problem, output)


def perform(command: str, problem: Problem, output: Path, progress: Progress) -> dict:
    """Perform a stage, or all that the file asks for and a report; documents are kept in the output folder for reports."""
    if command == "run":
        documents = {name: perform(name, problem, output, progress) for name in asked(problem)}
        documents["report"] = report(output, output)
        return documents | {"warnings": list(dict.fromkeys(line for document in documents.values() for line in document["warnings"]))}
    log.info("%s begins", command)
    document = STAGES[command](problem, output, progress)
    document["warnings"] = list(document.get("warnings", []))
    text = json.dumps(plain(document), indent=1, allow_nan=False)
    (output / DOCUMENTS.get(command, f"{command}.json")).write_text(text + "\n")
    log.info("%s ends", command)
    return document


def report(folder: Path, output: Path, kind_of_files: str = "") -> dict:
    """The report of what a folder holds."""
    from ..report.report import write_report

    if not folder.is_dir():
        raise InputError(f"{folder}: there is no such folder of results")
    return {"file": str(write_report(folder, output, kind_of_files)), "warnings": []}


def predict(surrogate: str, table: Path, output: Path) -> dict:
    """Mean and sd of the modulus for each row of a table, by a surrogate: predictions.csv and its rows."""
    from ..surrogate.surrogate import Surrogate

    model = Surrogate.load(surrogate)
    points = read_crystals(table, model.symmetry)
    mean, sd = model.predict(points.constants_array(), points.euler_deg)
    header, rows = joined(points, {"modulus_gpa": mean, "sd_gpa": sd})
    output.mkdir(parents=True, exist_ok=True)
    write_csv(output / "predictions.csv", header, rows)
    results = [identified(points, i) | {"modulus_gpa": mean[i], "sd_gpa": sd[i]} for i in range(len(points))]
    outside = np.flatnonzero(model.outside(points.constants_array())) + 1
    listed = ", ".join(map(str, outside[:10])) + (", .." if len(outside) > 10 else "")
    warnings = [f"{table}: {len(outside)} of {len(points)} rows are outside the surrogate's domain: {listed}"] if len(outside) else []
    return {"results": results, "file": str(output / "predictions.csv"), "warnings": warnings}


def identified(points: Points, row: int) -> dict:
    """Constants and orientation of a row."""
    return {"constants": points.constants[row], "euler_deg": points.euler_deg[row].tolist()}


def moduli_of_three_kinds(problem: Problem, modulus: np.ndarray) -> dict[str, np.ndarray]:
    """The indentation modulus M, and what an instrument reports: 1/E_eff = 1/M + (1-nu_i^2)/E_i, and E_s = (1-nu_s^2) M."""
    defaults = {v.name: v.default for v in schema() if v.group == "measurements"}
    settings = problem.get("measurements", {})
    young, nu_indenter, nu_sample = (
        float(settings.get(name, defaults[name])) for name in ("indenter_modulus_gpa", "indenter_nu", "sample_nu")
    )
    return {
        "indentation_modulus_gpa": modulus,
        "effective_modulus_gpa": 1 / (1 / modulus + (1 - nu_indenter**2) / young),
        "sample_modulus_gpa": (1 - nu_sample**2) * modulus,
    }


def write_moduli(file: Path, problem: Problem, points: Points, modulus, further: dict | None = None) -> None:
    """The rows of the points with the three kinds of modulus, and further columns."""
    write_csv(file, *joined(points, moduli_of_three_kinds(problem, np.asarray(modulus, dtype=float)) | (further or {})))


def write_curves(file: Path, rows: list) -> None:
    """Depth and force of every simulation, one point of a curve a line; `point` is the row of the crystal's table, from 1."""
    write_csv(
        file,
        ["point", "depth_um", "force_mn"],
        [
            [number, cell(depth), cell(force)]
            for number, row in enumerate(rows, start=1)
            for depth, force in zip(row.depth_um or [], row.force_mn or [])
        ],
    )


def write_fields(problem: Problem, chosen: list[int], output: Path, progress: Progress) -> None:
    """Of the chosen crystals the files that &simulation asks for, one a crystal by its row from 1: fields for ParaView (vtu), a deck (inp).

    A file that is there is written again: it costs one solution, and the crystal of its row may have changed.
    """
    settings, points = problem["simulation"], problem.crystals
    if settings["simulator"] != "fe" or not (settings["vtu"] or settings["inp"]):
        return
    simulator = new_indentation(problem)
    with progress.bar("fields and decks", len(chosen)) as advance:
        for i in chosen:
            stiffness, euler_deg = points.stiffness[i], points.euler_deg[i]
            stem = output / f"crystal_{i + 1:04d}"
            if settings["vtu"]:
                simulator.write_vtu(stem.with_suffix(".vtu"), stiffness, euler_deg)
            if settings["inp"]:
                title = f"{problem.title or 'spherical indentation'}, crystal {i + 1}"
                stem.with_suffix(".inp").write_text(simulator.deck(stiffness, euler_deg, title))
            advance(1)


def joined(points: Points, columns: dict) -> tuple[list[str], list[list]]:
    """Header and rows of a table as it was written, with columns added or, where it has them, replaced."""
    kept_columns = [i for i, name in enumerate(points.columns) if name not in columns]
    header = [points.columns[i] for i in kept_columns] + list(columns)
    rows = [
        [*(row[i] for i in kept_columns), *(cell(values[number]) for values in columns.values())] for number, row in enumerate(points.rows)
    ]
    return header, rows


def cell(value) -> str:
    """A value as text for a CSV; nothing where there is none."""
    if isinstance(value, float | np.floating):
        return f"{value:.10g}" if math.isfinite(value) else ""
    return str(value)


def write_csv(file: Path, header: list[str], rows: list[list]) -> None:
    """Write a table."""
    with open(file, "w", newline="") as stream:
        writer = csv.writer(stream, lineterminator="\n")
        writer.writerow(header)
        writer.writerows(rows)
