"""The public names of the package, see its docstring."""

from . import report
from .core import BayesindentError, BayesindentWarning, InputError, MachineError
from .crystal.elasticity import (
    anisotropy_index,
    halfspace_modulus,
    log_anisotropy,
    polycrystal_averages,
    quantities,
    rayleigh_velocity,
    stiffness,
)
from .crystal.elasticity import constant_names as constants
from .fe.indentation import Indentation, IndentationResult, film_modulus
from .program.functions import FUNCTIONS
from .report.comparison import compare
from .report.plots import PLOTS
from .settings.problem import Problem
from .stages.build import build_surrogate as build
from .stages.curves import curves
from .step_2 import Analysis, analysis, extract, next_grain, plan, summary
from .surrogate.surrogate import Surrogate

__all__ = [
    "Analysis",
    "BayesindentError",
    "BayesindentWarning",
    "Indentation",
    "IndentationResult",
    "InputError",
    "MachineError",
    "Problem",
    "Surrogate",
    "analysis",
    "anisotropy_index",
    "build",
    "compare",
    "constants",
    "curves",
    "extract",
    "film_modulus",
    "halfspace_modulus",
    "log_anisotropy",
    "next_grain",
    "plan",
    "polycrystal_averages",
    "quantities",
    "rayleigh_velocity",
    "report",
    "stiffness",
    "summary",
]
# Figures, and commands that have no function with keywords of their own.
globals().update(PLOTS | FUNCTIONS)
__all__ += [*PLOTS, *FUNCTIONS]
