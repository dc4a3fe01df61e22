"""Kill a campaign at random moments and inside writes, start it again, and compare the results with
those of an undisturbed run.
"""

import json
import os
import random
import signal
import sqlite3
import subprocess
import sys
import time
from contextlib import closing, suppress
from pathlib import Path

from bayesindent.core import InputError
from bayesindent.stages.results_folder import read_posterior
from bayesindent.surrogate.surrogate import Surrogate
from support.programs import BATCH
from support.tree import SOURCE

#: Both programs.
PROGRAMS = {
    "bayesindent": [sys.executable, "-m", "bayesindent"],
    "bayesindent-batch": [str(BATCH)],
}

#: A campaign of small finite element simulations (a twentieth of a second each) with validation,
#: and constants from its surrogate.
CAMPAIGN = """\
&problem symmetry = 'cubic' /
&specimen geometry = '{geometry}' /
&simulation refine = 0.65 depths = 2 /
&domain c_min = 50, 40, 15 c_max = 250, 150, 120 anisotropy_cap = 7.2 /
&surrogate model = 'paper' degree = 1 bandlimit = 4 file = 'surrogate.txt' /
&design n_candidates = 200 budget = {budget} batch = {batch} validation = 3 /
&measurements file = 'grains.csv' modulus_kind = 'indentation_modulus' /
&prior c_min = 50, 40, 15 c_max = 250, 150, 120 anisotropy_cap = 7.2 /
&sampler samples = 2000 burn_in = 1000 chains = 2 /
&execution workers = {workers} /
"""


def write_campaign(folder: Path, *, geometry="halfspace", budget=20, batch=1, workers=2) -> Path:
    """The namelist of a campaign in a new folder. In a block, a third of the simulations fails: the
    contact leaves the fine mesh.
    """
    folder.mkdir(parents=True)
    rows = (SOURCE / "tests" / "reference" / "cubic_fe3si.csv").read_text()
    (folder / "grains.csv").write_text(rows)
    path = folder / "campaign.nml"
    path.write_text(CAMPAIGN.format(geometry=geometry, budget=budget, batch=batch, workers=workers))
    return path


def words_for(program: str, command: str) -> list[str]:
    """How a program is called for a command; the batch program knows one."""
    return PROGRAMS[program] + [command] * (program == "bayesindent")


def start(program: str, namelist: Path, command: str) -> subprocess.Popen:
    """A command in a process group of its own."""
    words = [*words_for(program, command), str(namelist), "--output", str(namelist.parent / "out")]
    return subprocess.Popen(
        words,
        cwd=namelist.parent,
        start_new_session=True,
        stdin=subprocess.DEVNULL,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
    )


def finish(program: str, namelist: Path, command: str) -> None:
    """Run a command to its end; its exit status must be 0."""
    process = start(program, namelist, command)
    _, err = process.communicate()
    if process.returncode != 0:
        raise AssertionError(f"exit status {process.returncode}: {err.decode()}")


def kill(process: subprocess.Popen) -> bool:
    """Kill the process group at once; return whether it was still running."""
    was_alive = process.poll() is None
    with suppress(ProcessLookupError):
        os.killpg(process.pid, signal.SIGKILL)
    process.communicate()
    return was_alive


def kill_after(process: subprocess.Popen, seconds: float) -> bool:
    """Kill the process group after some seconds; return whether it was still running."""
    with suppress(subprocess.TimeoutExpired):
        process.wait(seconds)
    return kill(process)


def kill_inside_a_write(process: subprocess.Popen, folder: Path, number: int) -> bool:
    """End the group as soon as file number `number` that is written beside its name is seen;
    whether one was.
    """
    seen: set[str] = set()
    while process.poll() is None:
        with suppress(FileNotFoundError):
            seen |= {path.name for path in folder.iterdir() if str(process.pid) in path.name}
        if len(seen) >= number:
            return kill(process)
        time.sleep(0.0002)
    kill(process)
    return False


def rows_of(folder: Path) -> list[tuple]:
    """The rows of the campaign in a folder, in order; the file must be intact."""
    file = folder / "campaign.sqlite"
    if not file.exists():
        return []
    with closing(sqlite3.connect(file)) as connection:
        assert connection.execute("PRAGMA integrity_check").fetchall() == [("ok",)], (
            "the campaign is damaged"
        )
        if not connection.execute("SELECT COUNT(*) FROM sqlite_master").fetchone()[0]:
            return []
        columns = (
            "position, symmetry, constants, euler_deg, status, message, "
            "indentation_modulus_gpa, depth_um, force_mn"
        )
        return connection.execute(
            f"SELECT {columns} FROM simulation ORDER BY position, id"
        ).fetchall()


def half_written(folder: Path) -> list[str]:
    """Files that have their final name and are incomplete."""
    bad = []
    for file in folder.glob("[!.]*"):
        try:
            if file.suffix == ".json":
                json.loads(file.read_text())
            elif file.name == "surrogate.txt":
                Surrogate.load(file)
            elif file.name == "posterior.bin":
                read_posterior(folder)
            elif file.name in (
                "report.html",
                "resolved.nml",
            ) and not file.read_text().endswith(("\n", ">")):
                bad.append(file.name)
        except (ValueError, InputError, OSError):
            bad.append(file.name)
    return bad


def posterior_of(folder: Path) -> list:
    """Every draw, of either program; nothing where there is none."""
    found = read_posterior(folder)
    return [found[name].tolist() for name in ("draws", "log_density") if found]


def results_of(folder: Path) -> dict:
    """The results that must have the same bits in two runs."""
    document = json.loads((folder / "build.json").read_text())
    return {
        "rows": rows_of(folder),
        "surrogate": (folder / "surrogate.txt").read_text(),
        "history": [document["history"], document["validation"]],
        "posterior": posterior_of(folder),
    }


def disturbed(program: str, folder: Path, kills: int, seed: int, command="run", **campaign) -> dict:
    """Kill a campaign at work `kills` times, one time in four inside a write, and then let it
    finish.

    A kill that comes too late is not counted, and the next ones come twice as early: how long a
    campaign takes depends on the machine. Gives how many kills met a process at work, what was lost
    or repeated, half-written files, and the parts of the results that are not, bit for bit, those
    of a run that was not disturbed.
    """
    whole, broken = (write_campaign(folder / name, **campaign) for name in ("whole", "broken"))
    begin = time.monotonic()
    finish(program, whole, command)
    needed = time.monotonic() - begin
    random_moments, met, inside, lost, halves = random.Random(seed), 0, 0, 0, []
    before: list[tuple] = []
    earliest = 0.6 if program == "bayesindent" else 0.02
    latest = earliest + 4.0 * max(needed - earliest, 0.1) / kills
    for _ in range(10 * kills):
        process = start(program, broken, command)
        if random_moments.random() < 0.25:
            was_met = kill_inside_a_write(
                process, broken.parent / "out", random_moments.randint(1, 5)
            )
            inside += was_met
        else:
            was_met = kill_after(process, random_moments.uniform(earliest, latest))
            if not was_met:
                earliest, latest = earliest / 2, latest / 2
        met += was_met
        after = rows_of(broken.parent / "out")
        # Rows that were stored before are unchanged.
        lost += len([row for row in before if row not in after])
        before = after
        halves += half_written(broken.parent / "out")
        if met == kills:
            break
    finish(program, broken, command)
    ends = [results_of(path.parent / "out") for path in (whole, broken)]
    rows = ends[1]["rows"]
    return {
        "kills": met,
        "inside a write": inside,
        "simulations": len(rows),
        "lost": lost + len(set(ends[0]["rows"]) - set(rows)),
        "repeated": len(rows) - len({row[1:4] for row in rows}) + len(rows) - len(ends[0]["rows"]),
        "half-written files": sorted(set(halves)),
        "other": [name for name in ends[0] if ends[0][name] != ends[1][name]],
    }
