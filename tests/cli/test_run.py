"""From indentations to elastic constants on the command line, on a reduced quickstart."""

import html.parser
import json
import os
import signal
import subprocess
import sys
import time

import pytest

from bayesindent.common.result_files import read_json
from support.campaigns import count_rows
from support.diagnostics import of_code
from support.programs import HANGS_S
from support.tree import REFERENCE, SOURCE

FILES = [
    "build.json",
    "campaign.sqlite",
    "next.json",
    "posterior.nc",
    "report.html",
    "resolved.nml",
    "run.log",
    "summary.json",
    "surrogate.txt",
]


def reduced_quickstart(folder, further="", **replacements):
    """The quickstart with few simulations and short chains, and further groups."""
    text = (SOURCE / "inputs" / "quickstart.nml").read_text()
    text = text.replace(
        "data/copper_grains.csv", str(SOURCE / "inputs" / "data" / "copper_grains.csv")
    )
    for old, new in replacements.items():
        lines = [line for line in text.splitlines() if line.strip().startswith(f"{old} =")]
        assert lines, f"the quickstart has no {old}"
        for line in lines:
            text = text.replace(line, f"  {old} = {new}")
    file = folder / "reduced.nml"
    file.write_text(text + further)
    return file


SMALL = {"budget": 10, "samples": 2000}
#: On a coarse mesh, which is some per cent too stiff.
SMALLEST = {
    "budget": 9,
    "samples": "300, burn_in = 1000",
    "chains": 2,
    "further": "&simulation refine = 0.7, depths = 4 /\n&surrogate degree = 2 /\n",
}
#: What the synthetic moduli of the quickstart were made with, GPa.
TRUTH = {"C11": 168.4, "C12": 121.4, "C44": 75.4}


@pytest.fixture(
    params=[SMALLEST, pytest.param(SMALL, marks=pytest.mark.long)], ids=["smallest", "small"]
)
def finished(request, process, tmp_path):
    file = reduced_quickstart(tmp_path, **request.param)
    done = process("run", file, "--json")
    assert done.returncode == 0, done.stderr
    return file, json.loads(done.stdout), tmp_path / "runs" / "reduced"


def test_whole_path(finished, bayesindent, request):
    file, document, output = finished
    budget = request.node.callspec.params["finished"]["budget"]
    assert set(FILES) <= {path.name for path in output.iterdir()}
    assert list(document) == ["build", "extract", "next", "report", "warnings"]
    assert document["build"]["new_simulations"] == document["build"]["simulations"] == budget
    assert set(document["extract"]["parameters"]) == {"C11", "C12", "C44"}
    # The constants of the grain and not of the pair, which theory of the half-space alone misses.
    for name, item in document["extract"]["parameters"].items():
        assert abs(item["mean"] - TRUTH[name]) < 3.5 * item["sd"]
    alone = document["extract"]["theory_alone"]["C44"]
    assert abs(alone["mean"] - TRUTH["C44"]) > 2.5 * alone["sd"]
    assert read_json(output / "summary.json") == document["extract"]
    page = (output / "report.html").read_text()
    check_page(page)
    again = json.loads(
        bayesindent("run" if budget == SMALL["budget"] else "build", file, "--json").stdout
    )
    assert again.get("build", again)["new_simulations"] == 0
    if "extract" in again:
        assert again["extract"]["parameters"] == document["extract"]["parameters"]
    # A surrogate that was built predicts.
    points = ("--points", SOURCE / "inputs" / "data" / "isotropic.csv", "--symmetry", "cubic")
    predicted = bayesindent("predict", "--surrogate", output / "surrogate.txt", *points)
    assert predicted.returncode == 0, predicted.stderr
    header, row = predicted.stdout.splitlines()
    assert header == "C11,C12,C44,phi1_deg,Phi_deg,phi2_deg,modulus_gpa,sd_gpa"
    modulus, sd = map(float, row.split(",")[-2:])
    # The tungsten around it is stiffer than this grain.
    assert 1.02 * 200 / 0.91 < modulus < 1.2 * 200 / 0.91
    assert 0 < sd < 10


@pytest.mark.long
def test_step_two_alone(process):
    """Titanium: no simulation is needed, and what the data decide is what the reference posterior
    says.
    """
    done = process("run", SOURCE / "inputs" / "titanium.nml", "--json")
    assert done.returncode == 0, done.stderr
    document = json.loads(done.stdout)
    assert list(document) == ["extract", "next", "report", "warnings"]
    reference = json.loads((REFERENCE / "hex_titanium.json").read_text())
    for item, mean, sd in zip(
        document["extract"]["predicted"],
        reference["predicted_mean"],
        reference["predicted_sd"],
        strict=True,
    ):
        assert item["mean"] == pytest.approx(mean, abs=0.2)
        assert item["sd"] == pytest.approx(sd, rel=0.06)
    truncated = of_code(document["warnings"], "truncated")
    assert "lower limit of C12" in [found["subject"] for found in truncated]


class Page(html.parser.HTMLParser):
    """What matters of a page: that its elements close, its pictures have words, and nothing comes
    from elsewhere.
    """

    def __init__(self):
        super().__init__()
        self.open, self.pictures, self.headings, self.illustrated = [], [], [], set()

    def handle_starttag(self, tag, attrs):
        attrs = dict(attrs)
        assert tag not in ("script", "link", "iframe")
        assert attrs.get("src", "data:").startswith("data:")
        if tag == "img":
            self.pictures.append(attrs["alt"])
            self.illustrated.add(self.headings[-1])
        if tag not in ("img", "input", "meta"):
            self.open.append(tag)

    def handle_endtag(self, tag):
        assert self.open.pop() == tag

    def handle_data(self, data):
        if self.open and self.open[-1] in ("h1", "h2"):
            self.headings.append(data)


def check_page(text):
    page = Page()
    page.feed(text)
    assert page.open == []
    # Every section has a picture but tables of grains and where the results come from.
    assert page.illustrated == {*page.headings[1:]} - {
        "What the result rests on",
        "Grains and quantities",
        "Provenance",
    }
    assert all(len(words) > 20 for words in page.pictures)
    assert page.headings[1:] == [
        "What the result rests on",
        "What to do next",
        "The result in figures",
        "How well the surrogate predicts",
        "Grains and quantities",
        "Diagnostics",
        "Surrogate",
        "Provenance",
    ]
    assert "Synthetic data." in text


@pytest.mark.long
def test_killed_in_the_middle_and_resumed(process, tmp_path):
    file = reduced_quickstart(tmp_path, **SMALL)
    command = [sys.executable, "-m", "bayesindent", "build", str(file), "--json"]
    killed = subprocess.Popen(
        command, cwd=tmp_path, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL, env=os.environ
    )
    campaign = tmp_path / "runs" / "reduced" / "campaign.sqlite"
    deadline = time.monotonic() + HANGS_S
    while count_rows(campaign) < 2 and time.monotonic() < deadline and killed.poll() is None:
        time.sleep(0.05)
    killed.send_signal(signal.SIGKILL)
    killed.wait()
    kept = count_rows(campaign)
    assert kept >= 2
    document = json.loads(process("build", file, "--json").stdout)
    assert document["simulations"] == 10
    assert document["new_simulations"] == 10 - kept
