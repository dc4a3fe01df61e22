"""`size`: how thick a film or how large a grain must be."""

import json

import pytest

from bayesindent.pipeline.stage import run_stage
from bayesindent.settings.problem import Problem
from support.tree import SOURCE

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
        assert all(bias <= 0.01 for bias in beyond)
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


def sizes(folder, specimen: str, modulus) -> tuple[dict, list]:
    """The document of `size` of a crystal in a specimen whose modulus is what `modulus` makes of its &specimen, and all these."""
    made = []

    def simulate(job):
        made.append(Problem.parse("size", job.physics).settings.specimen)
        found = modulus(made[-1])
        return {"modulus_gpa": found} if found else {"message": "the contact leaves the refined zone"}

    (folder / "copper.csv").write_text("C11,C12,C44,phi1_deg,Phi_deg,phi2_deg\n168.4,121.4,75.4,0,0,0\n")
    text = "&problem symmetry = 'cubic' /\n&crystals points = 'copper.csv' /\n&simulation refine = 0.6 /\n&execution workers = 1 /\n"
    (folder / "a.nml").write_text(f"{text}&specimen {specimen} /\n")
    return run_stage(Problem(folder / "a.nml", "size"), "size", folder / "out", simulate=simulate), made


@pytest.mark.parametrize(
    ("biases", "smallest"),
    [
        # On a power law between two sizes; beyond the last as its inverse; the first where all are good.
        ({0.5: 0.08, 1.0: 0.08, 2.0: 0.04, 4.0: 0.005}, 2.0 * 2 ** (2 / 3)),
        ({0.5: 0.08, 1.0: 0.08, 2.0: -0.04, 4.0: -0.05, 8.0: 0.04, 16.0: 0.03, 32.0: -0.02}, 64.0),
        ({}, 0.5),
        (dict.fromkeys((0.5, 1.0, 2.0, 4.0, 8.0, 16.0, 32.0)), None),
        # A size without a modulus is passed over.
        ({0.5: 0.08, 1.0: 0.08, 2.0: 0.04, 4.0: None, 8.0: 0.005}, 2.0 * 4 ** (2 / 3)),
    ],
)
def test_the_smallest_size(tmp_path, biases, smallest):
    def modulus(specimen):
        bias = 0.0 if specimen.geometry == "halfspace" else biases.get(specimen.thickness_um, 0.002)
        return None if bias is None else 100 * (1 + bias)

    document, _ = sizes(tmp_path, "geometry = 'film', thickness_um = 1.0, substrate = 'rigid'", modulus)
    (row,) = document["results"]
    assert document["limit"] == 0.01 and row["halfspace_gpa"] == 100
    known = [size for size in (0.5, 1.0, 2.0, 4.0, 8.0, 16.0, 32.0) if biases.get(size, 0) is not None]
    assert row["size_um"] == known
    assert row["bias"] == pytest.approx([biases.get(size, 0.002) for size in known])
    assert row["smallest_um"] == (None if smallest is None else pytest.approx(smallest))
    assert len(document["warnings"]) == (len(known) < 7)


def test_a_cylinder_keeps_its_proportions(tmp_path):
    """Every size that is simulated has the depth over radius of the file; the surroundings are half and twice as stiff."""
    document, made = sizes(tmp_path, "geometry = 'grain', grain_radius_um = 4.0, grain_depth_um = 6.0", lambda specimen: 100.0)
    assert document["variable"] == "grain_radius_um"
    cylinders = [specimen for specimen in made if specimen.geometry == "grain"]
    assert (len(made), len(cylinders)) == (1 + 7 * 3, 7 * 3)
    assert all(specimen.grain_depth_um == pytest.approx(1.5 * specimen.grain_radius_um) for specimen in cylinders)
    assert sorted({specimen.grain_radius_um for specimen in cylinders}) == pytest.approx([0.5 * n for n in (3, 5, 8, 13, 20, 40, 80)])
    softer, _, stiffer = (row["young_gpa"] for row in document["results"])
    assert stiffer == pytest.approx(4 * softer)
    assert {specimen.matrix for specimen in cylinders} == {"self", "isotropic"}
