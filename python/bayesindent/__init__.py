"""Single-crystal elastic constants, with honest uncertainty, from spherical indentation of single grains."""

from .calibration import extract, quantities, summary
from .core import BayesindentError, InputError
from .crystal import anisotropy_index, halfspace_modulus, stiffness
from .domain import Domain
from .indentation import Indentation, IndentationResult
from .next_grain import next_grain
from .problem import Problem
from .surrogate import Surrogate

__all__ = [
    "BayesindentError",
    "Domain",
    "Indentation",
    "IndentationResult",
    "InputError",
    "Problem",
    "Surrogate",
    "anisotropy_index",
    "extract",
    "halfspace_modulus",
    "next_grain",
    "quantities",
    "stiffness",
    "summary",
]
