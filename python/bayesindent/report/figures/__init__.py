"""The figures of the report: functions of `Results` that give a `Picture`, or raise `NothingToShow`."""

from . import curves, learning, maps, mesh, orientations, posterior, simulations, young

__all__ = ["FIGURES"]

#: Section of the report, and figure, in the order in which they are shown. A figure's file bears the name of its function.
FIGURES = (
    ("simulation", mesh.mesh),
    ("simulation", simulations.load_depth),
    ("simulation", simulations.theory),
    ("size", simulations.specimen_size),
    ("plan", posterior.expected_sds),
    ("curves", curves.curve_fits),
    ("curves", curves.tip_radius),
    ("curves", curves.curve_moduli),
    ("curves", curves.moduli_errors),
    ("surrogate", learning.learning_curve),
    ("surrogate", learning.coefficients),
    ("surrogate", learning.parity),
    ("surrogate", learning.validation),
    ("surrogate", learning.truncations),
    ("posterior", posterior.marginals),
    ("posterior", posterior.prior_posterior),
    ("posterior", posterior.pairs),
    ("posterior", posterior.grain_comparison),
    ("posterior", posterior.residuals),
    ("posterior", posterior.velocities),
    ("posterior", orientations.orientations),
    ("posterior", maps.orientation_map),
    ("posterior", young.young_surface),
    ("posterior", posterior.traces),
    ("identifiability", posterior.shares),
    ("identifiability", posterior.error_budget),
    ("identifiability", posterior.knowledge),
    ("next", orientations.next_grains),
)
