"""How often the intervals of Step 0 cover the truth, on synthetic curves, and beside the least
squares of the field.

Each data set: 12 grains with three tests, ten tests of fused quartz, nuisances from the priors that
the program is given (tests/support/synthetic_curves.py). Least squares: P = k (h - h0)^1.5 up to 10
mN in every test, one radius from the quartz, the sd from the scatter of a grain's tests.

    ./bayesindent dev bench curves
    ./bayesindent dev bench curves --sets 200 --constants 200
    ./bayesindent dev bench curves --speed
"""

import argparse
import json
import os
import resource
import shutil
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import numpy as np
from scipy.optimize import curve_fit

import bayesindent as bi
from support.synthetic_curves import NAMELIST, QUARTZ, QUARTZ_NU, Truth, effective, write

COPPER = (168.4, 121.4, 75.4)
#: What differs from the model.
CASES = {
    "the model": {},
    "white noise": {"noise": 0.5, "correlation": 0.0},
    "three tests of quartz": {"references": 3},
    "drift that changes by 0.3 nm/s": {"drift_change": 0.3},
    "a dent of 5 % in the tip": {"dent": 0.05},
}
#: Curves, and points of each, whose time is measured.
SPEED = ((100, 1000), (200, 16000))
#: Of 90 % intervals, in sds.
NINETY = 1.645


def least_squares(curves: list, tests: list) -> dict[str, tuple[float, float]]:
    """Hertz fits with a fixed window: modulus of each grain and its relative sd."""
    points: dict[str, list] = {}
    for name, *row in curves:
        points.setdefault(name, []).append(row)
    slopes: dict[str, list] = {}
    for name, reference, grain, _ in tests:
        _, depth, load = np.array(points[name]).T
        peak = int(np.argmax(load))
        chosen = np.flatnonzero((load[:peak] > 0.3) & (load[:peak] < 10))
        h, p = depth[chosen] / 1e3, load[chosen]
        (k, _), _ = curve_fit(
            lambda h, k, h0: k * np.maximum(h - h0, 1e-9) ** 1.5,
            h,
            p,
            p0=(p[-1] / (h[-1] - h[0]) ** 1.5, h[0] - 0.01),
            maxfev=5000,
        )
        slopes.setdefault(reference or grain, []).append(k)
    root = np.mean(slopes.pop("quartz")) * 0.75 / float(effective(QUARTZ[0] / (1 - QUARTZ_NU**2)))
    return {
        g: (0.75 * np.mean(k) / root, np.std(k, ddof=1) / np.mean(k) / len(k) ** 0.5)
        for g, k in slopes.items()
    }


def study(seed: int, changes: dict, folder: Path, constants: bool) -> dict[str, list[float]]:
    """Residuals of one data set in sds, by quantity, and relative errors of the moduli."""
    rng = np.random.default_rng(seed)
    angles = np.degrees(
        [
            rng.uniform(0, 2 * np.pi, 12),
            np.arccos(rng.uniform(0, 1, 12)),
            rng.uniform(0, 2 * np.pi, 12),
        ]
    ).T
    crystals = np.repeat(bi.stiffness("cubic", *COPPER)[None], 12, axis=0)
    truth = Truth(rng, moduli=np.asarray(bi.halfspace_modulus(crystals, angles)), **changes)
    curves, tests = truth.draw()
    write(folder, curves, tests)
    (folder / "a.nml").write_text(NAMELIST)
    run_batch(folder)
    document = json.loads((folder / "here" / "curves.json").read_text())
    radius = document["tip"]["radius_um"]
    found: dict[str, list[float]] = {
        "radius": [np.log(radius["mean"] / truth.radius) * radius["mean"] / radius["sd"]]
    }
    fits = least_squares(curves, tests)
    for row in document["grains"]:
        true = truth.effective_gpa[int(row["grain"][1:]) - 1]
        error = np.log(row["effective_modulus_gpa"] / true)
        for name, sd in (("moduli", "sd_gpa"), ("moduli, shared errors left out", "own_sd_gpa")):
            found.setdefault(name, []).append(error * row["effective_modulus_gpa"] / row[sd])
        found.setdefault("error of moduli", []).append(error)
        modulus, sd = fits[row["grain"]]
        found.setdefault("least squares", []).append(np.log(modulus / true) / sd)
        found.setdefault("error of least squares", []).append(np.log(modulus / true))
    if constants:
        table, shared = (
            read(folder / "here" / "measurements.csv"),
            read(folder / "here" / "shared_errors.csv"),
        )
        order = [int(name[1:]) - 1 for name in table["grain"]]
        values = {name: table[name] for name in ("effective_modulus_gpa", "sd_gpa")} | {
            "euler_deg": angles[order]
        }
        for label, more in (
            ("constants", {name: shared[name] for name in shared if name != "grain"}),
            ("constants, shared errors left out", {}),
        ):
            known = {"bulk_modulus": (rng.normal(137.07, 3), 3)}
            result = bi.extract(
                values | more,
                "cubic",
                knowledge=known,
                samples=1000,
                burn_in=2000,
                chains=2,
                seed=seed + 1,
                workers=1,
            )
            for name, true in zip(("C11", "C12", "C44"), COPPER, strict=True):
                draws = result.posterior[name].values.ravel()
                # The rank as a normal number, so that a skewed posterior is judged by its interval.
                share = np.clip(np.mean(draws < true), 1e-4, 1 - 1e-4)
                found.setdefault(label, []).append(
                    NINETY * (1.0 if 0.05 <= share <= 0.95 else 2.0) * np.sign(share - 0.5) * 0.999
                )
    return found


def run_batch(folder: Path) -> float:
    """Step 0 of a.nml on one thread: seconds of CPU."""
    batch = shutil.which("bayesindent-batch") or Path(sys.executable).with_name("bayesindent-batch")
    before = resource.getrusage(resource.RUSAGE_CHILDREN)
    environment = os.environ | {"OMP_NUM_THREADS": "1", "OPENBLAS_NUM_THREADS": "1"}
    subprocess.run(
        [batch, "a.nml", "--output", "here"],
        cwd=folder,
        check=True,
        capture_output=True,
        env=environment,
    )
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    return after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime


def speed(folder: Path) -> None:
    """Seconds of CPU for curves from a file to the tables of the moduli."""
    for curves, points in SPEED:
        # A tenth of `points` before the contact and a quarter for unloading are added.
        truth = Truth(
            np.random.default_rng(1),
            grains=(curves - 10) // 3,
            references=curves - (curves - 10) // 3 * 3,
            points=points * 20 // 27,
        )
        rows, tests = truth.draw()
        write(folder, rows, tests)
        (folder / "a.nml").write_text(NAMELIST)
        print(
            f"{len(tests)} curves of {len(rows) / len(tests):.0f} points: "
            f"{run_batch(folder):.1f} s of CPU on one thread, reading included"
        )


def read(path: Path) -> dict[str, list]:
    """The columns of a CSV."""
    from bayesindent.stages.curves import read_columns

    return read_columns(path)


def main(argv=None) -> None:
    """Print the tables."""
    parser = argparse.ArgumentParser(
        prog="bayesindent dev bench curves", description=__doc__.splitlines()[0]
    )
    parser.add_argument("--sets", type=int, default=40, help="data sets of each case")
    parser.add_argument(
        "--constants",
        type=int,
        default=0,
        help="data sets of the first case that go on to constants",
    )
    parser.add_argument(
        "--case", action="append", choices=CASES, help="this case alone; may be repeated (all)"
    )
    parser.add_argument(
        "--speed", action="store_true", help="the time of many curves, and nothing else"
    )
    arguments = parser.parse_args(argv)
    if arguments.speed:
        with tempfile.TemporaryDirectory() as folder:
            speed(Path(folder))
        return
    import warnings

    warnings.simplefilter("ignore", bi.BayesindentWarning)
    started = time.process_time()
    for case in arguments.case or CASES:
        changes = CASES[case]
        all_found: dict[str, list[float]] = {}
        with tempfile.TemporaryDirectory() as folder:
            refused = 0
            for seed in range(arguments.sets):
                try:
                    found = study(
                        seed,
                        changes,
                        Path(folder),
                        case == "the model" and seed < arguments.constants,
                    )
                except subprocess.CalledProcessError as error:
                    # A tip that is more than three sds from the stated radius.
                    print(f"data set {seed}: {error.stderr.decode().strip()}", flush=True)
                    refused += 1
                    continue
                for name, values in found.items():
                    all_found.setdefault(name, []).extend(values)
        print(
            f"\n{case}, {arguments.sets} data sets, {refused} refused\n| quantity | values | 90 "
            "% intervals cover |\n|---|---|---|"
        )
        for name, values in all_found.items():
            if not name.startswith("error"):
                print(
                    f"| {name} | {len(values)} | {100 * np.mean(np.abs(values) < NINETY):.1f} % |"
                )
        errors = [
            100 * np.sqrt(np.mean(np.square(all_found[name])))
            for name in ("error of moduli", "error of least squares")
        ]
        print(
            f"root mean square error of the moduli: {errors[0]:.2f} %; of least squares "
            f"{errors[1]:.2f} %",
            flush=True,
        )
    print(f"\n{time.process_time() - started:.0f} s of CPU in this process")


if __name__ == "__main__":
    main()
