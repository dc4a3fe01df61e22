"""Single-crystal elastic constants, with honest uncertainty, from spherical indentation of single grains."""

from .core import BayesindentError, InputError
from .crystal import anisotropy_index, halfspace_modulus, stiffness
from .indentation import Indentation, IndentationResult
from .problem import Problem

__all__ = [
    "BayesindentError",
    "Indentation",
    "IndentationResult",
    "InputError",
    "Problem",
    "anisotropy_index",
    "halfspace_modulus",
    "stiffness",
]
