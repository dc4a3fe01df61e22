"""Ctrl-C in a call of the library that samples for minutes: KeyboardInterrupt, and the next call is
as ever.
"""

import signal
import subprocess
import sys
import time

import pytest

from support.programs import HANGS_S
from support.tree import SOURCE

pytestmark = pytest.mark.long

CODE = """
import sys, time
import numpy as np
import bayesindent as bi

def draws(symmetry, **settings):
    settings |= {"modulus_kind": "indentation_modulus", "method": sys.argv[1], "chains": 2}
    posterior = bi.extract(FILE, symmetry=symmetry, **settings).posterior
    return np.stack([posterior[name] for name in bi.constants(symmetry)])

few = {"samples": 20, "burn_in": 20, "knowledge": {"bulk_modulus": (165, 3)}}
before = draws("cubic", **few)
print("begin", flush=True)
try:
    draws("triclinic", samples=1000000, burn_in=1000000)
except KeyboardInterrupt:
    print("interrupted", flush=True)
assert (draws("cubic", **few) == before).all()
print("the same", flush=True)
try:
    time.sleep(3600)
except KeyboardInterrupt:
    print("as ever", flush=True)
"""


@pytest.mark.parametrize("method", ["ensemble", "scmh"])
def test_extract_is_interrupted(method):
    code = CODE.replace("FILE", repr(str(SOURCE / "inputs" / "data" / "fe3si.csv")))
    # A job in the background of a shell ignores SIGINT, and so do its children.
    heed = lambda: signal.signal(signal.SIGINT, signal.default_int_handler)  # noqa: E731
    pipes = {"stdout": subprocess.PIPE, "stderr": subprocess.PIPE, "text": True}
    with subprocess.Popen(
        [sys.executable, "-c", code, method], **pipes, preexec_fn=heed
    ) as process:
        assert process.stdout.readline() == "begin\n", process.stderr.read()
        time.sleep(2)
        # Before samples that take hours have been drawn.
        process.send_signal(signal.SIGINT)
        assert process.stdout.readline() == "interrupted\n", process.stderr.read()
        assert process.stdout.readline() == "the same\n", process.stderr.read()
        time.sleep(0.5)
        process.send_signal(signal.SIGINT)
        assert process.communicate(timeout=HANGS_S)[0] == "as ever\n"
