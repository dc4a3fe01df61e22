"""Both programs leave the same folder, and what reads a folder reads either.

Modules: stages.f90, abstract_stage.f90.
"""

import csv
import json
import re
import shlex
import shutil

import numpy as np
import pytest

from bayesindent.common.result_files import read_json
from bayesindent.program.cli import main, parser
from bayesindent.program.commands import HELP
from bayesindent.stages.results_folder import read_posterior
from support import few_figures as quick
from support.paper_domains import DOMAIN
from support.programs import BATCH, runner
from support.tree import REFERENCE, SOURCE

NAMELIST = f"""
&problem symmetry = 'cubic', seed = 3, title = 'Both' /
&crystals points = 'points.csv' /
&simulation simulator = 'theory' /
{DOMAIN["cubic"]}&surrogate degree = 2 /
&design n_candidates = 200, budget = 12, batch = 2, validation = 2 /
&measurements file = '{REFERENCE / "cubic_fe3si.csv"}', modulus_kind = 'indentation_modulus' /
&prior c_min = 50, 40, 15, c_max = 250, 150, 120, anisotropy_cap = 7.2 /
&sampler samples = 600, burn_in = 2000, chains = 2 /
&next count = 2 /
&execution workers = 2 /
"""
POINTS = "C11,C12,C44,phi1_deg,Phi_deg,phi2_deg\n225,135,124,0,0,0\n168.4,121.4,75.4,10,20,30\n"

#: What only Python adds: a page with its figures, a log, and a copy of the posterior for ArviZ.
OF_PYTHON = {"report.html", "run.log", "posterior.nc"}
#: What only the batch program adds, unless it is told otherwise.
OF_BATCH = {"posterior.csv"}

#: What differs from run to run, and between folders.
FREE = ("seconds", "created", "checksum", "file", "namelist")


def plain(document, folder: str):
    """A document without what may differ; the folder's own name is put in one way."""
    if isinstance(document, dict):
        return {key: plain(value, folder) for key, value in document.items() if key not in FREE}
    if isinstance(document, list):
        return [plain(value, folder) for value in document]
    return document.replace(folder, "FOLDER") if isinstance(document, str) else document


@pytest.fixture(scope="module")
def made(tmp_path_factory):
    """A place where both programs have made their folders."""
    place = tmp_path_factory.mktemp("both")
    (place / "points.csv").write_text(POINTS)
    (place / "a.nml").write_text(NAMELIST)
    with pytest.MonkeyPatch.context() as patch, quick.few_figures():
        patch.chdir(place)
        assert main(["run", "a.nml", "--output", "python"]) == 0
    done = runner([BATCH], place)("a.nml", "--output", "batch")
    assert done.returncode == 0, done.stderr
    return place


@pytest.fixture
def folders(made, tmp_path):
    """A copy of these folders, which a case may change."""
    shutil.copytree(made, tmp_path, dirs_exist_ok=True)
    return tmp_path / "python", tmp_path / "batch"


def test_the_same_files_with_the_same_content(folders):
    one, other = folders
    names = {path.name for path in other.iterdir()}
    assert {path.name for path in one.iterdir()} == names - OF_BATCH | OF_PYTHON
    documents = "simulate.json theory.json build.json summary.json next.json inputs.json"
    tables = "moduli.csv curves.csv theory.csv table.csv"
    assert names == OF_BATCH | {
        *documents.split(),
        *tables.split(),
        ".lock",
        "campaign.sqlite",
        "posterior.bin",
        "resolved.nml",
        "surrogate.txt",
    }
    for name in documents.split():
        read = [plain(json.loads((folder / name).read_text()), folder.name) for folder in folders]
        assert read[0] == read[1], name
    for name in (*tables.split(), "resolved.nml", "surrogate.txt"):
        assert (one / name).read_bytes() == (other / name).read_bytes(), name
    values = [read_posterior(folder) for folder in folders]
    assert values[0].keys() == values[1].keys()
    for name, value in values[0].items():
        if name == "document":
            assert plain(json.loads(value), "python") == plain(json.loads(values[1][name]), "batch")
        elif name not in FREE:
            assert np.array_equal(
                value, values[1][name], equal_nan=isinstance(value, np.ndarray | float)
            ), name


def test_the_table_of_draws_is_written_where_it_is_asked_for(bayesindent, batch, tmp_path):
    """By default by the batch program alone; a table of other draws does not stay. Results do not
    depend on it.
    """
    text = f"""
&problem symmetry = 'cubic' /
&measurements file = '{REFERENCE / "cubic_fe3si.csv"}', modulus_kind = 'indentation_modulus' /
&sampler samples = 20, burn_in = 100, chains = 2%s /
"""
    path, inputs = tmp_path / "out" / "posterior.csv", []
    for program, stated, is_there in [
        (batch, "", True),
        (lambda *words: bayesindent("extract", *words), "", False),
        (lambda *words: bayesindent("extract", *words), ", draws = 'csv'", True),
        (batch, ", draws = 'none'", False),
    ]:
        (tmp_path / "a.nml").write_text(text % stated)
        assert program("a.nml", "--output", "out").returncode in (0, 3)
        assert path.exists() == is_there
        inputs.append(read_json(tmp_path / "out" / "summary.json")["inputs"])
    assert all(other == inputs[0] for other in inputs)


def test_what_reads_a_folder_reads_either(bayesindent, folders, few_figures):
    sections = []
    for folder in folders:
        done = bayesindent("report", folder)
        assert done.returncode == 0, done.stderr
        page = (folder / "report.html").read_text()
        assert "other inputs" not in page
        sections.append(re.findall(r"<h[123][^>]*>(.*?)</h[123]>", page))
    assert len(sections[0]) > 5 and sections[0] == sections[1]
    documents = []
    for folder in folders:
        done = bayesindent("next", "a.nml", "--output", folder, "--json")
        assert done.returncode == 0, done.stderr
        documents.append(plain(json.loads(done.stdout), folder.name))
    assert documents[0] == documents[1]
    done = bayesindent("compare", *folders, "--json")
    assert done.returncode == 0, done.stderr
    document = json.loads(done.stdout)
    assert all(row["difference_sd"] == 0 for row in document["constants"])
    assert len(document["models"]) == 2 and all(row["elpd_diff"] == 0 for row in document["models"])


def test_single_stages(batch, bayesindent, tmp_path):
    (tmp_path / "points.csv").write_text(POINTS)
    (tmp_path / "a.nml").write_text(NAMELIST)
    done = batch("a.nml", "--stage", "theory", "--output", "out")
    assert (done.returncode, done.stdout) == (0, "theory: 2 crystals: out/theory.csv\n"), (
        done.stderr
    )
    assert {path.name for path in (tmp_path / "out").iterdir()} == {
        ".lock",
        "inputs.json",
        "resolved.nml",
        "table.csv",
        "theory.csv",
        "theory.json",
    }
    rows = list(
        csv.DictReader(
            line
            for line in (tmp_path / "out" / "theory.csv").read_text().splitlines()
            if not line.startswith("#")
        )
    )
    told = json.loads(bayesindent("theory", "a.nml", "--json").stdout)["results"]
    moduli = [float(row["indentation_modulus_gpa"]) for row in rows]
    assert moduli == pytest.approx([row["indentation_modulus_gpa"] for row in told], rel=1e-9)
    for name, words in (
        ("hardness", "no command is named 'hardness'; allowed: run, simulate"),
        ("next", "&next"),
    ):
        text = NAMELIST if name != "next" else NAMELIST.split("&measurements")[0]
        (tmp_path / "a.nml").write_text(text)
        done = batch("a.nml", "--stage", name)
        assert done.returncode == 2 and (words in done.stderr or "&measurements" in done.stderr), (
            done.stderr
        )


def examples():
    """The commands of the help."""
    return [
        re.split(r" {2,}", line.strip())[0]
        for line in HELP["examples"].splitlines()
        if line.startswith("  bayesindent ")
    ]


@pytest.mark.parametrize("example", examples())
def test_the_examples_of_the_help_are_understood(example):
    words = shlex.split(example.split(">")[0])[1:]
    arguments = parser().parse_args(words)
    assert arguments.command.name == words[0]
    for word in words:
        if word.startswith("inputs/"):
            assert (SOURCE / word).exists()


def test_there_are_examples():
    assert len(examples()) == 8
