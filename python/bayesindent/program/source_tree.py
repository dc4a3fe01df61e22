"""What only a source tree can do: run its tests, its linters and its benchmarks, and count its lines."""

import importlib.util
import json
import os
import re
import subprocess
import sys
from collections import Counter
from pathlib import Path
from xml.etree import ElementTree

from ..core import BayesindentError

__all__ = ["count_cases", "run_benchmark", "run_tests", "run_tool", "source_root"]

#: What a build that checks itself is made with.
SANITIZERS = (
    "-Db_sanitize=address,undefined",
    "-Db_lundef=false",
    "-Db_ndebug=false",
    "-Dbuildtype=debugoptimized",
    "-Dnative=false",
    "-Dfortran_args=-fcheck=all,no-array-temps",
)


def source_root() -> Path:
    """The root of the source tree: the launcher says where it is; otherwise the current folder must be it."""
    root = Path(os.environ.get("BAYESINDENT_SOURCE", "."))
    if not (root / "tests" / "meson.build").exists():
        raise BayesindentError(f"{root.resolve()} is no source tree of bayesindent; use ./bayesindent in one")
    return root


def run_tests(names: list[str], sanitize: bool = False) -> int:
    """Build and run the tests of these names (none: all), print the count of cases last, and return an exit status.

    A name is a suite, one of meson's tests, or else part of the names of cases of pytest. With `sanitize` it is a build of its own in
    build-sanitize/ that checks addresses, undefined behaviour and the bounds of arrays.
    """
    build = source_root() / ("build-sanitize" if sanitize else "build")
    if sanitize and not (build / "build.ninja").exists():
        meson("setup", "--reconfigure", source_root(), build, *SANITIZERS)
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
        raise BayesindentError(f"meson could not build or start the tests (status {status})")
    entries = [json.loads(line) for line in log.read_text().splitlines()]
    return sum((count_cases(entry, logs) for entry in entries), Counter())


def count_cases(entry: dict, logs: Path) -> Counter:
    """Count the cases of one of meson's tests: of pytest by the report that it leaves in `logs`, else by lines of TAP.

    A test that fails without a failed case (a crash, a timeout) counts as one failure more.
    """
    report = logs / f"{entry['name'].rsplit(':')[-1]}.junit.xml"
    if report.exists():
        suite = next(ElementTree.parse(report).iter("testsuite"))
        tests, failures, errors, skipped = (int(suite.get(key, 0)) for key in ("tests", "failures", "errors", "skipped"))
        count = Counter(passed=tests - failures - errors - skipped, failed=failures + errors, skipped=skipped)
    else:
        lines = re.findall(r"^(not )?ok\b([^\n]*)", entry.get("stdout", ""), re.MULTILINE)
        count = Counter("failed" if bad else "skipped" if "# SKIP" in rest.upper() else "passed" for bad, rest in lines)
        if not lines and entry["result"] == "OK":
            count["passed"] = 1
        if not lines and entry["result"] == "SKIP":
            count["skipped"] = 1
    if entry["result"] not in ("OK", "SKIP") and not count["failed"]:
        count["failed"] = 1
    return count


def run_benchmark(name: str, arguments: list[str]) -> int:
    """Run tests/benchmarks/bench_NAME.py of the source tree."""
    return run_script("benchmarks", "bench_", name, arguments)


def run_tool(name: str, arguments: list[str]) -> int:
    """Run tests/tools/NAME.py of the source tree."""
    return run_script("tools", "", name, arguments)


def run_script(folder: str, prefix: str, name: str, arguments: list[str]) -> int:
    """Run a script below tests/: its `main(arguments)` returns an exit status or nothing."""
    scripts = source_root() / "tests" / folder
    file = scripts / f"{prefix}{name}.py"
    specification = importlib.util.spec_from_file_location(file.stem, file)
    if not file.exists() or specification is None or specification.loader is None:
        known = ", ".join(sorted(path.stem.removeprefix(prefix) for path in scripts.glob(f"{prefix}*.py")))
        raise BayesindentError(f"there is no '{name}' in {scripts}; there are: {known or 'none'}")
    sys.path.insert(0, str(scripts))
    module = importlib.util.module_from_spec(specification)
    specification.loader.exec_module(module)
    return int(module.main(arguments) or 0)
