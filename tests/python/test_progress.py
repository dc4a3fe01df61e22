"""Progress goes to standard error, only where it is wanted, with what is left."""

import os
import pty
import subprocess
import sys

from bayesindent.common.progress import progress_bar

#: A loop of 4 steps, of which three take half a second each, and one within it.
CODE = """
import time
from bayesindent.common.progress import progress_bar, show_progress
show_progress(True)
with progress_bar("outer", 4) as advance:
    for _ in range(3):
        time.sleep(0.5)
        with progress_bar("inner", 2) as step:
            step(1)
        advance(1)
"""


def test_silent_by_default(capfd):
    with progress_bar("simulations", 3) as advance:
        advance(1)
        advance()
    assert capfd.readouterr() == ("", "")


def test_a_terminal_sees_the_share_and_the_time_left():
    ours, its = pty.openpty()
    with subprocess.Popen([sys.executable, "-c", CODE], stderr=its) as process:
        os.close(its)
        seen = b""
        while piece := read(ours):
            seen += piece
    assert process.returncode == 0
    # Nothing in the first second; then one line that is written anew, and that is gone at the end.
    assert seen.count(b"outer: ") >= 1 and b"outer: 75 %, about 0 s left" in seen
    assert b"inner" not in seen and seen.endswith(b"\r\033[K") and b"\n" not in seen


def read(terminal: int) -> bytes:
    """What a process has written; nothing once it has ended."""
    try:
        return os.read(terminal, 1000)
    except OSError:
        return b""
