"""Damage the files of a campaign, fill the disk under it, take the permissions away; check how both
programs respond.

A fault is met well if the program ends as it should without one, with the same numbers, or with one
line that names the file and the cause, and with an exit status that says whose fault it is. All
else is told in words.
"""

import ctypes
import json
import os
import random
import re
import shutil
import sqlite3
import subprocess
import sys
import time
from collections.abc import Iterator
from contextlib import closing, contextmanager
from pathlib import Path

from support.fault_kills import PROGRAMS, SOURCE, half_written, kill_after, posterior_of, words_for

#: A campaign of the theory, the constants from its surrogate, and what to measure next: seconds in
#: Python, a tenth in Fortran.
QUICK = """\
&problem symmetry = 'cubic' /
&simulation simulator = 'theory' /
&domain c_min = 50, 40, 15 c_max = 250, 150, 120 anisotropy_cap = 7.2 /
&surrogate model = 'paper' degree = 1 bandlimit = 4 file = 'surrogate.txt' /
&design n_candidates = 200 budget = 20 batch = 6 /
&measurements file = 'grains.csv' modulus_kind = 'indentation_modulus' /
&prior c_min = 50, 40, 15 c_max = 250, 150, 120 anisotropy_cap = 7.2 /
&sampler samples = 500 burn_in = 1000 chains = 2 /
&next count = 1 /
&execution workers = 1 /
"""

#: Seconds after which a program hangs.
PATIENCE = 60


def write_quick(folder: Path) -> Path:
    """Make a folder with the namelist of the campaign; return the namelist."""
    folder.mkdir(parents=True, exist_ok=True)
    (folder / "grains.csv").write_text(
        (SOURCE / "tests" / "reference" / "cubic_fe3si.csv").read_text()
    )
    path = folder / "quick.nml"
    path.write_text(QUICK)
    return path


def run(
    program: str, namelist: Path, *arguments: str, command: str = "run", **options
) -> subprocess.CompletedProcess:
    """A command of either program, with its results in `out` beside the namelist."""
    words = words_for(program, command)
    what = str(namelist.parent / "out") if command == "report" else str(namelist)
    where = [] if command == "report" else ["--output", str(namelist.parent / "out")]
    return subprocess.run(
        [*words, what, *where, *arguments],
        cwd=namelist.parent,
        capture_output=True,
        text=True,
        errors="replace",
        stdin=subprocess.DEVNULL,
        timeout=PATIENCE,
        **options,
    )


def finished(program: str, folder: Path, command: str) -> Path:
    """The namelist of a campaign that was run to its end by a command of a program."""
    namelist = write_quick(folder)
    done = run(program, namelist, command=command)
    assert done.returncode == 0, done.stderr
    return namelist


def damages(content: bytes, others: dict[str, bytes], seed: int) -> Iterator[tuple[str, bytes]]:
    """Names of kinds of damage, and the content of a file after each."""
    dice = random.Random(seed)
    yield "emptied", b""
    yield "cut short", content[: dice.randrange(1, len(content))]
    for _ in range(4):
        at = dice.randrange(len(content))
        yield (
            "one bit changed",
            content[:at] + bytes([content[at] ^ (1 << dice.randrange(8))]) + content[at + 1 :],
        )
    at, size = dice.randrange(len(content)), dice.choice((8, 64, 512))
    yield (
        "bytes changed",
        content[:at] + dice.randbytes(len(content[at : at + size])) + content[at + size :],
    )
    yield "zeros in it", content[:at] + bytes(len(content[at : at + size])) + content[at + size :]
    name = dice.choice(sorted(others))
    yield "another file", others[name]


def others(folder: Path) -> dict[str, bytes]:
    """Contents of files of other kinds."""
    database = folder / "other.sqlite"
    with closing(sqlite3.connect(database)) as connection:
        connection.execute("CREATE TABLE IF NOT EXISTS recipes (name TEXT)")
    found = {
        "database": database.read_bytes(),
        "JSON": b'{"a": 1}\n',
        "PNG": b"\x89PNG\r\n\x1a\n" + bytes(100),
        "text": b"one\ntwo\n",
    }
    database.unlink()
    return found


def words_of(done: subprocess.CompletedProcess, file: str, status: int) -> str:
    """What is wrong in the response of a program to a damaged file; '' if nothing is."""
    lines = [
        line
        for line in done.stderr.splitlines()
        if not re.match(r"warning: |note: |[a-z ]+: \d+(/\d+ in| simulations of) ", line)
    ]
    if "Traceback" in done.stderr or done.returncode < 0 or done.returncode > 2:
        return f"crashed with exit status {done.returncode}: {done.stderr[-300:]}"
    if done.returncode != status:
        return f"exit status {done.returncode} instead of {status}: {done.stderr[-300:]}"
    if len(lines) != 1 or file not in lines[0]:
        return f"not one line that names {file}: {lines}"
    return ""


def numbers_of(folder: Path) -> list:
    """The results that must have the same bits if a program accepts a damaged file."""
    numbers: list = [(folder / "surrogate.txt").read_text(), posterior_of(folder)]
    with closing(sqlite3.connect(folder / "campaign.sqlite")) as connection:
        columns = (
            "symmetry, constants, euler_deg, status, message, indentation_modulus_gpa, "
            "elements, depth_um, force_mn"
        )
        numbers.append(
            connection.execute(f"SELECT {columns} FROM simulation ORDER BY position, id").fetchall()
        )
    return numbers


def killed(command: str, folder: Path, kills: int, seed: int) -> dict:
    """Kill `report`, `compare` or `init` at random moments, and let it do its work after each kill:
    the files must be those of an undisturbed one.
    """
    results = finished("bayesindent", folder, "run").parent / "out"
    shutil.copytree(results, folder / "other")
    where = {
        "report": ["out", "--output", "new"],
        "compare": ["out", "other", "--output", "new"],
        "init": ["cubic", "--output", "new"],
    }
    words, new, dice = (
        [*PROGRAMS["bayesindent"], command, *where[command]],
        folder / "new",
        random.Random(seed),
    )
    outcome: dict = {"tries": 0, "refused": 0, "same": 0, "wrong": []}
    whole, needed = [], 0.0
    while outcome["tries"] < kills:
        shutil.rmtree(new, ignore_errors=True)
        if whole:
            process = subprocess.Popen(
                words,
                cwd=folder,
                start_new_session=True,
                stdout=subprocess.PIPE,
                stderr=subprocess.PIPE,
            )
            if not kill_after(process, dice.uniform(0.3 * needed, needed)):
                continue
            outcome["tries"] += 1
            if new.exists() and (bad := half_written(new)):
                outcome["wrong"].append(f"half-written: {bad}")
        begun = time.monotonic()
        done = subprocess.run(words, cwd=folder, capture_output=True, text=True, timeout=PATIENCE)
        needed = time.monotonic() - begun
        # A kill may come after the last file, which `init` does not replace.
        present = sorted(path.name for path in new.iterdir() if not path.name.startswith("."))
        whole = whole or present
        if done.returncode not in ((0, 2) if command == "init" else (0,)) or present != whole:
            outcome["wrong"].append(
                f"exit status {done.returncode}, {present}: {done.stderr[-300:]}"
            )
    outcome["same"] = outcome["tries"] - len(outcome["wrong"])
    return outcome


#: The command that reads a file of the results.
READERS = dict.fromkeys(
    ("posterior.bin", "build.json", "summary.json", "next.json", "resolved.nml"), "report"
)


def damaged(program: str, folder: Path, file: str, seeds: range) -> dict:
    """Damage a file of a finished campaign again and again. Gives the number of tries, of refusals
    in words, of tries that gave the same numbers, and what went wrong.
    """
    namelist = finished(program, folder / "whole", "run")
    results = namelist.parent / "out"
    content, expected = (results / file).read_bytes(), numbers_of(results)
    kept = folder / "kept"
    shutil.copytree(results, kept)
    outcome: dict = {"tries": 0, "refused": 0, "same": 0, "wrong": []}
    for seed in seeds:
        for kind, bad in damages(content, others(folder), seed):
            if bad == content:
                continue
            shutil.rmtree(results)
            shutil.copytree(kept, results)
            (results / file).write_bytes(bad)
            if file == "surrogate.txt":
                # Otherwise the program would write it again.
                namelist.write_text(
                    "\n".join(line for line in QUICK.splitlines() if not line.startswith("&design"))
                    + "\n"
                )
            outcome["tries"] += 1
            try:
                done = run(program, namelist, command=READERS.get(file, "run"))
            except subprocess.TimeoutExpired:
                outcome["wrong"].append(f"{kind}: hangs")
                continue
            if done.returncode == 0 and file != "surrogate.txt" and numbers_of(results) == expected:
                outcome["same"] += 1
            elif wrong := words_of(done, file, 2):
                outcome["wrong"].append(f"{kind} (seed {seed}): {wrong}")
            else:
                outcome["refused"] += 1
    return outcome


@contextmanager
def small_disk(kilobytes: int) -> Iterator[Path | None]:
    """Mount a disk of this size; None if this user may not mount one."""
    import tempfile

    with tempfile.TemporaryDirectory() as name:
        mounted = (
            subprocess.run(
                ["mount", "-t", "tmpfs", "-o", f"size={kilobytes}k", "tmpfs", name],
                capture_output=True,
            ).returncode
            == 0
        )
        try:
            yield Path(name) if mounted else None
        finally:
            if mounted:
                subprocess.run(["umount", "-l", name], check=True)


def full_disk(program: str, sizes: range, command: str = "run") -> dict:
    """Run a campaign on disks with so many kilobytes left, from an empty folder and after a
    finished run of which the surrogate and the posterior are to be written anew; then free the
    disk, and run on.
    """
    outcome: dict = {"tries": 0, "refused": 0, "same": 0, "wrong": []}
    with small_disk(8000) as disk:
        if disk is None:
            return outcome
        namelist = finished(program, disk, command)
        expected = numbers_of(disk / "out")
        for left in sizes:
            for again in (False, True):
                if again:
                    (disk / "out" / "build.json").unlink()
                else:
                    shutil.rmtree(disk / "out")
                fill(disk, left)
                before = {path.name: path.read_bytes() for path in (disk / "out").glob("*")}
                done = run(program, namelist, command=command)
                (disk / "fill").unlink()
                outcome["tries"] += 1
                wrong = ""
                if done.returncode == 0:
                    outcome["same"] += 1
                else:
                    wrong = words_of(done, "", 1)
                    if not wrong and "disk is full" not in done.stderr:
                        wrong = f"does not say that the disk is full: {done.stderr}"
                    outcome["refused"] += not wrong
                wrong = wrong or broken_files(disk / "out", before)
                after = run(program, namelist, command=command)
                if after.returncode != 0 or numbers_of(disk / "out") != expected:
                    wrong = (
                        wrong
                        or f"with room again: exit status {after.returncode}, {after.stderr[-200:]}"
                    )
                if wrong:
                    outcome["wrong"].append(f"{left} kB left: {wrong}")
    return outcome


def fill(disk: Path, left: int) -> None:
    """Leave so many kilobytes of a disk."""
    with open(disk / "fill", "wb", buffering=0) as stream:
        free = os.statvfs(disk)
        stream.write(bytes(max(0, free.f_bavail * free.f_frsize - left * 1024)))


def broken_files(folder: Path, before: dict[str, bytes]) -> str:
    """Files that a full disk left broken or that are gone, in words."""
    gone = sorted(
        name
        for name in before
        if not name.startswith(".part-")
        and not name.endswith("-journal")
        and not (folder / name).exists()
    )
    half = []
    for path in folder.glob("*.json"):
        try:
            json.loads(path.read_text())
        except ValueError:
            half.append(path.name)
    return f"gone: {gone}; half: {half}" if gone or half else ""


def heed_permissions() -> None:
    """Make permissions of files hold for this process and its children, even for root."""
    drop_from_bounding_set, override_permissions = 24, 1
    if os.geteuid() == 0 and ctypes.CDLL(None, use_errno=True).prctl(
        drop_from_bounding_set, override_permissions, 0, 0, 0
    ):
        raise OSError(ctypes.get_errno(), "root's right to write everything cannot be dropped")


def no_permission(program: str, folder: Path, command: str = "run") -> dict:
    """Results in a folder, and a campaign, that this user may only read."""
    outcome: dict = {"tries": 0, "refused": 0, "same": 0, "wrong": []}
    namelist = finished(program, folder / "whole", command)
    results = namelist.parent / "out"
    results.chmod(0o555)
    for file in ("", "campaign.sqlite"):
        if file:
            # The folder takes files, the campaign takes no rows.
            results.chmod(0o755)
            (results / file).chmod(0o444)
        outcome["tries"] += 1
        done = run(program, namelist, command=command, preexec_fn=heed_permissions)
        wrong = words_of(done, str(results), 1)
        outcome["refused"] += not wrong
        if wrong:
            outcome["wrong"].append(wrong)
    return outcome


if __name__ == "__main__":
    sys.exit("these are the parts of `bench faults`")
