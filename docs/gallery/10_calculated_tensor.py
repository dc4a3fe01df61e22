"""
A calculated tensor against the measurements
============================================

Do the moduli of eleven grains (synthetic) agree with a calculated stiffness? A predictive p below
0.05 refutes it. The calculated C44 runs from 80 to 150 GPa here; the grains were made with 118 GPa.
"""

from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np

import bayesindent as bi

Path("grains.nml").write_text("""\
&problem symmetry = 'cubic', synthetic = .true. /
&measurements file = 'data/fe3si.csv' /
""")
values = range(80, 151, 10)
chances = []
for c44 in values:
    np.savetxt("calculated.txt", bi.stiffness("cubic", C11=225, C12=135, C44=c44))
    document = bi.tensor("grains.nml", "calculated.txt", relative_sd=0.03)
    chances.append(document["predictive_p"])
figure, axes = plt.subplots()
axes.semilogy(values, chances, "o-")
axes.axhline(0.05, color="black", linestyle="--")
axes.set(xlabel="calculated C44 (GPa)", ylabel="predictive p")
figure.savefig("calculated_tensor.png")
