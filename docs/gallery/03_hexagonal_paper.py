"""
A hexagonal crystal, with figures for a paper
=============================================

Grains of titanium (synthetic moduli) determine three combinations of the five constants. The
bulk modulus and the ratio C33/C11 add the rest. The report writes each figure in the width of a
column, with its numbers, tables and a paragraph of methods.
"""

from pathlib import Path

import bayesindent as bi

Path("titanium.nml").write_text("""\
&problem symmetry = 'hexagonal', synthetic = .true. /
&measurements file = 'data/titanium.csv' /
&knowledge
  quantity = 'bulk_modulus', 'C33/C11'
  mean = 107, 1.11
  sd = 3, 0.02
/
""")
bi.run("titanium.nml", output="titanium")
bi.report("titanium", paper=True)
for name in ("pairs", "orientations"):
    figure = Path("titanium/paper/figures", f"{name}.png")
    figure.replace(f"hexagonal_{name}.png")
