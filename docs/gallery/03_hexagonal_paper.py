"""
A hexagonal crystal, with figures for a paper
=============================================

Grains of titanium (synthetic moduli) determine three combinations of the five constants. The
bulk modulus and the ratio C33/C11 add the rest. The report writes each figure in the width of a
column, with its numbers, tables and a paragraph of methods.
"""

import shutil

import bayesindent as bi

result = bi.extract(
    "data/titanium.csv",
    "hexagonal",
    technique="exact",
    knowledge={"bulk_modulus": (107, 3), "C33/C11": (1.11, 0.02)},
    seed=1,
)
bi.report(result, "titanium", paper=True)
for name in ("pairs", "orientations"):
    shutil.copy(f"titanium/paper/figures/{name}.png", f"hexagonal_{name}.png")
