"""Where the tests find the source tree and its reference values; both programs as a user runs them; what becomes of each case.

A case marked `long` is left out of `./bayesindent test` and run by `./bayesindent test --long`: it takes more than some seconds, and what it
looks at another case looks at in a smaller way; or it needs another program.
"""

import sys
from pathlib import Path
from types import SimpleNamespace

import pytest

from support.programs import BATCH, runner

pytest_plugins = ["support.step_2_cases"]


@pytest.fixture
def bayesindent(tmp_path, monkeypatch, capsys):
    """`bayesindent(*arguments)` in an empty folder: exit status and what was printed, as a finished process has them.

    It is the program's main in this process, which has the libraries that take seconds to import; `process` is one of its own.
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
    """The same as a process of its own, as a user has it."""
    return runner([sys.executable, "-m", "bayesindent"], tmp_path)


@pytest.fixture
def batch(tmp_path):
    """The same of `bayesindent-batch`."""
    return runner([BATCH], tmp_path)


@pytest.hookimpl(tryfirst=True)
def pytest_collection_modifyitems(items):
    """Cases that share something costly run in one process: a fixture of their file, or the posteriors of the reference data sets.

    `long_where(words)`: of the cases of a function those are long whose parameters have one of these names.
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
    """Keeps what became of each case in a file as soon as it has ended: outcome, seconds, name."""

    def __init__(self, file: Path):
        self.file, self.seconds, self.outcome = file, {}, {}
        file.parent.mkdir(parents=True, exist_ok=True)
        file.write_text("")

    def pytest_runtest_logreport(self, report):
        name = report.nodeid
        self.seconds[name] = self.seconds.get(name, 0.0) + report.duration
        if report.when == "call" or report.outcome != "passed":
            self.outcome[name] = report.outcome
        # A worker that has crashed reports nothing more of its case.
        if report.when == "teardown" or report.when == "???":
            with open(self.file, "a") as file:
                file.write(f"{self.outcome.get(name, 'failed')} {self.seconds[name]:.2f} {name}\n")


def pytest_addoption(parser):
    parser.addoption("--cases", type=Path, metavar="FILE", help="keep outcome, seconds and name of each case that has ended in this file")


def pytest_configure(config):
    file = config.getoption("--cases")
    if file and not hasattr(config, "workerinput"):
        config.pluginmanager.register(Cases(file))
