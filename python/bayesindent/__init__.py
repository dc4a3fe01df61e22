"""Single-crystal elastic constants, with honest uncertainty, from spherical indentation of single grains."""

from .core import BayesindentError, InputError
from .crystal import anisotropy_index, halfspace_modulus, stiffness

__all__ = ["BayesindentError", "InputError", "anisotropy_index", "halfspace_modulus", "stiffness"]
