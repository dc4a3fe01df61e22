"""
A cubic crystal in three lines
==============================

Eleven grains of an iron alloy (synthetic moduli), and a bulk modulus of 165 ± 3 GPa. The figure has
the constants in pairs.
"""

import bayesindent as bi

known = {"bulk_modulus": (165, 3)}
result = bi.extract("data/fe3si.csv", "cubic", knowledge=known, technique="exact", seed=1)
bi.plot_pairs(result).savefig("cubic_in_three_lines.png")
