"""The batch program: arguments, exit status, and the same verdict on a file as the Python
program.
"""

import json
import os
import re
from pathlib import Path

import arviz
import numpy as np
import pytest
import xarray

from bayesindent import Problem
from bayesindent.common.diagnostics import labelled
from bayesindent.inference.arviz_groups import groups_of, inference_data
from bayesindent.step_2 import summary
from bayesindent.surrogate.surrogate import SHIPPED, Surrogate
from support.csv_tables import numbers, read_rows
from support.densities import EXTRACTION, Posterior
from support.diagnostics import of_code
from support.paper_domains import DOMAIN
from support.small_builds import HEADER, PAPER, WIDE, small, stored
from support.theory_cases import theory_surrogate
from support.tree import SOURCE

BAD = [
    path
    for path in sorted((SOURCE / "inputs" / "bad").glob("*.nml"))
    if "\n! command: " not in path.read_text()
]


def test_help_and_version(batch):
    done = batch("--help")
    assert (done.returncode, done.stderr) == (0, "")
    assert done.stdout.startswith("usage: bayesindent-batch FILE.nml")
    done = batch("--version")
    assert done.returncode == 0
    assert re.fullmatch(r"bayesindent-batch \d+\.\d+\.\d+\n", done.stdout)


@pytest.mark.parametrize(
    "arguments", [(), ("--unknown",), ("a.nml", "b.nml"), ("a.nml", "--output")]
)
def test_wrong_usage_exits_2(batch, arguments):
    done = batch(*arguments)
    assert done.returncode == 2
    assert done.stdout == ""
    assert "usage:" in done.stderr


@pytest.mark.parametrize("path", BAD, ids=lambda path: path.stem)
def test_bad_input_exits_2_with_one_line(batch, path):
    expected = path.read_text().splitlines()[0].removeprefix("! expect: ")
    done = batch(path)
    assert (done.returncode, done.stdout) == (2, "")
    assert done.stderr.startswith(f"{path}: {expected}")
    assert done.stderr.count("\n") == 1


@pytest.mark.parametrize(
    "name", ["unstable", "nan", "unknown_variable", "missing_slash", "missing_file"]
)
def test_both_programs_say_the_same(batch, bayesindent, name):
    path = next(path for path in BAD if path.stem.endswith(name))
    done = bayesindent("run", path)
    assert (done.returncode, done.stdout) == (2, "")
    assert done.stderr == batch(path).stderr


def test_check_writes_nothing(batch, tmp_path):
    (tmp_path / "a.nml").write_text(
        "&problem symmetry = 'cubic' /\n" + DOMAIN["cubic"] + "&design /\n"
    )
    done = batch("a.nml", "--check")
    assert (done.returncode, done.stdout, done.stderr) == (
        0,
        "a.nml is right; it asks for: build\n",
        "",
    )
    assert [path.name for path in tmp_path.iterdir()] == ["a.nml"]


def test_documentation_is_current(batch):
    """The list has the variables of docs/namelists.md, each with the facts of its row."""
    listed, group = [], ""
    for line in (SOURCE / "docs" / "namelists.md").read_text().splitlines():
        if line.startswith("## `&"):
            group = line[4:-1]
        elif line.startswith("| `"):
            name, kind, _, default, _, meaning = line[2:-2].split(" | ")
            kind = re.sub("list of | for each constant|s$", "", kind)
            listed.append(f"{group} {name.strip('`')} = {default} ({kind}): {meaning}")
    assert batch("--schema").stdout.splitlines() == listed, (
        "the build is older than docs/namelists.md"
    )


@pytest.mark.long_where("fe")
@pytest.mark.parametrize(
    "simulation", ["refine = 0.6", "simulator = 'theory'"], ids=["fe", "theory"]
)
def test_each_program_continues_the_campaign_of_the_other(batch, bayesindent, tmp_path, simulation):
    rows = [
        "225,135,124,0,0,0,iron",
        '168.4,121.4,75.4,10,20,30,"a, b"',
        "225,135,124,0,0,0,again",
        "200,100,60,30,45,0,",
    ]
    (tmp_path / "a.nml").write_text(
        f"&problem symmetry = 'cubic' /\n&crystals points = 'p.csv' /\n&simulation {simulation} /\n"
    )

    def points(count):
        (tmp_path / "p.csv").write_text("\n".join([HEADER + ",note", *rows[:count]]) + "\n")

    def by_batch(output):
        done = batch("a.nml", "--output", output)
        assert done.returncode == 0
        assert "warning" not in done.stderr
        return int(done.stdout.split(" new,")[0].split()[-1])

    def by_python(output):
        done = bayesindent("simulate", "a.nml", "--output", output, "--json")
        assert done.returncode == 0, done.stderr
        return json.loads(done.stdout)["new_simulations"]

    orders = {"batch first": (by_batch, by_python), "python first": (by_python, by_batch)}
    for output, (first, second) in orders.items():
        for count, program, new in ((3, first, 2), (3, second, 0), (4, second, 1), (4, first, 0)):
            points(count)
            assert program(output) == new
    one, other = (stored(tmp_path / output) for output in orders)
    # All but the wall times and dates, and the order in which threads were done.
    assert [row[1:11] + row[12:14] for row in one] == [row[1:11] + row[12:14] for row in other]
    assert all(row[11] > 0 for row in one + other)
    # The tables of the two programs are the same.
    for name in ("moduli.csv", "curves.csv"):
        by_program = [(tmp_path / output / name).read_text() for output in orders]
        by_python("batch first")
        by_program.append((tmp_path / "batch first" / name).read_text())
        assert by_program[0] == by_program[1] == by_program[2]
    assert [row["note"] for row in read_rows(tmp_path / "python first" / "moduli.csv")] == [
        "iron",
        "a, b",
        "again",
        "",
    ]
    assert (len(by_program[0].splitlines()) > 1) == simulation.startswith("refine")


BUILDS = {
    "fe": {"simulator": "fe", "budget": 4},
    "theory": {},
    "all crystals": {"domain": WIDE},
    "paper": {"surrogate": PAPER},
}


@pytest.mark.long_where("theory", "all crystals")
@pytest.mark.parametrize("words", BUILDS.values(), ids=list(BUILDS))
def test_builds_as_python_does(batch, bayesindent, tmp_path, words):
    """From nothing: the same choices, simulations, surrogate and document, to the last bit; and
    each resumes from what the other did.
    """
    small(tmp_path, **words)
    done = bayesindent("build", "small.nml", "--output", "python", "--json")
    assert done.returncode == 0, done.stderr
    budget = words.get("budget", 20)
    by_batch = batch("small.nml", "--output", "batch")
    assert by_batch.returncode == 0, by_batch.stderr
    assert by_batch.stdout.startswith(
        f"build: {budget} simulations, {budget + 2} new, 0 failed, the budget is used: "
        "batch/surrogate.txt"
    )
    folders = [tmp_path / "python", tmp_path / "batch"]
    one, other = (stored(folder) for folder in folders)
    assert [row[1:11] + row[12:14] for row in one] == [row[1:11] + row[12:14] for row in other]
    assert len(one) == budget + 2
    texts = [(folder / "surrogate.txt").read_text() for folder in folders]
    assert texts[0] == texts[1]
    documents = [
        json.loads(done.stdout),
        json.loads((tmp_path / "batch" / "build.json").read_text()),
    ]
    for document in documents:
        for name in ("file", "inputs", "checksum"):
            document.pop(name, None)
    assert documents[0] == documents[1]
    small(tmp_path, **(words | {"budget": budget + 4}))
    done = batch("small.nml", "--output", "python")
    assert (done.returncode, f"{budget + 4} simulations, 4 new" in done.stdout) == (0, True), (
        done.stdout + done.stderr
    )
    done = bayesindent("build", "small.nml", "--output", "batch", "--json")
    assert json.loads(done.stdout)["new_simulations"] == 4
    texts = [(folder / "surrogate.txt").read_text() for folder in folders]
    assert texts[0] == texts[1]


def test_goes_on_where_it_was(batch, tmp_path):
    rows = ["225,135,124,0,0,0", "168.4,121.4,75.4,10,20,30", "200,100,60,30,45,0"]
    (tmp_path / "a.nml").write_text(
        "&problem symmetry = 'cubic' /\n"
        "&crystals points = 'p.csv' /\n"
        "&simulation simulator = 'theory' /\n"
    )
    (tmp_path / "p.csv").write_text("\n".join([HEADER, *rows[:2]]))
    assert batch("a.nml").stdout.splitlines() == [
        "simulate: 2 crystals, 2 new, 0 failed: runs/a/moduli.csv",
        "theory: 2 crystals: runs/a/theory.csv",
    ]
    output = tmp_path / "runs" / "a"
    first, moduli = stored(output), (output / "moduli.csv").read_text()
    (tmp_path / "p.csv").write_text("\n".join([HEADER, *rows]))
    assert (
        batch("a.nml", "--stage", "simulate").stdout
        == "simulate: 3 crystals, 1 new, 0 failed: runs/a/moduli.csv\n"
    )
    assert stored(output)[:2] == first
    assert (output / "moduli.csv").read_text().startswith(moduli)
    files = (
        ".lock campaign.sqlite curves.csv inputs.json moduli.csv resolved.nml simulate.json "
        "theory.csv theory.json"
    )
    assert sorted(path.name for path in output.iterdir()) == files.split()
    # Results of another physics are not touched, and not used.
    (tmp_path / "a.nml").write_text(
        "&problem symmetry = 'cubic' /\n&crystals points = 'p.csv' /\n&simulation refine = 0.6 /\n"
    )
    assert "3 crystals, 3 new" in batch("a.nml").stdout
    assert [row[1] for row in stored(output)] == [1, 2] * 3


def test_a_crystal_that_cannot_be_simulated(batch, bayesindent, tmp_path):
    # A contact under a hexagonal crystal near instability that is longer than the small grain
    # holds.
    rows = ["100,99.9,50,100,50,0,90,0", "161.1,34.2,38.3,61.1,50.3,0,0,0"]
    text = (
        "&problem symmetry = 'hexagonal' /\n"
        "&crystals points = 'p.csv' /\n"
        "&simulation refine = 0.7 /\n"
    )
    (tmp_path / "a.nml").write_text(f"{text}&specimen geometry = 'grain' grain_radius_um = 1.5 /\n")
    (tmp_path / "p.csv").write_text(
        "\n".join(["C11,C12,C44,C33,C13,phi1_deg,Phi_deg,phi2_deg", *rows])
    )
    done = batch("a.nml", "--output", "out")
    told = "simulate: 2 crystals, 2 new, 1 failed: out/moduli.csv\n"
    assert (done.returncode, done.stdout) == (0, told), done.stderr
    document = json.loads((tmp_path / "out" / "simulate.json").read_text())
    (found,) = of_code(document["warnings"], "simulation_failed")
    assert found["numbers"] == {"crystal": 1}
    assert labelled(found) in done.stderr.splitlines()
    assert read_rows(tmp_path / "out" / "moduli.csv")[0]["indentation_modulus_gpa"] == ""
    # It stays failed, with its reason, for both programs.
    assert "2 crystals, 0 new, 1 failed" in batch("a.nml", "--output", "out").stdout
    again = bayesindent("simulate", "a.nml", "--output", "out")
    assert done.stderr.splitlines()[0].removeprefix("warning: ") in again.stderr + again.stdout


def test_a_damaged_campaign(batch, bayesindent, tmp_path):
    (tmp_path / "p.csv").write_text(f"{HEADER}\n225,135,124,0,0,0\n")
    (tmp_path / "a.nml").write_text(
        "&problem symmetry = 'cubic' /\n"
        "&crystals points = 'p.csv' /\n"
        "&simulation simulator = 'theory' /\n"
    )
    (tmp_path / "out").mkdir()
    (tmp_path / "out" / "campaign.sqlite").write_text(
        "no database, but long enough to look like one " * 20
    )
    done, other = (
        batch("a.nml", "--output", "out"),
        bayesindent("simulate", "a.nml", "--output", "out"),
    )
    assert (done.returncode, other.returncode) == (2, 2)
    assert (
        done.stderr
        == "out/campaign.sqlite: is not a campaign, or is damaged (file is not a database); "
        "restore a copy, or move it away to start a new one\n"
    )
    assert other.stderr.endswith(done.stderr)


def test_impossible_mesh(batch, bayesindent, tmp_path):
    (tmp_path / "p.csv").write_text("C11,C12,C44,phi1_deg,Phi_deg,phi2_deg\n225,135,124,0,0,0\n")
    head = "&problem symmetry = 'cubic' /\n&simulation refine = 0.3 /\n"
    (tmp_path / "a.nml").write_text(head + "&crystals points = 'p.csv' /\n")
    (tmp_path / "b.nml").write_text(head + DOMAIN["cubic"] + "&design budget = 2 /\n")
    for done in (batch("a.nml"), bayesindent("build", "b.nml")):
        assert done.returncode == 2
        assert ".nml: &simulation: the contact radius spans" in done.stderr


SAMPLE = """
&problem symmetry = '{symmetry}', seed = 3 /
&surrogate file = 'surrogate.txt' /
&measurements file = '{data}', {measurements} /
&prior {prior} /
&sampler method = '{method}', samples = 200, burn_in = 600, chains = 2 /
"""

CUBIC_PRIORS = """
  c_max = 250, 150, 130 /
&knowledge
  quantity = 'C11', 'C44', 'bulk_modulus', 'polycrystal_young', 'polycrystal_poisson',
    "C44/C'", 'C12/C11'
  mean = 220, 115, 165, 210, 0.29, 2.4, 0.6
  sd = 30, 20, 8, 20, 0.02, 0.5, 0.1
"""
HEXAGONAL_PRIORS = """
 /
&knowledge quantity = 'C33/C11', 'C13/C12', 'C44/C66', mean = 1.1, 0.75, 1.3, sd = 2*0.1, 0.2
"""


@pytest.mark.long_where("hexagonal", "scmh")
@pytest.mark.parametrize(
    ("symmetry", "method", "measurements", "prior"),
    [
        ("cubic", "scmh", "modulus_kind = 'effective_modulus', scale = 'inferred'", CUBIC_PRIORS),
        (
            "cubic",
            "ensemble",
            "modulus_kind = 'sample_modulus', likelihood = 'student', student_dof = 5",
            "anisotropy_cap = 6",
        ),
        (
            "hexagonal",
            "ensemble",
            "modulus_kind = 'indentation_modulus', calibration_sd = 0.02",
            HEXAGONAL_PRIORS,
        ),
    ],
    ids=["scmh", "student", "hexagonal"],
)
def test_samples_as_python_does(
    batch, bayesindent, tmp_path, symmetry, method, measurements, prior
):
    small(
        tmp_path,
        symmetry=symmetry,
        domain=DOMAIN[symmetry] if symmetry == "cubic" else "&domain log_anisotropy_max = 3 /\n",
        budget=16,
    )
    assert batch("small.nml", "--output", "out").returncode == 0
    data = (
        SOURCE
        / "tests"
        / "reference"
        / {"cubic": "cubic_fe3si.csv", "hexagonal": "hex_titanium.csv"}[symmetry]
    )
    path = tmp_path / "sample.nml"
    path.write_text(
        SAMPLE.format(
            symmetry=symmetry, data=data, method=method, measurements=measurements, prior=prior
        )
    )
    done = batch("sample.nml", "--output", "out")
    problem = Problem(path, "extract")
    surrogate = Surrogate.load(tmp_path / "out" / "surrogate.txt")
    result = inference_data(groups_of(Posterior(problem, surrogate, EXTRACTION).values))
    rows = read_rows(tmp_path / "out" / "posterior.csv")
    assert len(rows) == 400
    for name, draws in result.posterior.data_vars.items():
        assert [float(row[name]) for row in rows] == pytest.approx(
            draws.values.ravel().tolist(), rel=1e-14 if name == "sd_factor" else 0
        )
    assert [float(row["log_density"]) for row in rows] == result.sample_stats[
        "lp"
    ].values.ravel().tolist()
    document, expected = (
        json.loads((tmp_path / "out" / "summary.json").read_text()),
        summary(result),
    )
    assert done.returncode == (0 if expected["usable"] else 3)
    assert {
        key: value for key, value in document.items() if key not in ("format", "inputs", "checksum")
    } | {"seconds": 0} == expected | {"seconds": 0}
    # Against ArviZ.
    for name, item in document["parameters"].items():
        draws = np.reshape([float(row[name]) for row in rows], (2, 200))
        assert [item["mean"], item["sd"]] == pytest.approx([draws.mean(), draws.std(ddof=1)])
        tail = {"prob": (0.05, 0.95)}
        assert [item["ess_bulk"], item["ess_tail"]] == pytest.approx(
            [float(arviz.ess(draws)), float(arviz.ess(draws, method="tail", **tail))], rel=1e-7
        )
        assert item["r_hat"] == pytest.approx(float(arviz.rhat(draws)), rel=1e-7)
        new = {"prob": 0.95} if int(arviz.__version__.split(".")[0]) else {"hdi_prob": 0.95}
        assert item["hdi_95"] == pytest.approx(arviz.hdi(draws.ravel(), **new).tolist())
    # Chains as short as these give both programs something to warn of, but where they mix fast.
    mixing = of_code(expected["warnings"], "not_mixed", "poorly_mixed")
    assert mixing or method == "ensemble"
    told = [line for line in done.stderr.splitlines() if "mixed" in line]
    assert told == [labelled(found) for found in mixing]


def test_surrogate_of_another_symmetry(batch, tmp_path):
    small(tmp_path, budget=4)
    done = batch("small.nml", "--output", "out")
    assert done.returncode == 0, done.stderr
    data = SOURCE / "tests" / "reference" / "hex_titanium.csv"
    (tmp_path / "b.nml").write_text(
        "&surrogate file = 'surrogate.txt' /\n&problem symmetry = 'hexagonal' /\n"
        + MEASURED.format(data=data)
    )
    done = batch("b.nml", "--output", "out")
    assert done.returncode == 2
    assert (
        done.stderr
        == "b.nml: &surrogate file: out/surrogate.txt is for cubic crystals, not hexagonal ones\n"
    )
    done = batch("b.nml")
    assert done.returncode == 2
    assert done.stderr.startswith(
        "b.nml: &surrogate file: 'surrogate.txt': there is no such surrogate"
    )


def test_one_chain_has_no_r_hat(batch, tmp_path):
    (tmp_path / "a.nml").write_text(
        "&problem symmetry = 'cubic' /\n"
        f"&surrogate file = 'halfspace' /\n{MEASURED.format(data=FE3SI)}"
        "&sampler method = 'scmh', samples = 50, burn_in = 100, chains = 1 /\n"
    )
    done = batch("a.nml", "--output", "out")
    # Fifty samples are not a hundred effective ones.
    assert done.returncode == 3
    document = json.loads((tmp_path / "out" / "summary.json").read_text())
    told = [labelled(found) for found in of_code(document["warnings"], "too_few_draws")]
    assert told and set(told) <= set(done.stderr.splitlines())
    parameters = document["parameters"].values()
    assert all(item["r_hat"] is None and np.isfinite(item["ess_bulk"]) for item in parameters)


FE3SI = SOURCE / "tests" / "reference" / "cubic_fe3si.csv"
MEASURED = "&measurements file = '{data}', modulus_kind = 'indentation_modulus' /\n"
CHECKED = (
    "&problem symmetry = 'cubic' /\n&surrogate file = '{file}' /\n"
    + MEASURED
    + "&sampler samples = 10 /\n"
)


def spoil(path):
    path.write_text(path.read_text()[:2000])


@pytest.mark.parametrize("folder", ["out", "."])
@pytest.mark.parametrize(
    ("symmetry", "spoiled", "prior", "expected"),
    [
        ("cubic", None, "", ""),
        (
            "cubic",
            None,
            "c_min = 300, 1, 1, c_max = 400, 2, 2, anisotropy_cap = 1000",
            "&prior: the prior is outside the surrogate's domain: none of",
        ),
        ("cubic", spoil, "", "&surrogate file: {path}: the surrogate is damaged: line "),
        (
            "cubic",
            Path.unlink,
            "",
            "&surrogate file: 'surrogate.txt': there is no such surrogate; ",
        ),
        (
            "hexagonal",
            None,
            "",
            "&surrogate file: {path} is for hexagonal crystals, not cubic ones",
        ),
    ],
    ids=["right", "bounds", "damaged", "missing", "symmetry"],
)
def test_check_says_what_sampling_says(batch, tmp_path, folder, symmetry, spoiled, prior, expected):
    (tmp_path / "out").mkdir()
    path = tmp_path / folder / "surrogate.txt"
    theory_surrogate(symmetry, 1, 4, points=200).save(path)
    if spoiled:
        spoiled(path)
    (tmp_path / "a.nml").write_text(
        CHECKED.format(file="surrogate.txt", data=FE3SI) + f"&prior {prior} /\n"
    )
    checked, sampled = (batch("a.nml", "--output", "out", *option) for option in (["--check"], []))
    if expected:
        expected = expected.format(path=path.relative_to(tmp_path))
        assert (checked.returncode, checked.stdout) == (2, "")
        assert checked.stderr.startswith(f"a.nml: {expected}")
        assert checked.stderr == sampled.stderr
    else:
        assert (checked.returncode, checked.stderr) == (0, "")
        # It samples; ten samples are too few to be used.
        assert sampled.returncode == 3, sampled.stderr


def test_both_programs_check_the_bounds(batch, bayesindent, tmp_path):
    prior = "&prior c_min = 300, 1, 1, c_max = 400, 2, 2, anisotropy_cap = 1000 /\n"
    theory_surrogate("cubic", 1, 4, points=200).save(tmp_path / "mine.txt")
    (tmp_path / "a.nml").write_text(CHECKED.format(file="mine.txt", data=FE3SI) + prior)
    done = bayesindent("run", "a.nml", "--output", "out", "--check")
    assert (done.returncode, done.stdout) == (2, "")
    assert done.stderr == batch("a.nml", "--output", "out", "--check").stderr
    assert done.stderr.startswith("a.nml: &prior: the prior is outside the surrogate's domain")
    assert done.stderr == bayesindent("run", "a.nml", "--output", "out").stderr


@pytest.mark.long
@pytest.mark.parametrize(
    ("stated", "low", "high"),
    [
        ("c_max = 180, 150, 130", -np.inf, [180, 150, 130]),
        ("c_min = 230, 20, 100", [230, 20, 100], np.inf),
    ],
    ids=["c_max", "c_min"],
)
def test_one_bound_alone_holds(batch, bayesindent, tmp_path, stated, low, high):
    names = ["C11", "C12", "C44"]
    text = (
        CHECKED.format(file="halfspace", data=FE3SI).replace(
            "samples = 10", "samples = 2000, burn_in = 1000"
        )
        + f"&prior {stated} /\n"
    )
    (tmp_path / "a.nml").write_text(text)
    for program in (
        lambda: bayesindent("extract", "a.nml", "--output", "out"),
        lambda: batch("a.nml", "--output", "out"),
    ):
        done = program()
        assert done.returncode == 0, done.stderr
    posterior = xarray.open_dataset(
        tmp_path / "out" / "posterior.nc", group="posterior", engine="h5netcdf"
    )
    written = numbers(read_rows(tmp_path / "out" / "posterior.csv"), names)
    for draws in (written, np.stack([posterior[name].values.ravel() for name in names], axis=1)):
        assert np.all((draws >= low) & (draws <= high))


#: Names under which no new surrogate is kept, and why.
NAMES = {
    "campaign.sqlite": (
        "'campaign.sqlite' is no name of a new surrogate; allowed: a name that ends in .txt, "
        "for example surrogate.txt"
    ),
    "../other/surrogate.txt": (
        "'../other/surrogate.txt': a new surrogate is kept in the output folder; allowed: a "
        "name that ends in .txt"
    ),
    "notes.txt": (
        "out/notes.txt: is there and is not a surrogate, so it is not replaced; give the "
        "surrogate another name"
    ),
}


@pytest.mark.long_where("notes.txt")
@pytest.mark.parametrize("name", NAMES)
def test_no_program_replaces_what_is_no_surrogate(batch, bayesindent, tmp_path, name):
    (tmp_path / "out").mkdir()
    (tmp_path / "out" / "notes.txt").write_text("mine")
    small(tmp_path, budget=12)
    assert bayesindent("build", "small.nml", "--output", "out").returncode == 0
    before = {
        path.name: path.read_bytes()
        for path in (tmp_path / "out").iterdir()
        if path.suffix in (".sqlite", ".txt")
    }
    text = (
        (tmp_path / "small.nml").read_text().replace("&surrogate ", f"&surrogate file = '{name}', ")
    )
    (tmp_path / "a.nml").write_text(text)
    for done in (
        *(
            bayesindent(command, "a.nml", "--output", "out", *option)
            for command, option in (("build", []), ("run", ["--check"]), ("run", []))
        ),
        *(batch("a.nml", "--output", "out", *option) for option in (["--check"], [])),
    ):
        assert done.returncode == 2, done.stderr
        assert done.stderr.splitlines()[-1].startswith(f"a.nml: &surrogate file: {NAMES[name]}")
    assert before == {
        path.name: path.read_bytes() for path in (tmp_path / "out").iterdir() if path.name in before
    }


def test_check_waits_for_what_a_stage_makes(batch, tmp_path):
    # The surrogate that the file's own build makes is not looked for.
    (tmp_path / "a.nml").write_text(
        CHECKED.format(file="mine.txt", data=FE3SI) + DOMAIN["cubic"] + "&design /\n"
    )
    done = batch("a.nml", "--check")
    assert (done.returncode, done.stderr) == (0, "")


def test_the_shipped_surrogates_are_where_the_environment_says(batch, process, tmp_path):
    name = SHIPPED[0]
    (tmp_path / "elsewhere").mkdir()
    theory_surrogate("cubic", 1, 4, points=200).save(tmp_path / "elsewhere" / f"{name}.txt")
    (tmp_path / "a.nml").write_text(CHECKED.format(file=name, data=FE3SI))
    for folder, status in (("elsewhere", 0), ("nowhere", 2)):
        environment = os.environ | {"BAYESINDENT_DATA": str(tmp_path / folder)}
        for done in (
            batch("a.nml", "--check", env=environment),
            process("run", "a.nml", "--check", env=environment),
        ):
            assert done.returncode == status, done.stderr
            assert (status == 0) or f"'{name}': there is no such surrogate" in done.stderr


@pytest.mark.parametrize(
    "path",
    sorted((SOURCE / "inputs").glob("*.nml"))
    + sorted((SOURCE / "inputs" / "case_studies").glob("*.nml")),
)
def test_inputs_are_right(batch, tmp_path, path):
    done = batch(path, "--check", "--output", "out")
    assert done.returncode == 0, done.stderr
