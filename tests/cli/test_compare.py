"""`compare`: several runs side by side."""

import csv
import itertools
import json
import math
from pathlib import Path

import arviz as az
import pytest

import bayesindent as bi
from bayesindent.common.diagnostics import labelled, message
from bayesindent.common.result_files import read_json
from support.tree import SOURCE

TABLE = SOURCE / "tests" / "reference" / "cubic_fe3si.csv"
CASE = f"""&problem symmetry = 'cubic', title = 'TITLE', synthetic = .true. /
&measurements file = '{TABLE}', modulus_kind = 'KIND', calibration_sd = CALIBRATION /
&prior c_min = 50, 40, 15, c_max = 250, 150, 150, anisotropy_cap = 7.2 /
&sampler samples = 1000, burn_in = 1000, chains = 2 /
"""


def extract(program, folder, name, kind="indentation_modulus", calibration=0.0):
    """A run of this name."""
    words = {"TITLE": name, "KIND": kind, "CALIBRATION": str(calibration)}
    text = CASE
    for word, value in words.items():
        text = text.replace(word, value)
    (folder / f"{name}.nml").write_text(text)
    done = program("extract", f"{name}.nml")
    assert done.returncode == 0, done.stderr
    return json.loads((folder / "runs" / name / "summary.json").read_text())


def test_compare(bayesindent, tmp_path, monkeypatch):
    summaries = {
        "plain": extract(bayesindent, tmp_path, "plain"),
        "tip": extract(bayesindent, tmp_path, "tip", calibration=0.02),
        "other": extract(bayesindent, tmp_path, "other", kind="effective_modulus"),
    }
    done = bayesindent("compare", "runs/plain", "runs/tip", "--json")
    assert done.returncode == 0, done.stderr
    document = json.loads(done.stdout)
    names = ["runs/plain", "runs/tip"]
    constants = ("C11", "C12", "C44")
    cells = [(row["constant"], row["run"]) for row in document["constants"]]
    assert cells == list(itertools.product(constants, names))
    for row in document["constants"]:
        a, b = (
            summaries[Path(name).name]["parameters"][row["constant"]]
            for name in (names[0], row["run"])
        )
        assert [row["mean_gpa"], row["sd_gpa"], row["low_95_gpa"], row["high_95_gpa"]] == [
            b["mean"],
            b["sd"],
            *b["hdi_95"],
        ]
        assert row["difference_sd"] == pytest.approx(
            (b["mean"] - a["mean"]) / math.hypot(a["sd"], b["sd"])
        )
    # Leave-one-out of the stored draws; ArviZ lists the best model first, and differences from it.
    stored = {
        name: az.from_netcdf(str(tmp_path / name / "posterior.nc"), engine="h5netcdf")
        for name in names
    }
    loo = {name: az.loo(result, pointwise=True) for name, result in stored.items()}
    # Names of ArviZ before its version 1, and since.
    each = {
        name: getattr(found, "loo_i", getattr(found, "elpd_i", None)).values
        for name, found in loo.items()
    }
    best, second = document["models"]
    assert [best["run"], second["run"]] == sorted(names, key=lambda name: -each[name].sum())
    for row in (best, second):
        assert row.get("elpd_loo", row.get("elpd")) == pytest.approx(
            each[row["run"]].sum(), abs=0.02
        )
    difference = each[best["run"]] - each[second["run"]]
    assert abs(second["elpd_diff"]) == pytest.approx(difference.sum(), abs=0.02)
    assert second["dse"] == pytest.approx(math.sqrt(difference.size) * difference.std(), abs=0.02)
    folder = tmp_path / "runs" / "compare"
    rows = list(csv.DictReader((folder / "comparison.csv").open()))
    assert [(row["constant"], row["run"]) for row in rows] == cells
    assert float(rows[1]["mean_gpa"]) == summaries["tip"]["parameters"]["C11"]["mean"]
    assert read_json(folder / "comparison.json") == document
    assert {path.name for path in folder.glob("[!.]*")} == {
        "comparison.csv",
        "comparison.json",
        "forest.png",
    }
    assert (folder / "forest.png").read_bytes()[:4] == b"\x89PNG"
    # The library returns the same; its warnings are Python's. It writes files only on request.
    monkeypatch.chdir(tmp_path)
    before = set(folder.iterdir())
    assert json.loads(json.dumps(bi.compare("runs/plain", Path("runs/tip")))) == document
    assert set(folder.iterdir()) == before
    with pytest.warns(bi.BayesindentWarning) as warned:
        other = bi.compare("runs/plain", "runs/other", output="new/folder")
    assert other["warnings"][0]["code"] == "compared_measurements"
    assert warned[0].filename == __file__
    assert [line.message.diagnostic for line in warned] == other["warnings"]
    assert [str(line.message) for line in warned] == [message(each) for each in other["warnings"]]
    assert {path.name for path in Path("new/folder").iterdir()} == {
        "comparison.csv",
        "comparison.json",
        "forest.png",
    }
    # Constants of runs of other measurements are compared under a warning.
    done = bayesindent("compare", "runs/plain", "runs/other", "runs/tip", "--output", "three")
    assert done.returncode == 0, done.stderr
    assert labelled(other["warnings"][0]) in done.stderr.splitlines()
    assert "models:" not in done.stdout
    assert "models:" in bayesindent("compare", "runs/plain", "runs/tip").stdout
    lines = [line.split() for line in done.stdout.splitlines() if line.startswith("C44")]
    assert [line[1] for line in lines] == ["runs/plain", "runs/other", "runs/tip"]
    item = summaries["plain"]["parameters"]["C44"]
    assert lines[0][2:] == [
        f"{value:.2f}" for value in (item["mean"], item["sd"], *item["hdi_95"], 0.0)
    ]
    # What cannot be compared.
    (tmp_path / "empty").mkdir()
    for folders, words in {
        ("runs/plain",): "compare: two or more different results are needed",
        ("runs/plain", "nowhere"): "nowhere: there is no such folder of results",
        ("runs/plain", "runs/plain/"): "compare: two or more different results are needed",
        ("runs/plain", "empty"): "empty: there is no posterior of its latest inputs in it",
    }.items():
        done = bayesindent("compare", *folders)
        assert done.returncode == 2
        assert done.stderr.startswith(words)
