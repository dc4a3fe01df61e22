"""Build and run the tests: those of every day; with --long all others.

The last lines are the ten slowest cases and the count. Each case is written to
build/meson-logs/*.txt as soon as it has ended, so that a run that is killed leaves its results.
"""

import argparse
import json
import os
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import NamedTuple

ROOT = Path(__file__).parents[2]
UNITS = ROOT / "tests" / "fortran"
#: What is built for all other tests.
EVERYTHING = ("--ninja-args=all,meson-test-prereq",)
#: Options of a build that checks addresses, undefined behaviour and bounds.
SANITIZERS = (
    "-Db_sanitize=address,undefined",
    "-Db_lundef=false",
    "-Db_ndebug=false",
    "-Ddebug=true",
    "-Doptimization=1",
    "-Dfortran_args=-fcheck=all,no-array-temps",
)


class Case(NamedTuple):
    """One case that has ended: 'passed', 'failed' or 'skipped', how long it took, and its name."""

    outcome: str
    seconds: float
    name: str
    #: Why it was skipped.
    reason: str = ""


def main(argv=None) -> int:
    """Run the tests asked for and return an exit status."""
    parser = argparse.ArgumentParser(
        prog="bayesindent test",
        description=__doc__,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    parser.add_argument(
        "names",
        nargs="*",
        metavar="NAME",
        help="a suite (unit, python, long), a unit test, or part of the name of cases of pytest",
    )
    parser.add_argument(
        "--long",
        action="store_true",
        help="the long cases: whole examples, calibration, kills, other programs",
    )
    parser.add_argument(
        "--sanitize",
        action="store_true",
        help="of a build that checks addresses, undefined behaviour and bounds",
    )
    arguments = parser.parse_args(argv)
    names = arguments.names or (["unit-long", "long"] if arguments.long else ["unit", "python"])
    build = ROOT / ("build-sanitize" if arguments.sanitize else "build")
    if arguments.sanitize and not (build / "build.ninja").exists():
        meson("setup", "--reconfigure", ROOT, build, *SANITIZERS)
    # Programs of unit tests alone need no others.
    units = [f"test_{name}" for name in names if (UNITS / f"test_{name}.f90").exists()]
    targets = [*units, "bayesindent-batch"] if len(units) == len(names) else EVERYTHING
    if meson("compile", "-C", build, *targets, stdout=sys.stderr).returncode:
        return 1
    return run_tests(build, names)


def run_tests(build: Path, names: list[str]) -> int:
    """Run the tests of these names in a build and return an exit status."""
    known = {
        test["name"]: test
        for test in json.loads(meson("introspect", "--tests", build, stdout=subprocess.PIPE).stdout)
    }
    suites = {}
    for name, test in known.items():
        # With the name of the project before a colon.
        suites[name] = {suite.rpartition(":")[-1] for suite in test["suite"]}
    runners = ("python", "long")
    programs = [
        name for name in known if name not in runners and ({name} | suites[name]) & set(names)
    ]
    words = [name for name in names if name not in known and name not in ("unit", "unit-long")]
    logs = build / "meson-logs"
    for old in [*logs.glob("*.junit.xml"), *logs.glob("cases-*.txt"), logs / "testlog.json"]:
        old.unlink(missing_ok=True)
    good = True
    cases: list[Case] = []
    if programs:
        # Suites that are named are run, even if a plain `meson test` leaves them out.
        named = set().union(*(suites[name] for name in programs))
        chosen = [f"--suite={suite}" for suite in sorted(named)]
        good = (
            meson(
                "test", "-C", build, "--no-rebuild", "--print-errorlogs", *chosen, *programs
            ).returncode
            == 0
        )
        cases += unit_cases(logs / "testlog.json")
    runs: list[tuple[str, list[str]]] = [(name, []) for name in runners if name in names]
    if words:
        runs.append(("python", ["-m", "long or not long", "-k", " or ".join(words)]))
    for name, more in runs:
        test = known[name]
        status = subprocess.run(
            [*test["cmd"], *more], env=os.environ | test["env"], stdin=subprocess.DEVNULL
        ).returncode
        found = pytest_cases(logs / f"cases-{name}.txt")
        # Status 5 means that no case was collected. A crash of pytest itself appears as no failed
        # case.
        good &= status in (0, 5)
        cases += found
    return conclude(cases, good, logs / "not-checked.txt")


def conclude(cases: list[Case], good: bool, file: Path) -> int:
    """Print the slowest cases, what was not checked, and the count; return an exit status. `file`
    has what was not checked, too. With BAYESINDENT_STRICT=1 that counts as a failure.
    """
    outcomes = [case.outcome for case in cases]
    count = {outcome: outcomes.count(outcome) for outcome in ("passed", "failed", "skipped")}
    if not good and not count["failed"]:
        print("the tests ended abnormally", file=sys.stderr)
        count["failed"] = 1
    print("The slowest:")
    for case in sorted(cases, key=lambda case: -case.seconds)[:10]:
        print(f"{case.seconds:7.1f} s  {case.name}")
    lines = [f"{case.name}: {case.reason}" for case in cases if case.outcome == "skipped"]
    if file.parent.is_dir():
        file.write_text("".join(f"{line}\n" for line in lines))
    print(*(f"not checked: {line}" for line in lines), sep="\n")
    strict = os.environ.get("BAYESINDENT_STRICT") == "1" and bool(lines)
    skipped = f", {count['skipped']} skipped" if count["skipped"] else ""
    print(f"{count['passed']} passed, {count['failed']} failed{skipped}", flush=True)
    return 1 if strict or count["failed"] or not count["passed"] else 0


def unit_cases(log: Path) -> Iterator[Case]:
    """The cases of the unit tests, lines of TAP; the first of each program has its seconds."""
    for line in log.read_text().splitlines() if log.exists() else []:
        entry = json.loads(line)
        name, seconds = entry["name"].rpartition(":")[-1].strip(), entry["duration"]
        reported = [
            text
            for text in entry.get("stdout", "").splitlines()
            if text.startswith(("ok", "not ok"))
        ]
        for text in reported or ["ok" if entry["result"] == "OK" else "not ok"]:
            outcome = (
                "failed"
                if text.startswith("not")
                else "skipped"
                if "# SKIP" in text.upper()
                else "passed"
            )
            yield Case(outcome, seconds, f"unit {name}")
            seconds = 0.0
        if (
            entry["result"] != "OK"
            and reported
            and not any(text.startswith("not") for text in reported)
        ):
            yield Case("failed", 0.0, f"unit {name}: {entry['result']}")


def pytest_cases(log: Path) -> Iterator[Case]:
    """The cases that tests/conftest.py has recorded."""
    for line in log.read_text().splitlines() if log.exists() else []:
        found, _, reason = line.partition("\t")
        outcome, seconds, name = found.split(maxsplit=2)
        yield Case(outcome, float(seconds), name, reason)


def meson(*arguments: str | Path, **options) -> subprocess.CompletedProcess:
    """Run meson, and through it ninja, from the environment of this Python."""
    tools = Path(sys.executable).parent
    environment = os.environ | {"PATH": f"{tools}:{os.environ['PATH']}"}
    return subprocess.run(
        [tools / "meson", *arguments],
        env=environment,
        stdin=subprocess.DEVNULL,
        text=True,
        **options,
    )


if __name__ == "__main__":
    sys.exit(main())
