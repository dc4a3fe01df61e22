"""Counting the cases of meson's tests: of pytest by its reports, else by lines of TAP."""

import re
from collections import Counter
from pathlib import Path
from xml.etree import ElementTree


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
