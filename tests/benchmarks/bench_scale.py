"""Cost against size: seconds, CPU seconds and peak memory of a process, and how they grow.

- predict: points from a CSV to a CSV by the command line, with the correction of the paper's block
- extract: grains of a cubic crystal to a posterior by the command line, with the exact theory
- campaign: rows of a campaign that were made elsewhere are imported; then a build opens it, chooses
a batch of 16 and stores their results

Each size is a process of its own, on as many threads as there are processors. What the machine does
beside counts: CPU seconds do not wait.
"""

import argparse
import json
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import numpy as np

import bayesindent as bi
from bayesindent.common.result_files import write_csv
from bayesindent.crystal.elasticity import constant_names, halfspace_modulus, stiffness_rows
from bayesindent.settings.problem import Problem, read_crystals
from bayesindent.stages.build import tell
from bayesindent.stages.stage import Stage
from bayesindent.surrogate.basis import Basis
from support.learner import spread_crystals

SIZES = {
    "predict": (1000, 10000, 100000, 1000000),
    "extract": (10, 100, 1000, 10000),
    "campaign": (100, 1000, 10000, 100000),
}
FIGURE = Path(__file__).parents[2] / "docs" / "figures" / "scale.png"
COPPER = {"C11": 168.4, "C12": 121.4, "C44": 75.4}
BATCH = 16
#: The peak of a process is at least that of the one that starts it, which therefore is a small one.
LAUNCH = """
import json, resource, subprocess, sys, time
start = time.monotonic()
with open("printed", "wb") as printed:
    command = [sys.executable, *sys.argv[1:]]
    code = subprocess.call(command, stdout=printed, stderr=subprocess.DEVNULL)
used = resource.getrusage(resource.RUSAGE_CHILDREN)
print(json.dumps([code, time.monotonic() - start, used.ru_utime + used.ru_stime, used.ru_maxrss]))
"""


def main(argv=None) -> int:
    """Run what is asked for, print its table, and draw all with --figures."""
    parser = argparse.ArgumentParser(
        prog="bench scale",
        description=__doc__,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    parser.add_argument("parts", nargs="*", choices=[*SIZES, []], help="what to measure (all)")
    parser.add_argument("--most", type=int, default=10**6, help="leave larger sizes out")
    parser.add_argument(
        "--figures",
        action="store_true",
        help=f"draw {FIGURE.name} of docs/figures; needs all parts",
    )
    parser.add_argument("--campaign", nargs=2, metavar=("ROWS", "FOLDER"), help=argparse.SUPPRESS)
    arguments = parser.parse_args(argv)
    if arguments.campaign:
        print(json.dumps(campaign_steps(int(arguments.campaign[0]), Path(arguments.campaign[1]))))
        return 0
    found: dict[str, list[dict]] = {}
    for part in arguments.parts or SIZES:
        found[part] = []
        for size in SIZES[part]:
            if size <= arguments.most:
                with tempfile.TemporaryDirectory() as folder:
                    found[part].append({"size": size} | MEASURES[part](size, Path(folder)))
                print(
                    f"{part} {size}: "
                    + ", ".join(
                        f"{name} {value:.4g}"
                        for name, value in found[part][-1].items()
                        if name != "size"
                    ),
                    flush=True,
                )
    for part, rows in found.items():
        names = list(rows[0])
        print(f"\n| {part}: {' | '.join(names)} |\n|{'---|' * len(names)}")
        for row in rows:
            cells = [format(row[name], "," if name == "size" else ".3g") for name in names]
            print(f"| {' | '.join(cells)} |")
    if arguments.figures:
        draw(found)
    return 0


def angles(n: int, rng: np.random.Generator) -> np.ndarray:
    """Orientations (n, 3) in degrees, uniform."""
    return np.column_stack(
        [
            rng.uniform(0, 360, n),
            np.degrees(np.arccos(rng.uniform(-1, 1, n))),
            rng.uniform(0, 360, n),
        ]
    )


def process(command: list, folder: Path) -> dict:
    """Seconds, CPU seconds and peak MB of a command, which must succeed; what it prints is kept in
    folder/printed.
    """
    done = subprocess.run(
        [sys.executable, "-S", "-c", LAUNCH, *map(str, command)],
        cwd=folder,
        capture_output=True,
        text=True,
        check=True,
    )
    code, seconds, cpu, peak = json.loads(done.stdout)
    if code:
        raise SystemExit(f"{command} ended with status {code}")
    return {"s": seconds, "CPU s": cpu, "MB": peak / 1024}


def measure_predict(size: int, folder: Path) -> dict:
    """Crystals within 10 % of copper."""
    rng = np.random.default_rng(1)
    constants = np.array(list(COPPER.values())) * (1 + 0.1 * rng.random((size, 3)))
    header = ",".join([*COPPER, "phi1_deg", "Phi_deg", "phi2_deg"])
    np.savetxt(
        folder / "points.csv",
        np.column_stack([constants, angles(size, rng)]),
        delimiter=",",
        header=header,
        comments="",
        fmt="%.3f",
    )
    return process(
        [
            "-m",
            "bayesindent",
            "predict",
            "--surrogate",
            "block",
            "--symmetry",
            "cubic",
            "--points",
            "points.csv",
        ],
        folder,
    )


def measure_extract(size: int, folder: Path) -> dict:
    """Copper, measured with an sd of 3 GPa."""
    rng = np.random.default_rng(1)
    euler_deg = angles(size, rng)
    moduli = bi.halfspace_modulus(bi.stiffness("cubic", **COPPER), euler_deg) + rng.normal(
        0, 3, size
    )
    header = "phi1_deg,Phi_deg,phi2_deg,modulus_gpa,sd_gpa"
    np.savetxt(
        folder / "grains.csv",
        np.column_stack([euler_deg, moduli, np.full(size, 3)]),
        delimiter=",",
        header=header,
        comments="",
        fmt="%.3f",
    )
    (folder / "a.nml").write_text(
        "&problem symmetry = 'cubic', synthetic = .true. /\n"
        "&measurements file = 'grains.csv', modulus_kind = 'indentation_modulus' /\n"
    )
    return process(["-m", "bayesindent", "extract", "a.nml"], folder)


def measure_campaign(size: int, folder: Path) -> dict:
    """The steps, with the peak of the process that does them all."""
    whole = process(["-m", "benchmarks.bench_scale", "--campaign", size, folder], folder)
    return json.loads((folder / "printed").read_text()) | {"MB": whole["MB"]}


def campaign_steps(rows: int, folder: Path) -> dict:
    """CPU seconds to import so many rows, to open them, to choose a batch; milliseconds to store a
    row; bytes of the file a row.

    The rows are crystals of every class, with 1.1 times the theory's modulus. All are learnt before
    the variance chooses (`initial`), and alpha and beta are learnt once.
    """
    design = {
        "n_candidates": rows + 2000,
        "budget": rows + 2 * BATCH,
        "initial": rows,
        "batch": BATCH,
        "refit": 100000,
    }
    problem = Problem.from_keywords("bench scale", specimen={"geometry": "block"}, design=design)
    constants, euler_deg = spread_crystals(Basis(problem), rows, 1)
    moduli = 1.1 * halfspace_modulus(stiffness_rows("triclinic", constants), euler_deg)
    clock = [time.process_time()]

    def lap() -> float:
        clock.append(time.process_time())
        return clock[-1] - clock[-2]

    header = [*constant_names("triclinic"), "phi1_deg", "Phi_deg", "phi2_deg", "modulus_gpa"]
    write_csv(folder / "told.csv", header, np.column_stack([constants, euler_deg, moduli]).tolist())
    lap()
    tell(problem, folder, read_crystals(folder / "told.csv", "triclinic"))
    found = {"import, CPU s": lap()}
    build = Stage(problem, "build", folder)
    found["open, CPU s"] = lap()
    numbers, _ = build.wanted()
    wanted = len(numbers)
    assert wanted == build.expected // 2 == BATCH
    found["choose 16, CPU s"] = lap()
    depth = np.linspace(0.01, 0.1, 10)
    start, size = time.monotonic(), (folder / "campaign.sqlite").stat().st_size
    for number in range(wanted):
        result = {
            "modulus_gpa": 150.0 + number,
            "seconds": 1.0,
            "elements": 12400,
            "depth_um": depth,
            "force_mn": depth**1.5 / (1 + number),
        }
        build.take(numbers[number], result)
    found["store, CPU ms"] = 1000 * lap() / wanted
    found["store, ms"] = 1000 * (time.monotonic() - start) / wanted
    found["bytes a row"] = size / rows
    return found


MEASURES = {"predict": measure_predict, "extract": measure_extract, "campaign": measure_campaign}


def draw(found: dict[str, list[dict]]) -> None:
    """Time and memory over size, with lines of growth in proportion."""
    from matplotlib.figure import Figure

    from bayesindent.report.figures.style import CYCLE, MARKERS, house_style

    curves = {
        "predict": ("points", {"s": "s", "CPU s": "CPU s"}),
        "extract": ("grains", {"s": "s", "CPU s": "CPU s"}),
        "campaign": (
            "rows",
            {"import, CPU s": "import", "open, CPU s": "open", "choose 16, CPU s": "choose 16"},
        ),
    }
    with house_style():
        figure = Figure(figsize=(9, 5), layout="constrained")
        axes = figure.subplots(2, 3, sharex="col")
        for column, (part, (unit, lines)) in enumerate(curves.items()):
            sizes = np.array([row["size"] for row in found[part]])
            above, below = axes[:, column]
            for k, (name, label) in enumerate(lines.items()):
                above.loglog(
                    sizes,
                    [row[name] for row in found[part]],
                    MARKERS[k] + "-",
                    color=CYCLE[k],
                    label=label,
                )
            last = max(found[part][-1][name] for name in lines)
            above.loglog(sizes, last * sizes / sizes[-1], ":", color="0.5", label="in proportion")
            above.set(title=part, ylabel="CPU s" if part == "campaign" else "seconds")
            above.legend()
            below.loglog(sizes, [row["MB"] for row in found[part]], "o-", color=CYCLE[0])
            below.set(xlabel=unit, ylabel="peak memory, MB", ylim=(30, 3000))
        figure.savefig(FIGURE, dpi=110)


if __name__ == "__main__":
    sys.exit(main())
