"""What only a source tree can do: run all the tests, and run the benchmarks."""

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

__all__ = ["count_cases", "run_benchmark", "run_tests", "source_root"]


def source_root() -> Path:
    """The root of the source tree: the launcher says where it is; otherwise the current folder must be it."""
    root = Path(os.environ.get("BAYESINDENT_SOURCE", "."))
    if not (root / "tests" / "meson.build").exists():
        raise BayesindentError(f"{root.resolve()} is no source tree of bayesindent; use ./bayesindent in one")
    return root


def run_tests(suites: list[str]) -> int:
    """Build and run the tests of these suites (none: all) by meson; print the count of cases last; return an exit status."""
    build = source_root() / "build"
    for report in build.glob("meson-logs/*.junit.xml"):
        report.unlink()
    log = build / "meson-logs" / "testlog.json"
    log.unlink(missing_ok=True)
    tools = Path(sys.executable).parent
    command = [tools / "meson", "test", "-C", build, "--print-errorlogs"]
    command += [argument for suite in suites for argument in ("--suite", suite)]
    environment = os.environ | {"PATH": f"{tools}:{os.environ['PATH']}"}
    status = subprocess.run(command, env=environment, stdin=subprocess.DEVNULL).returncode
    if not log.exists():
        raise BayesindentError(f"meson could not build or start the tests (status {status})")
    entries = [json.loads(line) for line in log.read_text().splitlines()]
    count = sum((count_cases(entry, build / "meson-logs") for entry in entries), Counter())
    skipped = f", {count['skipped']} skipped" if count["skipped"] else ""
    print(f"{count['passed']} passed, {count['failed']} failed{skipped}", flush=True)
    return 1 if status or count["failed"] or not count["passed"] else 0


def count_cases(entry: dict, logs: Path) -> Counter:
    """Count the cases of one of meson's tests: of pytest by the report that it leaves in `logs`, else by lines of TAP.

    A test that fails without a failed case (a crash, a timeout) counts as one failure more.
    """
    report = logs / f"{entry['name'].rsplit(':')[-1]}.junit.xml"
    if report.exists():
        suite = next(ElementTree.parse(report).iter("testsuite"))
        count = Counter(failed=int(suite.get("failures")) + int(suite.get("errors")), skipped=int(suite.get("skipped")))
        count["passed"] = int(suite.get("tests")) - count["failed"] - count["skipped"]
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
    """Run tests/benchmarks/bench_NAME.py of the source tree: its `main(arguments)` returns an exit status or nothing."""
    folder = source_root() / "tests" / "benchmarks"
    file = folder / f"bench_{name}.py"
    if not file.exists():
        known = ", ".join(sorted(path.stem.removeprefix("bench_") for path in folder.glob("bench_*.py")))
        raise BayesindentError(f"there is no benchmark '{name}' in {folder}; there are: {known or 'none'}")
    sys.path.insert(0, str(folder))
    specification = importlib.util.spec_from_file_location(file.stem, file)
    module = importlib.util.module_from_spec(specification)
    specification.loader.exec_module(module)
    return int(module.main(arguments) or 0)
