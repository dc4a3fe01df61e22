"""Step 2: infer the constants from measured moduli, and suggest the grain to measure next. The core
computes the densities, the chains and their diagnostics.
"""

import json
from collections.abc import Mapping
from os import PathLike
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from ..common.result_files import plain
from ..core import InputError
from ..settings.keywords import takes
from ..settings.problem import Problem, grouped
from ..surrogate.surrogate import Surrogate
from .analysis import CoreAnalysis
from .measurements import GROUPS, problem_of

#: Variables that have no keyword of their name; other keywords replace them.
LEFT_OUT = (
    *("symmetry", "title", "synthetic", "file", "c_min", "c_max", "draws", "engine", "scheduler"),
    *("cores", "memory", "walltime"),
)


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

    Examples
    --------
    >>> result = bi.extract("grains.csv", "cubic", technique="exact", samples=300)
    >>> len(bi.next_grain(result, count=2)["suggestions"])
    2
    """
    own = {"symmetry": symmetry, "bounds": bounds, "knowledge": knowledge} | settings
    if hasattr(measurements, "posterior"):
        result, facts = measurements, measurements.posterior.attrs
        surrogate = surrogate or result.posterior.encoding.get("surrogate") or facts["surrogate"]
        if not surrogate:
            raise InputError(
                "a result from a file does not have its surrogate; state it with surrogate=",
                "bi.next_grain",
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
    references: str | PathLike | None = None,
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
    given = {"symmetry": symmetry, "bounds": bounds, "knowledge": knowledge}
    given |= {"references": references} | settings
    return sampled(*begun("bi.extract", measurements, surrogate, **given), progressbar)


def begun(
    origin: str, measurements: Any, surrogate: Surrogate | str | PathLike, **given: Any
) -> tuple[Problem, Surrogate, str]:
    """The problem that the keywords of the function `origin` state, the surrogate and its name."""
    name = "" if isinstance(surrogate, Surrogate) else str(surrogate)
    model = loaded(surrogate)
    return problem_of(origin, model, measurements, **given), model, name


def sampled(problem: Problem, surrogate: Surrogate, name: str, progressbar: bool = False) -> Any:
    """The result of `bi.extract` with a surrogate that has this name."""
    result = CoreAnalysis(problem, surrogate).infer(progressbar)
    made = problem._made_of[0]
    result.posterior.attrs.update(
        surrogate=name, asked=json.dumps(plain([*made.args, made.keywords]), default=str)
    )
    # `next_grain` uses the surrogate in this process; a file of the result has only its name.
    result.posterior.encoding["surrogate"] = surrogate
    return result


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

    Examples
    --------
    >>> found = bi.plan("cubic", [168.4, 121.4, 75.4], grains=[10], noise=[0.02], technique="exact")
    >>> sorted(found["results"][0]["sd"])
    ['C11', 'C12', 'C44']
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
    `reasons`, `laboratory`, `assumptions`, `warnings`, `correlation`, `predicted` (of each grain),
    `identifiability`, `error_budget`, and more.

    Examples
    --------
    >>> result = bi.extract("grains.csv", "cubic", technique="exact", samples=300)
    >>> sorted(bi.summary(result)["parameters"])
    ['C11', 'C12', 'C44']
    """
    return json.loads(result.posterior.attrs["summary"])
