"""Single-crystal elastic constants, with honest uncertainty, from spherical indentation of single grains."""

from .core import BayesindentError, InputError, MachineError
from .crystal.elasticity import anisotropy_index, halfspace_modulus, log_anisotropy, polycrystal_averages, stiffness
from .crystal.elasticity import constant_names as constants
from .fe.indentation import Indentation, IndentationResult
from .inference.extract import extract, summary
from .inference.next_grain import next_grain
from .inference.quantities import quantities
from .settings.problem import Problem
from .surrogate.surrogate import Surrogate

__all__ = [
    "BayesindentError",
    "Indentation",
    "IndentationResult",
    "InputError",
    "MachineError",
    "Problem",
    "Surrogate",
    "anisotropy_index",
    "constants",
    "extract",
    "halfspace_modulus",
    "log_anisotropy",
    "next_grain",
    "polycrystal_averages",
    "quantities",
    "stiffness",
    "summary",
]
