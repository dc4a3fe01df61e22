"""A wheel on a bare Debian: Python and the smallest system that debootstrap makes, without
compiler, OpenBLAS or SuiteSparse.
"""

import json
import os
import resource
import shutil
import subprocess
import sys
import tempfile
import time
from pathlib import Path

ROOT = Path(__file__).parents[2]
SUITE = "bookworm"
#: pip on the bare system trusts the same certificates as this machine.
CERTIFICATES = Path("/etc/ssl/certs/ca-certificates.crt")

PATH = f"{os.environ['PATH']}:/usr/sbin:/sbin"
#: Programs and libraries that the wheel must not need.
LACKING = ("gcc", "gfortran", "libopenblas", "libcholmod", "libgfortran", "libgomp")

DOMAIN = "&domain c_min = 50, 40, 15, c_max = 250, 150, 120, anisotropy_cap = 7.2 /\n"
FILES = {
    "own.nml": "&problem symmetry = 'cubic', seed = 1 /\n"
    "&measurements file = 'own.csv', modulus_kind = 'indentation_modulus' /\n"
    "&knowledge quantity = 'bulk_modulus', mean = 165, sd = 3 /\n",
    "build.nml": "&problem symmetry = 'cubic' /\n"
    "&simulation simulator = 'theory' /\n"
    "&surrogate model = 'paper', degree = 2, bandlimit = 4 /\n"
    "&design n_candidates = 200, budget = 60 /\n" + DOMAIN,
    "simulate.nml": "&problem symmetry = 'cubic' /\n&crystals points = 'crystals.csv' /\n",
    "crystals.csv": "C11,C12,C44,phi1_deg,Phi_deg,phi2_deg\n168.4,121.4,75.4,0,45,0\n",
}
STEPS = {
    "pip install": "python3 -m venv venv && venv/bin/pip install --quiet *.whl",
    "extract": "bayesindent extract own.nml --json > extract.json",
    "report": "bayesindent report runs/own",
    "build": "bayesindent build build.nml --json > build.json",
    "simulate": "bayesindent simulate simulate.nml --json > simulate.json",
    "batch": "bayesindent-batch own.nml --output batch && "
    "bayesindent-batch build.nml --output batch",
    "import": "python -c 'import bayesindent'",
}


def try_wheel(wheel: Path, made: Path | None) -> int:
    """Install the wheel on a copy of the system `made` or on a new one, run STEPS there and here,
    and print seconds and results.
    """
    if os.geteuid() != 0 or not shutil.which("debootstrap", path=PATH):
        sys.exit(
            "wheel --try makes a bare Debian, which takes root and debootstrap (apt-get install "
            "debootstrap)"
        )
    with tempfile.TemporaryDirectory(prefix="bare-") as folder:
        system, here = Path(folder, "system"), Path(folder, "here")
        packages = "--include=python3-venv,ca-certificates"
        command: list[str | Path] = ["debootstrap", "--variant=minbase", packages, SUITE, system]
        if made is not None:
            command = ["cp", "--archive", made, system]
        subprocess.run(
            command, check=True, stdout=subprocess.DEVNULL, env=os.environ | {"PATH": PATH}
        )
        for file in ("/etc/resolv.conf", "/etc/hosts", CERTIFICATES):
            shutil.copyfile(file, f"{system}{file}")
        write_files(system / "home")
        shutil.copy(wheel, system / "home")
        found = [
            name
            for name in LACKING
            if list(system.glob(f"usr/bin/{name}*")) + list(system.glob(f"usr/lib/**/{name}.so*"))
        ]
        print(f"not there: {', '.join(sorted(set(LACKING) - set(found)))}", flush=True)
        for name, step in STEPS.items():
            seconds, cpu = run_inside(system, step)
            print(f"{name}: {seconds:.1f} s, {cpu:.1f} s of CPU", flush=True)
        write_files(here)
        for step in list(STEPS.values())[1:]:
            subprocess.run(
                step,
                shell=True,
                check=True,
                cwd=here,
                env=os.environ | {"PATH": f"{Path(sys.executable).parent}:{PATH}"},
            )
        there, ours = results(system / "home"), results(here)
    for name, value in there.items():
        print(f"{name}: {value:.12g} there, {ours[name]:.12g} here")
    return 0


def write_files(folder: Path) -> None:
    """FILES, and a table of measurements."""
    folder.mkdir(exist_ok=True)
    for name, text in FILES.items():
        (folder / name).write_text(text)
    shutil.copy(ROOT / "inputs" / "data" / "fe3si.csv", folder / "own.csv")


def run_inside(system: Path, command: str) -> tuple[float, float]:
    """Seconds and CPU seconds of a shell's command in the home folder of the system; it ends this
    program if it fails.
    """
    script = (
        f"mount -t proc proc {system}/proc && mount --rbind /dev {system}/dev && "
        f"exec chroot {system} /usr/bin/env -i HOME=/home LANG=C.UTF-8 PIP_CERT={CERTIFICATES} "
        "PIP_DISABLE_PIP_VERSION_CHECK=1 "
        'PATH=/home/venv/bin:/usr/bin:/bin sh -c "cd /home && $1"'
    )
    started, used = time.monotonic(), resource.getrusage(resource.RUSAGE_CHILDREN)
    # The mounts are private to this process and end with it.
    done = subprocess.run(
        ["unshare", "--mount", "sh", "-c", script, "sh", command], capture_output=True, text=True
    )
    if done.returncode:
        sys.exit(f"failed on the bare system: {command}\n{done.stdout}{done.stderr}")
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    return (
        time.monotonic() - started,
        after.ru_utime + after.ru_stime - used.ru_utime - used.ru_stime,
    )


def results(folder: Path) -> dict[str, float]:
    """The numbers that the programs computed in a folder."""
    extracted = json.loads((folder / "extract.json").read_text())["parameters"]
    batch = json.loads((folder / "batch" / "summary.json").read_text())["parameters"]
    return {
        "one simulation, GPa": json.loads((folder / "simulate.json").read_text())["results"][0][
            "indentation_modulus_gpa"
        ],
        "leave-one-out error of build, GPa": json.loads((folder / "build.json").read_text())[
            "loocv_gpa"
        ],
        **{f"{name} of extract, GPa": values["mean"] for name, values in extracted.items()},
        **{f"{name} of the batch program, GPa": values["mean"] for name, values in batch.items()},
    }
