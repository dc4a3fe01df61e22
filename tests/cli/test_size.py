"""`size`: how thick a film or how large a grain must be."""

import json

import pytest

import bayesindent.pipeline.specimen_size as specimen_size_module
from bayesindent.fe.indentation import Indentation
from bayesindent.pipeline.specimen_size import LIMIT, smallest_size
from conftest import SOURCE

FILE = """
&problem symmetry = 'cubic' /
&crystals points = 'copper.csv' /
&specimen geometry = 'film', thickness_um = 1.0, substrate_young_gpa = 163, substrate_nu = 0.223 /
&simulation refine = 0.6, depths = 3 /
"""


@pytest.mark.long
def test_films_of_copper(bayesindent, tmp_path):
    """The bias has the sign of the substrate, falls with the thickness, and is below the limit where the command says."""
    (tmp_path / "film.nml").write_text(FILE)
    (tmp_path / "copper.csv").write_text("C11,C12,C44,phi1_deg,Phi_deg,phi2_deg\n168.4,121.4,75.4,0,54.7356,45\n")
    done = bayesindent("size", "film.nml", "--json")
    assert done.returncode == 0, done.stderr
    document = json.loads(done.stdout)
    assert (document["variable"], document["contact_radius_um"], document["limit"]) == ("thickness_um", 0.5, 0.01)
    softer, stated, stiffer = document["results"]
    assert [row["surroundings"] for row in document["results"]] == ["softer", "as stated", "stiffer"]
    assert [row["young_gpa"] for row in document["results"]] == [81.5, 163, 326]
    for row, sign in ((softer, -1), (stated, 1), (stiffer, 1)):
        # Meshes of different sizes differ by some 0.2 % at this refine.
        large = [bias for bias in row["bias"] if abs(bias) > 0.004]
        assert len(large) >= 4 and all(sign * bias > 0 for bias in large)
        assert large == sorted(large, key=abs, reverse=True)
        beyond = [abs(bias) for size, bias in zip(row["size_um"], row["bias"], strict=True) if size >= row["smallest_um"]]
        assert all(bias <= LIMIT for bias in beyond)
    assert stated["smallest_um"] < min(softer["smallest_um"], stiffer["smallest_um"])
    output = tmp_path / "runs" / "film"
    assert (output / "size.png").stat().st_size > 5000
    page = bayesindent("report", output)
    assert page.returncode == 0, page.stderr
    assert "How far is far enough" in (output / "report.html").read_text()


def test_a_half_space_has_no_neighbours(bayesindent):
    done = bayesindent("size", SOURCE / "inputs" / "zinc.nml")
    assert done.returncode == 2
    assert "&specimen geometry: a 'halfspace' has no neighbours; allowed: film, grain" in done.stderr


def test_the_smallest_size():
    """On a power law between two sizes; beyond the last as its inverse; the first where all are good."""
    assert smallest_size([(1.0, 0.08), (2.0, 0.04), (4.0, 0.005)]) == pytest.approx(2.0 * 2 ** (2 / 3))
    assert smallest_size([(1.0, 0.08), (4.0, -0.02)]) == pytest.approx(8.0)
    assert smallest_size([(1.0, 0.005), (4.0, 0.002)]) == 1.0
    assert smallest_size([]) is None


def test_a_cylinder_keeps_its_proportions(bayesindent, monkeypatch, tmp_path):
    """Every size that is simulated has the depth over radius of the file."""
    made = []

    class Recorder(Indentation):
        def __init__(self, **settings):
            made.append(settings)
            super().__init__(**settings | {"refine": 0.6, "depths": 1})

    monkeypatch.setattr(specimen_size_module, "Indentation", Recorder)
    variable, multiples, around = specimen_size_module.SIZES["grain"]
    monkeypatch.setitem(specimen_size_module.SIZES, "grain", (variable, multiples[-2:], around))
    (tmp_path / "copper.csv").write_text("C11,C12,C44,phi1_deg,Phi_deg,phi2_deg\n168.4,121.4,75.4,0,0,0\n")
    (tmp_path / "grain.nml").write_text(
        "&problem symmetry = 'cubic' /\n&crystals points = 'copper.csv' /\n"
        "&specimen geometry = 'grain', grain_radius_um = 4.0, grain_depth_um = 6.0 /\n"
    )
    done = bayesindent("size", "grain.nml", "--json")
    assert done.returncode == 0, done.stderr
    assert json.loads(done.stdout)["variable"] == "grain_radius_um"
    cylinders = [settings for settings in made if settings["geometry"] == "grain"]
    assert len(cylinders) == 2 * 3
    assert all(settings["grain_depth_um"] == pytest.approx(1.5 * settings["grain_radius_um"]) for settings in cylinders)
