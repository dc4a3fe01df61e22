"""The report shows what belongs to the present inputs, the answer first, and who decided it."""

import json
import re
from collections import defaultdict
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

import bayesindent as bi
from bayesindent.common.diagnostics import message
from bayesindent.crystal.elasticity import quantity_names
from bayesindent.program.cli import main
from bayesindent.report.figures import FIGURES
from bayesindent.report.formatting import (
    direction_name,
    latex,
    plus_minus,
    quantity_name,
    region,
    share_cells,
)
from bayesindent.report.results import Results
from bayesindent.report.sections import compliance_rows, tables
from bayesindent.report.summary import CONSEQUENCES, advice
from bayesindent.report.templates import read_data, render
from support.diagnostics import ROWS, filled
from support.theory_cases import theory_surrogate

COPPER, TUNGSTEN = (
    {"C11": 168.4, "C12": 121.4, "C44": 75.4},
    {"C11": 198.0, "C12": 140.0, "C44": 110.0},
)
ANGLES = [(0, 0, 0), (0, 30, 10), (0, 45, 0), (0, 54.7, 45), (10, 20, 30), (0, 40, 45)]
BOUNDS = "c_min = 50, 40, 15 c_max = 250, 150, 120"


def write_case(
    folder: Path,
    constants: dict,
    kind: str = "indentation_modulus",
    more: str = ", chains = 2",
    stages: str = "",
) -> Path:
    """A namelist with the moduli of a crystal by theory."""
    modulus = bi.halfspace_modulus(
        bi.stiffness("cubic", **constants), np.array(ANGLES, dtype=float)
    )
    rows = [
        ",".join(map(str, (*angles, m, 2.0)))
        for angles, m in zip(ANGLES, modulus.tolist(), strict=True)
    ]
    (folder / "grains.csv").write_text(
        "\n".join(["phi1_deg,Phi_deg,phi2_deg,modulus_gpa,sd_gpa", *rows]) + "\n"
    )
    file = folder / "case.nml"
    file.write_text(
        "&problem symmetry = 'cubic' /\n"
        "&surrogate file = 'halfspace' /\n"
        f"&measurements file = 'grains.csv' modulus_kind = '{kind}' /\n"
        f"&prior {BOUNDS} /\n"
        f"&sampler samples = 2000, burn_in = 1000 {more} /\n"
        f"&next sd_gpa = 3.0, count = 2 /\n{stages}"
    )
    return file


def headings(folder: Path) -> list[str]:
    """Of sections, and that of the table of suggestions."""
    text = (folder / "report.html").read_text()
    return re.findall("<h2>(.*?)</h2>", text) + re.findall("Which grain to measure next", text)


@pytest.mark.long
def test_results_of_other_inputs_are_not_shown(tmp_path, capsys):
    """Copper is measured, then tungsten: nothing of copper's may stand beside it."""
    output = tmp_path / "out"
    step_two, following = "The result in figures", "Which grain to measure next"
    assert main(["run", str(write_case(tmp_path, COPPER)), "--output", str(output)]) == 0
    assert {step_two, following} <= set(headings(output))
    file = str(write_case(tmp_path, TUNGSTEN))
    assert main(["extract", file, "--output", str(output)]) == 0
    assert main(["report", str(output)]) == 0
    assert step_two in headings(output)
    assert following not in headings(output)
    assert "left out, since made from other inputs" in (output / "report.html").read_text()
    # The other way round: a new suggestion does not bring back an old posterior.
    file = str(write_case(tmp_path, COPPER))
    assert main(["next", file, "--output", str(output)]) == 0
    assert main(["report", str(output)]) == 0
    assert following in headings(output)
    assert step_two not in headings(output)
    # Inputs that a stage does not need change nothing.
    (tmp_path / "points.csv").write_text(
        "C11,C12,C44,phi1_deg,Phi_deg,phi2_deg\n168.4,121.4,75.4,0,0,0\n"
    )
    file = str(write_case(tmp_path, COPPER, stages="&crystals points = 'points.csv' /\n"))
    assert main(["theory", file, "--output", str(output)]) == 0
    assert main(["report", str(output)]) == 0
    assert following in headings(output)


@pytest.mark.long
def test_a_stage_that_fails_leaves_no_results_of_other_inputs(tmp_path, monkeypatch, capsys):
    output = tmp_path / "out"
    assert main(["extract", str(write_case(tmp_path, COPPER)), "--output", str(output)]) == 0

    def failing(*_):
        raise bi.BayesindentError("no")

    monkeypatch.setattr("bayesindent.program.command.perform", failing)
    assert main(["extract", str(write_case(tmp_path, TUNGSTEN)), "--output", str(output)]) == 1
    assert main(["report", str(output)]) == 0
    assert headings(output) == ["Provenance"]


@pytest.mark.long
@pytest.mark.parametrize("kind", ["indentation_modulus", "effective_modulus", "sample_modulus"])
def test_every_kind_of_modulus_has_its_orientation_figure(tmp_path, kind, capsys):
    output = tmp_path / "out"
    assert main(["extract", str(write_case(tmp_path, COPPER, kind)), "--output", str(output)]) == 0
    assert main(["report", str(output), "--figures", "svg"]) == 0
    assert (output / "figures" / "orientations.svg").exists()


@pytest.mark.long
def test_a_surrogate_beside_the_namelist_is_found(tmp_path, monkeypatch, capsys):
    (tmp_path / "case").mkdir()
    file = write_case(tmp_path / "case", COPPER)
    theory_surrogate("cubic", 2, 4, points=400).save(tmp_path / "case" / "mine.nc")
    file.write_text(file.read_text().replace("'halfspace'", "'mine.nc'"))
    (tmp_path / "elsewhere").mkdir()
    monkeypatch.chdir(tmp_path / "elsewhere")
    assert main(["extract", str(file), "--output", "out"]) == 0
    assert main(["report", "out", "--figures", "svg"]) == 0
    assert Path("out/figures/orientations.svg").exists()


@pytest.mark.long
def test_one_chain(tmp_path, capsys):
    output = tmp_path / "out"
    assert (
        main(
            ["run", str(write_case(tmp_path, COPPER, more=", chains = 1")), "--output", str(output)]
        )
        == 0
    )
    assert json.loads((output / "summary.json").read_text())["parameters"]["C11"]["r_hat"] is None
    assert (
        "<td>C11</td><td>–</td>"
        in (output / "report.html").read_text().split("Convergence of 1 chains")[1]
    )


@pytest.mark.long
def test_shares_stand_beside_the_constants(tmp_path, capsys):
    output = tmp_path / "out"
    assert main(["extract", str(write_case(tmp_path, COPPER)), "--output", str(output)]) == 0
    lines = capsys.readouterr().out.splitlines()
    assert main(["report", str(output)]) == 0
    page = (output / "report.html").read_text()
    assert 'role="alert"' not in page
    for name, item in json.loads((output / "summary.json").read_text())["parameters"].items():
        cells = share_cells(item)
        assert (
            next(line for line in lines if line.startswith(name)).split()[6:]
            == " ".join(cells).split()
        )
        assert (
            re.findall("<td>(.*?)</td>", page.split(f"<td>{name}</td>")[1].split("</tr>")[0])[-4:]
            == cells
        )


def test_a_result_that_cannot_be_used(tmp_path, capsys, few_figures):
    """Too few draws: exit status 3, the reason first everywhere, and no grain to measure next."""
    output, file = tmp_path / "out", write_case(tmp_path, COPPER)
    file.write_text(file.read_text().replace("samples = 2000", "samples = 20"))
    assert main(["run", str(file), "--output", str(output)]) == 3
    words = "The result cannot be used: "
    first = capsys.readouterr().out.splitlines()[0]
    assert first.startswith(words)
    assert not (output / "next.json").exists()
    page = (output / "report.html").read_text()
    assert 'role="alert"' in page
    reason = first.removeprefix(words).split(",")[0]
    assert page.index(f"Not usable: {reason}") < page.index("Elastic constants in GPa")
    assert main(["extract", str(file), "--output", str(output), "--json"]) == 3
    captured = capsys.readouterr()
    document = json.loads(captured.out)
    assert not document["usable"]
    reasons = [found for found in document["warnings"] if found["severity"] == "unusable"]
    assert len(reasons) == 1 and reasons[0]["consequence"] == "draws"
    assert (
        captured.err.splitlines()[-2 - len(document["warnings"])]
        == f"{words}{document['reasons'][0]}"
        == f"{words}{message(reasons[0])}"
        == first
    )
    settings = {
        "symmetry": "cubic",
        "modulus_kind": "indentation_modulus",
        "samples": 20,
        "burn_in": 500,
        "chains": 2,
    }
    with pytest.warns(bi.BayesindentWarning) as told:
        bi.extract(tmp_path / "grains.csv", **settings)
    assert str(told[0].message).startswith(words.replace("The", "the"))
    assert told[0].message.diagnostic["severity"] == "unusable"


def test_shares_in_words():
    item = {
        "share": {"measurements": 0.223, "knowledge": 0.73, "prior": 0.047},
        "verdict": "not_determined",
    }
    assert share_cells(item) == ["22", "73", "5", "not determined"]
    assert share_cells({"share": dict.fromkeys(item["share"]), "verdict": "weak"}) == [
        "–",
        "–",
        "–",
        "weak",
    ]


def test_names_of_quantities():
    names = {
        "young[110]": "Young's modulus along [110]",
        "polycrystal_poisson": "Poisson's ratio of the polycrystal",
    }
    names |= {"bulk_modulus": "bulk modulus", "anisotropy_index": "anisotropy index", "C11": "C11"}
    assert {name: quantity_name(name) for name in names} == names
    for symmetry in ("cubic", "triclinic"):
        assert all("_" not in quantity_name(name) for name in quantity_names(symmetry))


def test_every_figure_has_a_section_and_a_name_of_its_own():
    call = r'part\("[^"]*", \[[^]]*\], "(\w+)"'
    shown = re.findall(call, read_data("report.html.j2"))
    assert {section for section, _ in FIGURES} == set(shown)
    assert len(set(shown)) == len(shown)
    names = [function.__name__ for _, function in FIGURES]
    assert len(set(names)) == len(names)


@pytest.mark.long
def test_what_was_asked_stands_first_and_all_is_numbered(tmp_path, capsys):
    output = tmp_path / "out"
    for command in ("extract", "next"):
        assert (
            main(
                [
                    command,
                    str(write_case(tmp_path, COPPER, "effective_modulus")),
                    "--output",
                    str(output),
                ]
            )
            == 0
        )
    assert main(["report", str(output), "--figures", "svg"]) == 0
    page = (output / "report.html").read_text()
    order = [
        'class="answer"',
        'aria-label="contents"',
        "Elastic constants in GPa",
        "<h2>What the result rests on",
        "If the moduli are 5 % too high",
        "<h2>What to do next",
        'class="warnings"',
        "Which grain to measure next",
        "What else to measure",
        "<h2>The result in figures",
        "Pairs of constants",
        "<h2>Grains and quantities",
        "Error budget",
        "and Zener ratio",
        "Products of powers",
        "<h2>Diagnostics",
        "<h2>Provenance",
        "effective_modulus of 6 grains",
        "indenter_modulus_gpa = 1140",
    ]
    places = [page.index(words) for words in order]
    assert places == sorted(places)
    for word in ("Table", "Figure"):
        numbers = [int(number) for number in re.findall(rf"<b>{word} (\d+)\.</b>", page)]
        assert numbers == list(range(1, len(numbers) + 1))
        assert len(numbers) > 5
    drawn = {path.stem for path in (output / "figures").iterdir()}
    assert drawn >= {
        "marginals",
        "orientations",
        "next_grains",
    }
    # What other inputs cannot make any more goes.
    for stage in ("next.json", "summary.json"):
        (output / stage).unlink()
    assert main(["report", str(output), "--figures", "svg"]) == 0
    assert not list((output / "figures").iterdir())


@pytest.mark.parametrize("count", [40, 41])
def test_more_than_forty_rows_are_folded(tmp_path, count):
    results = Results(tmp_path)
    row = {"euler_deg": [0.0, 0.0, 0.0], "indentation_modulus_gpa": 130.0}
    results.documents["simulate"] = {"results": [row] * count}
    results.simulations = [row] * count
    page = render(
        "report.html.j2", results=results, tables=tables(results), figures=defaultdict(list)
    )
    assert page.count("<td>130.00</td>") == count
    assert ("<details><summary>41 rows</summary>" in page) == (count > 40)


def test_an_empty_folder_has_no_report(tmp_path, capsys):
    assert main(["report", str(tmp_path)]) == 2
    assert "there are no results" in capsys.readouterr().err


def test_directions_in_four_indices():
    """x along [2-1-10], y along [01-10]: Cartesian components (u - (v + t)/2, (v - t) sqrt(3)/2, w)
    of [uvtw].
    """
    four = {(0, 0, 1): "[0001]", (1, 0, 0): "[21\u03051\u03050]", (0, 1, 0): "[011\u03050]"}
    assert {direction: direction_name(direction, True) for direction in four} == four
    assert direction_name((1, 0, 1), True) == "45° from [0001] to [21\u03051\u03050]"
    assert direction_name((0, 1, 1), True) == "45° from [0001] to [011\u03050]"
    assert direction_name((1, -1, 0), False) == "[11\u03050]"
    assert region({"within_deg": 2.0}, "6° from [0001]") == "6° from [0001], within 2°"
    assert region({"within_deg": 8.0}, "[001]") == "within 8° of [001]"
    assert latex("φ₁ of C11") == r"$\varphi_1$ of $C_{11}$"
    assert (
        quantity_name("young[101]", "hexagonal")
        == "Young's modulus at 45° from [0001] to [21\u03051\u03050]"
    )
    assert quantity_name("young[100]", "trigonal") == "Young's modulus along [21\u03051\u03050]"
    assert quantity_name("young[100]", "cubic") == "Young's modulus along [100]"


@pytest.mark.parametrize(
    ("sd", "words"),
    [(14.6, "153 ± 15"), (4.33, "153.0 ± 4.3"), (0.0272, "153.000 ± 0.027"), (0.0, "153.0 ± 0.0")],
)
def test_an_sd_has_two_digits(sd, words):
    assert plus_minus({"mean": 153.0, "sd": sd}) == words


def test_each_warning_stands_once_under_its_consequence():
    lower, upper = {"limit": 40, "percent": 7}, {"limit": 120, "percent": 12}
    few = {"effective": 80, "needed": 400}
    results = SimpleNamespace(
        warnings=[
            filled("table_changed", "row 3 has no angle"),
            filled("truncated", "lower limit of C12", lower),
            filled("few_draws", "C11", few),
            filled("not_mixed", "C12", {"r_hat": 1.2, "allowed": 1.05}),
            filled("truncated", "upper limit of C12", upper),
        ],
    )
    truncated = ROWS["truncated"]["sentence"]
    first = truncated.format(subject="lower limit of C12", **lower)
    second = truncated.format(subject="upper limit of C12", **upper)
    found = advice(results)
    # In the order of the headings; what cannot be used at all is told elsewhere.
    assert list(found) == [CONSEQUENCES[name] for name in ("undetermined", "draws", "inputs")]
    assert found == {
        CONSEQUENCES["undetermined"]: [
            f"{first[0].upper()}{first[1:]}; {second}. {ROWS['truncated']['remedy']}."
        ],
        CONSEQUENCES["draws"]: [
            f"{ROWS['few_draws']['sentence'].format(subject='C11', **few)}. "
            f"{ROWS['few_draws']['remedy']}."
        ],
        CONSEQUENCES["inputs"]: ["Row 3 has no angle."],
    }


def test_zener_ratio_and_compliances_of_copper():
    """Of a cubic crystal S11 = (C11 + C12)/((C11 - C12)(C11 + 2 C12)), S44 = 1/C44."""
    stiffness = bi.stiffness("cubic", **COPPER)[None]
    rows = compliance_rows(
        SimpleNamespace(symmetry="cubic", constants=tuple(COPPER), draws=lambda _: stiffness)
    )
    s11, zener = (
        1000 * (168.4 + 121.4) / ((168.4 - 121.4) * (168.4 + 2 * 121.4)),
        2 * 75.4 / (168.4 - 121.4),
    )
    expected = [s11, -s11 * 121.4 / (168.4 + 121.4), 1000 / 75.4, zener]
    assert [row[1] for row in rows] == [f"{value:.1f} ± 0.0" for value in expected]


def test_residuals_leave_out_what_all_grains_share():
    """Moduli that are 1.2 times the predicted ones, and two that are off by one and two sds."""
    mean, off = np.array([100.0, 110.0, 120.0, 130.0]), np.array([0.0, 0.0, 1.0, -2.0])
    measured = 1.2 * mean + 3.0 * off
    names = ("mean", "measured", "measured_sd")
    predicted = [dict(zip(names, row)) for row in zip(mean, measured, np.full(4, 3.0))]
    laboratory = {"log_factor": [{"prior_sd": 0.15}]}
    found = SimpleNamespace(extracted={"laboratory": laboratory}, predicted=predicted, scatter=0.0)
    found.shared_factor = Results.shared_factor.func(found)
    weights = mean / np.sum(mean**2)
    assert found.shared_factor == pytest.approx(weights @ measured)
    residuals = [Results.residual(found, item) for item in predicted]
    assert residuals == pytest.approx((measured - found.shared_factor * mean) / 3.0)
    # A factor that is known stays, and scatter makes the sds larger.
    laboratory["log_factor"][0]["prior_sd"] = 0.0
    assert Results.shared_factor.func(found) == 1.0
    found.shared_factor, found.scatter = 1.0, 0.04
    assert Results.residual(found, predicted[0]) == pytest.approx(20.0 / 5.0)
