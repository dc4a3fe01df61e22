"""Step 2 as an object: the posterior of a table of measurements, and what follows from it."""

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from os import PathLike
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from .crystal.elasticity import constant_names, stiffness_rows
from .inference.analysis import CoreAnalysis
from .inference.extract import LEFT_OUT, begun, next_grain, sampled, summary
from .inference.measurements import GROUPS
from .settings.keywords import takes
from .settings.problem import Problem
from .surrogate.surrogate import Surrogate

#: Draws of the posterior from which moduli are predicted.
PREDICTED = 500


@dataclass(frozen=True, eq=False)
class Analysis:
    """Step 2 of a table of measurements as an object, see `bi.analysis`. The posterior is sampled
    when a result is first asked for.

    Examples
    --------
    >>> isinstance(bi.analysis("grains.csv", "cubic", technique="exact"), bi.Analysis)
    True
    """

    problem: Problem
    surrogate: Surrogate
    #: Name of the surrogate; empty if it has none.
    name: str = ""

    @cached_property
    def posterior(self) -> Any:
        """The result of `bi.extract`."""
        return sampled(self.problem, self.surrogate, self.name)

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
        asked = {"grains": grains, "noise": noise} | settings
        if "constants" not in asked:
            names = constant_names(self.problem.settings.problem.symmetry)
            asked["constants"] = [parameters[name]["mean"] for name in names]
        (_, tables), groups = self.problem._made_of[0].args, self.problem._made_of[0].keywords
        problem = Problem.from_keywords("Analysis.plan", tables, **groups | {"plan": asked})
        return CoreAnalysis(problem, self.surrogate).document("plan")

    def report(self, output: str | PathLike = ".", figures: str = "", paper: bool = False) -> Path:
        """Write the report of the results, see `bi.report`."""
        from .report.report import write_report

        return write_report(self.posterior, Path(output), figures, paper)[1]


@takes(*GROUPS, without=LEFT_OUT)
def analysis(
    measurements: Any,
    symmetry: str | None = None,
    *,
    surrogate: Surrogate | str | PathLike = "halfspace",
    bounds: Mapping | None = None,
    knowledge: Mapping | None = None,
    references: str | PathLike | None = None,
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
    given = {"symmetry": symmetry, "bounds": bounds, "knowledge": knowledge}
    given |= {"references": references} | settings
    return Analysis(*begun("bi.analysis", measurements, surrogate, **given))
