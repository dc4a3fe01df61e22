"""Simulations on the workers of a real Dask scheduler: the same numbers, with a worker killed on
the way.
"""

import json
import os
import signal
import socket
import sqlite3
import subprocess
import sys
import time
from contextlib import contextmanager, nullcontext

import pytest

import bayesindent as bi
from bayesindent.engines import DaskEngine
from bayesindent.settings.problem import Problem
from support.counted_job import Counted
from support.learner import build
from support.programs import HANGS_S, with_tests

dask = pytest.importorskip("dask", reason="the extra dask is not installed")
distributed = pytest.importorskip("distributed", reason="the extra dask is not installed")

START = "import sys; from distributed.cli.{0} import main; sys.exit(main(sys.argv[1:]))"


@pytest.fixture(scope="module")
def cluster(tmp_path_factory):
    """Address of a scheduler of its own, and two worker processes."""
    folder = tmp_path_factory.mktemp("dask")
    file = folder / "scheduler.json"

    def start(kind: str, *arguments: str) -> subprocess.Popen:
        command = [
            sys.executable,
            "-c",
            START.format(kind),
            "--scheduler-file",
            str(file),
            *arguments,
        ]
        with open(folder / f"{kind}.log", "a") as log:
            return subprocess.Popen(command, cwd=folder, env=with_tests(), stdout=log, stderr=log)

    processes = [start("dask_scheduler", "--host", "127.0.0.1", "--port", "0", "--no-dashboard")]
    end = time.monotonic() + HANGS_S
    while not file.exists() and time.monotonic() < end:
        time.sleep(0.1)
    workers = [
        start("dask_worker", "--nthreads", "1", "--no-nanny", "--no-dashboard") for _ in range(2)
    ]
    yield json.loads(file.read_text())["address"], workers
    for process in workers + processes:
        process.kill()
        process.wait()


@contextmanager
def engine_with_two(address: str):
    with DaskEngine(0, address) as engine:
        end = time.monotonic() + HANGS_S
        while engine.workers < 2 and time.monotonic() < end:
            time.sleep(0.1)
        assert engine.workers == 2
        yield engine


def test_each_worker_makes_the_job_once(cluster, tmp_path):
    found = {}
    with engine_with_two(cluster[0]) as engine:
        engine.map(Counted(tmp_path / "made"), list(range(40)), found.__setitem__)
    assert [found[i][1] for i in range(40)] == [i**2 for i in range(40)]
    made = (tmp_path / "made").read_text().split()
    assert len(set(made)) == len(made) == 2 and set(made) == {str(pid) for pid, _ in found.values()}


def test_an_exception_starts_no_more_and_keeps_what_is_done(cluster, tmp_path):
    found = {}
    with (
        engine_with_two(cluster[0]) as engine,
        pytest.raises(bi.InputError, match="less than nothing"),
    ):
        engine.map(Counted(tmp_path / "made"), [*range(5), -1, *range(5, 400)], found.__setitem__)
    assert len(found) < 200 and all(found[i][1] == i**2 for i in found if i < 5)


def test_a_build_whose_worker_is_killed_gives_the_same_numbers(cluster, tmp_path, monkeypatch):
    address, workers = cluster
    with engine_with_two(address):
        pass
    problem = (
        "&problem title = 'On workers', seed = 3 /\n&simulation refine = 0.6, depths = 4 /\n"
        "&design budget = 12, batch = 4, n_candidates = 200 /\n&surrogate degree = 1 /\n"
    )
    for name, execution in (
        ("local", ""),
        ("dask", "&execution engine = 'dask', scheduler = 'address' /\n"),
    ):
        (tmp_path / f"{name}.nml").write_text(problem + execution)
    build(Problem(tmp_path / "local.nml", "build"), tmp_path / "local")

    def kill(_):
        if workers[0].poll() is None:
            workers[0].send_signal(signal.SIGKILL)

    monkeypatch.setattr("bayesindent.stages.stage.progress_bar", lambda *_: nullcontext(kill))
    with dask.config.set({"scheduler-address": address}):
        build(Problem(tmp_path / "dask.nml", "build"), tmp_path / "dask")
    assert workers[0].wait(HANGS_S) == -signal.SIGKILL

    def rows(name: str) -> list[tuple]:
        with sqlite3.connect(tmp_path / name / "campaign.sqlite") as campaign:
            columns = "position, symmetry, constants, euler_deg, indentation_modulus_gpa, force_mn"
            return campaign.execute(
                f"SELECT {columns} FROM simulation ORDER BY position"
            ).fetchall()

    assert len(rows("dask")) == 12 and rows("dask") == rows("local")
    coefficients = [
        bi.Surrogate.load(tmp_path / name / "surrogate.txt").coefficients.tolist()
        for name in ("dask", "local")
    ]
    assert coefficients[0] == coefficients[1]


def test_no_scheduler_is_told(monkeypatch):
    monkeypatch.setattr("bayesindent.engines.dask.PATIENCE_S", 0.5)
    with pytest.raises(
        bi.core.MachineError, match="no scheduler with workers answers at tcp://127.0.0.1:1"
    ):
        DaskEngine(0, "tcp://127.0.0.1:1")


def test_every_engine_serves_many_crystals(cluster):
    address, _ = cluster
    model = bi.Indentation(refine=0.6, depths=1)
    copper = bi.stiffness("cubic", C11=168.4, C12=121.4, C44=75.4)
    crystals, angles = (
        [copper, 1.1 * copper, 1e-9 * copper - copper],
        [[0, 0, 0], [0, 45, 0], [0, 0, 0]],
    )
    here = model.run_many(crystals, angles, errors="return")
    there = model.run_many(crystals, angles, errors="return", engine="dask", scheduler=address)
    assert [getattr(result, "indentation_modulus_gpa", str(result)) for result in there] == [
        getattr(result, "indentation_modulus_gpa", str(result)) for result in here
    ]


@pytest.mark.parametrize("address", ["tcp://127.0.0.1:{}", "tls://127.0.0.1:{}", "scheduler.json"])
def test_a_namelist_connects_to_nothing(tmp_path, bayesindent, address):
    with socket.create_server(("127.0.0.1", 0)) as host:
        stated = address.format(host.getsockname()[1])
        (tmp_path / "a.nml").write_text(
            "&problem seed = 1 /\n&design budget = 40 /\n"
            f"&execution engine = 'dask', scheduler = '{stated}' /\n"
        )
        done = bayesindent("build", "a.nml")
        assert done.returncode == 2
        assert done.stderr.startswith(
            f"a.nml: &execution scheduler: '{stated}' is not known; allowed 'local', "
        )
        host.settimeout(0.2)
        with pytest.raises(TimeoutError):
            host.accept()


def test_an_address_is_that_of_the_configuration(cluster):
    with dask.config.set({"scheduler-address": cluster[0]}), DaskEngine(0, "address") as engine:
        assert engine.workers >= 1
    with (
        dask.config.set({"scheduler-address": None}),
        pytest.raises(bi.InputError, match="needs the option --scheduler ADDRESS"),
    ):
        DaskEngine(0, "address")


def test_the_option_states_the_address(tmp_path, process):
    (tmp_path / "a.nml").write_text(
        "&problem seed = 1 /\n&simulation refine = 0.6, depths = 4 /\n&design budget = 40 /\n"
    )
    done = process("build", "a.nml", "--scheduler", "tcp://127.0.0.1:1")
    assert done.returncode == 1
    assert "trying to connect to tcp://127.0.0.1:1 " in done.stderr


def test_a_scheduler_without_workers_is_told(tmp_path, monkeypatch):
    monkeypatch.setattr("bayesindent.engines.dask.PATIENCE_S", 1.0)
    file = tmp_path / "scheduler.json"
    arguments = ["--scheduler-file", str(file), "--host", "127.0.0.1", "--port", "0"]
    command = [sys.executable, "-c", START.format("dask_scheduler"), *arguments, "--no-dashboard"]
    with open(tmp_path / "log", "w") as log:
        scheduler = subprocess.Popen(command, cwd=tmp_path, stdout=log, stderr=log)
    try:
        end = time.monotonic() + HANGS_S
        while not file.exists() and time.monotonic() < end:
            time.sleep(0.1)
        address = json.loads(file.read_text())["address"]
        with pytest.raises(bi.core.MachineError, match=f"with workers answers at {address}"):
            DaskEngine(0, address)
    finally:
        scheduler.kill()
        scheduler.wait()


def test_an_own_cluster_has_a_certificate(tmp_path):
    with DaskEngine(1) as engine:
        address = engine._cluster.scheduler_address
        assert address.startswith("tls://")
        found = {}
        engine.map(Counted(tmp_path / "made"), [3], found.__setitem__)
        assert found[0][1] == 9
        with pytest.raises((OSError, TimeoutError, TypeError)):
            distributed.Client(address, timeout=1.0, set_as_default=False)


def test_a_job_of_slurm_has_what_execution_states(tmp_path, process, monkeypatch):
    pytest.importorskip("dask_jobqueue", reason="the extra dask is not installed")
    (tmp_path / "sbatch").write_text(
        f"#!/bin/sh\ncat > {tmp_path}/job.sh\necho 'sbatch: error: no partition' >&2\nexit 1\n"
    )
    (tmp_path / "sbatch").chmod(0o755)
    monkeypatch.setenv("PATH", f"{tmp_path}:{os.environ['PATH']}")
    monkeypatch.setenv("DASK_CONFIG", str(tmp_path))
    groups = (
        "&problem seed = 1 /\n&simulation refine = 0.6, depths = 4 /\n&design budget = 40 /\n"
        "&execution engine = 'dask', scheduler = 'slurm'{} /\n"
    )
    (tmp_path / "a.nml").write_text(groups.format(""))
    done = process("build", "a.nml")
    assert done.returncode == 2 and "Traceback" not in done.stderr
    assert "a.nml: &execution scheduler: 'slurm' needs the cores and the memory" in done.stderr
    job = ", cores = 3, memory = '5GB', walltime = '00:07:00'"
    (tmp_path / "a.nml").write_text(groups.format(job))
    done = process("build", "a.nml")
    assert done.returncode == 2 and "Traceback" not in done.stderr
    assert "a.nml: &execution scheduler: SLURM refuses the job: sbatch: error: no" in done.stderr
    script = (tmp_path / "job.sh").read_text()
    assert all(
        f"#SBATCH {line}" in script for line in ("--cpus-per-task=3", "--mem=5G", "-t 00:07")
    )
