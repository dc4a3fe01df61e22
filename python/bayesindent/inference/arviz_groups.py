"""The results of Step 2 by the groups of ArviZ' schema."""

import json
from typing import Any

import numpy as np

from ..crystal.elasticity import constant_names, quantity_names


def inference_data(groups: dict[str, tuple[dict, dict]]) -> Any:
    """Groups of variables and facts as an InferenceData of ArviZ, or a DataTree from its version 1
    on.
    """
    # Importing these takes seconds.
    import arviz as az
    import xarray as xr

    sets: dict = {
        name: xr.Dataset(variables, attrs=facts) for name, (variables, facts) in groups.items()
    }
    return (
        az.InferenceData(**sets)
        if int(az.__version__.split(".")[0]) < 1
        else xr.DataTree.from_dict(sets)
    )


def groups_of(found: dict) -> dict[str, tuple[dict, dict]]:
    """The results of Step 2 by the groups of ArviZ' schema. A group is a pair of variables (axes,
    values, perhaps attributes; coordinates have the name of their axis) and facts. `found` has the
    names of fortran/documents/analysis_document.f90; fortran/inference/model_checks.f90 defines
    the likelihood and the predictions.
    """
    names, units = constant_names(found["symmetry"]), quantity_names(found["symmetry"])
    draws, before, sd = found["draws"], found["prior_draws"], found["sd_gpa"]
    each, per_grain = ("chain", "draw"), ("chain", "draw", "grain")

    def counted(like: np.ndarray, stride: int = 1) -> dict:
        chains, samples = like.shape[:2]
        return {
            "chain": (("chain",), np.arange(chains)),
            "draw": (("draw",), np.arange(0, samples, stride)),
        }

    def by_kind(
        axes: tuple,
        values: np.ndarray,
        names: tuple = ("modulus", "velocity"),
        units: tuple = ("GPa", "m/s"),
    ) -> dict:
        modulus, velocity = np.split(values, [found["n_moduli"]], axis=axes.index("grain"))
        parts = {names[0]: (axes, modulus, {"units": units[0]})}
        if velocity.size:
            of_waves = tuple("wave" if name == "grain" else name for name in axes)
            parts[names[1]] = (of_waves, velocity, {"units": units[1]})
        return parts

    bounds = dict(zip(names, zip(found["lower"].tolist(), found["upper"].tolist())))
    of_core = ("symmetry", "title", "modulus_kind", "acceptance", "anisotropy_cap", "share_inside")
    facts = {name: found[name] for name in of_core} | {
        "summary": found["document"],
        "settings": found["resolved"],
        "map": found["most_probable"],
        "bounds": json.dumps(bounds),
    }
    parameters = {
        name: (each, draws[..., j], {"units": units.get(name, "1")})
        for j, name in enumerate(json.loads(found["document"])["parameters"])
    }
    some = counted(draws, found["stride"])
    log_prior = {"long_name": "log prior density of all constants, up to a constant"}
    groups = {
        "prior": counted(before)
        | {name: (each, before[..., j], {"units": "GPa"}) for j, name in enumerate(names)},
        "sample_stats": counted(draws) | {"lp": (each, found["log_density"])},
        "derived": some
        | {
            name: (each, found["quantities"][..., q], {"units": unit})
            for q, (name, unit) in enumerate(units.items())
            if name not in names
        },
        "predictions": some
        | by_kind(per_grain, found["predicted"])
        | {"calibration_factor": ((*each, "group"), found["factor"], {"units": "1"})},
        "posterior_predictive": some | by_kind(per_grain, found["replicated"]),
        "log_likelihood": some
        | by_kind(per_grain, found["log_likelihood"], units=("log(1/GPa)", "log(1/m/s)")),
        "log_prior": some | {"constants": (each, found["log_prior"], log_prior)},
        "observed_data": by_kind(("grain",), found["modulus_gpa"]),
        "constant_data": by_kind(
            ("grain", "angle"),
            found["euler_deg"],
            ("euler_deg", "velocity_euler_deg"),
            ("degree", "degree"),
        )
        | by_kind(("grain",), np.where(sd > 0, sd, 1.0), ("sd", "velocity_sd")),
    }
    posterior = counted(draws) | parameters, facts
    return {"posterior": posterior} | {name: (group, {}) for name, group in groups.items()}
