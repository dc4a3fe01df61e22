"""What a person waits for: seconds and CPU seconds of processes, beside the machine's rates of
SGEMM and of memory.

- start: `import bayesindent`, `bayesindent --help`
- extract: eleven cubic, fifty hexagonal, thirty grains of quartz, forty of forsterite, a hundred
with 21 constants
- theory: moduli a second on one core
- curve: one curve on the paper's block, in per cent of SGEMM's rate; the hexagonal paper campaign,
2,800 such curves on two cores by CPU time
- grains: extract of 10,000 grains of copper
- quickstart: `run inputs/quickstart.nml` in a new folder; then `report` and `report --paper` of it
- setup: a copy of the source tree without environment and build: `./bayesindent --version`. Only
where it is asked for

Each but theory and curve is a process of its own. On a busy machine only CPU seconds count; they
are those of all its threads.
"""

import argparse
import os
import resource
import shutil
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import numpy as np

import bayesindent as bi
from benchmarks.bench_simulate import ZINC, sgemm_rate, timed
from support.tree import REFERENCE, SOURCE

PROGRAM = str(Path(sys.executable).with_name("bayesindent"))
PARTS = ("start", "extract", "theory", "curve", "grains", "quickstart")
#: Table and class of each case of extract.
CASES = {
    "11 cubic grains": ("cubic_fe3si", "cubic"),
    "50 hexagonal grains": ("hex_titanium", "hexagonal"),
    "30 grains of quartz": ("trigonal_quartz", "trigonal"),
    "40 grains of forsterite": ("orthorhombic_forsterite", "orthorhombic"),
    "100 grains, 21 constants": ("triclinic_albite", "triclinic"),
}
#: Simulations of the hexagonal paper campaign.
CAMPAIGN = 2800


def main(argv=None) -> int:
    """Print one table."""
    parser = argparse.ArgumentParser(
        prog="bench wait", description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument(
        "parts", nargs="*", choices=[*PARTS, "setup", []], help="what to measure (all but setup)"
    )
    arguments = parser.parse_args(argv)
    print(
        f"SGEMM on one core: {sgemm_rate():.1f} Gflop/s; memory: {memory_rate():.1f} GB/s read "
        "and written by one core"
    )
    print(
        f"load average {os.getloadavg()[0]:.1f} on {len(os.sched_getaffinity(0))} cores\n\n| "
        "what | seconds | CPU seconds |\n|---|---|---|"
    )
    for part in arguments.parts or PARTS:
        with tempfile.TemporaryDirectory() as folder:
            for name, seconds, cpu in globals()[f"measure_{part}"](Path(folder)):
                print(f"| {name} | {seconds} | {cpu} |", flush=True)
    return 0


def memory_rate(n: int = 20_000_000) -> float:
    """Of a copy of an array that no cache holds, GB/s, best of five."""
    source, target = np.ones(n), np.zeros(n)
    return 16e-9 * n / min(timed(lambda: np.copyto(target, source))[0] for _ in range(5))


def row(name: str, command: list, times: int = 1, **options) -> tuple[str, str, str]:
    """The least wall and CPU seconds of so many runs."""
    walls, cpus = [], []
    for _ in range(times):
        before, start = resource.getrusage(resource.RUSAGE_CHILDREN), time.monotonic()
        done = subprocess.run(
            command,
            stdin=subprocess.DEVNULL,
            stdout=subprocess.DEVNULL,
            stderr=subprocess.DEVNULL,
            **options,
        )
        after = resource.getrusage(resource.RUSAGE_CHILDREN)
        walls.append(time.monotonic() - start)
        cpus.append(after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime)
        if done.returncode not in (0, 3):
            raise SystemExit(f"{name}: exit status {done.returncode}")
    return name, f"{min(walls):.2f}", f"{min(cpus):.3f}" if min(cpus) < 1 else f"{min(cpus):.1f}"


def measure_start(folder: Path):
    """The package and the program without work."""
    yield row("import bayesindent", [sys.executable, "-c", "import bayesindent"], 10)
    yield row("bayesindent --help", [PROGRAM, "--help"], 10)


def measure_extract(folder: Path):
    """Posteriors with the settings of the program, the table's class apart."""
    for name, (table, symmetry) in CASES.items():
        yield extract(name, folder, f"{REFERENCE / table}.csv", symmetry)


def extract(name: str, folder: Path, table: str, symmetry: str):
    """The program's `extract` of a table of indentation moduli."""
    (folder / "extract.nml").write_text(
        f"&problem symmetry = '{symmetry}', synthetic = .true. /\n"
        f"&measurements file = '{table}', modulus_kind = 'indentation_modulus' /\n"
    )
    return row(
        f"extract: {name}", [PROGRAM, "extract", folder / "extract.nml", "--output", folder / name]
    )


def measure_theory(folder: Path):
    """Many directions of zinc."""
    n = 20000
    angles = np.random.default_rng(1).uniform(0, 180, (n, 3))
    crystals = np.broadcast_to(ZINC, (n, 6, 6))
    seconds = min(timed(lambda: bi.halfspace_modulus(crystals, angles))[0] for _ in range(5))
    yield f"exact theory: {n / seconds:,.0f} moduli a CPU second", "", f"{seconds:.2f}"


def measure_curve(folder: Path):
    """A further crystal on a block whose symbolic work is done."""
    model = bi.Indentation(geometry="block")
    cpu = min(timed(lambda: model.run(ZINC, (0, 30, 0)))[0] for _ in range(5))
    share = 100e-9 * model.factor_operations / cpu / sgemm_rate()
    yield f"one curve on the paper's block: {share:.0f} % of SGEMM's rate", "", f"{cpu:.3f}"
    yield (
        f"{CAMPAIGN:,} such curves, at least",
        f"{CAMPAIGN * cpu / 2:.0f} on two free cores",
        f"{CAMPAIGN * cpu:.0f}",
    )


def measure_grains(folder: Path):
    """Copper at random orientations, sd 2 %."""
    rng, copper = np.random.default_rng(1), bi.stiffness("cubic", C11=168.4, C12=121.4, C44=75.4)
    angles = np.column_stack(
        [
            rng.uniform(0, 360, 10000),
            np.degrees(np.arccos(rng.uniform(-1, 1, 10000))),
            rng.uniform(0, 360, 10000),
        ]
    )
    moduli = bi.halfspace_modulus(np.broadcast_to(copper, (10000, 6, 6)), angles)
    rows = np.column_stack([angles, moduli * rng.normal(1, 0.02, 10000), 0.02 * moduli])
    np.savetxt(
        folder / "grains.csv",
        rows,
        delimiter=",",
        header="phi1_deg,Phi_deg,phi2_deg,indentation_modulus_gpa,sd_gpa",
        comments="",
    )
    yield extract("10,000 grains", folder, "grains.csv", "cubic")


def measure_quickstart(folder: Path):
    """Everything, then reports of its folder."""
    yield row(
        "run inputs/quickstart.nml",
        [PROGRAM, "run", SOURCE / "inputs" / "quickstart.nml", "--output", folder],
    )
    yield row("report", [PROGRAM, "report", folder], 3)
    yield row("report --paper", [PROGRAM, "report", folder, "--paper"], 3)


def measure_setup(folder: Path):
    """Without what the launcher makes; Debian packages are those of the machine."""
    tree = folder / "tree"
    shutil.copytree(
        SOURCE,
        tree,
        ignore=shutil.ignore_patterns(
            ".venv", "build", "build-*", "runs", ".git", ".mypy_cache", "__pycache__"
        ),
    )
    yield row("set-up: ./bayesindent --version in a new copy", [tree / "bayesindent", "--version"])


if __name__ == "__main__":
    sys.exit(main())
