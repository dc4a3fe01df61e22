"""Too little memory is a failure of the machine: nothing crashes, nothing is stored, and another
attempt succeeds.

Modules: system.cpp, machine.f90.
"""

import os
import resource
import subprocess
import sys

import pytest

from support.programs import BATCH, HANGS_S, SANITIZED, with_tests

SCRIPT = """
import resource, sys
import numpy as np
import bayesindent as bi
from support.campaigns import rows
from bayesindent.stages.stage import Simulator, run_stage

folder = sys.argv[1]
with open(folder + "/points.csv", "w") as file:
    file.write("C11,C12,C44,phi1_deg,Phi_deg,phi2_deg\\n")
    file.writelines(f"168.4,121.4,75.4,0,{10 * k},0\\n" for k in range(3))
with open(folder + "/a.nml", "w") as file:
    file.write("&problem symmetry = 'cubic' /\\n")
    file.write("&crystals points = 'points.csv' /\\n&execution workers = 2 /\\n")
problem = bi.Problem(folder + "/a.nml", "simulate")
workspace = bi.Indentation().workspace_bytes
theory = Simulator("test", "&simulation simulator = 'theory' /\\n")
copper = bi.stiffness("cubic", C11=168.4, C12=121.4, C44=75.4)
theory._call("run", stiffness=copper, euler_deg=(0, 0, 0))


def limit(more):
    pages = int(open("/proc/self/statm").read().split()[0])
    free = resource.RLIM_INFINITY if more is None else int(pages * resource.getpagesize() + more)
    resource.setrlimit(resource.RLIMIT_AS, (free, resource.RLIM_INFINITY))


def attempt(name, work):
    try:
        print(name, "worked", work())
    except bi.MachineError as error:
        print(name, "MachineError", error)


limit(20e6)
attempt("finest mesh", lambda: bi.Indentation(refine=1.6).elements)
limit(None)
simulations = Simulator("test", "&specimen /\\n")


def simulate(job):
    return simulations._call("run", stiffness=job.stiffness, euler_deg=job.euler_deg)


for name, more in (("none fits", 0.5 * workspace), ("again", None)):
    limit(more)
    attempt(name, lambda: run_stage(problem, "simulate", folder, simulate)["failed"])
    limit(None)
    found = rows(folder + "/campaign.sqlite")
    print("rows", len(found), [row.modulus_gpa is not None for row in found])
"""


@pytest.mark.long
def test_too_little_memory_is_retried_and_never_stored(tmp_path):
    done = subprocess.run(
        [sys.executable, "-c", SCRIPT, str(tmp_path)],
        capture_output=True,
        text=True,
        env=with_tests(),
    )
    assert done.returncode == 0, done.stderr
    lines = done.stdout.splitlines()
    assert lines[0].startswith(
        "finest mesh MachineError bi.Indentation: simulation: too little memory for a mesh of"
    )
    assert lines[1].startswith("none fits MachineError too little memory for a factor of")
    assert lines[2] == "rows 0 []"
    assert lines[3] == "again worked 0"
    assert lines[4] == "rows 3 [True, True, True]"


@pytest.mark.skipif(
    SANITIZED, reason="AddressSanitizer reserves more addresses than the limit leaves"
)
def test_batch_program_without_memory_stores_nothing_and_goes_on_later(tmp_path):
    (tmp_path / "a.csv").write_text(
        "C11,C12,C44,phi1_deg,Phi_deg,phi2_deg\n168.4,121.4,75.4,0,0,0\n168.4,121.4,75.4,0,40,0\n"
    )
    (tmp_path / "a.nml").write_text(
        "&problem symmetry = 'cubic' /\n"
        "&crystals points = 'a.csv' /\n"
        "&simulation refine = 0.6 /\n"
        "&execution workers = 1 /\n"
    )

    def run(megabytes):
        limit = int(1e6 * megabytes) if megabytes else resource.RLIM_INFINITY
        return subprocess.run(
            [BATCH, "a.nml", "--output", "out"],
            cwd=tmp_path,
            capture_output=True,
            text=True,
            env=os.environ | {"OMP_NUM_THREADS": "1", "OPENBLAS_NUM_THREADS": "1"},
            timeout=HANGS_S,
            preexec_fn=lambda: resource.setrlimit(resource.RLIMIT_AS, (limit, limit)),
        )

    done = next(
        done
        for done in map(run, range(160, 400))
        if "too little memory for the factor" in done.stderr
    )
    assert done.returncode == 1
    assert done.stderr.startswith("a.nml: &simulation: too little memory")
    done = run(None)
    assert done.returncode == 0, done.stderr
    assert "2 crystals, 2 new, 0 failed" in done.stdout
