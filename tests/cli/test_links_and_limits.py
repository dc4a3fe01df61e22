"""Links and pipes in an output folder, limits of the system, and files that are not what they
should be: one line, and nothing else is touched.
"""

import json
import os
import re
import resource
import shutil
import signal
import subprocess
import sys
from types import SimpleNamespace

import pytest

from bayesindent.program.cli import main
from bayesindent.report.results import Results
from bayesindent.report.templates import render
from benchmarks.bench_mutations import MAPS, prepare, write
from support import few_figures as quick
from support.programs import BATCH, SANITIZED

PROGRAMS = {
    "bayesindent": [sys.executable, "-m", "bayesindent", "run"],
    "bayesindent-batch": [str(BATCH)],
}
TABLE = (
    "phi1_deg,Phi_deg,phi2_deg,indentation_modulus_gpa,sd_gpa\n0,0,0,130.1,2\n0,45,0,141.9,2\n"
    "0,54.7,45,144.2,2\n10,20,30,138.0,2\n"
)
STEP_2 = (
    "&problem symmetry = 'cubic' /\n"
    "&measurements file = 'a.csv' /\n"
    "&sampler samples = 400, burn_in = 400, chains = 2 /\n"
)
THEORY = "&crystals points = 'c.csv' /\n&simulation simulator = 'theory' /\n"
BUILD = (
    "&simulation simulator = 'theory' /\n"
    "&design n_candidates = 60, budget = 8 /\n"
    "&surrogate degree = 1, file = 's.txt' /\n"
)


@pytest.fixture
def folder(tmp_path):
    (tmp_path / "a.csv").write_text(TABLE)
    (tmp_path / "c.csv").write_text(
        "C11,C12,C44,phi1_deg,Phi_deg,phi2_deg\n168.4,121.4,75.4,0,0,0\n"
    )
    (tmp_path / "a.nml").write_text(STEP_2)
    (tmp_path / "t.nml").write_text("&problem symmetry = 'cubic' /\n" + THEORY)
    (tmp_path / "out").mkdir()
    return tmp_path


def outcome(folder, program, *words, limits=(), **options):
    """Status and the last line on standard error of a process with these limits; it may not
    hang.
    """

    def limit():
        for kind, bytes_ in limits:
            resource.setrlimit(kind, (bytes_, bytes_))

    done = subprocess.run(
        [*PROGRAMS[program], *words],
        cwd=folder,
        preexec_fn=limit,
        text=True,
        timeout=120,
        **{"stdout": subprocess.DEVNULL, "stderr": subprocess.PIPE} | options,
    )
    assert "Traceback" not in done.stderr and "Backtrace" not in done.stderr
    return done.returncode, done.stderr.strip().split("\n")[-1]


@pytest.mark.parametrize(
    "program, name",
    [("bayesindent", ".lock"), ("bayesindent", "run.log"), ("bayesindent-batch", ".lock")],
)
def test_a_link_in_the_folder_is_not_followed(folder, program, name):
    (folder / "other").write_text("of somebody else")
    (folder / "out" / name).symlink_to(folder / "other")
    status, line = outcome(folder, program, "t.nml", "--output", "out")
    assert status == 1 and f"out/{name}: is a link" in line
    assert (folder / "other").read_text() == "of somebody else"


@pytest.mark.parametrize("program", PROGRAMS)
def test_a_file_is_begun_anew_where_a_link_has_its_first_name(folder, program):
    """The number of the process is part of that name: a shell that becomes the program makes the
    links.
    """
    (folder / "other").write_text("of somebody else")
    names = [
        "inputs.json",
        "resolved.nml",
        "campaign.sqlite",
        "moduli.csv",
        "theory.csv",
        *["report.html"] * (program == "bayesindent"),
    ]
    links = "".join(f"ln -s ../other out/.part-$$-{name}; " for name in names)
    # Those of a process that is no more are removed: this one is at work.
    done = subprocess.run(
        ["sh", "-c", f'{links}exec "$@"', "sh", *PROGRAMS[program], "t.nml", "--output", "out"],
        cwd=folder,
    )
    assert done.returncode == 0
    assert (folder / "other").read_text() == "of somebody else"
    assert not [path for path in (folder / "out").iterdir() if path.is_symlink()]


def test_a_picture_is_not_written_through_a_link(tmp_path, bayesindent):
    prepare(tmp_path)
    namelist = write("map", MAPS[".ctf"], tmp_path).with_suffix(".nml")
    (tmp_path / "out").mkdir()
    (tmp_path / "other").write_text("of somebody else")
    (tmp_path / "out" / "map.png").symlink_to("../other")
    done = bayesindent("map", namelist, "--output", "out")
    assert done.returncode == 0, done.stderr
    assert (tmp_path / "other").read_text() == "of somebody else"
    assert (tmp_path / "out" / "map.png").read_bytes().startswith(b"\x89PNG")


def test_a_pipe_as_the_log_does_not_hang(folder):
    os.mkfifo(folder / "out" / "run.log")
    status, line = outcome(folder, "bayesindent", "t.nml", "--output", "out")
    assert status == 1 and line.endswith(
        "out/run.log: is a pipe; remove it, or choose another folder"
    )


@pytest.mark.parametrize("program", PROGRAMS)
def test_a_limit_of_file_sizes_is_one_line(folder, program):
    status, line = outcome(
        folder, program, "a.nml", "--output", "out", limits=[(resource.RLIMIT_FSIZE, 4096)]
    )
    assert status == 1 and re.fullmatch(
        r"out/\S+: cannot be written: (larger than files may be here|File too large)", line
    )
    assert not list((folder / "out").glob(".part-*"))


@pytest.mark.skipif(
    SANITIZED, reason="AddressSanitizer reserves more addresses than the limit leaves"
)
@pytest.mark.parametrize(
    "program, file, megabytes",
    [
        ("bayesindent-batch", "f.nml", 200),
        ("bayesindent-batch", "f.nml", 550),
        ("bayesindent-batch", "f.nml", 600),
        ("bayesindent-batch", "a.nml", 300),
        ("bayesindent", "f.nml", 720),
        ("bayesindent", "a.nml", 500),
    ],
)
def test_little_memory_is_one_line_and_no_hang(folder, program, file, megabytes):
    """Two threads need two buffers of OpenBLAS, which tries for ever to have them; a library of
    Python needs room, too.
    """
    two = " &execution workers = 2 /"
    by_elements = (folder / "t.nml").read_text().replace("'theory'", "'fe', depths = 2")
    (folder / "f.nml").write_text(by_elements + two)
    (folder / "a.nml").write_text(STEP_2 + two)
    (folder / "c.csv").write_text(
        "C11,C12,C44,phi1_deg,Phi_deg,phi2_deg\n"
        + "168.4,121.4,75.4,0,0,0\n168.4,121.4,75.4,0,45,0\n" * 2
    )
    status, line = outcome(
        folder, program, file, limits=[(resource.RLIMIT_AS, megabytes * 1024**2)]
    )
    assert status in (0, 3) or (status == 1 and "too little memory for" in line)


@pytest.mark.parametrize(
    "program, words",
    [
        ("bayesindent-batch", ["--schema"]),
        ("bayesindent-batch", ["a.nml", "--check"]),
        ("bayesindent", ["--version"]),
        ("bayesindent", ["run", "--help"]),
        ("bayesindent", ["run", "a.nml", "--check"]),
    ],
)
def test_a_full_standard_output_is_an_error(folder, program, words):
    with open("/dev/full", "w") as full:
        done = subprocess.run(
            [*PROGRAMS[program][:3], *words],
            cwd=folder,
            stdout=full,
            stderr=subprocess.PIPE,
            text=True,
        )
    assert (done.returncode, done.stderr.splitlines()[-1]) == (
        1,
        "standard output: cannot be written: the disk is full",
    )


@pytest.fixture(scope="module")
def next_done(tmp_path_factory):
    """A folder with a namelist of Step 2 and the next grain, and what a run of it leaves in
    `out`.
    """
    place = tmp_path_factory.mktemp("next")
    (place / "a.csv").write_text(TABLE)
    (place / "n.nml").write_text(f"{STEP_2}&next count = 1 /\n")
    with quick.few_figures():
        assert main(["run", str(place / "n.nml"), "--output", str(place / "out")]) in (0, 3)
    return place


@pytest.fixture
def measured(next_done, tmp_path):
    """A copy of that folder, which a case may change."""
    return shutil.copytree(next_done, tmp_path, dirs_exist_ok=True)


def test_a_posterior_that_was_removed_is_missed(measured, bayesindent, few_figures):
    folder = measured
    (folder / "out" / "posterior.bin").unlink()
    for command in (["report", "out"], ["next", "n.nml", "--output", "out"]):
        done = bayesindent(*command)
        assert (
            done.returncode == 0 and "out/posterior.bin" in done.stderr and "missing" in done.stderr
        )


def test_a_build_by_itself_keeps_step_2(folder, bayesindent, few_figures):
    """What a surrogate is made of counts, not which command asked for it, nor its title."""
    text = f"{STEP_2}{BUILD}"
    (folder / "b.nml").write_text(text)
    assert bayesindent("run", "b.nml", "--output", "out").returncode in (0, 3)
    surrogate, figures = (
        (folder / "out" / "s.txt").read_text(),
        (folder / "out" / "report.html").read_text().count("<figure"),
    )
    assert bayesindent("build", "b.nml", "--output", "out").returncode == 0
    assert (folder / "out" / "s.txt").read_text() == surrogate
    (folder / "b.nml").write_text(text.replace("'cubic'", "'cubic', title = 'another'", 1))
    assert bayesindent("build", "b.nml", "--output", "out").returncode == 0
    assert bayesindent("report", "out").returncode == 0
    assert (folder / "out" / "report.html").read_text().count("<figure") == figures > 1


def test_what_was_changed_or_damaged_is_not_believed(measured, bayesindent):
    folder = measured
    summary, posterior = folder / "out" / "summary.json", folder / "out" / "posterior.bin"
    whole = summary.read_text()
    document = json.loads(whole)
    del document["checksum"]
    summary.write_text(json.dumps(document, indent=1))
    done = bayesindent("report", "out")
    assert (done.returncode, done.stderr.count("\n")) == (2, 1) and done.stderr.startswith(
        "out/summary.json: is damaged"
    )
    summary.write_text(whole)
    posterior.write_bytes(posterior.read_bytes()[:1000])
    done = bayesindent("next", "n.nml", "--output", "out")
    assert done.returncode == 2 and "out/posterior.bin: is damaged" in done.stderr


def test_a_constant_that_its_bounds_fix_is_not_truncated_by_them(folder, bayesindent):
    bounds = "&prior c_min = 100, 121.4, 50, c_max = 300, 121.4, 120 /\n"
    (folder / "b.nml").write_text(STEP_2.replace("samples = 400", "samples = 2000") + bounds)
    document = json.loads(bayesindent("extract", "b.nml", "--output", "out", "--json").stdout)
    assert abs(document["parameters"]["C12"]["mean"] - 121.4) < 0.03
    assert not [found for found in document["warnings"] if "limit of C12" in found["subject"]]


def test_texts_are_escaped_wherever_they_enter_latex():
    known = {"name": "bulk_modulus", "unit": "GPa", "mean": 165.0, "sd": 3.0}
    document = {
        "reasons": [r"\input{x} 5 % of $a_1$"],
        "parameters": {},
        "checks": {},
        "predicted": [{"measured": 1.0}],
        "prior": {"density": ["#"], "knowledge": [known], "surrogate": "&"},
        "method": "&",
        "chains": 1,
        "samples": 1,
    }
    settings = (
        "&problem symmetry = 'cubic', title = '# & %' /\n"
        "&knowledge quantity = 'bulk_modulus', mean = 165, sd = 3, source = 'A & B #1' /\n"
    )
    facts = {"settings": settings, "summary": json.dumps(document)}
    results = Results(SimpleNamespace(posterior=SimpleNamespace(attrs=facts)))
    text = render("methods.tex.j2", results=results, constants="&", known={})
    assert r"\textbackslash{}input\{x\} 5 \% of \$a\_1\$." in text
    assert r"A \& B \#1" in text
    assert not re.search(r"(?<!\\)[&#]", text) and r"\cite{bayesindent}" in text


def test_init_goes_on_after_a_full_disk(folder, bayesindent):
    assert bayesindent("init", "cubic", "--output", "out").returncode == 0
    (folder / "out" / "grains.csv").unlink()
    assert bayesindent("init", "cubic", "--output", "out").returncode == 0
    # A file of the user's is not replaced.
    (folder / "out" / "grains.nml").unlink()
    (folder / "out" / "grains.csv").write_text("mine")
    assert bayesindent("init", "cubic", "--output", "out").returncode == 2
    assert (folder / "out" / "grains.csv").read_text() == "mine"


@pytest.mark.parametrize("size", ["refine = 4.0", "refine = 0.1"])
def test_a_check_refuses_what_the_run_refuses(folder, bayesindent, batch, size):
    (folder / "m.nml").write_text(
        f"&problem symmetry = 'cubic' /\n&crystals points = 'c.csv' /\n&simulation {size} /\n"
    )
    found = {
        (done.returncode, done.stderr)
        for done in (
            bayesindent("run", "m.nml", "--check"),
            batch("m.nml", "--check"),
            batch("m.nml", "--output", "out"),
        )
    }
    assert len(found) == 1
    status, line = found.pop()
    assert status == 2 and line.startswith("m.nml: &simulation")


def test_no_line_of_another_file_is_quoted(folder, batch):
    (folder / "secret").write_text("user:hunter2:0\nother:pass:1\n")
    (folder / "latin").write_bytes(b"hunter2 \xfc\n")
    for name in ("secret", "latin"):
        (folder / "s.nml").write_text(STEP_2.replace("a.csv", name))
        for file in ("s.nml", name):
            done = batch(file, "--check")
            assert done.returncode == 2 and "hunter2" not in done.stderr and name in done.stderr


def test_a_signal_is_obeyed_where_the_log_is_a_pipe(folder):
    """The handler writes to the log: of the batch program, which does not open it before."""
    os.mkfifo(folder / "out" / "run.log")
    (folder / "long.nml").write_text(STEP_2.replace("samples = 400", "samples = 4000000"))
    process = subprocess.Popen(
        [*PROGRAMS["bayesindent-batch"], "long.nml", "--output", "out"],
        cwd=folder,
        stderr=subprocess.PIPE,
    )
    while not (folder / "out" / "resolved.nml").exists() and process.poll() is None:
        pass
    process.send_signal(signal.SIGTERM)
    process.communicate(timeout=60)
    assert process.returncode == 128 + signal.SIGTERM
