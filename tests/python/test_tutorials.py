"""The code of every tutorial runs, and prints what its page says."""

import contextlib
import io
import re
import subprocess
import sys

import pytest

from conftest import SOURCE

pytestmark = pytest.mark.long

PAGES = sorted((SOURCE / "docs" / "tutorials").glob("*.md"))
NUMBER = r"-?\d+(?:\.\d+)?"


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.stem)
def test_prints_what_it_says(page, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "data").symlink_to(SOURCE / "inputs" / "data")
    run = subprocess.run

    def as_installed(command, **options):
        """The commands of the package that is tested."""
        return run([sys.executable, "-m", *command], **options)

    monkeypatch.setattr(subprocess, "run", as_installed)
    names: dict = {"__name__": "tutorial"}
    printed = ""
    for language, block in re.findall(r"^```(python|text)\n(.*?)^```", page.read_text(), flags=re.M | re.S):
        if language == "python":
            with contextlib.redirect_stdout(io.StringIO()) as output:
                exec(block, names)
            printed = output.getvalue()
        else:
            assert re.sub(NUMBER, "#", printed) == re.sub(NUMBER, "#", block)
            for value, shown in zip(re.findall(NUMBER, printed), re.findall(NUMBER, block), strict=True):
                # Monte Carlo errors and other processors: a fifth, or two units of the last digit.
                assert float(value) == pytest.approx(float(shown), rel=0.2, abs=2 * 10.0 ** -len(shown.partition(".")[2])), printed
