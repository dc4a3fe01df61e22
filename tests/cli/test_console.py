"""What a terminal shows: the answer whole and last, few warnings, and what was meant."""

import json
from types import SimpleNamespace

import pytest

import bayesindent as bi
from bayesindent.common.diagnostics import diagnostic, labelled
from bayesindent.program import cli
from bayesindent.program.commands.stages import show_extract
from bayesindent.report.results import Results
from support.diagnostics import of_code
from support.tree import SOURCE

IRON = (
    "&problem symmetry = 'bcc' /\n"
    "&measurements file = 'grains.csv' /\n"
    "&knowledge quantity = 'bulk_modulus', mean = 165, sd = 3 /\n"
    "&sampler samples = {} burn_in = 300 /\n"
)


@pytest.fixture
def iron(tmp_path):
    (tmp_path / "grains.csv").write_text((SOURCE / "inputs" / "data" / "fe3si.csv").read_text())
    (tmp_path / "a.nml").write_text(IRON.format("1e3"))
    return tmp_path


def test_no_number_of_the_answer_is_cut(capsys, monkeypatch):
    """Twenty-one constants, of diamond's size and negative ones, in 80 columns and in fewer."""
    share = {"measurements": 0.005, "knowledge": 0.0, "prior": 0.995}
    item = {
        "mean": 1076.04,
        "sd": 123.46,
        "median": 1001.04,
        "hdi_95": [-234.56, 1234.56],
        "share": share,
        "verdict": "not_determined",
    }
    names = [f"C{i}{j}" for i in range(1, 7) for j in range(i, 7)]
    document = {"parameters": dict.fromkeys(names, item), "prior": {"words": ["measured: nothing"]}}
    for columns in ("80", "40"):
        monkeypatch.setenv("COLUMNS", columns)
        show_extract(document)
        lines = capsys.readouterr().out.splitlines()[-22:]
        assert [line.split()[:6] for line in lines[1:]] == [
            [name, "1001.0", "median", "-234.6", "..", "1234.6"] for name in names
        ]
    assert max(map(len, lines)) <= 82


def test_the_first_warnings_are_shown_and_all_are_in_the_document(capsys):
    warnings = [diagnostic("table_changed", f"number {n}") for n in range(12)]
    document = {"warnings": list(warnings)}
    command = SimpleNamespace(show=lambda document: print("the answer"), then=None)
    arguments = SimpleNamespace(json=False, quiet=False, results=None, command=command)
    assert cli.finish(arguments, document) == 0
    out, err = capsys.readouterr()
    assert out == "the answer\n"
    assert err.splitlines() == [
        *(f"warning: number {n}" for n in range(8)),
        "4 more warnings are in the JSON document (--json)",
    ]
    arguments.quiet = True
    cli.finish(arguments, document)
    assert capsys.readouterr() == ("the answer\n", "")


@pytest.mark.parametrize(
    ("words", "meant"),
    [
        (["rnu", "a.nml"], "'rnu' is no command; allowed: init, table, map, run, "),
        (["extrct", "a.nml"], "Did you mean 'extract'?"),
        (["a.nml"], "Did you mean 'run a.nml'?"),
        (["run", "a.nml", "--chek"], "unrecognized arguments: --chek. Did you mean '--check'?"),
        (["extract", "a.nml", "--sample5", "5"], "Did you mean '--samples'?"),
        (["extract", "a.nml", "--samples", "5.5"], "invalid whole value: '5.5'"),
    ],
)
def test_what_was_meant(bayesindent, words, meant):
    done = bayesindent(*words)
    assert (done.returncode, done.stdout) == (2, "")
    assert meant in done.stderr


def test_a_class_that_begins_with_a_minus_is_no_option(bayesindent, tmp_path):
    assert bayesindent("init", "-3m", "--output", tmp_path / "quartz").returncode == 0
    assert (
        "a trigonal crystal (C11, C12, C13, C14, C33, C44)"
        in (tmp_path / "quartz" / "grains.nml").read_text()
    )


def test_help_and_version_are_commands(bayesindent):
    assert bayesindent("version").stdout == bayesindent("--version").stdout
    short = bayesindent("help", "run")
    assert (short.returncode, short.stdout) == (0, bayesindent("run", "--help").stdout)
    # Groups first, with the names of their variables; --all explains these.
    assert "  &sampler       How the posterior is sampled." in short.stdout
    assert "Sweeps before" not in " ".join(short.stdout.split()) and "burn_in" in short.stdout
    for words in (["run", "--all"], ["help", "run", "--all"], ["run", "--help", "--all"]):
        full = bayesindent(*words).stdout
        assert "sweeps before" in " ".join(full.split()) and len(full) > 3 * len(short.stdout)
    assert (
        "Ti, " in " ".join(bayesindent("init", "--help").stdout.split())
        and "Zr" in bayesindent("init", "--help").stdout
    )


@pytest.mark.long
def test_samples_and_seed_take_the_place_of_the_files(bayesindent, iron):
    def found(*options):
        done = bayesindent("extract", "a.nml", "--quiet", "--json", *options)
        assert (
            done.returncode in (0, 3),
            done.stderr.replace("The result cannot be used", "")[:1] in ("", ":"),
        ) == (True, True), done.stderr
        return json.loads(done.stdout)

    usual = found()
    assert usual["samples"] == 1000
    assert found("--samples", "400")["samples"] == 400
    assert found("--seed", "7")["parameters"]["C11"]["mean"] != usual["parameters"]["C11"]["mean"]
    assert "samples = 400" not in (iron / "a.nml").read_text()
    done = bayesindent("extract", "a.nml", "--samples", "3")
    assert (done.returncode, done.stderr) == (
        2,
        "a.nml: &sampler samples: 3 is out of range; allowed 10 to 100000000\n",
    )
    # A group that the file does not have.
    (iron / "b.nml").write_text(IRON.format("10").rpartition("&sampler")[0])
    assert (
        json.loads(bayesindent("extract", "b.nml", "--quiet", "--json", "--samples", "500").stdout)[
            "samples"
        ]
        == 500
    )


@pytest.mark.long
def test_a_report_says_what_was_edited_since(bayesindent, iron):
    assert bayesindent("extract", "a.nml", "--quiet").returncode in (0, 3)
    assert "edited" not in bayesindent("report", "runs/a").stderr
    table = iron / "grains.csv"
    table.write_text(table.read_text().replace("219.025", "229.025"))
    done = bayesindent("report", "runs/a")
    (edited,) = of_code(Results(iron / "runs" / "a").warnings, "inputs_edited")
    assert edited["subject"].startswith("&measurements of ")
    assert done.returncode == 0 and labelled(edited) in done.stderr.splitlines()
    assert "was edited after these results" in (iron / "runs" / "a" / "report.html").read_text()


@pytest.mark.parametrize(
    ("text", "said"),
    [
        (
            "&problem symmetry = \u2018cubic\u2019 /",
            "&problem symmetry: curly quotes stand around "
            "\u2018cubic\u2019; straight quotes are needed",
        ),
        (
            "&problem symmetry = \u201ccubic\u201d /",
            "&problem symmetry: curly quotes stand around "
            "\u201ccubic\u201d; straight quotes are needed",
        ),
        (
            "&problem symmetry = 'hcp' lattice = 2.95 /",
            "&problem lattice: the number of values is 1; a hexagonal crystal needs 2: a, c",
        ),
        (
            "&problem symmetry = 'bcc' /\n&sampler samples = 1.5e1, burn_in = 2.5 /",
            "&sampler burn_in: 2.5 is not an integer",
        ),
    ],
)
def test_slips_of_namelists_are_named(bayesindent, iron, text, said):
    (iron / "c.nml").write_text(f"{text}\n&measurements file = 'grains.csv' /\n", encoding="utf-8")
    done = bayesindent("run", "c.nml", "--check")
    assert done.returncode == 2 and said in done.stderr, done.stderr


@pytest.mark.parametrize("words", [["-V"], ["-v"], ["version"]])
def test_the_version(bayesindent, words):
    assert bayesindent(*words).stdout == f"bayesindent {bi.__version__}\n"


def test_no_words_are_a_question(bayesindent):
    done = bayesindent()
    assert (done.returncode, done.stdout) == (0, bayesindent("--help").stdout)


@pytest.mark.parametrize("name", ["nickel", "Ni"])
def test_a_metal_by_its_name(bayesindent, tmp_path, name):
    assert bayesindent("init", name, "--output", tmp_path / name).returncode == 0
    assert "Of pure nickel" in (tmp_path / name / "grains.nml").read_text()
