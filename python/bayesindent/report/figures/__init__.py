"""The figures of the report: functions of `Results` that give a `Picture`, or raise
`NothingToShow`.
"""

from . import curves, learning, maps, mesh, orientations, posterior, simulations, young

#: Figures by section of the report, in their order. The file of a figure has the name of its
#: function.
SECTIONS = {
    "next": (posterior.knowledge, orientations.next_grains),
    "result": (
        posterior.pairs,
        posterior.shares,
        posterior.error_budget,
        posterior.grain_comparison,
        posterior.velocities,
        young.young_surface,
        orientations.orientations,
        maps.orientation_map,
    ),
    "curves": (curves.curve_fits, curves.curve_moduli, curves.moduli_errors, curves.tip_radius),
    "parity": (learning.parity,),
    "simulation": (mesh.mesh, simulations.load_depth, simulations.theory),
    "plan": (posterior.expected_sds,),
    "diagnostics": (posterior.marginals, posterior.residuals, posterior.traces),
    "surrogate": (learning.learning_curve, learning.validation, learning.truncations),
}
FIGURES = tuple((section, figure) for section, figures in SECTIONS.items() for figure in figures)
