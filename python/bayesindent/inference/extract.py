"""Step 2: the constants behind measured moduli, and which grain to measure next. The densities, the chains and what is said of them are the core's."""

import json
from os import PathLike

import numpy as np

from ..core import warn_of
from ..crystal.elasticity import constant_names, quantity_names
from ..surrogate.surrogate import Surrogate
from .measurements import problem_of
from .posterior import EXTRACTION, Posterior

__all__ = ["arviz_data", "extract", "groups_of", "inference_data", "loaded", "next_grain", "summary"]


def next_grain(measurements, *, surrogate: Surrogate | str | PathLike = "halfspace", result=None, **settings) -> dict:
    """Orientations worth measuring next, ranked, each given those above it.

    `measurements`, `surrogate` and `settings` are those of `extract`, whose `result` may be given, and the variables of `&next`: `target`: 'all' (gain: information on
    the constants in nats), a quantity of the vocabulary of `&knowledge`, or a product of powers, of which the logarithm is to be known
    (gain: the share of the variance that is expected to go); `sd_gpa`: of the next measurement, 0: the median of those made; `count`.
    """
    surrogate = loaded(surrogate)
    problem = problem_of("bi.next_grain", surrogate, measurements, **settings)
    if result is None:
        result = extract(measurements, surrogate=surrogate, **settings)
    draws = np.stack([values.values.ravel() for values in result.posterior.data_vars.values()], axis=1)
    document = Posterior(problem, surrogate).suggest(problem, draws)
    warn_of(document)
    return document


def extract(measurements, *, surrogate: Surrogate | str | PathLike = "halfspace", **settings):
    """Sample the constants behind measured moduli; an ArviZ InferenceData whose `posterior` holds one variable a constant.

    `measurements`: a CSV file or a table (see `measurements_of`). `surrogate`: a `Surrogate`, or what `Surrogate.load` takes; 'halfspace'
    is the exact theory. `settings`: `symmetry`, the crystal class, which only a surrogate of a class of its own can do without; `lattice`, its unit cell, where the table has indices (`&problem lattice`); `bounds` maps constants to (low, high) in GPa, either perhaps None; `knowledge` maps quantities ('C44', 'C33/C11',
    'bulk_modulus', 'young[110]', ..) to (mean, sd), and 'stiffness' to (means, covariance) of all constants in GPa and GPa², or to a CSV of
    them; `seed`, `workers` (0: all cores; results do not depend on it), and the variables of
    `&measurements`, `&prior` and `&sampler`: `modulus_kind`, `calibration_sd`, `likelihood`, `scale`, `anisotropy_cap`, `method`,
    `samples`, `burn_in`, `chains`, `surrogate_variance`, ... Further groups: `prior` (constants without the data), `derived` (quantities
    of the crystal, for some of the draws), `predictions` (the modulus of each grain, of the kind that was measured), for the same draws
    `log_likelihood` (of each measurement given all others), `log_prior` and `posterior_predictive` (the grains measured anew), and
    `observed_data`, `constant_data`. Why a result cannot be used is its first warning.
    """
    surrogate = loaded(surrogate)
    found = Posterior(problem_of("bi.extract", surrogate, measurements, **settings), surrogate, EXTRACTION)
    warn_of(found.document)
    return inference_data(groups_of(found.values))


def loaded(surrogate: Surrogate | str | PathLike) -> Surrogate:
    """A surrogate, or the one of a name."""
    return surrogate if isinstance(surrogate, Surrogate) else Surrogate.load(surrogate)


def inference_data(groups: dict[str, tuple[dict, dict]]):
    """Groups of variables and facts, for ArviZ."""
    import xarray as xr

    return arviz_data({name: xr.Dataset(variables, attrs=facts) for name, (variables, facts) in groups.items()})


def arviz_data(groups: dict):
    """Groups, datasets of xarray by name, as the object that ArviZ takes: an InferenceData; from its version 1 on a DataTree."""
    import arviz as az
    import xarray as xr

    return az.InferenceData(**groups) if int(az.__version__.split(".")[0]) < 1 else xr.DataTree.from_dict(groups)


def groups_of(found: dict) -> dict[str, tuple[dict, dict]]:
    """What Step 2 found by the groups of ArviZ' schema: of each the variables (axes, values; coordinates have the name of their axis)
    and facts. `found`: by the names of fortran/pipeline/posterior_file.f90; fortran/inference/model_checks.f90 says what a likelihood
    and a prediction are."""
    document = json.loads(found["document"])
    names, units = constant_names(found["symmetry"]), quantity_names(found["symmetry"])
    draws, before, quantities = (found[name] for name in ("draws", "prior_draws", "quantities"))
    each, per_grain, gpa = ("chain", "draw"), ("chain", "draw", "grain"), {"units": "GPa"}

    def counted(like: np.ndarray, stride: int = 1) -> dict:
        chains, samples = like.shape[:2]
        return {"chain": (("chain",), np.arange(chains)), "draw": (("draw",), np.arange(0, samples, stride))}

    some = counted(draws, found["stride"])
    derived = {name: (each, quantities[..., q], {"units": unit}) for q, (name, unit) in enumerate(units.items()) if name not in names}
    predictions = {
        "modulus": (per_grain, found["predicted"], gpa),
        "calibration_factor": ((*each, "group"), found["factor"], {"units": "1"}),
    }
    likelihood = {"modulus": (per_grain, found["log_likelihood"], {"units": "log(1/GPa)"})}
    replicated = {"modulus": (per_grain, found["replicated"], gpa)}
    before_data = {"constants": (each, found["log_prior"], {"long_name": "log prior density of all constants, up to a constant"})}
    conditions = {
        "euler_deg": (("grain", "angle"), found["euler_deg"], {"units": "degree"}),
        "sd": (("grain",), np.where(found["sd_gpa"] > 0, found["sd_gpa"], 1.0), gpa),
    }
    bounds = zip(found["lower"].tolist(), found["upper"].tolist())
    facts = {name: found[name] for name in ("symmetry", "title", "modulus_kind", "acceptance", "anisotropy_cap", "share_inside")}
    facts |= {
        "summary": found["document"],
        "settings": found["resolved"],
        "map": found["most_probable"],
        "bounds": json.dumps(dict(zip(names, bounds))),
    }
    return {
        "posterior": (
            counted(draws)
            | {name: (each, draws[..., j], {"units": units.get(name, "1")}) for j, name in enumerate(document["parameters"])},
            facts,
        ),
        "prior": (counted(before) | {name: (each, before[..., j], gpa) for j, name in enumerate(names)}, {}),
        "sample_stats": (counted(draws) | {"lp": (each, found["log_density"])}, {}),
        "derived": (some | derived, {}),
        "predictions": (some | predictions, {}),
        "posterior_predictive": (some | replicated, {}),
        "log_likelihood": (some | likelihood, {}),
        "log_prior": (some | before_data, {}),
        "observed_data": ({"modulus": (("grain",), found["modulus_gpa"], gpa)}, {}),
        "constant_data": (conditions, {}),
    }


def summary(result) -> dict:
    """The document of `extract` from `result`, what the function of that name gives."""
    return json.loads(result.posterior.attrs["summary"])
