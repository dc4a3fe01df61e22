"""campaign.sqlite: what it keeps, what it refuses, and that nothing in it changes."""

import sqlite3

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
    with Campaign(path, {"simulator": "fe", "mesh": "paper"}) as campaign:
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
        with pytest.raises(bi.InputError, match="row 2 .*215.*same point has 214 GPa in the campaign"):
            campaign.import_rows("cubic", constants, angles, [134.0, 215.0])
        with pytest.raises(bi.InputError, match="row 2 .*same point has 150 GPa in an earlier row"):
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
