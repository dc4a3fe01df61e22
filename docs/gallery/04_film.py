"""
How thick is a film that behaves as a bulk sample?
==================================================

Exact theory gives the modulus of a copper film on silicon at any thickness. The contact has a
radius of 0.5 µm. Below ten contact radii the substrate is felt, and differently by each face.
"""

import matplotlib.pyplot as plt
import numpy as np

import bayesindent as bi

copper = bi.stiffness("cubic", C11=168.4, C12=121.4, C44=75.4)
faces = {"(001)": [0, 0, 0], "(011)": [0, 45, 0], "(111)": [0, 54.74, 45]}
thickness = np.geomspace(0.25, 10, 12)
substrate = {"substrate_young_gpa": 163, "substrate_nu": 0.223}
figure, axes = plt.subplots()
for face, angles in faces.items():
    bulk = bi.halfspace_modulus(copper, angles)
    films = [bi.film_modulus(copper, angles, thickness_um=t, **substrate) for t in thickness]
    axes.semilogx(thickness, films / bulk, "o-", label=face)
axes.set(xlabel="thickness (µm)", ylabel="modulus of the film / of a bulk sample")
axes.legend()
figure.savefig("film.png")
