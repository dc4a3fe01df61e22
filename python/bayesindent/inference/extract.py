"""Step 2: the constants behind measured moduli. The densities, the chains and what is said of them are the core's."""

import json

import numpy as np

from ..core import warn_of
from .measurements import problem_of
from .posterior import EXTRACTION, Posterior
from .quantities import quantity_names

__all__ = ["arviz_data", "extract", "groups_of", "inference_data", "loaded", "summary"]


def extract(measurements, *, surrogate="halfspace", **settings):
    """Sample the constants behind measured moduli; an ArviZ InferenceData whose `posterior` holds one variable a constant.

    `measurements`: a CSV file or a table (see `measurements_of`). `surrogate`: a `Surrogate`, or what `Surrogate.load` takes; 'halfspace'
    is the exact theory. `settings`: `symmetry`, the crystal class, which only a surrogate of a class of its own can do without; `lattice`, its unit cell, where the table has indices (`&problem lattice`); `bounds` maps constants to (low, high) in GPa, either perhaps None; `knowledge` maps quantities ('C44', 'C33/C11',
    'bulk_modulus', 'young[110]', ..) to (mean, sd), and 'stiffness' to (means, covariance) of all constants in GPa and GPa², or to a CSV of
    them; `seed`, `workers` (0: all cores; results do not depend on it), and the variables of
    `&measurements`, `&prior` and `&sampler`: `modulus_kind`, `calibration_sd`, `likelihood`, `scale`, `anisotropy_cap`, `method`,
    `samples`, `burn_in`, `chains`, `surrogate_variance`, ... Further groups: `prior` (constants without the data), `derived` (quantities
    of the crystal, for some of the draws), `predictions` (the modulus of each grain, of the kind that was measured), for the same draws
    `log_likelihood` (of each measurement given all others), `log_prior` and `posterior_predictive` (the grains measured anew), and
    `observed_data`, `constant_data`.
    """
    surrogate = loaded(surrogate)
    found = Posterior(problem_of("bi.extract", surrogate, measurements, **settings), surrogate, EXTRACTION)
    warn_of(found.document("extract"))
    return inference_data(found)


def loaded(surrogate):
    """A surrogate, or the one of a name."""
    if hasattr(surrogate, "handle"):
        return surrogate
    from ..surrogate.surrogate import Surrogate

    return Surrogate.load(surrogate)


def inference_data(found: Posterior):
    """What Step 2 found, for ArviZ."""
    import xarray as xr

    groups: dict = {name: xr.Dataset(variables, attrs=facts) for name, (variables, facts) in groups_of(found).items()}
    return arviz_data(groups)


def arviz_data(groups: dict):
    """Groups, datasets of xarray by name, as the object that ArviZ takes: an InferenceData; from its version 1 on a DataTree."""
    import arviz as az
    import xarray as xr

    return az.InferenceData(**groups) if int(az.__version__.split(".")[0]) < 1 else xr.DataTree.from_dict(groups)


def groups_of(found: Posterior) -> dict[str, tuple[dict, dict]]:
    """What Step 2 found by the groups of ArviZ' schema: of each the variables (axes, values; coordinates have the name of their axis)
    and facts. `fortran/inference/model_checks.f90` says what a likelihood and a prediction are."""
    settings, measured, names = found.problem.settings, found.problem.measurements, found.names
    draws, before, quantities = (found.values(label) for label in ("found_draws", "prior_draws", "quantities"))
    document = found.document("extract")
    each = ("chain", "draw")

    gpa = {"units": "GPa"}

    def counted(like: np.ndarray, stride: int = 1) -> dict:
        _, samples, chains = like.shape
        return {"chain": (("chain",), np.arange(chains)), "draw": (("draw",), np.arange(0, samples, stride))}

    some = counted(draws, int(found.values("stride")[0]))
    units = quantity_names(found.symmetry)
    derived = {name: (each, quantities[q].T, {"units": unit}) for q, (name, unit) in enumerate(units.items()) if name not in names}
    per_grain = (*each, "grain")
    predictions = {
        "modulus": (per_grain, found.values("predicted").T, gpa),
        "calibration_factor": ((*each, "group"), found.values("factor").T, {"units": "1"}),
    }
    likelihood = {"modulus": (per_grain, found.values("log_likelihood").T, {"units": "log(1/GPa)"})}
    replicated = {"modulus": (per_grain, found.values("replicated").T, gpa)}
    before_data = {"constants": (each, found.values("log_prior").T, {"long_name": "log prior density of all constants, up to a constant"})}
    conditions = {
        "euler_deg": (("grain", "angle"), measured.euler_deg, {"units": "degree"}),
        "sd": (("grain",), np.ones(len(measured)) if measured.sd_gpa is None else measured.sd_gpa, gpa),
    }
    bounds = zip(found.values("lower").tolist(), found.values("upper").tolist())
    facts = {
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
    return {
        "posterior": (
            counted(draws) | {name: (each, draws[j].T, {"units": units.get(name, "1")}) for j, name in enumerate(document["parameters"])},
            facts,
        ),
        "prior": (counted(before) | {name: (each, before[j].T, gpa) for j, name in enumerate(names)}, {}),
        "sample_stats": (counted(draws) | {"lp": (each, found.values("found_log_density").T)}, {}),
        "derived": (some | derived, {}),
        "predictions": (some | predictions, {}),
        "posterior_predictive": (some | replicated, {}),
        "log_likelihood": (some | likelihood, {}),
        "log_prior": (some | before_data, {}),
        "observed_data": ({"modulus": (("grain",), measured.modulus_gpa, gpa)}, {}),
        "constant_data": (conditions, {}),
    }


def summary(result) -> dict:
    """The document of `extract` from `result`, what the function of that name gives."""
    return json.loads(result.posterior.attrs["summary"])
