"""Stopped by a signal, in any stage, both programs end at once: what was finished is kept, and how
to go on is said.

Modules: running_command.cpp, running_command.f90.
"""

import fcntl
import os
import re
import shutil
import signal
import sqlite3
import subprocess
import time
from contextlib import closing
from pathlib import Path

import numpy as np
import pytest
import xarray

from benchmarks.bench_stop import BATCH, POINTS, PROGRAMS, STAGES, start, stored
from support.programs import HANGS_S
from support.small_builds import IMPORTED
from support.tree import SOURCE


def wait_for(condition, process):
    deadline = time.monotonic() + HANGS_S
    while not condition() and time.monotonic() < deadline:
        assert process.poll() is None, process.communicate()[1]
        time.sleep(0.02)


def working(folder, stage) -> bool:
    """Whether the stage is well under way."""
    if stage == "extract":
        resolved = folder / "out" / "resolved.nml"
        return resolved.exists() and time.time() - resolved.stat().st_mtime > 2
    return len(stored(folder)) >= 2


@pytest.mark.long
@pytest.mark.parametrize("program", PROGRAMS)
@pytest.mark.parametrize(
    ("stage", "number"),
    [("simulate", signal.SIGINT), ("build", signal.SIGTERM), ("extract", signal.SIGHUP)],
)
def test_three_signals_in_a_row_end_at_once_and_lose_nothing(program, stage, number, tmp_path):
    process = start(tmp_path, program, stage)
    wait_for(lambda: working(tmp_path, stage), process)
    kept = stored(tmp_path)
    for _ in range(3):
        process.send_signal(number)
    out, err = process.communicate(timeout=HANGS_S)
    # With work for minutes before it; `bench stop` measures how long it takes.
    assert (process.returncode, out) == (128 + number, "")
    told = (
        f"stopped by {number.name}; what was finished is kept in out, and the same command goes "
        "on from there"
    )
    assert err.splitlines()[-1] == told
    assert err.count("stopped by") == 1
    assert "Traceback" not in err
    last = (tmp_path / "out" / "run.log").read_text().splitlines()[-1]
    assert re.fullmatch(r"\d{4}-\d\d-\d\d \d\d:\d\d:\d\d,\d{3} WARNING " + re.escape(told), last)
    assert abs(time.mktime(time.strptime(last[:19], "%Y-%m-%d %H:%M:%S")) - time.time()) < 1500
    if stage != "extract":
        assert stored(tmp_path)[: len(kept)] == kept
        with closing(sqlite3.connect(tmp_path / "out" / "campaign.sqlite")) as campaign:
            assert campaign.execute("PRAGMA integrity_check").fetchall() == [("ok",)]
        # The same command goes on: it waits for no lock, and repeats nothing.
        process = start(tmp_path, program, stage)
        wait_for(lambda: len(stored(tmp_path)) > len(kept) + 2, process)
        process.send_signal(signal.SIGINT)
        process.communicate(timeout=HANGS_S)
        rows = stored(tmp_path)
        assert rows[: len(kept)] == kept
        assert len({row[3:6] for row in rows}) == len(rows)


@pytest.mark.long
@pytest.mark.parametrize("program", PROGRAMS)
def test_signals_that_are_ignored_stay_so(program, tmp_path):
    (tmp_path / "points.csv").write_text("".join(POINTS.splitlines(keepends=True)[:4]))
    (tmp_path / "a.nml").write_text(STAGES["simulate"])
    command = [*PROGRAMS[program]("simulate"), "a.nml", "--output", "out"]
    ignore = lambda: signal.signal(signal.SIGHUP, signal.SIG_IGN)  # noqa: E731, what nohup does
    process = subprocess.Popen(
        command,
        cwd=tmp_path,
        stderr=subprocess.PIPE,
        stdout=subprocess.PIPE,
        text=True,
        preexec_fn=ignore,
    )
    wait_for(lambda: len(stored(tmp_path)) > 0, process)
    process.send_signal(signal.SIGHUP)
    assert process.wait(timeout=HANGS_S) == 0
    assert len(stored(tmp_path)) == 3


def test_while_it_waits_for_another_process(tmp_path):
    (tmp_path / "out").mkdir()
    (tmp_path / "mine.nml").write_text(IMPORTED)
    command = [*PROGRAMS["bayesindent"]("build"), "mine.nml", "--output", "out", "--ask", "2"]
    with open(tmp_path / "out" / ".lock", "w") as lock:
        fcntl.flock(lock, fcntl.LOCK_EX)
        process = subprocess.Popen(
            command, cwd=tmp_path, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True
        )
        # Until then it may still be starting.
        wait_for(lambda: has_open(process.pid, tmp_path / "out" / ".lock"), process)
        process.send_signal(signal.SIGTERM)
        assert process.communicate(timeout=HANGS_S) == (
            "",
            "stopped by SIGTERM; the same command begins anew\n",
        )
        assert process.returncode == 128 + signal.SIGTERM


def has_open(process, file) -> bool:
    try:
        return any(
            os.path.realpath(link) == str(file) for link in Path(f"/proc/{process}/fd").iterdir()
        )
    except FileNotFoundError:  # It was closed meanwhile.
        return False


STEP_2 = f"""&problem symmetry = 'cubic' /
&measurements file = '{SOURCE}/inputs/data/fe3si.csv' /
&sampler samples = 400, burn_in = 1000, chains = 3 /
&execution workers = 1 /
"""


@pytest.mark.long
def test_a_stopped_posterior_is_sampled_anew_with_the_same_numbers(bayesindent, tmp_path):
    """By the other program."""
    (tmp_path / "a.nml").write_text(STEP_2.replace("samples =", "method = 'scmh', samples ="))
    whole = subprocess.run([BATCH, "a.nml", "--output", "whole"], cwd=tmp_path, capture_output=True)
    # So short chains are not mixed.
    assert whole.returncode == 3, whole.stderr
    output = tmp_path / "stopped"
    # Again, where it has ended before the signal comes.
    for _ in range(10):
        shutil.rmtree(output, ignore_errors=True)
        process = subprocess.Popen(
            [BATCH, "a.nml", "--output", "stopped"], cwd=tmp_path, stderr=subprocess.PIPE, text=True
        )
        while not (output / "resolved.nml").exists() and process.poll() is None:
            time.sleep(0.005)
        process.send_signal(signal.SIGTERM)
        told = process.communicate(timeout=HANGS_S)[1]
        if process.returncode == 128 + signal.SIGTERM:
            break
    assert told.startswith("stopped by SIGTERM; what was finished is kept in stopped")
    assert not list(output.glob("posterior.*"))
    whole = np.genfromtxt(tmp_path / "whole" / "posterior.csv", delimiter=",", names=True)
    done = bayesindent("extract", "a.nml", "--output", "stopped")
    assert done.returncode == 3, done.stderr
    draws = xarray.open_dataset(output / "posterior.nc", group="posterior", engine="h5netcdf")
    assert all(
        (draws[name].to_numpy().ravel() == whole[name]).all() for name in ("C11", "C12", "C44")
    )
