"""Step 2 as an object and as functions: infer the constants from measured moduli, and suggest the
grain to measure next. The core computes the densities, the chains and their diagnostics.
"""

import json
from collections.abc import Mapping
from functools import cached_property
from os import PathLike
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from .common.progress import show_progress
from .common.result_files import plain
from .core import InputError, NativeObject
from .crystal.elasticity import constant_names, stiffness_rows
from .inference.arviz_groups import groups_of, inference_data
from .inference.measurements import GROUPS, problem_of
from .settings.keywords import takes, warn_of
from .settings.problem import Problem
from .surrogate.surrogate import Surrogate

#: Draws of the posterior from which moduli are predicted.
PREDICTED = 500
#: Variables that have no keyword of their name; other keywords replace them.
LEFT_OUT = (
    *("symmetry", "title", "synthetic", "file", "c_min", "c_max", "draws", "engine", "scheduler"),
    *("cores", "memory", "walltime"),
)


class Analysis(NativeObject):
    """Step 2 of a `problem` with a `surrogate` as an object, see `bi.analysis`. The posterior is
    sampled when a result is first asked for. The surrogate's `name` is empty if it has none.

    Examples
    --------
    >>> isinstance(bi.analysis("grains.csv", "cubic", technique="exact"), bi.Analysis)
    True
    """

    kind = "analysis"

    def __init__(self, problem: Problem, surrogate: Surrogate, name: str = ""):
        self.problem, self.surrogate, self.name = problem, surrogate, name
        self._hold(surrogate._call("analysis", problem=problem.handle)["handle"])

    @classmethod
    def of_keywords(
        cls, origin: str, measurements: Any, surrogate: Surrogate | str | PathLike, **given: Any
    ) -> "Analysis":
        """The analysis that the keywords of the function `origin` state."""
        name = "" if isinstance(surrogate, Surrogate) else str(surrogate)
        model = loaded(surrogate)
        return cls(problem_of(origin, model, measurements, **given), model, name)

    def infer(self, progressbar: bool = False) -> Any:
        """Sample the posterior, and return the result of `bi.extract`."""
        show_progress(progressbar)
        try:
            found = self._call("infer")
        finally:
            show_progress(False)
        warn_of(json.loads(found["document"]))
        result, made = inference_data(groups_of(found)), self.problem._made_of[0]
        result.posterior.attrs.update(
            surrogate=self.name, asked=json.dumps(plain([*made.args, made.keywords]), default=str)
        )
        # `next_grain` uses the surrogate in this process; a file of the result has only its name.
        result.posterior.encoding["surrogate"] = self.surrogate
        return result

    @cached_property
    def posterior(self) -> Any:
        """The result of `bi.extract`."""
        return self.infer()

    def document(self, verb: str, **values: Any) -> dict:
        """The document of 'next', from draws (n, parameters) as `points`, or of 'plan'."""
        document = json.loads(self._call(verb, **values)["text"])
        warn_of(document)
        return document

    def summary(self) -> dict:
        """See `bi.summary`."""
        return summary(self.posterior)

    def predict(self, euler_deg: ArrayLike) -> tuple[np.ndarray, np.ndarray]:
        """Mean and sd in GPa of the indentation modulus at Bunge's angles (n, 3) in degrees, over
        the posterior and the error of the surrogate.
        """
        symmetry, angles = self.problem.settings.problem.symmetry, np.atleast_2d(euler_deg)
        draws = draws_of(self.posterior)[:, : len(constant_names(symmetry))]
        draws = draws[:: max(1, len(draws) // PREDICTED)]
        modulus, sd = self.surrogate.predict(stiffness_rows(symmetry, draws)[:, None], angles)
        return modulus.mean(axis=0), np.sqrt(modulus.var(axis=0) + (sd**2).mean(axis=0))

    def diagnosis(self) -> list[dict]:
        """Other models of the measurements, the best first: `explanation`, `group`, `log_odds` over
        the stated model, `constants`, and the `remedy` that states it.
        """
        return self.summary()["diagnosis"]

    def next(self, **settings: Any) -> dict:
        """The grains to measure next; the keywords are those of `&next`, see `bi.next_grain`."""
        return next_grain(self.posterior, **settings)

    def plan(self, grains: ArrayLike, noise: ArrayLike, **settings: Any) -> dict:
        """Expected sds of the constants for numbers of grains and noises of such a crystal; other
        keywords are those of `&plan`, see `bi.plan`.
        """
        parameters = self.summary()["parameters"]
        names = constant_names(self.problem.settings.problem.symmetry)
        asked = {"constants": [parameters[name]["mean"] for name in names]}
        asked |= {"grains": grains, "noise": noise} | settings
        problem = problem_of_result(self.posterior, "Analysis.plan", plan=asked)
        return Analysis(problem, self.surrogate).document("plan")

    def report(self, output: str | PathLike = ".", figures: str = "", paper: bool = False) -> Path:
        """Write the report of the results, see `bi.report`."""
        from .report.report import write_report

        return write_report(self.posterior, Path(output), figures, paper)[1]


def problem_of_result(result: Any, origin: str, **group: Mapping) -> Problem:
    """The problem of a result of `bi.extract` with a further group of variables."""
    _, tables, groups = json.loads(result.posterior.attrs["asked"])
    return Problem.from_keywords(origin, tables, **groups | group)


def draws_of(result: Any) -> np.ndarray:
    """The draws (n, parameters) of a result of `bi.extract`."""
    return np.stack(
        [values.values.ravel() for values in result.posterior.data_vars.values()], axis=1
    )


@takes(*GROUPS, "next", without=LEFT_OUT, of=problem_of)
def next_grain(
    measurements: Any,
    symmetry: str | None = None,
    *,
    surrogate: Surrogate | str | PathLike | None = None,
    result: Any = None,
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
    symmetry, surrogate, bounds, knowledge, references
        As in `bi.extract`.

    Returns
    -------
    dict
        `suggestions`, each with `euler_deg`, `gain` and indices; the `unit` of the gain; and all
        `candidates`.

    Examples
    --------
    >>> result = bi.extract("grains.csv", "cubic", technique="exact", samples=300)
    >>> len(bi.next_grain(result, count=2)["suggestions"])
    2
    """
    if hasattr(measurements, "posterior"):
        result, facts = measurements, measurements.posterior.attrs
        surrogate = surrogate or result.posterior.encoding.get("surrogate") or facts["surrogate"]
        if not surrogate:
            raise InputError(
                "a result from a file does not have its surrogate; state it with surrogate=",
                "bi.next_grain",
            )
        problem = problem_of_result(result, "bi.next_grain", next=settings)
        analysis = Analysis(problem, loaded(surrogate))
    else:
        given = {"symmetry": symmetry} | settings
        analysis = Analysis.of_keywords(
            "bi.next_grain", measurements, surrogate or "halfspace", **given
        )
    return analysis.document(
        "next", points=draws_of(analysis.posterior if result is None else result)
    )


@takes(*GROUPS, without=LEFT_OUT, of=problem_of)
def extract(
    measurements: Any,
    symmetry: str | None = None,
    *,
    surrogate: Surrogate | str | PathLike = "halfspace",
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
    references : path, optional
        `&references crystals`: the crystals that the column `reference` of the table names.
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

    Examples
    --------
    >>> known = {"bulk_modulus": (137, 3)}
    >>> result = bi.extract("grains.csv", "cubic", knowledge=known, technique="exact")
    >>> c44 = bi.summary(result)["parameters"]["C44"]
    >>> c44["verdict"], abs(c44["mean"] - 75.4) < 3 * c44["sd"]
    ('determined', True)
    """
    given = {"symmetry": symmetry} | settings
    return Analysis.of_keywords("bi.extract", measurements, surrogate, **given).infer(progressbar)


@takes(*GROUPS, without=LEFT_OUT, of=problem_of)
def analysis(
    measurements: Any,
    symmetry: str | None = None,
    *,
    surrogate: Surrogate | str | PathLike = "halfspace",
    **settings: Any,
) -> Analysis:
    """Step 2 as an object: `posterior`, `summary()`, `diagnosis()`, `predict(euler_deg)`,
    `next()`, `plan(grains, noise)`, `report()`.

    Parameters
    ----------
    measurements, symmetry, surrogate, bounds, knowledge, references
        As in `bi.extract`.

    Returns
    -------
    Analysis
        Its posterior is sampled when a result is first asked for.

    Examples
    --------
    >>> analysis = bi.analysis(
    ...     "grains.csv", "cubic", knowledge={"bulk_modulus": (137, 3)}, technique="exact"
    ... )
    >>> mean, sd = analysis.predict([0, 0, 0])
    >>> abs(float(mean[0]) - 134.0) < 5
    True
    """
    given = {"symmetry": symmetry} | settings
    return Analysis.of_keywords("bi.analysis", measurements, surrogate, **given)


@takes("plan", *GROUPS, without=(*LEFT_OUT, "lattice"), of=problem_of)
def plan(
    symmetry: str,
    constants: ArrayLike,
    grains: ArrayLike,
    noise: ArrayLike,
    *,
    surrogate: Surrogate | str | PathLike = "halfspace",
    **settings: Any,
) -> dict:
    """Plan measurements: `results` has the expected `sd` in GPa of each constant for each number of
    grains and each noise.

    Parameters
    ----------
    constants, grains, noise
        As in `&plan`; the constants in the order of `bi.constants(symmetry)`, the others numbers or
        lists.
    symmetry, surrogate, bounds, knowledge, references
        As in `bi.extract`.

    Examples
    --------
    >>> found = bi.plan("cubic", [168.4, 121.4, 75.4], grains=[10], noise=[0.02], technique="exact")
    >>> sorted(found["results"][0]["sd"])
    ['C11', 'C12', 'C44']
    """
    given = {"symmetry": symmetry, "constants": constants, "grains": grains, "noise": noise}
    given |= settings
    return Analysis.of_keywords("bi.plan", None, surrogate, **given).document("plan")


def loaded(surrogate: Surrogate | str | PathLike) -> Surrogate:
    """The surrogate itself, or the one with this name."""
    return surrogate if isinstance(surrogate, Surrogate) else Surrogate.load(surrogate)


def summary(result: Any) -> dict:
    """The summary of a `result` of `bi.extract`: the document that the command `extract` writes.

    `parameters` has `mean`, `sd`, `hdi_95`, `share` (of the variance: measurements, knowledge,
    prior), `verdict`, `ess_bulk` and `r_hat` of each constant. Further entries are `usable` with
    `reasons`, `laboratory`, `assumptions`, `warnings`, `correlation`, `predicted` (of each grain),
    `identifiability`, `error_budget`, and more.

    Examples
    --------
    >>> result = bi.extract("grains.csv", "cubic", technique="exact", samples=300)
    >>> sorted(bi.summary(result)["parameters"])
    ['C11', 'C12', 'C44']
    """
    return json.loads(result.posterior.attrs["summary"])
