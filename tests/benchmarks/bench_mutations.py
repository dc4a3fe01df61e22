"""Inputs with a few bytes changed: each is read, or refused in one line that names the file; nothing else happens, and nothing is slow.

Namelists and tables of inputs/, the surrogate that comes with the package, a spreadsheet (its bytes, or those of the files in it) and an
orientation map lose, repeat or swap bytes and lines, or get numbers, signs and bytes that nobody means. All in this process but for some whole runs of both programs, whose verdicts of a namelist must be the same.
"""

import argparse
import csv
import io
import random
import re
import shutil
import subprocess
import sys
import tempfile
import time
import zipfile
from collections import Counter
from pathlib import Path

import openpyxl
from measured_tables import read_measurements
from programs import BATCH

from bayesindent.core import BayesindentError
from bayesindent.settings.problem import Problem
from bayesindent.surrogate.surrogate import Surrogate

SOURCE = Path(__file__).parents[2]


def contents(*patterns: str) -> list[bytes]:
    """Of files of the source tree."""
    return [path.read_bytes() for pattern in patterns for path in sorted(SOURCE.glob(pattern))]


def spreadsheet() -> bytes:
    """A table of inputs/ as a spreadsheet."""
    book, file = openpyxl.Workbook(), io.BytesIO()
    for row in csv.reader((SOURCE / "inputs/data/fe3si.csv").read_text().splitlines()):
        book.active.append([float(cell) if re.fullmatch(r"[\d.]+", cell) else cell for cell in row])
    book.save(file)
    return file.getvalue()


def orientation_map() -> bytes:
    """Two grains of six by four points each."""
    head = ["Channel Text File", "Prj\ta", "Author\tb", "JobMode\tGrid", "XCells\t12", "YCells\t4", "XStep\t1", "YStep\t1"]
    head += ["AcqE1\t0", "AcqE2\t0", "AcqE3\t0", "Euler angles refer to Sample Coordinate system (CS0)!\tMag\t100", "Phases\t1"]
    head += ["2.866;2.866;2.866\t90;90;90\tIron\t11\t229\t\t\t", "Phase\tX\tY\tBands\tError\tEuler1\tEuler2\tEuler3\tMAD\tBC\tBS"]
    points = [f"1\t{k % 12}\t{k // 12}\t8\t0\t{30 if k % 12 < 6 else 200}\t40\t70\t0.5\t100\t100" for k in range(48)]
    return "\n".join([*head, *points, ""]).encode()


SEEDS = {
    ".nml": contents("inputs/*.nml", "inputs/case_studies/*.nml"),
    ".csv": contents("inputs/data/*.csv"),
    ".txt": contents("python/bayesindent/data/block.txt"),
    ".xlsx": [spreadsheet()],
    ".ctf": [orientation_map()],
}
#: Indents on the map.
INDENTS = {"x_um": [2.0, 9.0], "y_um": [1.0, 2.0], "Er": [200.0, 210.0], "sd": [4.0, 4.0]}
COMMANDS = ("run", "simulate", "theory", "size", "build", "extract", "next")
#: What is put in: marks of the syntax, and values that nobody means.
PIECES = [
    *(
        b"'",
        b'"',
        b"&",
        b"/",
        b"=",
        b",",
        b"!",
        b"\n",
        b"\r\n",
        b"\x00",
        b";",
        b"\xff",
        b"\xef\xbb\xbf",
        b"*",
        b"(",
        b")",
        b"2*3",
        b"%",
        b"\t",
    ),
    *(b"1e999", b"nan", b"-inf", b"-1", b"1e-320", b"999999999999999999999", b"0", b"1d5", b".", b"", b"3,5"),
]
#: Seconds that reading one file may take.
SLOW = 5.0


def mutated(content: bytes, rng: random.Random) -> bytes:
    """The content with one change or a few; of an archive those of one file, or of its bytes."""
    if content.startswith(b"PK") and rng.random() < 0.8:
        changed = io.BytesIO()
        with zipfile.ZipFile(io.BytesIO(content)) as before, zipfile.ZipFile(changed, "w") as after:
            chosen = rng.choice(before.namelist())
            for name in before.namelist():
                after.writestr(name, mutated(before.read(name), rng) if name == chosen else before.read(name))
        return changed.getvalue()
    for _ in range(rng.choice([1, 1, 2, 5])):
        first = rng.randrange(len(content) + 1)
        last = min(len(content), first + rng.choice([1, 1, 3, 10, 100]))
        kind = rng.randrange(7)
        if kind == 0:
            content = content[:first] + content[last:]
        elif kind == 1:
            content = content[:first] + rng.randbytes(last - first) + content[last:]
        elif kind == 2:
            content = content[:first] + rng.choice(PIECES) + content[first:]
        elif kind == 3:
            content = content[:first] + rng.choice([1, 3, 50]) * content[first:last] + content[first:]
        elif kind == 4:
            lines = content.split(b"\n")
            lines.insert(rng.randrange(len(lines)), lines.pop(rng.randrange(len(lines))))
            content = b"\n".join(lines)
        elif kind == 5:
            content = content[:first] if rng.random() < 0.2 else content
        else:
            numbers = list(re.finditer(rb"\d+\.?\d*", content))
            if numbers:
                number = rng.choice(numbers)
                content = content[: number.start()] + rng.choice(PIECES) + content[number.end() :]
    return content


def read(path: Path, command: str) -> str:
    """'read' or 'refused'; what else happens is raised or told."""
    start = time.perf_counter()
    try:
        if path.suffix == ".nml":
            Problem(path, command)
        elif path.suffix == ".ctf":
            Problem.from_keywords(str(path), {"measurements": INDENTS}, problem={"symmetry": "cubic"}, measurements={"ebsd": path})
        elif path.suffix != ".txt":
            read_measurements(path, "cubic", modulus_kind="indentation_modulus")
        else:
            Surrogate.load(path)
        outcome = "read"
    except BayesindentError as error:
        text = str(error)
        outcome = "refused" if text.startswith(str(path)) and "\n" not in text else f"refused in words that are none: {text!r}"
    return outcome if time.perf_counter() - start < SLOW else f"{outcome}, slowly"


def try_in_process(tries: int, seed: int, folder: Path) -> tuple[Counter, list[str]]:
    """How many were read and refused by kind of file, and what else happened; the file of each such case is kept in `folder`."""
    rng, counted, failures = random.Random(seed), Counter(), []
    shutil.copytree(SOURCE / "inputs/data", folder / "data", dirs_exist_ok=True)
    for suffix, files in SEEDS.items():
        # Unchanged: the packages that read maps take seconds to begin.
        (folder / f"whole{suffix}").write_bytes(files[0])
        read(folder / f"whole{suffix}", "run")
    for number in range(tries):
        suffix = rng.choice([".nml"] * 6 + [".csv"] * 3 + [".xlsx"] * 2 + [".txt", ".ctf"])
        path = folder / f"mutated{suffix}"
        path.write_bytes(mutated(rng.choice(SEEDS[suffix]), rng))
        try:
            outcome = read(path, rng.choice(COMMANDS))
        except Exception as error:  # whatever it is, it is a finding
            outcome = f"{type(error).__name__}: {error}"
        counted[suffix, outcome if outcome in ("read", "refused") else "wrong"] += 1
        if outcome not in ("read", "refused"):
            shutil.copy(path, folder / f"case_{number}{suffix}")
            failures.append(f"case_{number}{suffix}: {outcome}")
    return counted, failures


def try_programs(tries: int, seed: int, folder: Path, programs: tuple[list[str], list[str]]) -> list[str]:
    """Whether a check of a namelist by both programs ends alike, with status 0 or 2 and one line; what differs."""
    rng, failures = random.Random(seed), []
    shutil.copytree(SOURCE / "inputs/data", folder / "data", dirs_exist_ok=True)
    for number in range(tries):
        path = folder / "mutated.nml"
        path.write_bytes(mutated(rng.choice(SEEDS[".nml"]), rng))
        done = [subprocess.run([*program, path], cwd=folder, capture_output=True, timeout=60, check=False) for program in programs]
        status = [one.returncode for one in done]
        refusals = [one.stderr.decode(errors="replace").splitlines() if one.returncode else [] for one in done]
        if status[0] != status[1] or status[0] not in (0, 2) or refusals[0][-1:] != refusals[1][-1:]:
            shutil.copy(path, folder / f"both_{number}.nml")
            failures.append(f"both_{number}.nml: {status}, {refusals}")
    return failures


def main(argv=None) -> int:
    """Try, count; 1 if anything else happened."""
    parser = argparse.ArgumentParser(prog="bench mutations", description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--tries", type=int, default=2000, help="files in this process (2000)")
    parser.add_argument("--programs", type=int, default=100, help="namelists that both programs check (100)")
    parser.add_argument("--seed", type=int, default=1)
    arguments = parser.parse_args(argv)
    folder = Path(tempfile.mkdtemp(prefix="mutations_"))
    counted, failures = try_in_process(arguments.tries, arguments.seed, folder)
    print("| file | read | refused | anything else |\n|---|---|---|---|")
    for suffix in SEEDS:
        print(f"| {suffix} | " + " | ".join(str(counted[suffix, outcome]) for outcome in ("read", "refused", "wrong")) + " |")
    programs = (
        [sys.executable, "-m", "bayesindent", "run", "--check"],
        [str(BATCH), "--check"],
    )
    differences = try_programs(arguments.programs, arguments.seed, folder, programs)
    print(f"both programs on {arguments.programs} namelists: {len(differences)} that they judge differently or not in one line")
    for failure in failures + differences:
        print(failure)
    if failures or differences:
        print(f"the files are in {folder}")
        return 1
    shutil.rmtree(folder)
    return 0
