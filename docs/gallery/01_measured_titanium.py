"""
Measured titanium
=================

Young's moduli of 56 grains of titanium were measured with a Berkovich tip. Plastic imprints change
the modulus and its contrast between directions. Read as exact moduli they give a C44 that is far
from the literature. With ``technique = 'oliver_pharr'`` the constants agree, and their standard
deviations are larger.
"""

import matplotlib.pyplot as plt
import numpy as np

import bayesindent as bi

literature = {"C11": 162.4, "C12": 92, "C44": 46.7, "C33": 180.7, "C13": 69}
known = {"bulk_modulus": (107, 3)}
figure, axes = plt.subplots()
for shift, technique in (-0.1, "exact"), (0.1, "oliver_pharr"):
    result = bi.extract(
        "data/titanium_measured.csv",
        "hexagonal",
        technique=technique,
        scatter="inferred",
        sample_nu=0.28,
        knowledge=known,
        samples=1000,
        seed=1,
    )
    found = bi.summary(result)["parameters"]
    mean, sd = np.transpose([(found[name]["mean"], found[name]["sd"]) for name in literature])
    print(f"{technique}: C44 = {mean[2]:.0f} ± {sd[2]:.0f} GPa")
    axes.errorbar(np.arange(5) + shift, mean, sd, fmt="o", capsize=4, label=technique)
axes.plot(literature.values(), "k_", markersize=25, label="literature")
axes.set_xticks(range(5), literature)
axes.set_ylabel("GPa")
axes.legend()
figure.savefig("measured_titanium.png")
