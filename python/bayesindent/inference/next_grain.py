"""Which grain to measure next: what one more modulus, over all orientations, is expected to add to a posterior."""

import os
import re
from collections.abc import Mapping
from contextlib import nullcontext
from pathlib import Path

import numpy as np

from ..core import InputError, check, native
from ..crystal.directions import direction_lattice, euler_of
from ..inference.extract import Posterior, extract, fingerprint, measurements_of, quantities, quantity_names, settings_of, surrogate_of

__all__ = ["next_grain", "next_stage", "target_values"]

#: Draws of the posterior, and scenarios of what earlier suggestions will say, behind the expected gains.
DRAWS, SCENARIOS = 2000, 48

#: Suggestions are at least so far apart: the same grain cannot be measured again, and a near twin is hard to find.
SEPARATION_DEG = 5.0


def target_values(symmetry: str, target: str, constants) -> np.ndarray:
    """A quantity ('C44', 'bulk_modulus', ..), or the logarithm of a product of powers of quantities ('C11^1 C12^-0.3', 'C33/C11'), of
    crystals (n, k)."""
    values = quantities(symmetry, constants)
    if target in values:
        return values[target]
    total = 0.0
    for factor in re.sub(r"/(\w+)", r" \1^-1", target).split():
        name, _, power = factor.partition("^")
        try:
            total = total + float(power or 1) * np.log(values[name])
        except (KeyError, ValueError):
            raise InputError(
                f"target: '{target}' is unknown; allowed: all, a product of powers such as 'C33/C11' or 'C11^1 C12^-0.3', or one of "
                f"{', '.join(quantity_names(symmetry))}"
            ) from None
    return np.asarray(total)


def suggest(posterior: Posterior, draws, *, sd_gpa: float, target: str, count: int, seed: int, threads: int) -> dict:
    """The ranked suggestions, and the gain of every candidate as the first of them, from draws (n, dimension)."""
    if not sd_gpa > 0:
        raise InputError(f"sd_gpa = {sd_gpa:g} of the next measurement must be positive")
    if count < 1:
        raise InputError(f"count = {count} must be at least 1")
    directions = direction_lattice(posterior.symmetry)
    angles = euler_of(directions)
    few = draws[:: max(1, len(draws) // DRAWS)]
    moduli, factor = posterior.moduli(few, angles, seed)
    predicted = posterior.as_measured(moduli) * factor[:, None]
    use_target = target != "all"
    values = target_values(posterior.symmetry, target, few[:, : len(posterior.names)]) if use_target else np.zeros(len(few))
    chosen, gains, first, status, message = native.next_choice(
        min(count, len(directions)), np.asfortranarray(predicted), np.asfortranarray(directions.T), sd_gpa, int(use_target), values,
        np.radians(SEPARATION_DEG), posterior.symmetry, SCENARIOS, seed, threads,
    )  # fmt: skip
    check(status, message)
    found = chosen > 0
    spread = predicted.std(axis=0)
    suggestions = [
        {
            "euler_deg": angles[c - 1].tolist(),
            "gain": float(gain),
            "predicted": float(predicted[:, c - 1].mean()),
            "sd": float(spread[c - 1]),
        }
        for c, gain in zip(chosen[found], gains[found], strict=True)
    ]
    candidates = [{"euler_deg": angle.tolist(), "gain": float(gain)} for angle, gain in zip(angles, first, strict=True)]
    unit = "nats" if target == "all" else "share of the variance"
    return {"suggestions": suggestions, "candidates": candidates, "target": target, "sd_gpa": float(sd_gpa), "unit": unit}


def next_grain(surrogate, measurements, *, sd_gpa: float = 0.0, target: str = "all", count: int = 5, result=None, **settings) -> dict:
    """Orientations worth measuring next, ranked, each given those above it.

    `target`: 'all' (gain: information on all constants in nats), or what `target_values` takes (gain: the share of its variance that is
    expected to go). `sd_gpa`: of the next measurement; 0: the median of those made. `settings` are those of `extract`, whose `result`
    may be given.
    """
    if not hasattr(surrogate, "handle"):
        from ..surrogate.surrogate import Surrogate

        surrogate = Surrogate.load(surrogate)
    if result is None:
        result = extract(surrogate, measurements, **settings)
    density = {key: value for key, value in settings.items() if key not in ("method", "samples", "burn_in", "chains", "seed", "threads")}
    posterior = Posterior(surrogate, *measurements_of(measurements, bool(settings.get("infer_scale"))), **density)
    names = [*posterior.names]
    draws = [result.posterior[name].values.ravel() for name in names]
    if posterior.infer_scale:
        draws.append(np.log(result.posterior["sd_factor"].values.ravel()))
    if not sd_gpa:
        factor = float(result.posterior["sd_factor"].mean()) if posterior.infer_scale else 1.0
        sd_gpa = factor * float(np.median(posterior.sd_gpa))
    return suggest(
        posterior, np.stack(draws, axis=1), sd_gpa=sd_gpa, target=target, count=count, seed=settings.get("seed", 1),
        threads=settings.get("threads", 0) or len(os.sched_getaffinity(0)),
    )  # fmt: skip


def stored_result(problem, output: Path, settings: Mapping):
    """The posterior that `extract` left in the output folder, if it is of this problem; else None."""
    import arviz as az

    path = Path(output) / "posterior.nc"
    if not path.is_file():
        return None
    try:
        result = az.from_netcdf(str(path), engine="h5netcdf")
        same = result.posterior.attrs["settings"] == fingerprint(problem, settings)
    except (OSError, ValueError, KeyError, AttributeError):
        return None
    return result if same else None


def next_stage(problem, output: Path, progress=None) -> dict:
    """The grains worth measuring next of a problem, after its posterior, which is sampled unless `extract` left it in the folder."""
    surrogate = surrogate_of(problem, output)
    settings = settings_of(problem)
    wanted = problem.settings.next
    with progress.bar("next grain", 1) if progress else nullcontext(lambda steps=1: None) as advance:
        try:
            result = next_grain(
                surrogate, problem.measurements, sd_gpa=wanted.sd_gpa, target=wanted.target, count=wanted.count,
                result=stored_result(problem, output, settings), **settings,
            )  # fmt: skip
        except InputError as error:
            raise InputError(f"{problem.path}: &next: {error}") from None
        advance(1)
    found = len(result["suggestions"])
    result["warnings"] = list(problem.warnings)
    if found < wanted.count:
        result["warnings"].append(f"only {found} of {wanted.count} orientations are {SEPARATION_DEG:g} degrees apart")
    return result
