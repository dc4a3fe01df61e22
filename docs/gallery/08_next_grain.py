"""
The next grain
==============

Which orientation determines C44 best, after eleven grains (synthetic)? The figure has the expected
gain over the distinct directions of a cubic crystal.
"""

import matplotlib.pyplot as plt
import numpy as np

import bayesindent as bi

known = {"bulk_modulus": (165, 3)}
result = bi.extract("data/fe3si.csv", "cubic", knowledge=known, technique="exact", seed=1)
ranked = bi.next_grain(result, target="C44", count=3)
for suggestion in ranked["suggestions"]:
    print("phi1 {:.0f}, Phi {:.0f}, phi2 {:.0f} degrees".format(*suggestion["euler_deg"]))
angles = np.radians([candidate["euler_deg"] for candidate in ranked["candidates"]])
gain = [100 * candidate["gain"] for candidate in ranked["candidates"]]
radius = np.tan(angles[:, 1] / 2)
figure, axes = plt.subplots()
points = axes.scatter(radius * np.sin(angles[:, 2]), radius * np.cos(angles[:, 2]), c=gain, s=60)
axes.set(aspect="equal", xlabel="stereographic projection", xticks=[], yticks=[])
figure.colorbar(points, label="expected gain (% of the variance of ln C44)")
figure.savefig("next_grain.png")
