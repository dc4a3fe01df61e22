"""Single-crystal elastic constants, with honest uncertainty, from spherical indentation of single grains."""

from .core import BayesindentError, InputError, MachineError
from .crystal.elasticity import anisotropy_index, halfspace_modulus, stiffness
from .fe.indentation import Indentation, IndentationResult
from .inference.extract import extract, quantities, summary
from .inference.next_grain import next_grain
from .settings.problem import Problem
from .surrogate.domain import Domain
from .surrogate.surrogate import Surrogate

__all__ = [
    "BayesindentError",
    "Domain",
    "Indentation",
    "IndentationResult",
    "InputError",
    "MachineError",
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
