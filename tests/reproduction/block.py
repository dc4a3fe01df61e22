"""Simulations of the paper's block beside those of converged meshes and the half-space: zinc of its
Fig. 5, other crystals, and independent crystals on which arms are judged.
"""

import csv
import time
from pathlib import Path

import f90nml
import numpy as np

from bayesindent.common.progress import progress_bar
from bayesindent.crystal.elasticity import constant_names, halfspace_modulus, stiffness
from bayesindent.fe.indentation import Indentation
from bayesindent.stages.stage import run_stage
from reproduction.published import ZINC
from reproduction.studies import Pool, independent_crystals, kept, problem_of

__all__ = ["MESHES", "judges_by_simulation", "meshes", "zinc"]

#: Settings of &simulation by the name of the mesh: the paper's, a finer one, and better elements.
MESHES = {
    "C3D8, default": {"element": "c3d8"},
    "C3D8, 1.5 times as fine": {"element": "c3d8", "refine": 1.5},
    "C3D8I, default": {"element": "c3d8i"},
    "C3D8I, 1.5 times as fine": {"element": "c3d8i", "refine": 1.5},
}

#: Declinations of zinc, degrees, and those whose curves are drawn.
ANGLES, DRAWN = tuple(range(0, 91, 10)), (0, 40, 90)

#: Crystals by name: class, constants in GPa, angles in degrees. The triclinic one is a rotated
#: albite-like matrix of log-anisotropy 0.9.
CRYSTALS = {
    "isotropic, E/(1-nu²) = 168 GPa": ("isotropic", (200.0, 80.0), (0, 0, 0)),
    "titanium, 90°": ("hexagonal", (162.0, 92.0, 47.0, 180.0, 69.0), (0, 90, 0)),
    "zinc, 0°": ("hexagonal", ZINC["constants"], (0, 0, 0)),
    "copper, general": ("cubic", (168.4, 121.4, 75.4), (10, 40, 30)),
    "albite, general": (
        "triclinic",
        (
            69.9,
            34.0,
            30.8,
            5.1,
            -2.4,
            -0.9,
            183.5,
            5.5,
            -3.9,
            -7.7,
            -5.8,
            179.5,
            -8.7,
            7.1,
            -9.8,
            24.9,
            -2.4,
            -7.2,
            26.8,
            0.5,
            33.5,
        ),
        (20, 50, 70),
    ),
}


def moduli(mesh: dict, crystals: list[tuple[np.ndarray, tuple]]) -> dict:
    """Indentation moduli of crystals on the paper's block with a mesh, its elements, the curves,
    and the CPU time of one crystal in seconds.
    """
    start = time.process_time()
    model, found = Indentation(geometry="block", **mesh), []
    with progress_bar("simulations", len(crystals)) as advance:
        for matrix, angles in crystals:
            found.append(model.run(matrix, angles))
            advance(1)
    return {
        "modulus": [result.indentation_modulus_gpa for result in found],
        "elements": found[0].elements,
        "depth_um": [result.depth_um for result in found],
        "force_mn": [result.force_mn for result in found],
        "cpu_s": (time.process_time() - start) / len(crystals),
    }


def zinc(folder: Path, quick: bool) -> dict:
    """Fig. 5: zinc by declination on the paper's block and on the same block converged, by
    Vlassak and Nix and by the exact theory; kept.
    """
    angles = ANGLES[::3] if quick else ANGLES
    matrix = stiffness("hexagonal", *ZINC["constants"])
    crystals = [(matrix, (0.0, angle, 0.0)) for angle in angles]
    found = {"angles": list(angles)}
    for name in ("C3D8, default", "C3D8I, default"):
        found[name] = kept(
            folder / f"zinc {name}.json",
            list(angles),
            lambda name=name: moduli(MESHES[name], crystals),
        )
    rows = np.array([(0.0, angle, 0.0) for angle in angles])
    found["Vlassak-Nix"] = halfspace_modulus(matrix, rows, circular=True).tolist()
    found["exact"] = halfspace_modulus(matrix, rows).tolist()
    return found


def meshes(folder: Path, quick: bool) -> dict[str, dict]:
    """Moduli of crystals by mesh, and by the exact theory of the half-space; kept."""
    crystals = [
        (stiffness(symmetry, *constants), angles)
        for symmetry, constants, angles in CRYSTALS.values()
    ]
    names = [name for name in MESHES if not quick or "fine" not in name]
    found = {
        name: kept(
            folder / f"mesh {name}.json",
            CRYSTALS,
            lambda name=name: moduli(MESHES[name], crystals),
        )
        for name in names
    }
    theory = [float(halfspace_modulus(*crystal)) for crystal in crystals]
    return found | {"half-space": {"modulus": theory, "elements": None}}


def judges_by_simulation(symmetry: str, folder: Path, count: int, workers: int) -> Pool:
    """Independent crystals of the paper's domain with moduli by simulation of its block."""
    constants, angles = independent_crystals(symmetry, count, 30190)
    folder.mkdir(parents=True, exist_ok=True)
    with (folder / "crystals.csv").open("w", newline="") as file:
        rows = csv.writer(file)
        rows.writerow([*constant_names(symmetry), "phi1_deg", "Phi_deg", "phi2_deg"])
        rows.writerows(np.column_stack([constants, angles]).tolist())
    namelist = f90nml.Namelist(
        {
            "problem": {"symmetry": symmetry},
            "specimen": {"geometry": "block"},
            "crystals": {"points": "crystals.csv"},
            "execution": {"workers": workers},
        }
    )
    document = kept(
        folder / "kept.json",
        [symmetry, count],
        lambda: run_stage(problem_of(namelist, folder, "simulate"), "simulate", folder),
    )
    modulus = np.array([row["indentation_modulus_gpa"] for row in document["results"]], float)
    # No modulus is given where the stated error of the mesh is above 5 %.
    stated = np.isfinite(modulus)
    return Pool(symmetry, constants[stated], angles[stated], modulus[stated])
