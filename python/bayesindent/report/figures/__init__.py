"""The figures of the report: functions of `Results` that give a `Picture`, or None where there is nothing to show."""

from . import learning, mesh, orientations, posterior, simulations, specimen_size

__all__ = ["FIGURES"]

#: Section of the report, and figure, in the order in which they are shown. A figure's file bears the name of its function.
FIGURES = (
    ("simulation", mesh.mesh),
    ("simulation", simulations.load_depth),
    ("simulation", simulations.theory),
    ("size", specimen_size.specimen_size),
    ("surrogate", learning.learning_curve),
    ("surrogate", learning.coefficients),
    ("surrogate", learning.parity),
    ("surrogate", learning.validation),
    ("surrogate", learning.truncations),
    ("posterior", posterior.marginals),
    ("posterior", posterior.pairs),
    ("posterior", posterior.grain_comparison),
    ("posterior", orientations.orientations),
    ("posterior", posterior.traces),
    ("identifiability", posterior.contraction),
    ("next", orientations.next_grains),
)
