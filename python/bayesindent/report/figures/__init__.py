"""The figures of the report: functions of `Results` that give a `Picture`, or raise
`NothingToShow`.
"""

from . import curves, learning, maps, orientations, posterior, simulations

#: Figures by section of the report, in their order. The file of a figure has the name of its
#: function.
SECTIONS = {
    "next": (orientations.next_grains,),
    "result": (
        posterior.pairs,
        posterior.grain_comparison,
        posterior.velocities,
        orientations.orientations,
        maps.orientation_map,
    ),
    "curves": (curves.curve_fits,),
    "parity": (learning.parity,),
    "simulation": (simulations.load_depth,),
    "plan": (posterior.expected_sds,),
    "diagnostics": (posterior.marginals, posterior.traces),
    "surrogate": (learning.learning_curve, learning.validation, learning.truncations),
}
FIGURES = tuple((section, figure) for section, figures in SECTIONS.items() for figure in figures)
