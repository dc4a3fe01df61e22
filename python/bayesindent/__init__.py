"""Single-crystal elastic constants, with honest uncertainty, from spherical indentation of single grains."""

from . import report
from .core import BayesindentError, BayesindentWarning, InputError, MachineError
from .crystal.elasticity import anisotropy_index, halfspace_modulus, log_anisotropy, polycrystal_averages, quantities, stiffness
from .crystal.elasticity import constant_names as constants
from .fe.indentation import Indentation, IndentationResult
from .inference.extract import extract, next_grain, summary
from .pipeline.build import build_surrogate as build
from .report.comparison import compare
from .settings.problem import Problem
from .surrogate.surrogate import Surrogate

__all__ = [
    "BayesindentError", "BayesindentWarning", "Indentation", "IndentationResult", "InputError", "MachineError", "Problem",
    "Surrogate", "anisotropy_index", "build", "compare", "constants", "extract", "halfspace_modulus", "log_anisotropy",
    "next_grain", "polycrystal_averages", "quantities", "report", "stiffness", "summary",
]  # fmt: skip
