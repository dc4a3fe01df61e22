"""Namelists of small builds that both programs run, and the rows that they leave in
campaign.sqlite.
"""

import sqlite3
from contextlib import closing

from support.paper_domains import DOMAIN

__all__ = ["HEADER", "IMPORTED", "PAPER", "WIDE", "small", "stored"]

#: A build whose moduli come from elsewhere, by `--ask` and `--tell`.
IMPORTED = """\
&problem
  symmetry = 'cubic'
/
&simulation
  simulator = 'import'
/
&domain
  c_min = 50, 40, 15
  c_max = 250, 150, 120
  anisotropy_cap = 7.2
/
&surrogate
  degree = 2
  bandlimit = 4
/
&design
  n_candidates = 100
  budget = 10
/
"""
HEADER = "C11,C12,C44,phi1_deg,Phi_deg,phi2_deg"


def stored(folder) -> list:
    """The rows of the campaign in a folder, in order of position, which Python's own SQLite finds
    whole; none if there is no file.
    """
    path = folder / "campaign.sqlite"
    if not path.exists():
        return []
    with closing(sqlite3.connect(path, timeout=60)) as file:
        assert file.execute("PRAGMA integrity_check").fetchall() == [("ok",)]
        if not file.execute("SELECT * FROM sqlite_master").fetchall():
            return []
        return file.execute("SELECT * FROM simulation ORDER BY position").fetchall()


SMALL = """
&problem symmetry = '{symmetry}', seed = 3 /
{domain}&simulation simulator = '{simulator}', refine = 0.6 /
{surrogate}
&design n_candidates = 300, budget = {budget}, batch = 2, validation = 2 /
"""
CORRECTION = "&surrogate degree = 2 /"
PAPER = "&surrogate model = 'paper', degree = 1, bandlimit = 4 /"
WIDE = "&domain log_anisotropy_max = 1.0 /\n"


def small(tmp_path, **words):
    """A small build of a correction of cubic crystals with the theory, or as the words say."""
    words = {
        "symmetry": "cubic",
        "domain": DOMAIN["cubic"],
        "simulator": "theory",
        "budget": 20,
        "surrogate": CORRECTION,
    } | words
    (tmp_path / "small.nml").write_text(SMALL.format(**words))
