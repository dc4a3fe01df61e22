"""Runs the command-line program as a user does: as a process of its own."""

import os
import subprocess
import sys
from pathlib import Path

import pytest

SOURCE = Path(os.environ.get("BAYESINDENT_SOURCE", Path(__file__).parents[2]))
REFERENCE = SOURCE / "tests" / "reference"


@pytest.fixture
def bayesindent(tmp_path):
    """`bayesindent(*arguments)` in an empty folder gives the finished process."""

    def run(*arguments, **options) -> subprocess.CompletedProcess:
        command = [sys.executable, "-m", "bayesindent", *map(str, arguments)]
        return subprocess.run(command, cwd=tmp_path, capture_output=True, text=True, stdin=subprocess.DEVNULL, **options)

    return run
