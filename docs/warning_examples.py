"""An example of each diagnostic, for the page on what can go wrong: what was done, then subject and
numbers of the sentence, in the order of docs/diagnostics.md.
"""

#: By code: what was done, the subject, and the numbers.
EXAMPLES: dict[str, tuple[str, str, tuple[float, ...]]] = {
    "table_changed": (
        "The table has a row named Mean at its end.",
        "grains.csv: line 13 (Mean) is a statistic and is left out",
        (),
    ),
    "angles_like_radians": ("The angles were exported in radians.", "grains.csv", ()),
    "one_grain": ("Ten tests were made, all in one grain.", "grains.csv", ()),
    "orientations_alike": (
        "The unit of the positions is wrong, so that all indents lie in one grain of the map.",
        "indents.csv",
        (),
    ),
    "few_directions": ("Two grains of titanium were measured.", "grains.csv", (2, 3, 5)),
    "large_sd": ("An sd of 120 GPa is stated beside a modulus of 150 GPa.", "grains.csv", ()),
    "small_sds": (
        "The column sd_gpa has fractions: 0.02 in place of 3 GPa.",
        "grains.csv",
        (0.013, 1),
    ),
    "tests_scatter_more": (
        "Sds of the instrument leave out what differs from place to place.",
        "grains.csv",
        (2.1, 264.6, 60),
    ),
    "tests_scatter_less": (
        "The stated sds contain the error of the tip, which all tests share.",
        "grains.csv",
        (0.3, 5.4, 60),
    ),
    "tests_disagree": (
        "One of four tests of a grain met a scratch.",
        "grain G7",
        (4, 6.2, 115.3, 3),
    ),
    "velocities_left_out": (
        "Speeds of copper on (001) were measured far from [100].",
        "",
        (7, 20),
    ),
    "points_not_indexed": (
        "Dust on the surface left points of the map without a solution.",
        "map.ang: 212 of 9800 points have no solution",
        (),
    ),
    "surface_turned": (
        "A map was saved in the coordinates of the microscope.",
        "map.ctf: its angles are in CS0 and were turned to CS1",
        (),
    ),
    "indents_bridged": (
        "The map was taken after the indentation, and the imprints have no solution.",
        "3 indents lie on points without a solution; they have the grain around them",
        (),
    ),
    "indents_left_out": (
        "An indent is half a micrometre from a grain boundary.",
        "1 of 14 indents is in one grain with a probability below 95 % and is left out: G9",
        (),
    ),
    "registration_unknown": (
        "Three marks were seen by the stage and in the map.",
        "points.csv: three points leave no residual",
        (),
    ),
    "phase_differs": (
        "A cubic crystal is stated for a map of a hexagonal phase.",
        "map.ang: its phase is 6/mmm, and the crystal is stated as cubic",
        (),
    ),
    "test_left_out": (
        "A test has a pop-in at its first loads, and no elastic part is left.",
        "T17: the elastic part spans less than a factor of four in load",
        (),
    ),
    "no_reference": ("Only grains were indented, no quartz.", "", (5,)),
    "simulation_failed": (
        "A crystal near instability was to be simulated.",
        "its contact leaves the refined zone",
        (12,),
    ),
    "mesh_error": (
        "A crystal of log-anisotropy 2.3 was simulated with the default mesh.",
        "instability",
        (1, 2, 1.4, 2),
    ),
    "layers_error": ("The paper's block was simulated with C3D8.", "", (2.5, 2.6)),
    "simulations_failed": ("The domain has crystals near instability.", "", (2, 60)),
    "candidates_left_out": (
        "A list of crystals has rows beyond the bounds of the domain.",
        "crystals.csv",
        (1, 12),
    ),
    "other_physics": (
        "The thickness was changed after twenty simulations.",
        "campaign.sqlite holds only simulations of another specimen",
        (),
    ),
    "simulations_outside": ("The domain was made smaller.", "", (5,)),
    "no_candidate_left": ("The budget is larger than the number of candidates.", "", (200,)),
    "surrogate_error": (
        "The budget ended before the surrogate was good enough.",
        "C44",
        (18, 10, 15),
    ),
    "surrogate_deviates": ("The same, in the directions of the grains.", "", (2.3, 1.5, 25)),
    "outside_domain": (
        "A surrogate of cubic crystals is asked for a much softer one.",
        "points.csv: 3 of 20 crystals are outside the domain of the surrogate",
        (),
    ),
    "technique_assumed": ("The namelist states no technique.", "", ()),
    "other_model": (
        "The moduli are shifted by one row against the orientations.",
        "the rows are shifted by one",
        (43,),
    ),
    "other_model_likely": (
        "One grain has half the modulus of its neighbours.",
        "outlier G7",
        (6.1,),
    ),
    "unexplained": ("Moduli and orientations are of different sorting.", "", (412, 18, 0.3)),
    "residuals_wrong": (
        "Sds of 0.5 % are stated for moduli that scatter by 4 %.",
        "",
        (8.1, 1180, 18),
    ),
    "limit_excludes": ("C12 is limited to 110 GPa, and copper has 121 GPa.", "C12", (97,)),
    "outside_surrogate": (
        "The crystal is more anisotropic than those that the surrogate was trained on.",
        "log-anisotropy",
        (1.5, 34),
    ),
    "truncated": ("A bound of C11 lies within the posterior.", "upper bound of C11", (250, 12)),
    "knowledge_wrong": (
        "Copper, whose bulk modulus is 137 GPa, is stated with 300 ± 3.3 GPa between bounds.",
        "bulk_modulus",
        (31, 10),
    ),
    "knowledge_together": ("Several stated values are in another unit.", "", (22, 10)),
    "knowledge_contradicts": ("The bulk modulus is that of another alloy.", "bulk_modulus", (4.2,)),
    "knowledge_conflict": ("Two stated values contradict each other.", "", (3.6, 15.7, 2)),
    "knowledge_sharp": (
        "A bulk modulus is stated to 0.01 %.",
        "bulk_modulus = 137.0 ± 0.14 GPa",
        (),
    ),
    "not_mixed": ("Twenty samples were asked for.", "C12", (1.2314, 1.05)),
    "poorly_mixed": ("A long ridge was sampled with few sweeps.", "C12", (1.0132, 1.01)),
    "too_few_draws": ("Fifty samples were asked for.", "C12", (62, 100)),
    "few_draws": ("Two hundred samples were asked for.", "C12", (310, 400)),
    "theory_rough": ("Twenty thousand grains of a strongly anisotropic crystal.", "", (14, 5)),
    "not_determined": (
        "Titanium was measured, and nothing else is known.",
        "C12 (prior 93 %), C13 (prior 87 %)",
        (),
    ),
    "knowledge_helps": (
        "The same: what would help is named.",
        "bulk_modulus to ± 2.1 GPa would reduce the sd of C11",
        (47, 16),
    ),
    "residuals_large": ("A scatter between grains is not stated.", "", (41, 16, 0.06)),
    "residuals_small": ("The sds contain the error of the tip.", "", (3.1, 16, 99.9)),
    "plastic_contact": ("A sharp tip was pressed to its yield.", "", (7.24, 4.9, 4.4)),
    "yielding_contact": ("The same, with a stated yield stress of 0.3 GPa.", "", (1.1, 0.8, 0.32)),
    "other_contact": (
        "Grains were indented deeper than the surrogate was trained for.",
        "",
        (0.5, 1.0, 0.5, 9.7, 9.7),
    ),
    "small_grains": ("Grains of 1 µm were indented with a contact of 0.5 µm.", "G3", (20, 20, 8.4)),
    "sampled_anew": ("The results of extract were deleted before next.", "posterior.bin", ()),
    "few_apart": ("The candidates are grains of like orientation.", "", (2, 5, 5)),
    "posterior_missing": ("A file of the results was deleted.", "runs/grains/posterior.bin", ()),
    "inputs_edited": (
        "A modulus was corrected in the table after the run.",
        "&measurements of grains.nml",
        (),
    ),
    "compared_unusable": (
        "One of the compared results cannot be used.",
        "runs/b cannot be used: C12: the chains have not mixed",
        (),
    ),
    "compared_classes": ("A cubic and a hexagonal result are compared.", "", ()),
    "compared_measurements": ("Results of two tables are compared.", "", ()),
}
