"""Where the tests find the source tree and its reference values; the program as a user runs it, in a process of its own."""

import os
import subprocess
import sys
from pathlib import Path

import pytest

SOURCE = Path(os.environ.get("BAYESINDENT_SOURCE", Path(__file__).parents[1]))
REFERENCE = SOURCE / "tests" / "reference"
#: Whether the compiled core checks itself: AddressSanitizer reserves 20 TB of addresses.
SANITIZED = "libasan" in os.environ.get("LD_PRELOAD", "")
#: Files whose long chains, whole campaigns and pictures take hours in such a core; the other files run the same code in shorter cases.
LONG = {
    "test_calibration", "test_compare", "test_drive", "test_halfspace", "test_other_openmp", "test_paper", "test_readme", "test_report",
    "test_report_page", "test_run", "test_sensitivity_and_evidence", "test_tutorials",
}  # fmt: skip

#: The paper's domains as namelist groups.
DOMAIN = {
    "cubic": "&domain c_min = 50, 40, 15, c_max = 250, 150, 120, anisotropy_cap = 7.2 /\n",
    "hexagonal": "&domain c_min = 80, 40, 30, 70, 40, c_max = 240, 120, 90, 210, 90, anisotropy_cap = 66.2 /\n",
}

# Modules that tests share with each other and with the benchmarks.
sys.path += [str(SOURCE / "tests" / "benchmarks"), str(SOURCE / "tests" / "python")]
pytest_plugins = ["step_2_cases"]


@pytest.fixture
def bayesindent(tmp_path):
    """`bayesindent(*arguments)` in an empty folder gives the finished process."""

    def run(*arguments, **options) -> subprocess.CompletedProcess:
        command = [sys.executable, "-m", "bayesindent", *map(str, arguments)]
        return subprocess.run(command, cwd=tmp_path, capture_output=True, text=True, stdin=subprocess.DEVNULL, **options)

    return run


def pytest_collection_modifyitems(items):
    """Leave out what takes too long in a core that checks itself."""
    if SANITIZED:
        for item in items:
            if item.path.stem in LONG:
                item.add_marker(pytest.mark.skip(reason="hours under the sanitizers, which see its code in shorter cases"))


def pytest_sessionfinish(session, exitstatus):
    """Where cases were asked for by a name and none bears it, tell meson that nothing was to be done."""
    if exitstatus == pytest.ExitCode.NO_TESTS_COLLECTED and session.config.option.keyword:
        session.exitstatus = 77
