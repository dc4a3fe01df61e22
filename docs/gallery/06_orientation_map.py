"""
Orientations from an EBSD map
=============================

The program finds the grain of each indent in a map (synthetic: fourteen grains of copper). Four
marks relate the coordinates of the stage to those of the map. An indent in the wrong grain is a
wrong orientation: look at the map before you trust the constants.
"""

from pathlib import Path

import bayesindent as bi

Path("map.nml").write_text("""\
&problem symmetry = 'cubic', synthetic = .true. /
&measurements
  file = 'data/copper_map_indents.csv'
  ebsd = 'data/copper_map.ctf'
  ebsd_points = 'data/copper_map_points.csv'
/
""")
bi.map("map.nml", output="map")
Path("map/map.png").replace("orientation_map.png")
