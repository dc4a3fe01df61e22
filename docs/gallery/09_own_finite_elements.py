"""
Your own finite elements
========================

The program chooses crystals, and a function of yours simulates them. Here a formula stands for the
simulation: a modulus 5 % above theory, times a factor of the anisotropy. The surrogate predicts
crystals that were not simulated.
"""

from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np

import bayesindent as bi

Path("own.nml").write_text("""\
&problem symmetry = 'cubic', synthetic = .true. /
&simulation simulator = 'import' /
&domain c_min = 50, 40, 15, c_max = 250, 150, 120, anisotropy_cap = 7.2 /
&design n_candidates = 200, budget = 15 /
""")


def simulate(stiffness, euler_deg):
    """A modulus in GPa; call your own code here."""
    factor = 1.05 * (stiffness[0, 0] / stiffness[3, 3]) ** 0.02
    return factor * float(bi.halfspace_modulus(stiffness, euler_deg))


surrogate = bi.build("own.nml", "own", simulate=simulate)
crystals = [bi.stiffness("cubic", 170, 110, c44) for c44 in np.linspace(30, 110, 12)]
mean, sd = surrogate.predict(np.array(crystals), np.full((12, 3), 30.0))
truth = [simulate(crystal, [30.0, 30.0, 30.0]) for crystal in crystals]
figure, axes = plt.subplots()
axes.errorbar(truth, mean / truth - 1, sd / truth, fmt="o", capsize=4)
axes.axhline(0, color="black", linewidth=0.8)
axes.set(xlabel="own simulation (GPa)", ylabel="relative error of the surrogate")
figure.savefig("own_finite_elements.png")
