"""How thick a film, or how large a grain, must be for its modulus to be that of a half-space."""

from concurrent.futures import ThreadPoolExecutor
from itertools import pairwise

import numpy as np

from ..common.progress import Progress
from ..core import BayesindentError, InputError
from ..crystal.elasticity import polycrystal_averages
from ..fe.indentation import NOT_OURS, Indentation
from ..pipeline.engines import LocalEngine
from ..pipeline.moduli import identified

__all__ = ["LIMIT", "specimen_size"]

#: The bias of the modulus that is small enough.
LIMIT = 0.01

#: For each geometry the variable that is varied, in contact radii, and how the surroundings are called.
SIZES = {
    "film": ("thickness_um", (1.0, 2.0, 4.0, 8.0, 16.0, 32.0, 64.0), "substrate"),
    "grain": ("grain_radius_um", (3.0, 5.0, 8.0, 13.0, 20.0, 40.0, 80.0), "matrix"),
}

#: The surroundings that are compared, Young's modulus over what the file says.
FACTORS = {"softer": 0.5, "as stated": 1.0, "stiffer": 2.0}


def specimen_size(problem, progress: Progress) -> dict:
    """The bias of the modulus of each crystal of &crystals against the half-space, by the size of the specimen, in its surroundings and in
    softer and stiffer ones; and from what size on it is below `LIMIT`."""
    geometry = problem.settings.specimen.geometry
    if geometry not in SIZES:
        raise InputError(f"{problem.path}: &specimen geometry: a '{geometry}' has no neighbours; allowed: {', '.join(SIZES)}")
    variable, multiples, around = SIZES[geometry]
    stated = {
        name: value
        for group in (problem.settings.specimen, problem.settings.indenter, problem.settings.simulation)
        for name, value in vars(group).items()
        if name not in ("given", "geometry", "grain_depth_um", variable, *NOT_OURS) and value is not None
    }
    half_space = Indentation(geometry="halfspace", **stated)
    # A cylinder keeps its proportions.
    depth, radius = problem.settings.specimen.grain_depth_um, problem.settings.specimen.grain_radius_um
    further = {"grain_depth_um": depth / radius} if geometry == "grain" and depth else {}
    contact_radius = half_space.contact_radius_max_um
    points = problem.crystals
    cases = [(i, name, settings) for i in range(len(points)) for name, settings in surroundings(stated, around, points.stiffness[i])]
    jobs: list[tuple] = [("half-space", i) for i in range(len(points))]
    jobs += [(case, multiple) for case in range(len(cases)) for multiple in multiples]

    def modulus(job) -> float | None:
        what, value = job
        indentation, i = half_space, value
        if what != "half-space":
            i, _, settings = cases[what]
            sizes = {name: share * value * contact_radius for name, share in ({variable: 1.0} | further).items()}
            indentation = Indentation(**stated | settings | {"geometry": geometry} | sizes)
        try:
            return indentation.run(points.stiffness[i], points.euler_deg[i]).indentation_modulus_gpa
        except InputError:
            raise
        except BayesindentError:
            return None
        finally:
            advance(1)

    with (
        progress.bar("indentations", len(jobs)) as advance,
        ThreadPoolExecutor(LocalEngine(problem.settings.execution.workers).workers) as pool,
    ):
        moduli = dict(zip(jobs, pool.map(modulus, jobs), strict=True))
    results = []
    for number, (i, name, settings) in enumerate(cases):
        ideal = moduli["half-space", i]
        found = [(multiple * contact_radius, moduli[number, multiple]) for multiple in multiples]
        biases = [(size, value / ideal - 1) for size, value in found if ideal is not None and value is not None]
        results.append(
            identified(points, i)
            | {"surroundings": name, "young_gpa": settings.get(f"{around}_young_gpa"), "halfspace_gpa": ideal}
            | {"size_um": [size for size, _ in biases], "bias": [bias for _, bias in biases], "smallest_um": smallest_size(biases)}
        )
    return {"variable": variable, "contact_radius_um": contact_radius, "limit": LIMIT, "results": results}


def surroundings(stated: dict, around: str, stiffness) -> list[tuple[str, dict]]:
    """The name and the settings of what may be around the crystal."""
    if stated[around] == "rigid":
        return [("rigid", {})]
    of_itself = stated[around] == "self"
    if of_itself:
        averages = polycrystal_averages(stiffness)
        bulk, shear = (0.5 * (averages[f"{name}_voigt"] + averages[f"{name}_reuss"]) for name in ("bulk", "shear"))
        young, nu = float(9 * bulk * shear / (3 * bulk + shear)), float((3 * bulk - 2 * shear) / (6 * bulk + 2 * shear))
    else:
        young, nu = stated[f"{around}_young_gpa"], stated[f"{around}_nu"]
    return [
        (name, {} if of_itself and factor == 1 else {around: "isotropic", f"{around}_young_gpa": factor * young, f"{around}_nu": nu})
        for name, factor in FACTORS.items()
    ]


def smallest_size(biases: list[tuple[float, float]]) -> float | None:
    """From where on the bias stays within the limit (um): on a power law between the last size that is beyond and the next, else the least
    size; beyond the largest the bias falls with the size. None where nothing was simulated."""
    if not biases:
        return None
    if abs(biases[-1][1]) > LIMIT:
        return biases[-1][0] * abs(biases[-1][1]) / LIMIT
    for (small, large_bias), (large, small_bias) in reversed(list(pairwise(biases))):
        if abs(large_bias) > LIMIT:
            share = np.log(abs(large_bias) / LIMIT) / np.log(abs(large_bias) / max(abs(small_bias), 1e-9))
            return float(small * (large / small) ** share)
    return biases[0][0]
