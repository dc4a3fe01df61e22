"""campaign.sqlite: what it keeps, what it refuses, and that nothing in it changes."""

import json
import sqlite3
import subprocess
import sys
import time
from contextlib import closing

import numpy as np
import pytest

import bayesindent as bi
from bayesindent.pipeline.campaign import Campaign

THEORY = {"simulator": "theory"}
COPPER, ANGLES = (168.4, 121.4, 75.4), (10.0, 20.0, 30.0)


def test_rows_come_back_to_the_last_bit(tmp_path):
    values = tuple(np.array(COPPER) / 3)
    with Campaign(tmp_path / "campaign.sqlite", THEORY) as campaign:
        campaign.add("cubic", values, ANGLES, modulus_gpa=0.1 + 0.2, elements=12, seconds=1.5, depth_um=[0.1], force_mn=[2.0])
        campaign.add("cubic", COPPER, ANGLES, message="the contact did not converge")
    with Campaign(tmp_path / "campaign.sqlite", THEORY) as campaign:
        done, failed = campaign.rows("cubic")
        assert (done.constants, done.euler_deg, done.modulus_gpa, done.seconds) == (values, ANGLES, 0.1 + 0.2, 1.5)
        assert (failed.message, failed.modulus_gpa) == ("the contact did not converge", None)
        assert campaign.find("cubic", values, ANGLES) == done
        assert campaign.rows("hexagonal") == []
        assert campaign.next_position() == 2


def test_the_file_is_plain_sqlite(tmp_path):
    path = tmp_path / "new folder" / "campaign.sqlite"
    # Powers of two, and numbers next to them, have the fewest digits in ways of their own.
    rng = np.random.default_rng(1)
    points = np.concatenate([rng.uniform(0, 360, (200, 6)), 2.0 ** rng.integers(-40, 40, (200, 6)), rng.integers(0, 300, (200, 6)) / 8])
    points[0] = 230.0, 1e-05, 1e16, 0.1, -0.0, 2.0**-44
    with Campaign(path, THEORY) as campaign:
        for point in points:
            campaign.add(
                "cubic", point[:3], point[3:], modulus_gpa=point[0] + 1, seconds=0.25, elements=7, depth_um=point[:2], force_mn=point[2:4]
            )
        campaign.add("cubic", COPPER, ANGLES, message="no contact")
    with closing(sqlite3.connect(path)) as file:
        assert file.execute("PRAGMA integrity_check").fetchall() == [("ok",)]
        rows = file.execute("SELECT * FROM simulation ORDER BY position").fetchall()
        assert [row[2] for row in rows] == list(range(601))
        # Every list as Python writes it, under which the point is found.
        for row, point in zip(rows, points.tolist(), strict=False):
            assert row[3:14] == (
                "cubic", json.dumps(point[:3]), json.dumps(point[3:]), "simulated", "done", "", point[0] + 1, 7, 0.25, json.dumps(point[:2]),
                json.dumps(point[2:4]),
            )  # fmt: skip
        assert rows[-1][3:14] == ("cubic", json.dumps(COPPER), json.dumps(ANGLES), "simulated", "failed", "no contact", *[None] * 5)
        written = time.mktime(time.strptime(rows[-1][14], "%Y-%m-%dT%H:%M:%S+00:00")) - time.timezone
        assert abs(time.time() - written) < 600


#: The layout of the files that version 0.1 wrote with Python's sqlite3.
OLD = """
CREATE TABLE physics (id INTEGER PRIMARY KEY, identity TEXT NOT NULL UNIQUE);
CREATE TABLE simulation (
    id INTEGER PRIMARY KEY, physics_id INTEGER NOT NULL REFERENCES physics(id), position INTEGER NOT NULL, symmetry TEXT NOT NULL,
    constants TEXT NOT NULL, euler_deg TEXT NOT NULL, origin TEXT NOT NULL, status TEXT NOT NULL, message TEXT NOT NULL,
    indentation_modulus_gpa REAL, elements INTEGER, seconds REAL, depth_um TEXT, force_mn TEXT, created TEXT NOT NULL,
    UNIQUE (physics_id, symmetry, constants, euler_deg)
);
PRAGMA application_id = 0x62617969;
PRAGMA user_version = 1;
INSERT INTO physics (identity) VALUES ('{"simulator": "theory"}');
"""


@pytest.mark.long
def test_rows_that_python_wrote_are_found(tmp_path):
    path = tmp_path / "campaign.sqlite"
    rng = np.random.default_rng(2)
    points = [(tuple(rng.uniform(1, 300, 3)), tuple(rng.uniform(0, 360, 3))) for _ in range(20000)]
    with closing(sqlite3.connect(path)) as file:
        file.executescript(OLD)
        cells = [(i, json.dumps(c), json.dumps(e), c[0] / 3, json.dumps([0.1, c[1]])) for i, (c, e) in enumerate(points)]
        file.executemany(
            "INSERT INTO simulation VALUES (NULL, 1, ?, 'cubic', ?, ?, 'told', 'done', '', ?, NULL, NULL, ?, '[1.0]', '2026-01-01')", cells
        )
        file.commit()
    with Campaign(path, THEORY) as campaign:
        start = time.process_time()
        rows = campaign.rows()
        assert [(row.constants, row.euler_deg) for row in rows] == points
        assert all(row == campaign.find("cubic", *point) for row, point in zip(rows[::10], points[::10], strict=True))
        assert time.process_time() - start < 10
        assert rows[7].modulus_gpa == points[7][0][0] / 3
        assert (rows[7].depth_um, rows[7].force_mn, rows[7].imported, rows[7].seconds) == ([0.1, points[7][0][1]], [1.0], True, None)
        campaign.add("cubic", *points[7], modulus_gpa=1.0)
        assert campaign.next_position() == 20000
        assert len(campaign.rows("cubic")) == 20000


WRITER = """
import sys
from bayesindent.pipeline.campaign import Campaign
sys.stdin.readline()
with Campaign(sys.argv[1], {"simulator": "theory"}) as campaign:
    for i in range(50):
        campaign.add("cubic", (200.0 + i, 100.0, 50.0), (float(sys.argv[2]) * (i % 2), 0.0, 0.0), modulus_gpa=150.0)
"""


def test_processes_share_a_file(tmp_path):
    path = tmp_path / "campaign.sqlite"
    writers = [subprocess.Popen([sys.executable, "-c", WRITER, path, str(k)], stdin=subprocess.PIPE, text=True) for k in range(3)]
    for writer in writers:
        writer.stdin.write("\n")
        writer.stdin.flush()
    for writer in writers:
        writer.communicate()
        assert writer.returncode == 0
    with Campaign(path, THEORY) as campaign:
        # Each has the 25 points of even i, which are one and the same, and 25 of its own.
        assert sorted(row.position for row in campaign.rows("cubic")) == list(range(100))


def test_a_closed_campaign_says_so(tmp_path):
    with Campaign(tmp_path / "campaign.sqlite", THEORY) as campaign:
        pass
    campaign.close()
    with pytest.raises(bi.InputError, match="the campaign does not exist any more"):
        campaign.rows()


def test_no_row_is_ever_changed(tmp_path):
    path = tmp_path / "campaign.sqlite"
    with Campaign(path, THEORY) as campaign:
        campaign.add("cubic", COPPER, ANGLES, modulus_gpa=134.0)
        campaign.add("cubic", COPPER, ANGLES, modulus_gpa=135.0)
        assert [row.modulus_gpa for row in campaign.rows("cubic")] == [134.0]
    file = sqlite3.connect(path)
    for statement in ("UPDATE simulation SET indentation_modulus_gpa = 1", "DELETE FROM simulation"):
        with pytest.raises(sqlite3.IntegrityError, match="never"):
            file.execute(statement)


def test_physics_are_kept_apart(tmp_path):
    path = tmp_path / "campaign.sqlite"
    with Campaign(path, THEORY) as campaign:
        campaign.add("cubic", COPPER, ANGLES, modulus_gpa=134.0)
    with Campaign(path, {"simulator": "fe", "geometry": "block"}) as campaign:
        assert campaign.rows("cubic") == []
        assert campaign.other_physics() == ['{"simulator": "theory"}']
        campaign.add("cubic", COPPER, ANGLES, modulus_gpa=140.0)
    with Campaign(path, THEORY) as campaign:
        assert [row.modulus_gpa for row in campaign.rows("cubic")] == [134.0]


def test_a_modulus_that_is_none_is_a_failure(tmp_path):
    with Campaign(tmp_path / "campaign.sqlite", THEORY) as campaign:
        campaign.add("cubic", COPPER, ANGLES, modulus_gpa=float("nan"))
        assert campaign.rows("cubic")[0].message == "the modulus is nan GPa"


def test_import(tmp_path):
    constants = np.array([COPPER, (225.0, 135.0, 124.0)])
    angles = np.array([ANGLES, ANGLES])
    with Campaign(tmp_path / "campaign.sqlite", THEORY) as campaign:
        assert campaign.import_rows("cubic", constants, angles, [134.0, 214.0]) == 2
        assert campaign.import_rows("cubic", constants, angles, [134.0, 214.0]) == 0
        with pytest.raises(bi.InputError, match="row 2 .*215.*same point has 214.0 GPa in the campaign"):
            campaign.import_rows("cubic", constants, angles, [134.0, 215.0])
        with pytest.raises(bi.InputError, match="row 2 .*same point has 150.0 GPa in an earlier row"):
            campaign.import_rows("cubic", 2 * constants[[0, 0]], angles, [150.0, 151.0])
        with pytest.raises(bi.InputError, match="row 1: modulus_gpa is nan"):
            campaign.import_rows("cubic", 3 * constants, angles, [np.nan, 1.0])
        assert len(campaign.rows("cubic")) == 2
        campaign.add("cubic", 5 * constants[0], ANGLES, message="no contact")
        with pytest.raises(bi.InputError, match="failed .no contact."):
            campaign.import_rows("cubic", 5 * constants[:1], angles[:1], [700.0])


def test_foreign_and_damaged_files_are_refused(tmp_path):
    text = tmp_path / "text.sqlite"
    text.write_text("this is not a database, but it is long enough to look like a file with something in it" * 20)
    with pytest.raises(bi.InputError, match="is not a campaign, or is damaged"):
        Campaign(text, THEORY)
    assert text.read_text().startswith("this is not")
    foreign = tmp_path / "foreign.sqlite"
    with sqlite3.connect(foreign) as file:
        file.execute("CREATE TABLE recipes (name TEXT)")
    with pytest.raises(bi.InputError, match="not a campaign of bayesindent"):
        Campaign(foreign, THEORY)
    path = tmp_path / "campaign.sqlite"
    with Campaign(path, THEORY) as campaign:
        for i in range(400):
            campaign.add("cubic", (100.0 + i, 50.0, 50.0), ANGLES, modulus_gpa=100.0)
    content = bytearray(path.read_bytes())
    content[8192:12288] = b"\x55" * 4096
    path.write_bytes(content)
    with pytest.raises(bi.InputError, match="damaged"):
        Campaign(path, THEORY)
