"""A program that is killed costs no finished simulation, and goes on where it was. Each has work
for minutes, so that the kill is never late.
"""

import subprocess
import time

import pytest

from support.programs import BATCH, HANGS_S
from support.small_builds import HEADER, small, stored

pytestmark = pytest.mark.long


def killed_after(rows: int, command: list, folder) -> list:
    """What a program has stored in out/ when it is killed, as soon as it has so many rows."""
    process = subprocess.Popen(
        [*command, "--output", "out"],
        cwd=folder,
        stdout=subprocess.DEVNULL,
        stderr=subprocess.DEVNULL,
    )
    deadline = time.monotonic() + HANGS_S
    while len(stored(folder / "out")) < rows and time.monotonic() < deadline:
        assert process.poll() is None
        time.sleep(0.01)
    process.kill()
    process.wait()
    return stored(folder / "out")


def test_simulations(batch, tmp_path):
    rows = [HEADER, *(f"200,120,90,{turn},{angle},0" for turn in range(20) for angle in range(90))]
    (tmp_path / "points.csv").write_text("\n".join(rows) + "\n")
    (tmp_path / "a.nml").write_text(
        "&problem symmetry = 'cubic' /\n"
        "&crystals points = 'points.csv' /\n"
        "&simulation refine = 0.6 /\n"
        "&execution workers = 1 /\n"
    )
    before = killed_after(1, [BATCH, "a.nml"], tmp_path)
    assert 0 < len(before) < 1800
    (tmp_path / "points.csv").write_text("\n".join(rows[: len(before) + 4]) + "\n")
    done = batch("a.nml", "--output", "out")
    assert (done.returncode, "3 new" in done.stdout) == (0, True), done.stdout + done.stderr
    after = stored(tmp_path / "out")
    assert after[: len(before)] == before
    assert [row[2] for row in after] == list(range(len(before) + 3))


def large(folder, budget):
    small(folder, simulator="fe", budget=budget)
    file = folder / "small.nml"
    file.write_text(file.read_text().replace("n_candidates = 300", "n_candidates = 3000"))


def test_a_build(batch, tmp_path):
    large(tmp_path, 2000)
    before = killed_after(3, [BATCH, "small.nml"], tmp_path)
    assert 3 <= len(before) < 2000
    budget = len(before) + 5
    large(tmp_path, budget)
    done = batch("small.nml", "--output", "out")
    # With two more for validation.
    assert (done.returncode, f"{budget} simulations, 7 new" in done.stdout) == (0, True), (
        done.stdout + done.stderr
    )
    assert [row for row in stored(tmp_path / "out") if row in before] == before
    # As if nothing had happened.
    assert batch("small.nml", "--output", "whole").returncode == 0
    whole, resumed = (stored(tmp_path / folder) for folder in ("whole", "out"))
    assert sorted(row[3:6] for row in whole) == sorted(row[3:6] for row in resumed)
