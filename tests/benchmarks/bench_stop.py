"""Stop both programs in every stage, and start many at once in a new folder.

Each stage gets a signal at a random moment, three in a row, SIGINT, SIGTERM and SIGHUP in turn: how
long it takes to end, whether status and message are right, and whether a row of the campaign is
lost or damaged. Processes that begin at once: how many worked, how many were refused in words, and
what went wrong.
"""

import argparse
import random
import signal
import sqlite3
import subprocess
import sys
import tempfile
import time
from contextlib import closing
from pathlib import Path

from support.programs import BATCH
from support.tree import SOURCE

PROGRAMS = {
    "bayesindent": lambda stage: [sys.executable, "-m", "bayesindent", stage],
    "bayesindent-batch": lambda stage: [BATCH],
}
SIGNALS = (signal.SIGINT, signal.SIGTERM, signal.SIGHUP)

POINTS = "C11,C12,C44,phi1_deg,Phi_deg,phi2_deg\n" + "".join(
    f"{160 + i % 100},110,{70 + i % 100 / 7:.3f},{3 * i},{i % 90},0\n" for i in range(2000)
)
STEP_2 = f"&measurements file = '{SOURCE}/inputs/data/fe3si.csv' /\n"
#: Each takes minutes, but the last, which is stopped anywhere.
STAGES = {
    "simulate": "&problem symmetry = 'cubic' /\n&crystals points = 'points.csv' /\n",
    "build": "&problem symmetry = 'cubic' /\n"
    "&specimen geometry = 'block' /\n"
    "&design budget = 1000, batch = 3 /\n",
    "build by theory": "&problem symmetry = 'hexagonal' /\n"
    "&simulation simulator = 'theory' /\n"
    "&surrogate model = 'paper', bandlimit = 4 /\n"
    "&domain c_min = 80, 40, 30, 70, 40, c_max = 240, 120, 90, 210, 90 /\n"
    "&design n_candidates = 40000, budget = 5000, batch = 20 /\n",
    "extract": "&problem symmetry = 'triclinic' /\n" + STEP_2,
    "next": "&problem symmetry = 'triclinic' /\n" + STEP_2 + "&next count = 5 /\n",
    "extract anywhere": "&problem symmetry = 'cubic' /\n" + STEP_2,
}


def main(argv=None) -> int:
    """Print both tables; exit status 1 if anything went wrong."""
    parser = argparse.ArgumentParser(
        prog="bench stop", description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument(
        "--tries", type=int, default=6, help="signals in each stage of each program (6)"
    )
    parser.add_argument("--rounds", type=int, default=20, help="how often many begin at once (20)")
    parser.add_argument("--processes", type=int, default=8, help="how many (8)")
    parser.add_argument("--seed", type=int, default=1)
    arguments = parser.parse_args(argv)
    rng = random.Random(arguments.seed)
    print(
        "| stage | program | signals | median, ms | longest, ms | went wrong |\n"
        "|---|---|---|---|---|---|"
    )
    wrong = 0
    for stage in STAGES:
        for program in PROGRAMS:
            if program == "bayesindent-batch" and stage == "next":
                continue
            seconds, faults = [], []
            for k in range(arguments.tries):
                with tempfile.TemporaryDirectory() as folder:
                    taken, fault = stop(
                        Path(folder), program, stage, SIGNALS[k % 3], rng.uniform(2, 12)
                    )
                seconds += [taken] * (taken is not None)
                faults += [fault] * bool(fault)
            wrong += len(faults)
            times = [
                f"{1000 * sorted(seconds)[n]:.0f}" if seconds else ""
                for n in (len(seconds) // 2, -1)
            ]
            print(
                f"| {stage} | `{program}` | {len(seconds)} | {' | '.join(times)} | "
                f"{'; '.join(faults) or 0} |",
                flush=True,
            )
    print(
        "\n| begin at once | rounds | processes | worked | refused in words | went wrong |\n"
        "|---|---|---|---|---|---|"
    )
    for what in ("one namelist", "tell", "library"):
        worked, refused, faults = crowd(what, arguments.rounds, arguments.processes)
        wrong += len(faults)
        total = arguments.rounds * arguments.processes
        print(
            f"| {what} | {arguments.rounds} | {total} | {worked} | {refused} | "
            f"{'; '.join(sorted(set(faults))) or 0} |",
            flush=True,
        )
    return int(wrong > 0)


def start(folder: Path, program: str, stage: str) -> subprocess.Popen:
    """A program at work on a stage in folder/out."""
    (folder / "points.csv").write_text(POINTS)
    (folder / "a.nml").write_text(STAGES[stage])
    command = [*PROGRAMS[program](stage.split()[0]), "a.nml", "--output", "out"]
    pipes = {"stdout": subprocess.PIPE, "stderr": subprocess.PIPE, "text": True}
    return subprocess.Popen(command, cwd=folder, **pipes, preexec_fn=heed_signals)


def heed_signals() -> None:
    """What a shell or nohup had this process ignore is not ignored in what it starts."""
    for number in (signal.SIGINT, signal.SIGTERM, signal.SIGHUP):
        signal.signal(number, signal.SIG_DFL)


def stored(folder: Path) -> list:
    """The rows of the campaign in out/, which may not be there yet."""
    file = folder / "out" / "campaign.sqlite"
    if not file.exists():
        return []
    with closing(sqlite3.connect(f"file:{file}?mode=ro", uri=True)) as campaign:
        try:
            return campaign.execute("SELECT * FROM simulation ORDER BY id").fetchall()
        except sqlite3.OperationalError:
            return []


def stop(
    folder: Path, program: str, stage: str, number: signal.Signals, after: float
) -> tuple[float | None, str]:
    """Seconds from the first of three signals to the end, None if it had ended before; and what
    went wrong.
    """
    process = start(folder, program, stage)
    while not (folder / "out" / ".lock").exists() and process.poll() is None:
        time.sleep(0.01)
    time.sleep(after)
    if process.poll() is not None:
        error = process.communicate()[1]
        return None, "" if process.returncode == 0 else error.splitlines()[-1]
    before = stored(folder)
    begin = time.monotonic()
    for _ in range(3):
        process.send_signal(number)
    error = process.communicate()[1]
    seconds = time.monotonic() - begin
    if process.returncode == 0:
        return None, ""
    told = error.splitlines()[-1:]
    log = (folder / "out" / "run.log").read_text().splitlines()[-1:]
    if (
        process.returncode != 128 + number
        or not told
        or not told[0].startswith(f"stopped by {number.name}; ")
        or told[0] not in log[0]
    ):
        return seconds, f"status {process.returncode}, {told}, {log}"
    return seconds, damage(folder / "out", before)


def damage(output: Path, before: list) -> str:
    """What is wrong with a campaign that had these rows."""
    if not (output / "campaign.sqlite").exists():
        return ""
    with closing(sqlite3.connect(output / "campaign.sqlite")) as campaign:
        whole = campaign.execute("PRAGMA integrity_check").fetchall() == [("ok",)]
    return (
        ""
        if whole and stored(output.parent)[: len(before)] == before
        else "the campaign is damaged"
    )


ADD = """import sys, time
from bayesindent.stages.build import tell
from bayesindent.settings.problem import Problem, read_crystals
problem, points = Problem("a.nml", "build"), read_crystals(f"{sys.argv[1]}.csv", "cubic")
time.sleep(max(0, float(sys.argv[2]) - time.time()))
tell(problem, "out", points)
"""
IMPORTED = """&problem symmetry = 'cubic' /
&simulation simulator = 'import' /
&domain c_min = 50, 40, 15, c_max = 250, 150, 120 /
&surrogate degree = 2, bandlimit = 4 /
&design n_candidates = 100, budget = 10 /
"""


def crowd(what: str, rounds: int, processes: int) -> tuple[int, int, list[str]]:
    """How many of many that begin at once in a new folder worked, how many were refused, and what
    went wrong.
    """
    worked, refused, faults = 0, 0, []
    for _ in range(rounds):
        with tempfile.TemporaryDirectory() as name:
            folder = Path(name)
            (folder / "points.csv").write_text("\n".join(POINTS.splitlines()[:3]) + "\n")
            (folder / "a.nml").write_text(
                STAGES["simulate"] if what == "one namelist" else IMPORTED
            )
            for i in range(processes):
                (folder / f"{i}.csv").write_text(
                    "C11,C12,C44,phi1_deg,Phi_deg,phi2_deg,modulus_gpa\n"
                    f"{200 + i},100,50,0,0,0,150\n"
                )
            python, at = [sys.executable, "-m", "bayesindent"], str(time.time() + 3)
            both = [
                [*python, "simulate", "a.nml", "--output", "out"],
                [BATCH, "a.nml", "--output", "out"],
            ]
            commands = {
                "one namelist": [both[i % 2] for i in range(processes)],
                "tell": [
                    [*python, "build", "a.nml", "--output", "out", "--tell", f"{i}.csv"]
                    for i in range(processes)
                ],
                "library": [[sys.executable, "-c", ADD, str(i), at] for i in range(processes)],
            }[what]
            pipes = {"stdout": subprocess.DEVNULL, "stderr": subprocess.PIPE, "text": True}
            started = [subprocess.Popen(command, cwd=folder, **pipes) for command in commands]
            errors = [process.communicate()[1] for process in started]
            for process, error in zip(started, errors, strict=True):
                busy = (
                    what == "one namelist"
                    and process.returncode == 2
                    and "is at work in this folder" in error
                )
                worked, refused = worked + (process.returncode == 0), refused + busy
                if process.returncode != 0 and not busy:
                    faults.append(f"status {process.returncode}, {error.splitlines()[-1:]}")
            wanted = 2 if what == "one namelist" else processes
            faults += ["rows are missing"] * (len(stored(folder)) != wanted)
            faults += [damage(folder / "out", [])] * bool(damage(folder / "out", []))
    return worked, refused, faults
