"""Every script of the gallery runs and draws its pictures."""

import ast
import contextlib
import io
import runpy
import warnings

import matplotlib as mpl
import pytest
from PIL import Image

from support.tree import SOURCE

FOLDER = SOURCE / "docs" / "gallery"
SCRIPTS = sorted(FOLDER.glob("*.py"))
SHORT = ("02_cubic_in_three_lines", "09_own_finite_elements")
#: Numbers that scripts print: the text before, and the value that the data were made with.
PRINTED = {"01_measured_titanium": "oliver_pharr: C44 = ", "05_curves": "C44 "}
LITERATURE = {"01_measured_titanium": 46.7, "05_curves": 75.4}


def marked(script):
    marks = () if script.stem in SHORT else (pytest.mark.long,)
    return pytest.param(script, id=script.stem, marks=marks)


@pytest.mark.parametrize("script", map(marked, SCRIPTS))
def test_draws_its_pictures(script, tmp_path, monkeypatch):
    if script.stem == "06_orientation_map":
        pytest.importorskip("orix")
    monkeypatch.chdir(tmp_path)
    (tmp_path / "data").symlink_to(FOLDER / "data", target_is_directory=True)
    with (
        mpl.rc_context({"backend": "agg"}),
        warnings.catch_warnings(),
        contextlib.redirect_stdout(io.StringIO()) as printed,
    ):
        warnings.simplefilter("ignore")
        runpy.run_path(str(script))
    pictures = list(tmp_path.glob("*.png"))
    assert pictures
    for picture in pictures:
        with Image.open(picture) as image:
            # An empty page has one colour.
            assert len(image.convert("RGB").getcolors(1 << 24)) > 20
    if before := PRINTED.get(script.stem):
        mean, sd = printed.getvalue().partition(before)[2].split(" GPa")[0].split(" ± ")
        assert abs(float(mean) - LITERATURE[script.stem]) < 2 * float(sd)


def test_there_are_ten_short_scripts():
    assert len(SCRIPTS) == 10
    for script in SCRIPTS:
        text = script.read_text(encoding="utf-8")
        docstring, *body = ast.parse(text).body
        assert len(text.splitlines()[docstring.end_lineno :]) <= 32
        assert sum(len(ast.unparse(part).splitlines()) for part in body) <= 30
        said = docstring.value.value
        assert (
            "synthetic" in said or "measured" in said or "Exact theory" in said or "formula" in said
        )
