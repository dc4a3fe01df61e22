"""Inputs with a few bytes or their structure changed: each is read, or refused in one line that
names the file; nothing else happens, and nothing is slow.

Namelists and tables of inputs/, tables as laboratories have them, spreadsheets, curves and their
tests, files of an instrument, orientation maps and their points, surface waves, shared errors,
stated stiffnesses, and the surrogate that comes with the package lose, repeat or swap bytes and
lines, or get numbers, signs and bytes that nobody means. In every other one columns, rows, groups,
cells or datasets are gone, twice, elsewhere or of another kind instead. All in this process, but
for checks by both programs of files of other structures, whose verdicts must be the same. Files of
results are changed as a stranger may do it, and have right checksums.
"""

import argparse
import csv
import faulthandler
import io
import os
import random
import re
import resource
import shutil
import signal
import subprocess
import tempfile
import time
import zipfile
from collections import Counter
from collections.abc import Callable
from contextlib import redirect_stderr, redirect_stdout
from multiprocessing import get_context
from multiprocessing.connection import Connection
from pathlib import Path

import openpyxl
import orix.io

from bayesindent.core import BayesindentError
from bayesindent.lab.reading import text_with_commas
from bayesindent.program.cli import main as bayesindent
from bayesindent.settings.problem import Problem, stages
from bayesindent.stages.stage import run_stage
from bayesindent.surrogate.surrogate import Surrogate
from support.changed_results import change
from support.few_figures import few_figures
from support.programs import BATCH, SANITIZED
from support.structural_changes import restructured
from support.tree import SOURCE


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


def text(*lines: str) -> bytes:
    """Of these lines."""
    return "\n".join([*lines, ""]).encode()


def orientation_maps() -> dict[str, bytes]:
    """Two grains of six by four points each, by the ending of the file."""
    head = [
        "Channel Text File",
        "Prj\ta",
        "Author\tb",
        "JobMode\tGrid",
        "XCells\t12",
        "YCells\t4",
        "XStep\t1",
        "YStep\t1",
    ]
    head += [
        "AcqE1\t0",
        "AcqE2\t0",
        "AcqE3\t0",
        "Euler angles refer to Sample Coordinate system (CS0)!\tMag\t100",
        "Phases\t1",
    ]
    head += [
        "2.866;2.866;2.866\t90;90;90\tIron\t11\t229\t\t\t",
        "Phase\tX\tY\tBands\tError\tEuler1\tEuler2\tEuler3\tMAD\tBC\tBS",
    ]
    points = [
        f"1\t{k % 12}\t{k // 12}\t8\t0\t{30 if k % 12 < 6 else 200}\t40\t70\t0.5\t100\t100"
        for k in range(48)
    ]
    found = {".ctf": text(*head, *points)}
    with tempfile.TemporaryDirectory() as folder:
        (path := Path(folder, "map.ctf")).write_bytes(found[".ctf"])
        with redirect_stdout(io.StringIO()):
            loaded = orix.io.load(str(path))
            for ending in (".ang", ".h5"):
                orix.io.save(str(path.with_suffix(ending)), loaded)
                found[ending] = path.with_suffix(ending).read_bytes()
    return found


def curve(name: str, modulus: float) -> list[str]:
    """Rows of an elastic contact with a sphere of 5 um: test, s, nm, mN."""
    loads = [0.5 * k for k in range(1, 61)]
    return [
        f"{name},{0.2 * k},{1e3 * (0.75 * load / modulus / 5**0.5) ** (2 / 3):.4f},{load}"
        for k, load in enumerate(loads)
    ]


def laboratory_tables() -> list[bytes]:
    """Units below the header, statistics, decimal commas, repeated tests without sds, indices, and
    other encodings.
    """
    head, units = "Grain;Test;phi1;Phi;phi2;Er;StDev;N", ";;°;°;°;GPa;GPa;"
    rows = [f"G{k};{k};{46 + k},3;{88 - 9 * k},7;{19 * k},3;{180 + k},0;3,5;4" for k in range(6)]
    plain = "\n".join(
        ["Sample;Fe", "", head, units, *rows, "Mean;;;;;183;3,5;", "Std. Dev.;;;;;2;;", ""]
    )
    repeated = [
        "Direction\tTest\tGrain\tMean Er (GPa)",
        *(f"[1 {k // 2} 0]\t{k}\tg {k // 2}\t{200 + k} GPa" for k in range(8)),
    ]
    errors = ["[001];109.7 ± 3.0", "[011];112.3 ± 2.5", "[111];120.4 ± 3.1"]
    return [
        plain.encode("utf-16"),
        plain.encode("cp1252"),
        text(*repeated),
        text("plane;Er (GPa)", *errors),
    ]


def exported(modulus: float) -> bytes:
    """A curve as a Hysitron exports it."""
    rows = [row.split(",") for row in curve("a", modulus)]
    return text(
        "Number of Points = 60",
        "",
        "Depth (nm)\tLoad (mN)\tTime (s)",
        *("\t".join([*row[2:], row[1]]) for row in rows),
    )


MAPS = orientation_maps()
#: Kinds of files: the ending, their contents, and how many tries of a hundred each has.
SEEDS = {
    "namelist": (".nml", contents("inputs/*.nml", "inputs/case_studies/*.nml"), 30),
    "table": (
        ".csv",
        [
            (SOURCE / f"inputs/data/{name}.csv").read_bytes()
            for name in ("fe3si", "titanium", "zinc", "copper_film", "copper_grains")
        ],
        10,
    ),
    "laboratory table": (".csv", laboratory_tables(), 10),
    "spreadsheet": (".xlsx", [spreadsheet()], 10),
    "crystals": (
        ".csv",
        [(SOURCE / f"inputs/data/{name}.csv").read_bytes() for name in ("copper", "isotropic")],
        2,
    ),
    "curves": (
        ".csv",
        [text("test,time_s,depth_nm,load_mn", *curve("a", 100), *curve("q", 69.6))],
        7,
    ),
    "tests": (
        ".csv",
        [
            text(
                "test,grain,reference,session,phi1_deg,Phi_deg,phi2_deg",
                "a,g,,s1,10,20,30",
                "q,,quartz,s1,,,",
            )
        ],
        4,
    ),
    "instrument": (".txt", [exported(100)], 4),
    "map": (".ctf", [MAPS[".ctf"]], 4),
    "map of EDAX": (".ang", [MAPS[".ang"]], 4),
    "map of HDF5": (".h5", [MAPS[".h5"]], 4),
    "points": (
        ".csv",
        [text("x_um,y_um,map_x_um,map_y_um", "0,0,0,0", "0,3,0,3", "11,0,11,0", "11,3.1,11,3")],
        3,
    ),
    "velocities": (
        ".csv",
        [
            text(
                "grain,phi1_deg,Phi_deg,phi2_deg,propagation_deg,rayleigh_velocity_m_s,sd_m_s"
                ",group",
                "a,1,2,3,4,2000,9,s",
                "b,5,40,7,8,2100,9,t",
            )
        ],
        3,
    ),
    "shared errors": (
        ".csv",
        [text("grain,shared_1,shared_2", "a,0.02,0.01", "b,0.02,-0.01", "c,0.02,0.0")],
        2,
    ),
    "stiffness": (".csv", contents("inputs/data/titanium_dft.csv"), 2),
    "orientations": (".csv", [text("grain,phi1_deg,Phi_deg,phi2_deg", "a,1,2,3", "b,40,50,60")], 2),
    "joined": (".txt", [text("Grain\tphi1\tPhi\tphi2", "a\t1\t2\t3", "b\t40\t50\t60")], 6),
    "surrogate": (".txt", contents("python/bayesindent/data/block.txt"), 3),
}
#: What stands beside the changed file.
BESIDE = {
    "curves.csv": SEEDS["curves"][1][0],
    "tests.csv": SEEDS["tests"][1][0],
    "map.ctf": MAPS[".ctf"],
    "grains.csv": text(
        "grain,phi1_deg,Phi_deg,phi2_deg,effective_modulus_gpa,sd_gpa",
        "a,1,2,3,150,3",
        "b,4,50,6,160,3",
        "c,7,8,9,170,3",
    ),
    "moduli.csv": text("grain,test,Er,sd", "a,1,150,3", "a,2,152,3", "B,1,160,3"),
    "indents.csv": text("x_um,y_um,Er,sd", "2,1,200,4", "9,2,210,4"),
}
STEP_0 = (
    "&curves {} radius_um = 5 / &references name = 'quartz', young_gpa = 72, young_sd_gpa = "
    "0.5, nu = 0.17 /"
)
CUBIC, ON_MAP = (
    "&problem symmetry = 'cubic' /",
    "&problem symmetry = 'cubic' / &measurements file = 'indents.csv', ",
)
#: A namelist that names the changed file, and the stage that it is opened for.
NAMELISTS = {
    "table": (
        "extract",
        f"{CUBIC} &measurements file = '{{file}}', modulus_kind = 'indentation_modulus' /",
    ),
    "laboratory table": ("extract", f"{CUBIC} &measurements file = '{{file}}' /"),
    "spreadsheet": (
        "extract",
        f"{CUBIC} &measurements file = '{{file}}', modulus_kind = 'indentation_modulus' /",
    ),
    "crystals": ("theory", f"{CUBIC} &crystals points = '{{file}}' /"),
    "curves": ("curves", STEP_0.format("file = '{file}', tests = 'tests.csv'")),
    "tests": ("curves", STEP_0.format("file = 'curves.csv', tests = '{file}'")),
    "instrument": ("curves", STEP_0.format("files = '{file}', 'q.txt', tests = 'instrument.csv'")),
    **dict.fromkeys(
        ("map", "map of EDAX", "map of HDF5"), ("extract", f"{ON_MAP}ebsd = '{{file}}' /")
    ),
    "points": ("extract", f"{ON_MAP}ebsd = 'map.ctf', ebsd_points = '{{file}}' /"),
    "velocities": (
        "extract",
        "&problem symmetry = 'cubic', density_kg_m3 = 8960 / &measurements velocities = '{file}' /",
    ),
    "shared errors": (
        "extract",
        f"{CUBIC} &measurements file = 'grains.csv', shared_errors = '{{file}}' /",
    ),
    "stiffness": (
        "extract",
        "&problem symmetry = 'hexagonal' / &measurements file = 'grains.csv' / &knowledge "
        "stiffness_file = '{file}' /",
    ),
    "orientations": (
        "extract",
        f"{CUBIC} &measurements file = 'grains.csv', orientations = 'unknown', "
        "texture = '{file}' /",
    ),
    "joined": (
        "extract",
        f"{CUBIC} &measurements file = 'moduli.csv', orientations_file = '{{file}}' /",
    ),
    "surrogate": (
        "extract",
        f"{CUBIC} &measurements file = 'grains.csv' / &surrogate file = '{{file}}' /",
    ),
}
#: Kinds of files that the batch program reads as well.
OF_BOTH = (
    "namelist",
    "crystals",
    "curves",
    "tests",
    "velocities",
    "shared errors",
    "stiffness",
    "orientations",
    "surrogate",
)
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
    *(
        b"1e999",
        b"1e308",
        b"nan",
        b"-inf",
        b"-1",
        b"1e-320",
        b"999999999999999999999",
        b"0",
        b"1d5",
        b".",
        b"",
        b"3,5",
    ),
]
#: Lines beside those of a refusal.
NOTES = re.compile("warning: |note: ")
#: CPU seconds that reading one file may take, a check, and a command; seconds to wait for them.
SLOW, CHECK_S, HANGS_S, WAITS_S = 5.0, 10, 600 if SANITIZED else 60, 1200


def mutated(content: bytes, rng: random.Random) -> bytes:
    """The content with one change or a few; of an archive those of one file, or of its bytes."""
    if content.startswith(b"PK") and rng.random() < 0.8:
        changed = io.BytesIO()
        with zipfile.ZipFile(io.BytesIO(content)) as before, zipfile.ZipFile(changed, "w") as after:
            chosen = rng.choice(before.namelist())
            for name in before.namelist():
                after.writestr(
                    name, mutated(before.read(name), rng) if name == chosen else before.read(name)
                )
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
            content = (
                content[:first] + rng.choice([1, 3, 50]) * content[first:last] + content[first:]
            )
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


def changed(kind: str, rng: random.Random) -> bytes:
    """A file of a kind with changed bytes or, as often, another structure."""
    ending, files, _ = SEEDS[kind]
    content = rng.choice(files)
    return restructured(content, ending, rng) if rng.random() < 0.5 else mutated(content, rng)


def read(path: Path, kind: str, command: str) -> str:
    """'read' or 'refused'; what else happens is raised or reported."""
    start = time.process_time()
    try:
        if kind == "namelist":
            Problem(path, command)
        else:
            command, _ = NAMELISTS[kind]
            problem = Problem(path.with_suffix(".nml"), command)
            if command in ("curves", "theory"):
                run_stage(problem, command, path.parent / "out")
            elif kind == "surrogate":
                Surrogate.load(path)
        outcome = "read"
    except BayesindentError as error:
        words = str(error)
        named = words.startswith((str(path), str(path.with_suffix(".nml"))))
        outcome = (
            "refused"
            if named and "\n" not in words
            else f"refused in words that are none: {words!r}"
        )
    return outcome if time.process_time() - start < SLOW else f"{outcome}, slowly"


def prepare(folder: Path) -> None:
    """The files beside those that are changed."""
    shutil.copytree(SOURCE / "inputs/data", folder / "data", dirs_exist_ok=True)
    for name, content in BESIDE.items():
        (folder / name).write_bytes(content)
    (folder / "q.txt").write_bytes(exported(69.6))
    (folder / "instrument.csv").write_bytes(text("test,grain,reference", "changed,g,", "q,,quartz"))


def write(kind: str, content: bytes, folder: Path) -> Path:
    """The changed file; beside it the namelist that names it."""
    path = folder / f"changed{SEEDS[kind][0]}"
    path.write_bytes(content)
    if kind in NAMELISTS:
        path.with_suffix(".nml").write_text(
            NAMELISTS[kind][1].format(file=path.name).replace(" / ", " /\n") + "\n"
        )
    return path


def keep(folder: Path, case: str) -> None:
    """Copy the files of a case that went wrong."""
    (folder / case).mkdir()
    for file in folder.glob("changed.*"):
        shutil.copy(file, folder / case)


def try_in_process(tries: int, seed: int, folder: Path) -> tuple[Counter, list[str]]:
    """How many were read and refused by kind of file, and what else happened; the files of each
    such case are kept in `folder`.
    """
    rng, counted, failures = random.Random(seed), Counter(), []
    prepare(folder)
    commands = [stage.name for stage in stages()]
    for kind, (_, files, _) in SEEDS.items():
        # Unchanged: the packages that read maps take seconds to begin.
        assert read(write(kind, files[0], folder), kind, "run").startswith("read"), kind
    weights = [weight for _, _, weight in SEEDS.values()]
    for number in range(tries):
        kind = rng.choices(list(SEEDS), weights)[0]
        path = write(kind, changed(kind, rng), folder)
        try:
            outcome = read(path, kind, rng.choice(commands))
        except Exception as error:  # whatever it is, it is a finding
            outcome = f"{type(error).__name__}: {error}"
        counted[kind, outcome if outcome in ("read", "refused") else "wrong"] += 1
        if outcome not in ("read", "refused"):
            keep(folder, f"case_{number}")
            failures.append(f"case_{number}, {kind}: {outcome}")
    return counted, failures


def in_workers(attempt: Callable, tries: int, seed: int, folder: Path) -> tuple[Counter, list[str]]:
    """Count the outcomes of attempts, and list what is neither 'read' nor 'refused'. Processes of a
    hundred attempts make them: reports leave much memory, and a process may end or hang in one.
    """
    counted, failures, done = Counter(), [], 0
    name = attempt.__name__
    while done < tries:
        numbers = range(done, min(tries, done + 100))
        ours, theirs = get_context("spawn").Pipe(duplex=False)
        worker = get_context("spawn").Process(
            target=work, args=(attempt, numbers, seed, folder, theirs)
        )
        worker.start()
        theirs.close()
        for done in numbers:
            try:
                if not ours.poll(WAITS_S):
                    worker.kill()
                kind, outcome = ours.recv()
            except EOFError:
                worker.join()
                kind, outcome = "process", f"ended with {worker.exitcode}"
            if outcome not in ("read", "refused"):
                keep(folder, f"{name}_{done}")
                failures.append(f"{name}_{done}, {kind}: {outcome}")
                outcome = "wrong"
            counted[kind, outcome] += 1
            if kind == "process":
                break
        done += 1
        worker.join()
    return counted, failures


def work(attempt: Callable, numbers: range, seed: int, folder: Path, pipe: Connection) -> None:
    """Send the outcomes of these attempts; one that hangs ends the process."""
    faulthandler.register(signal.SIGPROF, chain=True)
    with few_figures():
        for number in numbers:
            signal.setitimer(signal.ITIMER_PROF, HANGS_S)
            pipe.send(attempt(random.Random(f"{seed} {number}"), folder))


def check_by_both(rng: random.Random, folder: Path) -> tuple[str, str]:
    """The kind of a file of another structure, and whether both programs read it, or refuse it in
    the same line that names the namelist, and leave no unfinished file.
    """
    kind = rng.choice(["namelist"] * len(OF_BOTH) + list(OF_BOTH))
    ending, files, _ = SEEDS[kind]
    path = write(kind, restructured(rng.choice(files), ending, rng), folder).with_suffix(".nml")
    words, before = ["--check", str(path)], {*folder.iterdir()}
    signal.setitimer(signal.ITIMER_PROF, CHECK_S)
    runs = [quietly(["run", *words])]
    # The batch program reads no semicolons.
    if text_with_commas(folder / f"changed{ending}") is None:
        runs.append(by_batch(words, folder))
    outcomes = [
        (status, [line for line in lines if status and not NOTES.match(line)])
        for status, lines in runs
    ]
    status, lines = outcomes[0]
    left = {*folder.iterdir()} - before
    if outcomes[0] == outcomes[-1] and not left:
        if status == 0:
            return kind, "read"
        if status == 2 and len(lines) == 1 and lines[0].startswith(str(path)):
            return kind, "refused"
    return kind, f"{outcomes}, left {left}"


def by_batch(words: list[str], folder: Path) -> tuple[int, list[str]]:
    """The status of the batch program, and the lines of a refusal."""

    def limit() -> None:
        resource.setrlimit(resource.RLIMIT_CPU, (CHECK_S, CHECK_S))

    done = subprocess.run(
        [BATCH, *words],
        cwd=folder,
        capture_output=True,
        stdin=subprocess.DEVNULL,
        preexec_fn=limit,
        # A build with sanitizers reports what the program keeps until it ends.
        env=os.environ | {"ASAN_OPTIONS": "detect_leaks=0"},
        check=False,
    )
    return done.returncode, done.stderr.decode(errors="replace").split("\n")[:-1]


#: Results of every kind.
RESULTS = """
&problem symmetry = 'cubic', density_kg_m3 = 7500, synthetic = .true. /
&crystals points = 'points.csv' /
&simulation simulator = 'theory' /
&domain log_anisotropy_max = 3 /
&surrogate degree = 1, file = 'surrogate.txt' /
&design n_candidates = 60, budget = 30, initial = 8, validation = 2 /
&plan constants = 225, 135, 118, grains = 6, noise = 0.02 /
&measurements file = 'data/fe3si.csv', modulus_kind = 'indentation_modulus' /
&knowledge quantity = 'bulk_modulus', mean = 165, sd = 3 /
&sampler samples = 500, burn_in = 1000, chains = 2 /
&next count = 2 /
&execution workers = 1 /
"""
#: How often a file of results is changed, and the commands that read it.
STORED = {
    "posterior.bin": (5, ("next", "report", "compare")),
    "surrogate.txt": (5, ("predict", "extract", "report")),
    "campaign.sqlite": (5, ("simulate", "build")),
    "summary.json": (5, ("report", "compare")),
    "inputs.json": (1, ("report", "next")),
    **dict.fromkeys(
        [f"{name}.json" for name in ("simulate", "theory", "build", "plan", "next", "curves")],
        (1, ("report",)),
    ),
}


def make_results(folder: Path) -> None:
    """Write the files of a run with every stage into a folder 'whole'."""
    header, cubic = "symmetry,C11,C12,C44,phi1_deg,Phi_deg,phi2_deg", "cubic,200,120,100"
    (folder / "points.csv").write_bytes(text(header, f"{cubic},0,0,0", f"{cubic},0,45,10"))
    curves = STEP_0.format("file = 'curves.csv', tests = 'tests.csv'").replace(" / ", " /\n")
    (folder / "results.nml").write_text(f"{RESULTS}{curves}\n")
    words = ["run", str(folder / "results.nml"), "--output", str(folder / "whole")]
    status, lines = quietly(words)
    assert status in (0, 3), lines


def quietly(words: list[str]) -> tuple[int | None, list[str]]:
    """The status of a command, and its lines on standard error."""
    printed = io.TextIOWrapper(io.BytesIO())
    with redirect_stdout(printed), redirect_stderr(io.StringIO()) as said:
        status = bayesindent(words)
    return status, said.getvalue().split("\n")[:-1]


def read_changed(rng: random.Random, folder: Path) -> tuple[str, str]:
    """The name of a file of results that is changed and has a right checksum, and whether a command
    that reads it reads or refuses it; what else happens is reported.
    """
    file = rng.choices(list(STORED), [weight for weight, _ in STORED.values()])[0]
    command = rng.choice(STORED[file][1])
    namelist, out, changed = folder / "results.nml", folder / "out", folder / "changed"
    shutil.rmtree(out, ignore_errors=True)
    shutil.copytree(folder / "whole", out)
    change(out / file, (out / file).read_bytes(), rng)
    # A process that hangs or ends leaves the file.
    shutil.copy(out / file, changed.with_suffix(Path(file).suffix))
    words = {
        "report": ["report", out],
        "compare": ["compare", folder / "whole", out, "--output", folder / "compared"],
        "predict": [
            *("predict", "--points", folder / "points.csv"),
            *("--surrogate", out / "surrogate.txt", "--output", folder / "compared"),
        ],
    }.get(command, [command, namelist, "--output", out])
    status, lines = quietly([*map(str, words), "--quiet"])
    if status in (0, 3):
        return file, "read"
    named = any(str(name) in lines[-1] for name in (out, namelist)) if lines else False
    is_refused = status == 2 and named
    return file, "refused" if is_refused else f"{command}: status {status}: {lines[-1:]}"


def try_programs(tries: int, seed: int, folder: Path) -> tuple[Counter, list[str]]:
    """Attempts of `check_by_both`."""
    prepare(folder)
    return in_workers(check_by_both, tries, seed, folder)


def try_results(tries: int, seed: int, folder: Path) -> tuple[Counter, list[str]]:
    """Attempts of `read_changed`."""
    prepare(folder)
    with few_figures():
        make_results(folder)
    return in_workers(read_changed, tries, seed, folder)


def main(argv=None) -> int:
    """Try, count; 1 if anything else happened."""
    parser = argparse.ArgumentParser(
        prog="bench mutations",
        description=__doc__,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    parser.add_argument("--tries", type=int, default=2000, help="files in this process (2000)")
    parser.add_argument(
        "--programs", type=int, default=1000, help="files that both programs check (1000)"
    )
    parser.add_argument(
        "--results", type=int, default=2000, help="files of results with right checksums (2000)"
    )
    parser.add_argument("--seed", type=int, default=1)
    arguments = parser.parse_args(argv)
    folder = Path(tempfile.mkdtemp(prefix="mutations_"))
    failures = []
    print("| file | read | refused | anything else |\n|---|---|---|---|")
    for tries, count in (
        (try_in_process, arguments.tries),
        (try_programs, arguments.programs),
        (try_results, arguments.results),
    ):
        if not count:
            continue
        (own := folder / tries.__name__).mkdir()
        counted, found = tries(count, arguments.seed, own)
        for kind in dict.fromkeys(kind for kind, _ in counted):
            numbers = [counted[kind, outcome] for outcome in ("read", "refused", "wrong")]
            print("|", " | ".join(map(str, [kind, *numbers])), "|", flush=True)
        failures += [f"{tries.__name__}: {failure}" for failure in found]
    print(*failures, sep="\n")
    if failures:
        print(f"the files are in {folder}")
        return 1
    shutil.rmtree(folder)
    return 0
