"""One command at a time in an output folder: others wait, or are refused in a line that names who
has it.

Modules: running_command.cpp, running_command.f90.
"""

import csv
import fcntl
import io
import json
import os
import sqlite3
import subprocess
import sys
import time
from contextlib import closing, contextmanager

import pytest

from support.campaigns import rows as stored
from support.programs import BATCH
from support.small_builds import IMPORTED

PYTHON = [sys.executable, "-m", "bayesindent"]
PROGRAMS = {"python": [*PYTHON, "theory"], "batch": [BATCH]}
THEORY = (
    "&problem symmetry = 'cubic' /\n"
    "&crystals points = 'points.csv' /\n"
    "&simulation simulator = 'theory' /\n"
)
POINTS = "C11,C12,C44,phi1_deg,Phi_deg,phi2_deg\n168,121,75,0,0,0\n168,121,75,0,45,45\n"


@pytest.fixture
def small(tmp_path):
    """A folder with a namelist that takes no time."""
    (tmp_path / "a.nml").write_text(THEORY)
    (tmp_path / "points.csv").write_text(POINTS)
    return tmp_path


@contextmanager
def held(folder, process):
    """The folder's lock, as if that process held it."""
    folder.mkdir(exist_ok=True)
    with open(folder / ".lock", "w") as lock:
        fcntl.flock(lock, fcntl.LOCK_EX)
        lock.write(f"{process}\n")
        lock.flush()
        yield


def together(commands, folder) -> list[subprocess.CompletedProcess]:
    """Processes that begin at once."""
    started = [
        subprocess.Popen(
            command, cwd=folder, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True
        )
        for command in commands
    ]
    told = [process.communicate() for process in started]
    return [
        subprocess.CompletedProcess(process.args, process.returncode, *texts)
        for process, texts in zip(started, told)
    ]


@pytest.mark.parametrize("program", PROGRAMS)
def test_a_folder_that_another_process_has_is_refused(program, small):
    command = [*PROGRAMS[program], "a.nml", "--output", "out"]
    with held(small / "out", 4711):
        done = subprocess.run(command, cwd=small, capture_output=True, text=True)
        assert (done.returncode, done.stdout) == (2, "")
        assert done.stderr == (
            "out: process 4711 is at work in this folder; wait until it has ended, or "
            "choose another with --output\n"
        )
        assert [path.name for path in (small / "out").iterdir()] == [".lock"]
        # Elsewhere it may work.
        assert (
            subprocess.run([*command[:-1], "other"], cwd=small, capture_output=True).returncode == 0
        )
    # The lock of a process that is no more: its file stays and locks nothing.
    assert (small / "out" / ".lock").read_text() == "4711\n"
    assert subprocess.run(command, cwd=small, capture_output=True).returncode == 0


@pytest.mark.parametrize("program", PROGRAMS)
def test_what_killed_processes_left_unfinished_is_removed(program, small):
    gone = subprocess.Popen(["true"])
    gone.wait()
    output = small / "out"
    output.mkdir()
    for name in (
        f".part-{gone.pid}-summary.json",
        f".part-{os.getpid()}-summary.json",
        ".part-mine",
        "kept.csv",
    ):
        (output / name).write_text("half")
    assert (
        subprocess.run(
            [*PROGRAMS[program], "a.nml", "--output", "out"], cwd=small, capture_output=True
        ).returncode
        == 0
    )
    left = {path.name for path in output.iterdir()}
    assert f".part-{gone.pid}-summary.json" not in left
    assert {f".part-{os.getpid()}-summary.json", ".part-mine", "kept.csv"} <= left


def test_a_lock_ends_with_its_process(small):
    holder = subprocess.Popen(
        [
            sys.executable,
            "-c",
            "import bayesindent.core as c, time; c.call('file.take_folder', folder='out', "
            "patience=0, resumes=False); print(1, flush=True); time.sleep(60)",
        ],
        cwd=small,
        stdout=subprocess.PIPE,
    )
    holder.stdout.readline()
    command = [*PROGRAMS["python"], "a.nml", "--output", "out"]
    done = subprocess.run(command, cwd=small, capture_output=True, text=True)
    assert (done.returncode, done.stderr.partition(" is at work")[0]) == (
        2,
        f"out: process {holder.pid}",
    )
    holder.kill()
    holder.wait()
    assert subprocess.run(command, cwd=small, capture_output=True).returncode == 0


@pytest.mark.long
def test_of_many_that_begin_at_once_one_works_and_none_spoils_the_folder(small):
    (small / "a.nml").write_text(THEORY.replace("'theory'", "'fe'") + "&execution workers = 1 /\n")
    commands = [
        [*PYTHON, "simulate", "a.nml", "--output", "new"],
        [BATCH, "a.nml", "--output", "new"],
    ] * 3
    finished = together(commands, small)
    statuses = [done.returncode for done in finished]
    assert set(statuses) <= {0, 2}, [done.stderr for done in finished]
    assert 0 in statuses
    for done in finished:
        if done.returncode == 2:
            assert done.stderr.startswith("new: ")
            assert done.stderr.endswith(
                " is at work in this folder; wait until it has ended, "
                "or choose another with --output\n"
            )
            assert done.stderr.count("\n") == 1
    with closing(sqlite3.connect(small / "new" / "campaign.sqlite")) as campaign:
        assert campaign.execute("PRAGMA integrity_check").fetchall() == [("ok",)]
        assert campaign.execute("SELECT count(*) FROM simulation").fetchone() == (2,)
    assert not list((small / "new").glob(".part-*"))


def test_asking_and_telling_wait_for_each_other(bayesindent, tmp_path):
    (tmp_path / "mine.nml").write_text(IMPORTED)
    build = [*PYTHON, "build", "mine.nml", "--output", "out"]
    asked = subprocess.run(
        [*build, "--ask", "4"], cwd=tmp_path, capture_output=True, text=True, check=True
    )
    header, *rows = csv.reader(io.StringIO(asked.stdout))
    for i, row in enumerate(rows):
        (tmp_path / f"{i}.csv").write_text(
            ",".join([*header, "modulus_gpa"]) + "\n" + ",".join([*row, f"{150 + i}"]) + "\n"
        )
    finished = together(
        [[*build, "--tell", f"{i}.csv", "--json"] for i in range(4)] + [[*build, "--ask", "3"]] * 2,
        tmp_path,
    )
    assert [done.returncode for done in finished] == [0] * 6, [done.stderr for done in finished]
    assert sum(json.loads(done.stdout)["imported"] for done in finished[:4]) == 4
    with closing(sqlite3.connect(tmp_path / "out" / "campaign.sqlite")) as campaign:
        assert campaign.execute("SELECT count(*) FROM simulation").fetchone() == (4,)


@pytest.mark.long
def test_a_campaign_is_made_by_many_at_once(tmp_path):
    """The library takes no lock: the file itself must bear it."""
    code = """import sys, time
from bayesindent.stages.build import tell
from bayesindent.settings.problem import Problem, read_crystals
problem, points = Problem("mine.nml", "build"), read_crystals(f"{sys.argv[1]}.csv", "cubic")
time.sleep(max(0, float(sys.argv[2]) - time.time()))
for n in range(5):
    tell(problem, str(n), points)
"""
    (tmp_path / "mine.nml").write_text(IMPORTED)
    for i in range(6):
        (tmp_path / f"{i}.csv").write_text(
            f"{POINTS.splitlines()[0]},modulus_gpa\n{200 + i},100,50,0,0,0,150\n"
        )
    at = time.time() + 3
    finished = together([[sys.executable, "-c", code, str(i), str(at)] for i in range(6)], tmp_path)
    assert [done.returncode for done in finished] == [0] * 6, [done.stderr for done in finished]
    for n in range(5):
        assert sorted(
            row.position for row in stored(tmp_path / str(n) / "campaign.sqlite")
        ) == list(range(6))


@pytest.mark.parametrize("program", PROGRAMS)
def test_closed_streams(program, small):
    """What is printed on closed streams goes into no file that was opened in their place."""
    command = [*PROGRAMS[program], "a.nml", "--output", "out"]
    line = 'exec 0<&- 1>&- 2>&-; exec "$@"'
    done = subprocess.run(["sh", "-c", line, "sh", *command], cwd=small, timeout=60)
    assert done.returncode == 0
    assert (small / "out" / ".lock").read_text().strip().isdigit()


@pytest.mark.parametrize(
    "limit", ["ulimit -s 256", "export OMP_STACKSIZE=128K", "export OMP_STACKSIZE=64"]
)
@pytest.mark.parametrize("program", PROGRAMS)
def test_small_stacks(program, limit, small):
    """Stacks that are too small end a program in a line that says what to set."""
    command = ["sh", "-c", f'{limit}; exec "$@"', "sh", *PROGRAMS[program], "a.nml"]
    done = subprocess.run(command, cwd=small, timeout=60, capture_output=True, text=True)
    assert (done.returncode, done.stdout) == (1, "")
    line = "stacks of less than 1 MB: set ulimit -s 8192 and OMP_STACKSIZE=8M"
    assert done.stderr.splitlines() == [line]
