"""Fixtures that run both programs as a user does, the order of the cases, and the record of their
outcomes.

`./bayesindent test` leaves out the cases marked `long`, and `./bayesindent test --long` runs them.
Such a case takes more than some seconds, or needs another program. A case that is not long checks
the same in a smaller way.
"""

import sys
from pathlib import Path
from types import SimpleNamespace

import pytest

from bayesindent import core
from support import declared_operations
from support import few_figures as quick
from support.programs import BATCH, runner

pytest_plugins = ["support.step_2_cases"]


@pytest.fixture(autouse=True, scope="session")
def declared_values():
    """All calls of the core are compared with the declarations of its operations."""
    native, core.native = core.native, declared_operations.checked(core)
    yield
    core.native = native


@pytest.fixture
def bayesindent(tmp_path, monkeypatch, capsys):
    """`bayesindent(*arguments)` in an empty folder; it returns the exit status and what was
    printed.

    It calls the `main` of the program in this process, where the large libraries are imported
    already.
    """
    from bayesindent.program.cli import main

    def run(*arguments) -> SimpleNamespace:
        monkeypatch.chdir(tmp_path)
        capsys.readouterr()
        try:
            status = main([*map(str, arguments)])
        except SystemExit as ended:  # of argparse
            status = ended.code
        out, err = capsys.readouterr()
        return SimpleNamespace(returncode=status, stdout=out, stderr=err)

    return run


@pytest.fixture
def process(tmp_path):
    """The same in a process of its own."""
    return runner([sys.executable, "-m", "bayesindent"], tmp_path)


@pytest.fixture
def batch(tmp_path):
    """The same for `bayesindent-batch`."""
    return runner([BATCH], tmp_path)


@pytest.fixture
def few_figures():
    """Reports of this process draw a few quick figures alone."""
    with quick.few_figures():
        yield


@pytest.hookimpl(tryfirst=True)
def pytest_collection_modifyitems(items):
    """Keep cases in one process that share a fixture of their file or the posteriors of the
    reference data sets.

    `long_where(words)` marks those cases of a function as long whose parameters have one of these
    names.
    """
    for item in items:
        partly = item.get_closest_marker("long_where")
        if partly and {item.callspec.id, *item.callspec.id.split("-")} & set(partly.args):
            item.add_marker(pytest.mark.long)
        fixtures = item._fixtureinfo.name2fixturedefs
        if "results" in fixtures:
            symmetry = "hexagonal" if "[hexagonal" in item.name else "cubic"
            item.add_marker(pytest.mark.xdist_group(f"references {symmetry}"))
        elif any(definitions[-1].scope == "module" for definitions in fixtures.values()):
            item.add_marker(pytest.mark.xdist_group(item.path.stem))


class Cases:
    """Writes the outcome, the seconds and the name of each case to a file as soon as the case has
    ended.
    """

    def __init__(self, file: Path):
        self.file, self.seconds, self.outcome, self.reason = file, {}, {}, {}
        file.parent.mkdir(parents=True, exist_ok=True)
        file.write_text("")

    def pytest_runtest_logreport(self, report):
        name = report.nodeid
        if report.skipped and isinstance(report.longrepr, tuple):
            self.reason[name] = report.longrepr[2].removeprefix("Skipped: ")
        self.seconds[name] = self.seconds.get(name, 0.0) + report.duration
        if report.when == "call" or report.outcome != "passed":
            self.outcome[name] = report.outcome
        # A worker that has crashed reports nothing more of its case.
        if report.when == "teardown" or report.when == "???":
            with open(self.file, "a") as file:
                words = [self.outcome.get(name, "failed"), f"{self.seconds[name]:.2f}", name]
                file.write(f"{' '.join(words)}\t{self.reason.get(name, '')}\n")


def pytest_addoption(parser):
    parser.addoption(
        "--cases",
        type=Path,
        metavar="FILE",
        help="keep outcome, seconds and name of each case that has ended in this file",
    )


def pytest_configure(config):
    file = config.getoption("--cases")
    if file and not hasattr(config, "workerinput"):
        config.pluginmanager.register(Cases(file))
