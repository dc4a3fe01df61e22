"""The batch program that tests and benchmarks run, and how a test runs a program as a process."""

import os
import subprocess
import sys
from pathlib import Path

from support.tree import BUILD

__all__ = ["BATCH", "HANGS_S", "SANITIZED", "runner", "with_tests"]

#: The batch program of the build, or the one beside this Python, where pip puts it.
BATCH = (
    BUILD / "fortran" / "bayesindent-batch"
    if BUILD
    else Path(sys.executable).with_name("bayesindent-batch")
)
#: Whether the compiled core checks itself: AddressSanitizer reserves 20 TB of addresses.
SANITIZED = "libasan" in os.environ.get("LD_PRELOAD", "")
#: Seconds after which a process counts as hung: ten times what the longest takes on a slow machine.
HANGS_S = 1200


def runner(program, folder):
    """`run(*arguments)` of a program in a folder; it returns the finished process."""

    def run(*arguments, **options) -> subprocess.CompletedProcess:
        pipes = {"capture_output": True, "text": True, "stdin": subprocess.DEVNULL}
        options = {"cwd": folder, "timeout": HANGS_S} | pipes | options
        return subprocess.run([*program, *map(str, arguments)], **options)

    return run


def with_tests() -> dict[str, str]:
    """The environment for a Python process that imports from tests/, as `support` and test files
    do.
    """
    paths = [str(Path(__file__).parents[1]), os.environ.get("PYTHONPATH", "")]
    return os.environ | {"PYTHONPATH": os.pathsep.join(filter(None, paths))}
