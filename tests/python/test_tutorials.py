"""The code of every tutorial runs, and prints what its page says."""

import contextlib
import io
import json
import re
import subprocess
import sys

import pytest

from support.tree import SOURCE
from tools.notebooks import cells

pytestmark = pytest.mark.long

PAGES = sorted((SOURCE / "docs" / "tutorials").glob("*.md"))
NUMBER = r"-?\d+(?:\.\d+)?"


def agree(printed, shown):
    """The same words, and numbers within Monte Carlo errors and those of other processors: a fifth,
    or two units of the last digit.
    """
    assert re.sub(NUMBER, "#", printed) == re.sub(NUMBER, "#", shown)
    for one, other in zip(re.findall(NUMBER, printed), re.findall(NUMBER, shown), strict=True):
        assert float(one) == pytest.approx(
            float(other), rel=0.2, abs=2 * 10.0 ** -len(other.partition(".")[2])
        ), printed


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
    for language, block in re.findall(
        r"^```(python|text)\n(.*?)^```", page.read_text(), flags=re.M | re.S
    ):
        if language == "python":
            with contextlib.redirect_stdout(io.StringIO()) as output:
                exec(block, names)
            printed = output.getvalue()
        else:
            agree(printed, block)


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.stem)
def test_notebook_is_its_page(page):
    if not page.with_suffix(".ipynb").exists():
        assert page.stem not in ("own_table", "curves")
        return
    parts = cells(page.read_text(encoding="utf-8"))
    notebook = json.loads(page.with_suffix(".ipynb").read_text(encoding="utf-8"))["cells"]
    assert ["".join(cell["source"]) for cell in notebook] == [
        text for kind, text in parts if kind != "text"
    ]
    outputs = [output for cell in notebook for output in cell.get("outputs", [])]
    printed = ["".join(output["text"]) for output in outputs if output["output_type"] == "stream"]
    for one, other in zip(
        printed, [text + "\n" for kind, text in parts if kind == "text"], strict=True
    ):
        agree(one, other)
    assert any("image/png" in output.get("data", {}) for output in outputs)
