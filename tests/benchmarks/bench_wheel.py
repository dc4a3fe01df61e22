"""The two cores of a portable wheel beside the installed package: what they cost on one thread, CPU
time, and which digits differ.

The wheel must be one of this Python. Each is a process of its own; the shortest of the repeats
counts.
"""

import argparse
import json
import os
import shutil
import subprocess
import sys
import tempfile
import zipfile
from pathlib import Path

from support.tree import REFERENCE

#: What is measured, and how a number of seconds is shown.
ROWS = {
    "theory": ("exact theory, µs a modulus (copper)", 1e6),
    "cubic": ("`extract`, 11 cubic grains and the bulk modulus, s", 1),
    "hexagonal": ("`extract`, 50 hexagonal grains, s", 1),
    "halfspace": ("one simulation, half-space, s", 1),
    "block": ("one simulation, the paper's block, s", 1),
}
SCRIPT = """
import json, sys, time
import numpy as np
import bayesindent as bi

fe3si, titanium = (sys.argv[1] + "/" + name for name in ("cubic_fe3si.csv", "hex_titanium.csv"))
kind = {"modulus_kind": "indentation_modulus", "workers": 1, "seed": 1}
bulk_modulus = {"bulk_modulus": (165, 3)}
copper = bi.stiffness("cubic", C11=168.4, C12=121.4, C44=75.4)
angles = np.random.default_rng(1).uniform(0, 90, (20000, 3))
models = {name: bi.Indentation(geometry=name) for name in ("halfspace", "block")}
work = {
    "theory": lambda: bi.halfspace_modulus(copper, angles),
    "cubic": lambda: bi.extract(fe3si, symmetry="cubic", knowledge=bulk_modulus, **kind),
    "hexagonal": lambda: bi.extract(titanium, symmetry="hexagonal", **kind),
    **{name: lambda model=model: model.run(copper, [0, 30, 0]) for name, model in models.items()},
}
seconds, numbers = {}, {}
for name, job in work.items():
    start = time.process_time()
    numbers[name] = job()
    seconds[name] = (time.process_time() - start) / (len(angles) if name == "theory" else 1)
moduli = {name: numbers[name].indentation_modulus_gpa for name in models}
numbers = {"theory": numbers["theory"][0], **moduli}
print(json.dumps([seconds, {name: float(value) for name, value in numbers.items()}]))
"""


def least(found: list[tuple[dict, dict]], key: str) -> float:
    """The least of these seconds of several runs."""
    return min(seconds[key] for seconds, _ in found)


def main(argv=None) -> int:
    """Print both tables."""
    parser = argparse.ArgumentParser(
        prog="bench wheel",
        description=__doc__,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    parser.add_argument("wheel", type=Path)
    parser.add_argument("--repeats", type=int, default=2)
    arguments = parser.parse_args(argv)
    with tempfile.TemporaryDirectory() as folder:
        places = {"any": Path(folder, "any"), "x86-64-v3": Path(folder, "wide"), "installed": None}
        for place in (places["any"], places["x86-64-v3"]):
            with zipfile.ZipFile(arguments.wheel) as archive:
                archive.extractall(place)
        shutil.rmtree(places["any"] / "bayesindent" / "x86_64_v3")
        runs = {}
        for name, place in places.items():
            runs[name] = [run(place) for _ in range(arguments.repeats)]
        kernels = {
            name: run(places["x86-64-v3"], OPENBLAS_CORETYPE=name)[1]
            for name in ("PRESCOTT", "HASWELL", "SKYLAKEX")
        }
    print(f"| | {' | '.join(places)} |\n|---|---|---|---|")
    for key, (words, scale) in ROWS.items():
        cells = [f"{scale * least(found, key):.2f}" for found in runs.values()]
        print(f"| {words} | {' | '.join(cells)} |")
    moduli = {name: found[0][1] for name, found in runs.items()} | kernels
    print(f"\n| modulus, GPa | {' | '.join(moduli['any'])} |\n|---|---|---|---|")
    for name, values in moduli.items():
        print(f"| {name} | {' | '.join(f'{value:.15g}' for value in values.values())} |")
    return 0


def run(place: Path | None, **more: str) -> tuple[dict[str, float], dict[str, float]]:
    """CPU seconds and moduli of a package in a folder, or of the installed one."""
    environment = (
        os.environ | {"OMP_NUM_THREADS": "1"} | more | ({"PYTHONPATH": str(place)} if place else {})
    )
    done = subprocess.run(
        [sys.executable, "-c", SCRIPT, str(REFERENCE)],
        env=environment,
        stdout=subprocess.PIPE,
        text=True,
        check=True,
    )
    return json.loads(done.stdout)
