"""`compare`: several runs side by side."""

import csv
import json
import math
from pathlib import Path

import arviz as az
import pytest

import bayesindent as bi
from bayesindent.common.result_files import read_json
from support.tree import SOURCE

CASE = f"""&problem symmetry = 'cubic', title = 'TITLE', synthetic = .true. /
&measurements file = '{SOURCE / "tests" / "reference" / "cubic_fe3si.csv"}', modulus_kind = 'KIND', calibration_sd = CALIBRATION /
&prior c_min = 50, 40, 15, c_max = 250, 150, 150, anisotropy_cap = 7.2 /
&sampler samples = 2000, burn_in = 2000, chains = 2, evidence = EVIDENCE /
"""


def extract(program, folder, name, kind="indentation_modulus", calibration=0.0, evidence=".true."):
    """A run of this name."""
    words = {"TITLE": name, "KIND": kind, "CALIBRATION": str(calibration), "EVIDENCE": evidence}
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
        "other": extract(
            bayesindent, tmp_path, "other", kind="effective_modulus", evidence=".false."
        ),
    }
    done = bayesindent("compare", "runs/plain", "runs/tip", "--json")
    assert done.returncode == 0, done.stderr
    document = json.loads(done.stdout)
    assert [run["run"] for run in document["runs"]] == ["plain", "tip"]
    assert document["same_data"] is True
    for item in document["differences"]:
        a, b = (summaries[name]["parameters"][item["constant"]] for name in ("plain", "tip"))
        assert item["difference_gpa"] == pytest.approx(b["mean"] - a["mean"])
        assert item["difference_sd"] == pytest.approx(
            (b["mean"] - a["mean"]) / math.hypot(a["sd"], b["sd"])
        )
    # ArviZ' own comparison of the files; without the ranks, of which it makes the better one the
    # first.
    stored = {
        name: az.from_netcdf(str(tmp_path / "runs" / name / "posterior.nc"), engine="h5netcdf")
        for name in ("plain", "tip")
    }
    loo = {name: az.loo(result, pointwise=True) for name, result in stored.items()}
    first, second = document["models"]
    # Names of ArviZ before its version 1, and since.
    one, each = (
        getattr(found, "loo_i", getattr(found, "elpd_i", None)).values
        for found in (loo["plain"], loo["tip"])
    )
    each = each - one
    assert first["elpd"] == pytest.approx(one.sum(), abs=0.02)
    assert second["elpd_difference"] == pytest.approx(each.sum(), abs=0.02)
    assert second["elpd_difference_sd"] == pytest.approx(
        math.sqrt(each.size) * each.std(), abs=0.02
    )
    evidence = [summaries[name]["evidence"] for name in ("plain", "tip")]
    assert second["log_z_difference"] == pytest.approx(evidence[1]["log_z"] - evidence[0]["log_z"])
    assert second["log_z_difference_sd"] == pytest.approx(
        math.hypot(evidence[0]["sd"], evidence[1]["sd"])
    )
    folder = tmp_path / "runs" / "compare"
    rows = list(
        csv.DictReader(
            line for line in (folder / "comparison.csv").open() if not line.startswith("#")
        )
    )
    assert [(row["run"], row["constant"]) for row in rows] == [
        (run, name) for run in ("plain", "tip") for name in ("C11", "C12", "C44")
    ]
    assert float(rows[3]["mean_gpa"]) == summaries["tip"]["parameters"]["C11"]["mean"]
    assert read_json(folder / "comparison.json") == document
    assert all((tmp_path / figure).read_bytes()[:4] == b"\x89PNG" for figure in document["figures"])
    assert {Path(figure).name for figure in document["figures"]} == {"forest.png", "overlay.png"}
    # The library says the same; its warnings are Python's, and files are written where they are
    # asked for.
    monkeypatch.chdir(tmp_path)
    before = set(folder.iterdir())
    assert json.loads(json.dumps(bi.compare("runs/plain", Path("runs/tip")))) == document | {
        "figures": []
    }
    assert set(folder.iterdir()) == before
    with pytest.warns(bi.BayesindentWarning) as told:
        other = bi.compare("runs/plain", "runs/other", output="new/folder", figures="svg")
    assert other["warnings"][0].startswith("the runs are of different measurements")
    assert (
        told[0].filename == __file__
        and [line.message.args[0] for line in told] == other["warnings"]
    )
    assert {path.name for path in Path("new/folder").iterdir()} == {
        "comparison.csv",
        "comparison.json",
        "forest.svg",
        "overlay.svg",
    }
    # Other measurements are compared with a word, and as people read it.
    done = bayesindent(
        "compare", "runs/plain", "runs/other", "runs/tip", "--output", "three", "--figures", "svg"
    )
    assert done.returncode == 0, done.stderr
    assert (
        "warning: the runs are of different measurements: evidence and leave-one-out are not "
        "compared" in done.stderr
    )
    assert {path.name for path in (tmp_path / "three").glob("*.svg")} == {
        "forest.svg",
        "overlay.svg",
    }
    assert "share their measurements" not in done.stdout
    assert "share their measurements" in bayesindent("compare", "runs/plain", "runs/tip").stdout
    line = next(line for line in done.stdout.splitlines() if line.startswith("C44")).split()
    item = summaries["plain"]["parameters"]["C44"]
    assert line[1:4] == [f"{item['mean']:.1f}", "±", f"{item['sd']:.1f}"]
    assert len(line) == 1 + 3 + 4 + 4
    # What cannot be compared.
    (tmp_path / "empty").mkdir()
    for folders, words in {
        ("runs/plain",): "compare: two or more results are needed",
        ("runs/plain", "nowhere"): "nowhere: there is no such folder of results",
        ("runs/plain", "runs/../runs/plain"): "runs/../runs/plain: is named twice",
        ("runs/plain", "empty"): "empty: there is no posterior in it",
    }.items():
        done = bayesindent("compare", *folders)
        assert done.returncode == 2
        assert done.stderr.startswith(words)
