"""
Moduli and speeds of surface waves
==================================

Moduli and speeds of the same twenty grains of titanium (synthetic). Moduli alone leave the result
to the prior; together they determine all five constants.
"""

import matplotlib.pyplot as plt
import numpy as np

import bayesindent as bi

random = np.random.default_rng(1)
titanium = bi.stiffness("hexagonal", C11=162.4, C12=92.0, C44=46.7, C33=180.7, C13=69.0)
angles = random.uniform([0, 0, 0, 0], [360, 90, 360, 180], (20, 4)).T
grains = dict(zip(["phi1_deg", "Phi_deg", "phi2_deg"], angles))
modulus = bi.halfspace_modulus(titanium, angles[:3].T)
speed = bi.rayleigh_velocity(titanium, angles[:3].T, angles[3], 4506)
noise = 1 + random.normal(0, [[0.02], [0.005]], (2, 20))
moduli = grains | {"indentation_modulus_gpa": modulus * noise[0], "sd_gpa": 0.02 * modulus}
speeds = grains | {"propagation_deg": angles[3], "rayleigh_velocity_m_s": speed * noise[1]}
waves = {"velocities": speeds | {"sd_m_s": 0.005 * speed}, "density_kg_m3": 4506}
sampler = {"samples": 1000, "chains": 2, "seed": 1}
figure, axes = plt.subplots()
for label, more in {"moduli alone": {}, "moduli and speeds": waves}.items():
    found = bi.summary(bi.extract(moduli, "hexagonal", technique="exact", **sampler, **more))
    mean, sd = np.transpose([(c["mean"], c["sd"]) for c in found["parameters"].values()])
    axes.errorbar(list(found["parameters"]), mean, sd, fmt="o", capsize=4, label=label)
axes.plot([162.4, 92.0, 46.7, 180.7, 69.0], "k_", markersize=25, label="true")
axes.set(ylabel="GPa")
axes.legend()
figure.savefig("surface_waves.png")
