"""Progress goes to standard error, only where it is wanted, with what is left."""

import re
import subprocess
import sys

from bayesindent.common.progress import progress_bar

#: A loop of 4 steps, of which three take 3.5 s each, and one within it.
CODE = """
import time
from bayesindent.common.progress import progress_bar, show_progress
show_progress(True)
with progress_bar("outer", 4) as advance:
    for _ in range(3):
        time.sleep(3.5)
        with progress_bar("inner", 2) as step:
            step(1)
        advance(1)
    advance(1)
"""


def test_silent_by_default(capfd):
    with progress_bar("simulations", 3) as advance:
        advance(1)
        advance()
    assert capfd.readouterr() == ("", "")


def test_the_share_and_the_time_left():
    """Nothing in ten seconds; then one plain line, and none within the next ten seconds."""
    done = subprocess.run([sys.executable, "-c", CODE], capture_output=True, text=True, check=True)
    assert done.stdout == ""
    assert re.fullmatch(r"outer: 75 %, about \d+ s left\n", done.stderr)
