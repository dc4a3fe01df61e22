"""Step 2: infer the constants from measured moduli, and suggest the grain to measure next. The core
computes the densities, the chains and their diagnostics.
"""

import json
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from os import PathLike
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from ..common.result_files import plain
from ..core import InputError
from ..crystal.elasticity import constant_names, stiffness_rows
from ..settings.keywords import takes
from ..settings.problem import Problem, grouped
from ..surrogate.surrogate import Surrogate
from .analysis import CoreAnalysis
from .measurements import GROUPS, problem_of

#: Variables that have no keyword of their name; other keywords replace them.
LEFT_OUT = ("symmetry", "title", "synthetic", "file", "c_min", "c_max", "engine", "scheduler")
#: Draws of the posterior from which moduli are predicted.
PREDICTED = 500


@takes(*GROUPS, "next", without=LEFT_OUT)
def next_grain(
    measurements: Any,
    symmetry: str | None = None,
    *,
    surrogate: Surrogate | str | PathLike | None = None,
    result: Any = None,
    bounds: Mapping | None = None,
    knowledge: Mapping | None = None,
    **settings: Any,
) -> dict:
    """Rank orientations by the information that their measurement is expected to add to that of the
    orientations above them.

    bi.next_grain(result) is enough. The keywords target, sd_gpa, candidates and count describe the
    next measurement.

    Parameters
    ----------
    measurements : result of bi.extract, or measurements for it
        A result provides its own measurements and settings.
    result : result of bi.extract, optional
        Draws to reuse if `measurements` is a table.
    symmetry, surrogate, bounds, knowledge
        As in `bi.extract`.

    Returns
    -------
    dict
        `suggestions`, each with `euler_deg`, `gain` and indices; the `unit` of the gain; and all
        `candidates`.
    """
    own = {"symmetry": symmetry, "bounds": bounds, "knowledge": knowledge} | settings
    if hasattr(measurements, "posterior"):
        result, facts = measurements, measurements.posterior.attrs
        surrogate = surrogate or result.posterior.encoding.get("surrogate") or facts["surrogate"]
        if not surrogate:
            raise InputError(
                "bi.next_grain: a result from a file does not have its "
                "surrogate; state it with surrogate="
            )
        surrogate, (_, tables, groups) = loaded(surrogate), json.loads(facts["asked"])
        problem = Problem.from_keywords("bi.next_grain", tables, **groups | {"next": settings})
    else:
        surrogate = loaded(surrogate or "halfspace")
        problem = problem_of("bi.next_grain", surrogate, measurements, **own)
        if result is None:
            of_next = grouped(settings, ["next"])["next"]
            result = extract(
                measurements,
                surrogate=surrogate,
                **{name: own[name] for name in own if name not in of_next},
            )
    draws = np.stack(
        [values.values.ravel() for values in result.posterior.data_vars.values()], axis=1
    )
    return CoreAnalysis(problem, surrogate).document("next", points=draws)


@takes(*GROUPS, without=LEFT_OUT)
def extract(
    measurements: Any,
    symmetry: str | None = None,
    *,
    surrogate: Surrogate | str | PathLike = "halfspace",
    bounds: Mapping | None = None,
    knowledge: Mapping | None = None,
    progressbar: bool = False,
    **settings: Any,
) -> Any:
    """Infer the elastic constants of a crystal from measured moduli of its grains.

    Which modulus was measured must be stated: by `modulus_kind`, or by the name of its column
    (effective_modulus_gpa, Er, ..).

    Parameters
    ----------
    measurements : path or table
        A CSV or Excel file, a data frame, a mapping of columns, a list of rows, or an array (n, 5)
        of phi1, Phi, phi2, modulus and sd; or None with `velocities`, which may be a table too.
        Columns are those of a file. A column `orientation`, orix' Orientation, may replace the
        three angles.
    symmetry : str
        The crystal class, such as 'cubic', 'hcp' or '4/mmm'.
    surrogate : Surrogate, str or path, default 'halfspace'
        The model of the modulus; 'halfspace' is the exact theory of a bulk sample, 'block' a
        surrogate that comes with the package.
    bounds : dict, optional
        (low, high) in GPa by constant, {'C11': (150, 300)}; None leaves an end unbounded.
    knowledge : dict, optional
        (mean, sd) by quantity ('bulk_modulus', 'C44', 'C33/C11', 'young[110]', ..); 'stiffness':
        (means, covariance) of all constants in GPa and GPa², or a CSV of them; 'source': a list of
        the works that state the quantities.
    progressbar : bool, default False
        Show the progress of the chains.

    Returns
    -------
    arviz.InferenceData (DataTree with ArviZ 1)
        `posterior` has a variable for each constant, and further groups: `prior`, `derived`
        (quantities of the crystal), `predictions` (the modulus of each grain), `log_likelihood`,
        `log_prior`, `posterior_predictive`, `observed_data` and `constant_data`. If a result
        cannot be used, its first warning says why. `bi.summary(result)` has mean, sd and shares of
        each constant.
    """
    return begun(
        "bi.extract",
        measurements,
        surrogate,
        symmetry=symmetry,
        bounds=bounds,
        knowledge=knowledge,
        **settings,
    ).sample(progressbar)


@dataclass(frozen=True, eq=False)
class Analysis:
    """Step 2 of a table of measurements as an object, see `bi.analysis`. The posterior is sampled
    when a result is first asked for.
    """

    problem: Problem
    surrogate: Surrogate
    #: Name of the surrogate; empty if it has none.
    name: str = ""

    @cached_property
    def posterior(self) -> Any:
        """The result of `bi.extract`."""
        return self.sample()

    def sample(self, progressbar: bool = False) -> Any:
        """Sample the posterior."""
        result = CoreAnalysis(self.problem, self.surrogate).infer(progressbar)
        made = self.problem._made_of[0]
        result.posterior.attrs.update(
            surrogate=self.name, asked=json.dumps(plain([*made.args, made.keywords]), default=str)
        )
        # `next_grain` uses the surrogate in this process; a file of the result has only its name.
        result.posterior.encoding["surrogate"] = self.surrogate
        return result

    def summary(self) -> dict:
        """See `bi.summary`."""
        return summary(self.posterior)

    def predict(self, euler_deg: ArrayLike) -> tuple[np.ndarray, np.ndarray]:
        """Mean and sd in GPa of the indentation modulus at Bunge's angles (n, 3) in degrees, over
        the posterior and the error of the surrogate.
        """
        symmetry, angles = self.problem.settings.problem.symmetry, np.atleast_2d(euler_deg)
        draws = np.stack(
            [self.posterior.posterior[name].values.ravel() for name in constant_names(symmetry)], 1
        )
        draws = draws[:: max(1, len(draws) // PREDICTED)]
        modulus, sd = self.surrogate.predict(
            np.repeat(stiffness_rows(symmetry, draws), len(angles), axis=0),
            np.tile(angles, (len(draws), 1)),
        )
        moduli = modulus.reshape(len(draws), -1)
        variance = moduli.var(axis=0) + (sd.reshape(moduli.shape) ** 2).mean(axis=0)
        return moduli.mean(axis=0), np.sqrt(variance)

    def next(self, **settings: Any) -> dict:
        """The grains to measure next; the keywords are those of `&next`, see `bi.next_grain`."""
        return next_grain(self.posterior, **settings)

    def plan(self, grains: ArrayLike, noise: ArrayLike, **settings: Any) -> dict:
        """Expected sds of the constants for numbers of grains and noises of such a crystal; other
        keywords are those of `&plan`, see `bi.plan`.
        """
        parameters = self.summary()["parameters"]
        asked = {"grains": grains, "noise": noise} | settings
        if "constants" not in asked:
            names = constant_names(self.problem.settings.problem.symmetry)
            asked["constants"] = [parameters[name]["mean"] for name in names]
        (_, tables), groups = self.problem._made_of[0].args, self.problem._made_of[0].keywords
        problem = Problem.from_keywords("Analysis.plan", tables, **groups | {"plan": asked})
        return CoreAnalysis(problem, self.surrogate).document("plan")

    def report(self, output: str | PathLike = ".", figures: str = "", paper: bool = False) -> Path:
        """Write the report of the results, see `bi.report`."""
        from ..report.report import write_report

        return write_report(self.posterior, Path(output), figures, paper)[1]


@takes(*GROUPS, without=LEFT_OUT)
def analysis(
    measurements: Any,
    symmetry: str | None = None,
    *,
    surrogate: Surrogate | str | PathLike = "halfspace",
    bounds: Mapping | None = None,
    knowledge: Mapping | None = None,
    **settings: Any,
) -> Analysis:
    """Step 2 as an object: `posterior`, `summary()`, `predict(euler_deg)`, `next()`, `plan(grains,
    noise)`, `report()`. The arguments are those of `bi.extract`.
    """
    given = {"symmetry": symmetry, "bounds": bounds, "knowledge": knowledge} | settings
    return begun("bi.analysis", measurements, surrogate, **given)


def begun(
    origin: str, measurements: Any, surrogate: Surrogate | str | PathLike, **given: Any
) -> Analysis:
    """The analysis that the keywords of the function `origin` state."""
    name = "" if isinstance(surrogate, Surrogate) else str(surrogate)
    model = loaded(surrogate)
    return Analysis(problem_of(origin, model, measurements, **given), model, name)


@takes("plan", *GROUPS, without=(*LEFT_OUT, "lattice"))
def plan(
    symmetry: str,
    constants: ArrayLike,
    grains: ArrayLike,
    noise: ArrayLike,
    *,
    surrogate: Surrogate | str | PathLike = "halfspace",
    bounds: Mapping | None = None,
    knowledge: Mapping | None = None,
    **settings: Any,
) -> dict:
    """Plan measurements: `results` has the expected `sd` in GPa of each constant for each number of
    grains and each noise.

    Parameters
    ----------
    constants, grains, noise
        As in `&plan`; the constants in the order of `bi.constants(symmetry)`, the others numbers or
        lists.
    symmetry, surrogate, bounds, knowledge
        As in `bi.extract`.
    """
    surrogate = loaded(surrogate)
    problem = problem_of(
        "bi.plan",
        surrogate,
        None,
        symmetry=symmetry,
        bounds=bounds,
        knowledge=knowledge,
        constants=constants,
        grains=grains,
        noise=noise,
        **settings,
    )
    return CoreAnalysis(problem, surrogate).document("plan")


def loaded(surrogate: Surrogate | str | PathLike) -> Surrogate:
    """The surrogate itself, or the one with this name."""
    return surrogate if isinstance(surrogate, Surrogate) else Surrogate.load(surrogate)


def summary(result: Any) -> dict:
    """The summary of a `result` of `bi.extract`: the document that the command `extract` writes.

    `parameters` has `mean`, `sd`, `hdi_95`, `share` (of the variance: measurements, knowledge,
    prior), `verdict`, `ess_bulk` and `r_hat` of each constant. Further entries are `usable` with
    `reasons`, `warnings`, `correlation`, `predicted` (of each grain), `identifiability`,
    `error_budget`, and more.
    """
    return json.loads(result.posterior.attrs["summary"])
