"""
From curves to constants
========================

Curves of load and depth of fourteen copper grains and of fused quartz (synthetic, with drift,
pop-ins and a tip of unknown radius). The reference determines the tip; the errors that all grains
share go on to the constants.
"""

import bayesindent as bi

moduli = bi.curves(
    "data/copper_curves.csv",
    "data/copper_tests.csv",
    {"quartz": (72, 0.5, 0.17)},
    radius_um=5.0,
    radius_sd_um=0.5,
)
mean, sd = moduli.tip_radius_um
print(f"tip radius {mean:.1f} ± {sd:.1f} µm")
known = {"bulk_modulus": (137, 3)}
result = bi.extract(moduli, "cubic", knowledge=known, technique="exact", seed=1)
for name, found in bi.summary(result)["parameters"].items():
    print(f"{name} {found['mean']:.0f} ± {found['sd']:.0f} GPa")
bi.plot_constants(result).savefig("curves.png")
