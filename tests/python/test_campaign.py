"""campaign.sqlite: what it keeps, what it refuses, and that nothing in it changes. What is stored
is read by Python's sqlite3.

tests/fortran/test_campaign.f90 looks at the module itself.
"""

import json
import re
import sqlite3
import subprocess
import sys
import time
from contextlib import closing

import numpy as np
import pytest

import bayesindent as bi
from bayesindent.settings.problem import Problem
from bayesindent.stages.build import ask
from bayesindent.stages.stage import run_stage
from support.campaigns import rows, table, told
from support.programs import with_tests

COPPER, ANGLES = (168.4, 121.4, 75.4), (10.0, 20.0, 30.0)


def simulated(folder, points, simulate=None, simulator="theory"):
    """The document of `simulate` of these points, kept in the folder; what became of each job is
    what `simulate` says.
    """
    folder.mkdir(exist_ok=True)
    table(folder, points)
    text = (
        "&problem symmetry = 'cubic' /\n"
        "&crystals points = 'points.csv' /\n"
        f"&simulation simulator = '{simulator}', refine = 0.6 /\n"
    )
    (folder / "a.nml").write_text(text + "&execution workers = 1 /\n")
    return run_stage(Problem(folder / "a.nml", "simulate"), "simulate", folder, simulate=simulate)


def crystals(n, seed=1):
    """Points (n, 6) of stable crystals, among them powers of two and numbers next to them, which
    have the fewest digits in ways of their own.
    """
    rng = np.random.default_rng(seed)
    c12 = np.concatenate([rng.uniform(1, 100, n // 2), 2.0 ** rng.integers(0, 7, n - n // 2)])
    c44 = np.concatenate(
        [rng.uniform(10, 100, n // 2), 2.0 ** rng.integers(3, 7, n - n // 2) * (1 + 2.0**-52)]
    )
    angles = np.concatenate(
        [rng.uniform(0, 180, (n // 2, 3)), 2.0 ** rng.integers(-40, 7, (n - n // 2, 3))]
    )
    points = np.column_stack([c12 + 2.0 ** rng.integers(5, 7, n), c12, c44, angles])
    points[0] = 230.0, 0.1 + 0.2, 64.0, 1e-05, -0.0, 2.0**-44
    return points


def test_rows_come_back_to_the_last_bit(tmp_path):
    """Lists are spelled as Python spells them, under which a point is found."""
    points = crystals(400)
    curves = iter(np.random.default_rng(2).uniform(1e-9, 1e9, (400, 2, 3)).tolist())
    made = []

    def simulate(job):
        depth, force = next(curves)
        made.append((depth, force))
        if len(made) == 8:
            return {"message": "the contact did not converge"}
        return {
            "modulus_gpa": depth[0] + 0.1,
            "seconds": 0.25 + len(made),
            "elements": 7,
            "depth_um": depth,
            "force_mn": force,
        }

    document = simulated(tmp_path, points, simulate, "fe")
    assert (document["new_simulations"], document["failed"]) == (400, 1)
    stored = rows(tmp_path / "campaign.sqlite")
    assert [row.position for row in stored] == list(range(400))
    assert [(*row.constants, *row.euler_deg) for row in stored] == [
        tuple(point) for point in points.tolist()
    ]
    for i, (row, (depth, force)) in enumerate(zip(stored, made, strict=True)):
        if i == 7:
            assert (row.message, row.modulus_gpa, row.depth_um) == (
                "the contact did not converge",
                None,
                None,
            )
        else:
            assert row[5:] == ("", depth[0] + 0.1, 1.25 + i, 7, depth, force)
    with closing(sqlite3.connect(tmp_path / "campaign.sqlite")) as file:
        assert file.execute("PRAGMA integrity_check").fetchall() == [("ok",)]
        texts = file.execute(
            "SELECT symmetry, constants, euler_deg, depth_um, force_mn, origin, status FROM "
            "simulation ORDER BY position"
        )
        for i, (texts_of_row, point, curve) in enumerate(
            zip(texts, points.tolist(), made, strict=True)
        ):
            failed = i == 7
            curve = [None, None] if failed else [json.dumps(values) for values in curve]
            assert texts_of_row == (
                "cubic",
                json.dumps(point[:3]),
                json.dumps(point[3:]),
                *curve,
                "simulated",
                "failed" if failed else "done",
            )
        (created,) = file.execute("SELECT created FROM simulation WHERE position = 399").fetchone()
        written = time.mktime(time.strptime(created, "%Y-%m-%dT%H:%M:%S+00:00")) - time.timezone
        assert abs(time.time() - written) < 600
    # All are found again, the failed one too.
    again = simulated(tmp_path, points, None, "fe")
    assert again["new_simulations"] == 0
    assert again["results"] == document["results"]


def test_derivatives_are_kept(tmp_path):
    """Those of a simulation, and none where it states none."""
    points, derivatives = crystals(3), [[*np.linspace(-0.1, 1 / 3, 21)], []]
    given = iter(derivatives)

    def simulate(job):
        return {"modulus_gpa": 100.0, "modulus_by_stiffness": next(given)}

    simulated(tmp_path, points[:2], simulate, "fe")
    with closing(sqlite3.connect(tmp_path / "campaign.sqlite")) as file:
        texts = file.execute("SELECT modulus_by_stiffness FROM simulation ORDER BY position")
        assert texts.fetchall() == [(json.dumps(derivatives[0]),), (None,)]
    assert simulated(tmp_path, points[:2], None, "fe")["new_simulations"] == 0
    given = iter([[1.0, 2.0]])
    simulated(tmp_path, points, simulate, "fe")
    with pytest.raises(bi.InputError, match="the row of position 2 was changed"):
        simulated(tmp_path, points, None, "fe")


@pytest.mark.long
def test_many_rows_are_found(tmp_path):
    path = tmp_path / "campaign.sqlite"
    points = crystals(20000, 2).tolist()
    unique = list(dict.fromkeys(map(tuple, points)))
    told(tmp_path, unique, [point[0] / 3 for point in unique])
    document = simulated(tmp_path, points)
    assert document["new_simulations"] == 0
    assert [row["indentation_modulus_gpa"] for row in document["results"]] == [
        point[0] / 3 for point in points
    ]
    stored = rows(path)
    assert len(stored) == len(unique)
    assert (stored[7].imported, stored[7].seconds) == (True, None)
    # A new one comes after them.
    assert simulated(tmp_path, [*points[:3], (*COPPER, *ANGLES)])["new_simulations"] == 1
    assert rows(path)[-1].position == len(unique)


WRITER = """
import sys
from pathlib import Path
from support.campaigns import told
folder = Path(sys.argv[1])
k = float(sys.argv[2])
sys.stdin.readline()
for i in range(0, 50, 2):
    crystals = (200.0 + i, 100.0, 50.0), (201.0 + i, 100.0, 50.0)
    orientations = (0.0, 0.0, 0.0), (k, 0.0, 0.0)
    points = [crystal + angles for crystal, angles in zip(crystals, orientations)]
    told(folder, points, [150.0, 150.0])
"""


def test_processes_share_a_file(tmp_path):
    """The library takes no lock: the file itself bears it."""
    (tmp_path / "campaign").mkdir()
    writers = []
    for k in range(3):
        folder = tmp_path / str(k)
        folder.mkdir()
        (folder / "campaign.sqlite").symlink_to(tmp_path / "campaign" / "campaign.sqlite")
    told(tmp_path / "campaign", [(*COPPER, *ANGLES)], [134.0])
    for k in range(3):
        command = [sys.executable, "-c", WRITER, tmp_path / str(k), str(k)]
        writers.append(
            subprocess.Popen(command, stdin=subprocess.PIPE, text=True, env=with_tests())
        )
    for writer in writers:
        writer.stdin.write("\n")
        writer.stdin.flush()
    for writer in writers:
        writer.communicate()
        assert writer.returncode == 0
    # Each has the 25 points of even i, which are one and the same, and 25 of its own.
    assert sorted(row.position for row in rows(tmp_path / "campaign" / "campaign.sqlite")) == list(
        range(101)
    )


def test_no_row_is_ever_changed(tmp_path):
    path = tmp_path / "campaign.sqlite"
    told(tmp_path, [(*COPPER, *ANGLES)], [134.0])
    assert (
        simulated(tmp_path, [(*COPPER, *ANGLES)])["results"][0]["indentation_modulus_gpa"] == 134.0
    )
    assert [row.modulus_gpa for row in rows(path)] == [134.0]
    with closing(sqlite3.connect(path)) as file:
        for statement in (
            "UPDATE simulation SET indentation_modulus_gpa = 1",
            "DELETE FROM simulation",
        ):
            with pytest.raises(sqlite3.IntegrityError, match="never"):
                file.execute(statement)


def test_physics_are_kept_apart(tmp_path):
    point = [(*COPPER, *ANGLES)]
    told(tmp_path, point, [134.0])
    assert (
        simulated(tmp_path, point, lambda job: {"modulus_gpa": 140.0}, "fe")["new_simulations"] == 1
    )
    path = tmp_path / "campaign.sqlite"
    assert [row.modulus_gpa for row in rows(path, '{"simulator": "theory"}')] == [134.0]
    assert sorted(row.modulus_gpa for row in rows(path)) == [134.0, 140.0]
    # A build with yet another says so.
    text = (tmp_path / "b.nml").read_text().replace("'theory'", "'import'")
    (tmp_path / "c.nml").write_text(text)
    (warning,) = ask(Problem(tmp_path / "c.nml", "build"), tmp_path, 1)["warnings"]
    assert warning["code"] == "other_physics"
    assert str(path) in warning["subject"]


@pytest.mark.parametrize("modulus", [float("nan"), -1.0, float("inf")])
def test_a_modulus_that_is_none_is_a_failure(tmp_path, modulus):
    with pytest.raises(bi.BayesindentError, match="every simulation failed"):
        simulated(tmp_path, [(*COPPER, *ANGLES)], lambda job: {"modulus_gpa": modulus})
    (row,) = rows(tmp_path / "campaign.sqlite")
    assert (
        re.fullmatch("the modulus is (nan|-1.0|infinity) GPa", row.message)
        and row.modulus_gpa is None
    )


def test_import(tmp_path):
    points = np.array([(*COPPER, *ANGLES), (225.0, 135.0, 124.0, *ANGLES)])
    assert told(tmp_path, points, [134.0, 214.0]) == {
        "imported": 2,
        "simulations": 2,
        "failed": 0,
        "warnings": [],
    }
    assert told(tmp_path, points, [134.0, 214.0])["imported"] == 0
    with pytest.raises(
        bi.InputError, match=r"told.csv: row 2 .*215.*same point has 214.0 GPa in the campaign"
    ):
        told(tmp_path, points, [134.0, 215.0])
    with pytest.raises(bi.InputError, match="row 2 .*same point has 150.0 GPa in an earlier row"):
        told(tmp_path, [(*points[0, :3] + 1, *ANGLES)] * 2, [150.0, 151.0])
    assert len(rows(tmp_path / "campaign.sqlite")) == 2
    failing = [(*points[0, :3] * 2, *ANGLES)]
    with pytest.raises(bi.BayesindentError, match="no contact"):
        simulated(tmp_path, failing, lambda job: {"message": "no contact"})
    with pytest.raises(bi.InputError, match="failed .no contact."):
        told(tmp_path, failing, [700.0])


def test_foreign_and_damaged_files_are_refused(tmp_path):
    path = tmp_path / "campaign.sqlite"
    path.write_text(
        "this is not a database, but it is long enough to look like a file with something in it"
        * 20
    )
    with pytest.raises(bi.InputError, match="is not a campaign, or is damaged"):
        told(tmp_path, [(*COPPER, *ANGLES)], [134.0])
    assert path.read_text().startswith("this is not")
    path.unlink()
    with closing(sqlite3.connect(path)) as file:
        file.execute("CREATE TABLE recipes (name TEXT)")
        file.commit()
    with pytest.raises(bi.InputError, match="not a campaign of bayesindent"):
        told(tmp_path, [(*COPPER, *ANGLES)], [134.0])
    path.unlink()
    points = [(200.0 + i, 50.0, 50.0, *ANGLES) for i in range(400)]
    told(tmp_path, points, [100.0] * 400)
    content = bytearray(path.read_bytes())
    content[8192:12288] = b"\x55" * 4096
    path.write_bytes(content)
    for attempt in (
        lambda: told(tmp_path, points[:1], [100.0]),
        lambda: simulated(tmp_path, points[:1]),
    ):
        with pytest.raises(bi.InputError, match="damaged"):
            attempt()
