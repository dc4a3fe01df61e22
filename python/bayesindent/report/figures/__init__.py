"""The figures of the report: functions of `Results` that give a `Picture`, or raise `NothingToShow`."""

from . import curves, learning, maps, mesh, orientations, posterior, simulations, young

__all__ = ["FIGURES"]

#: Section of the report, and figure, in the order in which they are shown. A figure's file bears the name of its function.
FIGURES = (
    ("next", posterior.knowledge),
    ("next", orientations.next_grains),
    ("result", posterior.pairs),
    ("result", posterior.shares),
    ("result", posterior.error_budget),
    ("result", posterior.grain_comparison),
    ("result", posterior.velocities),
    ("result", young.young_surface),
    ("result", orientations.orientations),
    ("result", maps.orientation_map),
    ("curves", curves.curve_fits),
    ("curves", curves.curve_moduli),
    ("curves", curves.moduli_errors),
    ("curves", curves.tip_radius),
    ("parity", learning.parity),
    ("simulation", mesh.mesh),
    ("simulation", simulations.load_depth),
    ("simulation", simulations.theory),
    ("size", simulations.specimen_size),
    ("plan", posterior.expected_sds),
    ("diagnostics", posterior.marginals),
    ("diagnostics", posterior.residuals),
    ("diagnostics", posterior.traces),
    ("surrogate", learning.learning_curve),
    ("surrogate", learning.validation),
    ("surrogate", learning.truncations),
)
