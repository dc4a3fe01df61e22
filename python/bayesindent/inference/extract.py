"""Step 2: the constants behind measured moduli. The densities, the chains and what is said of them are the core's."""

import json
import warnings

import numpy as np

from .measurements import problem_of
from .posterior import EXTRACTION, Posterior
from .quantities import quantity_names

__all__ = ["extract", "inference_data", "loaded", "summary"]


def extract(measurements, *, surrogate="halfspace", **settings):
    """Sample the constants behind measured moduli; an ArviZ InferenceData whose `posterior` holds one variable a constant.

    `measurements`: a CSV file or a table (see `measurements_of`). `surrogate`: a `Surrogate`, or what `Surrogate.load` takes; 'halfspace'
    is the exact theory. `settings`: `symmetry`, the crystal class, which only a surrogate of a class of its own can do without; `bounds` maps constants to (low, high) in GPa, either perhaps None; `knowledge` maps quantities ('C44', 'C33/C11',
    'bulk_modulus', 'young[110]', ..) to (mean, sd), and 'stiffness' to (means, covariance) of all constants in GPa and GPa², or to a CSV of
    them; `seed`, `workers` (0: all cores; results do not depend on it), and the variables of
    `&measurements`, `&prior` and `&sampler`: `modulus_kind`, `calibration_sd`, `likelihood`, `scale`, `anisotropy_cap`, `method`,
    `samples`, `burn_in`, `chains`, `surrogate_variance`, ... Further groups: `prior` (constants without the data), `derived` (quantities
    of the crystal, for some of the draws), `predictions` (the modulus of each grain, of the kind that was measured), `observed_data`.
    """
    surrogate = loaded(surrogate)
    return inference_data(Posterior(problem_of("bi.extract", surrogate, measurements, **settings), surrogate, EXTRACTION))


def loaded(surrogate):
    """A surrogate, or the one of a name."""
    if hasattr(surrogate, "handle"):
        return surrogate
    from ..surrogate.surrogate import Surrogate

    return Surrogate.load(surrogate)


def inference_data(found: Posterior):
    """What Step 2 found, for ArviZ."""
    import arviz as az
    import xarray as xr

    settings, measured, names = found.problem.settings, found.problem.measurements, found.names
    draws, before, quantities = (found.values(label) for label in ("found_draws", "prior_draws", "quantities"))
    document = found.document("extract")
    some = ("draw", "chain")
    _, samples, chains = draws.shape
    coordinates = {"chain": np.arange(chains), "draw": np.arange(0, samples, int(found.values("stride")[0]))}
    reported = quantity_names(found.symmetry)
    derived = {name: (some, quantities[q]) for q, name in enumerate(reported) if name not in names}
    predictions = {
        "modulus": (("grain", *some), found.values("predicted")),
        "calibration_factor": (("group", *some), found.values("factor")),
    }
    data = {"modulus": ("grain", measured.modulus_gpa), "euler_deg": (("grain", "angle"), measured.euler_deg)}
    data["sd"] = ("grain", np.ones(len(measured)) if measured.sd_gpa is None else measured.sd_gpa)
    result = az.from_dict(
        posterior={name: draws[j].T for j, name in enumerate(document["parameters"])},
        prior={name: before[j].T for j, name in enumerate(names)},
        sample_stats={"lp": found.values("found_log_density").T},
    )
    bounds = zip(found.values("lower").tolist(), found.values("upper").tolist())
    result.posterior.attrs |= {
        "symmetry": found.symmetry,
        "summary": json.dumps(document),
        "settings": found.problem.resolved,
        "acceptance": found.values("found_acceptance"),
        "map": found.values("most_probable"),
        "bounds": json.dumps(dict(zip(names, bounds))),
        "anisotropy_cap": found.values("anisotropy_cap")[0],
        "share_inside": found.values("share_inside")[0],
        "modulus_kind": settings.measurements.modulus_kind,
        "title": settings.problem.title or "",
    }
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        groups: dict[str, tuple[dict, dict]] = {
            "derived": (derived, coordinates),
            "predictions": (predictions, coordinates),
            "observed_data": (data, {}),
        }
        result.add_groups(
            {
                name: xr.Dataset(variables, places).transpose("chain", "draw", ..., missing_dims="ignore")
                for name, (variables, places) in groups.items()
            }
        )
    return result


def summary(result) -> dict:
    """The document of `extract` from `result`, what the function of that name gives."""
    return json.loads(result.posterior.attrs["summary"])
