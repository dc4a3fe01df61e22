"""Build and run the tests; the last line counts the cases."""

import argparse
import json
import os
import subprocess
import sys
from collections import Counter
from pathlib import Path

from cases import count_cases

ROOT = Path(__file__).parents[2]
#: What a build that checks itself is made with.
SANITIZERS = (
    "-Db_sanitize=address,undefined",
    "-Db_lundef=false",
    "-Db_ndebug=false",
    "-Dbuildtype=debugoptimized",
    "-Dfortran_args=-fcheck=all,no-array-temps",
)


def main(argv=None) -> int:
    """Run the tests asked for and return an exit status."""
    parser = argparse.ArgumentParser(prog="bayesindent test", description=__doc__)
    parser.add_argument("names", nargs="*", metavar="NAME", help="a suite (unit, python, cli), a unit test, or part of a case's name (all)")
    parser.add_argument("--sanitize", action="store_true", help="of a build that checks addresses, undefined behaviour and bounds")
    arguments = parser.parse_args(argv)
    return run_tests(arguments.names, arguments.sanitize)


def run_tests(names: list[str], sanitize: bool) -> int:
    """Build and run the tests of these names (none: all), print the count of cases last, and return an exit status.

    A name is a suite, one of meson's tests, or else part of the names of cases of pytest. With `sanitize` it is a build of its own in
    build-sanitize/ that checks addresses, undefined behaviour and the bounds of arrays.
    """
    build = ROOT / ("build-sanitize" if sanitize else "build")
    if sanitize and not (build / "build.ninja").exists():
        meson("setup", "--reconfigure", ROOT, build, *SANITIZERS)
    known = json.loads(meson("introspect", "--tests", build, capture_output=True).stdout)
    suites = {test["name"]: {suite.rpartition(":")[-1] for suite in test["suite"]} for test in known}
    chosen = [name for name in suites if not names or name in names or suites[name] & set(names)]
    words = [name for name in names if name not in suites and name not in set().union(*suites.values())]
    patience = ["--timeout-multiplier", "10"] if sanitize else []
    count: Counter = Counter()
    if chosen:
        count += run_meson_tests(build, *patience, *chosen)
    if words:
        count += run_meson_tests(build, *patience, "python", "cli", f"--test-args=-k '{' or '.join(words)}'")
    skipped = f", {count['skipped']} skipped" if count["skipped"] else ""
    print(f"{count['passed']} passed, {count['failed']} failed{skipped}", flush=True)
    return 1 if count["failed"] or not count["passed"] else 0


def meson(*arguments: str | Path, **options) -> subprocess.CompletedProcess:
    """Run meson, and through it ninja, from the environment of this Python."""
    tools = Path(sys.executable).parent
    environment = os.environ | {"PATH": f"{tools}:{os.environ['PATH']}"}
    return subprocess.run([tools / "meson", *arguments], env=environment, stdin=subprocess.DEVNULL, **options)


def run_meson_tests(build: Path, *arguments: str) -> Counter:
    """Build, run some of meson's tests, and count their cases."""
    logs = build / "meson-logs"
    for report in [*logs.glob("*.junit.xml"), *logs.glob("testlog.json")]:
        report.unlink()
    status = meson("test", "-C", build, "--print-errorlogs", *arguments).returncode
    log = logs / "testlog.json"
    if not log.exists():
        sys.exit(f"meson could not build or start the tests (status {status})")
    entries = [json.loads(line) for line in log.read_text().splitlines()]
    return sum((count_cases(entry, logs) for entry in entries), Counter())
