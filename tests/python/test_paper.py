"""The author's pack: its numbers are those of the run, its figures have live text, and its cards
are read as the solvers' manuals say.
"""

import csv
import json
import re
import shutil
import subprocess
from types import SimpleNamespace

import numpy as np
import pytest

import bayesindent as bi
from bayesindent.common.progress import progress_bar
from bayesindent.lab.tensors import matrix_of_json
from bayesindent.program.cli import main
from bayesindent.report import drawing
from bayesindent.report.paper import card, methods
from bayesindent.report.results import Results
from support.programs import HANGS_S
from support.tree import SOURCE

CCX = shutil.which("ccx")
#: The order of the constants of *ELASTIC, TYPE=ANISO in the manuals of Abaqus and CalculiX.
ORDER = [
    "1111",
    "1122",
    "2222",
    "1133",
    "2233",
    "3333",
    "1112",
    "2212",
    "3312",
    "1212",
    "1113",
    "2213",
    "3313",
    "1213",
    "1313",
    "1123",
    "2223",
    "3323",
    "1223",
    "1323",
    "2323",
]
#: Voigt numbers of pairs, in the order 11, 22, 33, 23, 13, 12.
VOIGT = {"11": 0, "22": 1, "33": 2, "23": 3, "13": 4, "12": 5}


def any_stiffness() -> np.ndarray:
    """A stable stiffness (6, 6) in GPa without symmetry, all its numbers different."""
    factor = np.random.default_rng(11).standard_normal((6, 6))
    return 100 * np.eye(6) + 8 * (factor + factor.T)


def card_of(matrix, solver: str) -> str:
    names = [f"C{i}{j}" for i in range(1, 7) for j in range(i, 7)]
    parameters = {
        name: {"mean": matrix[int(name[1]) - 1, int(name[2]) - 1], "sd": 1.0} for name in names
    }
    results = SimpleNamespace(
        synthetic=False,
        title="a test",
        symmetry="triclinic",
        constants=names,
        extracted={"parameters": parameters},
    )
    return card(results, matrix, solver)


@pytest.mark.parametrize("solver", ["abaqus", "calculix"])
def test_cards_are_in_the_order_of_the_manuals(solver):
    matrix = any_stiffness()
    lines = card_of(matrix, solver).splitlines()
    start = next(i for i, line in enumerate(lines) if line.startswith("*ELASTIC"))
    numbers = [
        float(number) for line in lines[start + 1 :] for number in line.split(",") if number.strip()
    ]
    assert [len(line.rstrip(",").split(",")) for line in lines[start + 1 :]] == [8, 8, 5]
    assert numbers == pytest.approx(
        [1000 * matrix[VOIGT[key[:2]], VOIGT[key[2:]]] for key in ORDER], rel=1e-9
    )
    assert all(len(line) <= 132 for line in lines[start:])


@pytest.mark.skipif(
    CCX is None,
    reason="CalculiX (ccx) is not installed: its card is compared with the manual alone",
)
def test_calculix_reads_its_card(tmp_path):
    """Six strains of one brick: the stresses are the stiffness times the strain."""
    matrix = any_stiffness()
    corners = np.array(
        [(0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 1, 0), (0, 0, 1), (1, 0, 1), (1, 1, 1), (0, 1, 1)],
        dtype=float,
    )
    lines = [
        "*NODE, NSET=ALL",
        *(f"{i}, {x}, {y}, {z}" for i, (x, y, z) in enumerate(corners, start=1)),
    ]
    lines += [
        "*ELEMENT, TYPE=C3D8, ELSET=BRICK",
        "1, 1, 2, 3, 4, 5, 6, 7, 8",
        card_of(matrix, "calculix").rstrip(),
    ]
    lines += ["*SOLID SECTION, ELSET=BRICK, MATERIAL=CRYSTAL"]
    strains = []
    for k, (i, j) in enumerate([(0, 0), (1, 1), (2, 2), (1, 2), (0, 2), (0, 1)]):
        gradient = np.zeros((3, 3))
        gradient[i, j] += 0.5e-3
        gradient[j, i] += 0.5e-3
        strains.append(1e-3 * np.eye(6)[k])
        lines += ["*STEP", "*STATIC", "*BOUNDARY"]
        lines += [
            f"{n}, {a}, {a}, {u:.6e}"
            for n, x in enumerate(corners, start=1)
            for a, u in enumerate(gradient @ x, start=1)
        ]
        lines += ["*EL PRINT, ELSET=BRICK", "S", "*END STEP"]
    (tmp_path / "brick.inp").write_text("\n".join(lines) + "\n")
    done = subprocess.run(
        [str(CCX), "brick"], cwd=tmp_path, capture_output=True, text=True, timeout=HANGS_S
    )
    rows = [
        line.split()
        for line in (tmp_path / "brick.dat").read_text().splitlines()
        if re.match(r"\s+1\s+\d+\s+[-\d]", line)
    ]
    assert len(rows) == 6 * 8, done.stdout[-1000:]
    # Components xx, yy, zz, xy, xz, yz at eight points, equal in a brick of constant strain.
    stress = np.array(rows, dtype=float)[:, 2:].reshape(6, 8, 6).mean(axis=1)[:, [0, 1, 2, 5, 4, 3]]
    assert stress == pytest.approx(np.array(strains) @ (1000 * matrix), rel=1e-5, abs=1e-3)


#: The laboratory of a result whose factor and contrast are inferred.
LABORATORY = {
    "method": "scmh",
    "laboratory": {
        "log_factor": [{"mean": 0.0, "sd": 0.1, "prior_mean": 0.1, "prior_sd": 0.15}],
        "log_contrast": {"mean": 0.0, "sd": 0.1, "prior_mean": -0.15, "prior_sd": 0.4},
    },
}


def test_the_pack_has_the_numbers_of_the_run(tmp_path, monkeypatch, capsys):
    kept = [
        item for item in drawing.FIGURES if item[1].__name__ in ("grain_comparison", "validation")
    ]
    monkeypatch.setattr(drawing, "FIGURES", kept)
    file = tmp_path / "case.nml"
    file.write_text(
        "&problem symmetry = 'cubic', synthetic = .true. /\n"
        "&sampler samples = 600, burn_in = 500, chains = 2 /\n"
        f"&measurements file = '{SOURCE}/inputs/data/fe3si.csv' /\n"
        "&prior c_min = 150, 80, 60, c_max = 300, 200, 160 /\n"
    )
    output = tmp_path / "out"
    assert main(["report", str(tmp_path), "--paper"]) == 2
    assert "there is no posterior" in capsys.readouterr().err
    assert main(["extract", str(file), "--output", str(output)]) == 0
    # Figures take most of the time: a terminal sees how many are done.
    bars = []
    monkeypatch.setattr(
        "bayesindent.report.drawing.progress_bar",
        lambda *bar: bars.append(bar) or progress_bar(*bar),
    )
    assert main(["report", str(output), "--paper", "--json"]) == 0
    assert bars == [("figures", 4)]
    found = json.loads((output / "summary.json").read_text())["parameters"]
    paper = output / "paper"
    text = (paper / "methods.tex").read_text()
    assert "independence sampler" in text
    # As the sampler was, so it is described.
    results = Results(output)
    for change, words in (
        ({"independent_draws": None}, "Markov chains whose steps"),
        ({"method": "scmh"}, "single-component Metropolis--Hastings"),
        (LABORATORY, r"The logarithm of the contrast has the normal prior -0.15 $\pm$ 0.4."),
        (LABORATORY, r"of the factor of the laboratory has the normal prior 0.1 $\pm$ 0.15."),
    ):
        results.documents["extract"] = results.documents["extract"] | change
        described = methods(results)[0]
        assert words in described and "independence sampler" not in described
    for name, item in found.items():
        assert rf"${name[0]}_{{{name[1:]}}} = {item['mean']:.1f} \pm {item['sd']:.1f}$" in text
    assert text.startswith("% The data are synthetic")
    assert "11 grains" in text
    check = json.loads((output / "summary.json").read_text())["checks"]["misfit"]
    assert (
        f"is {check['chi_square']:.1f} for {check['freedom']:.0f} degrees of freedom "
        f"($p = {check['p']:.3f}$)" in text
    )
    # The file says nothing of the tip.
    assert "[State the shape and the radius of the tip" in text
    assert "paraboloid" not in text
    cited = {key for group in re.findall(r"\\cite\{(.*?)\}", text) for key in group.split(",")}
    assert cited == set(re.findall(r"@\w+\{(\w+),", (paper / "references.bib").read_text()))
    comment, header, *rows = (paper / "constants.csv").read_text().splitlines()
    assert comment.startswith("# Synthetic data. ")
    assert {row.split(",")[0]: row.split(",")[1] for row in rows} == {
        name: f"{item['mean']:.1f}" for name, item in found.items()
    }
    assert header.split(",")[0] == "constant"
    assert (paper / "constants.tex").read_text().count(r"\\") == 1 + len(rows)
    _, header, *draws = csv.reader((paper / "posterior.csv").open())
    assert header == ["chain", "draw", "C11_gpa", "C12_gpa", "C44_gpa"]
    table = np.array(draws, dtype=float)
    assert table[:, 2:].mean(axis=0) == pytest.approx(
        [found[name]["mean"] for name in ("C11", "C12", "C44")], rel=1e-9
    )
    expected = bi.stiffness(
        "cubic", **{name: found[name]["mean"] for name in ("C11", "C12", "C44")}
    )
    assert (
        f"{1000 * expected[0, 0]:.10g}, {1000 * expected[0, 1]:.10g},"
        in (paper / "stiffness_calculix.inp").read_text()
    )
    # The constants are a tensor again.
    for name, sd in (("json", {"relative_sd": 0.02}), ("csv", {})):
        again = bi.tensor(file, paper / f"stiffness.{name}", output=tmp_path / name, **sd)
        assert again["predictive_p"] > 0.05
    assert np.array(matrix_of_json(paper / "stiffness.json").split(), float) == pytest.approx(
        expected.ravel()
    )
    # What was known has its source, or a place for it.
    assert "state the source" not in text
    text, known = (
        file.read_text(),
        "&knowledge quantity = 'bulk_modulus', 'C44', mean = 165, 120, sd = 3, 40",
    )
    checksums = []
    for source in ("", ", source = 'a work of 1974', ''"):
        file.write_text(f"{text}{known}{source} /\n")
        assert main(["extract", str(file), "--output", str(output)]) == 0
        checksums.append(json.loads((output / "summary.json").read_text())["inputs"])
    # A source is no input of the posterior.
    assert checksums[0] == checksums[1]
    assert main(["report", str(output), "--paper"]) == 0
    text = (paper / "methods.tex").read_text()
    assert "(a work of 1974)" in text and text.count("[state the source") == 1
    # No figure of what the run has not got; of the others all five files, one for two columns.
    drawn = {path.stem for path in (paper / "figures").iterdir()}
    assert drawn == {"grain_comparison", "grain_comparison_wide"}
    for stem in ("grain_comparison",):
        wide = (paper / "figures" / f"{stem}_wide.pdf").read_bytes()
        assert b"/MediaBox [ 0 0 504 " in wide
        assert b"/CIDFontType2" in wide
        assert "<text" in (paper / "figures" / f"{stem}.svg").read_text()
        assert b"/CIDFontType2" in (paper / "figures" / f"{stem}.pdf").read_bytes()
        png = (paper / "figures" / f"{stem}.png").read_bytes()
        assert int.from_bytes(png[16:20], "big") == 2010
        assert len((paper / "figures" / f"{stem}.csv").read_text().splitlines()) > 8
    # The points of the residuals, by hand.
    rows = list(
        csv.DictReader((paper / "figures" / "grain_comparison.csv").read_text().splitlines()[1:])
    )
    drawn = sorted(float(row["y"]) for row in rows if row["panel"] == "2" and row["kind"] == "line")
    predicted = json.loads((output / "summary.json").read_text())["predicted"]
    assert drawn == pytest.approx(
        sorted((item["measured"] - item["mean"]) / item["measured_sd"] for item in predicted)
    )
