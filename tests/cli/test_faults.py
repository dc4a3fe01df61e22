"""Kills, damaged files, a full disk, no permission: nothing is lost, and what is wrong is told in
one line. `bench faults` is the long form.
"""

import pytest

from support.fault_files import damaged, full_disk, killed, no_permission
from support.fault_kills import disturbed

PROGRAMS = ("bayesindent", "bayesindent-batch")


def ended_well(found: dict) -> bool:
    return not found["wrong"] and found["refused"] + found["same"] == found["tries"]


@pytest.mark.long
@pytest.mark.parametrize(
    "program, kills, campaign",
    [
        ("bayesindent-batch", 6, {"budget": 17, "batch": 1}),
        ("bayesindent-batch", 6, {"budget": 22, "batch": 6}),
        ("bayesindent", 4, {"budget": 22, "batch": 6, "command": "build"}),
    ],
)
def test_a_campaign_that_is_killed_is_the_one_that_is_not(tmp_path, program, kills, campaign):
    found = disturbed(program, tmp_path, kills, seed=7, **campaign)
    assert found["kills"] == kills
    assert (found["lost"], found["repeated"], found["half-written files"], found["other"]) == (
        0,
        0,
        [],
        [],
    )


@pytest.mark.long
@pytest.mark.parametrize("command", ["report", "compare", "init"])
def test_a_page_whose_making_is_killed_is_made_by_the_next(tmp_path, command):
    found = killed(command, tmp_path, 2, seed=3)
    assert ended_well(found), found


@pytest.mark.long_where("campaign.sqlite")
@pytest.mark.parametrize("file", ["campaign.sqlite", "surrogate.txt"])
def test_a_damaged_file_is_named(tmp_path, file):
    """The batch program's; those of Python are damaged in tests/python/test_damaged_files.py."""
    found = damaged("bayesindent-batch", tmp_path, file, range(1, 2))
    assert ended_well(found), found
    assert found["refused"] > 0


@pytest.mark.long
@pytest.mark.parametrize(
    "program, sizes", [("bayesindent-batch", range(0, 40, 8)), ("bayesindent", range(12, 13))]
)
def test_a_full_disk_is_told_and_loses_nothing(program, sizes):
    found = full_disk(program, sizes, "build")
    if not found["tries"]:
        pytest.skip("this user may not mount a small disk")
    assert ended_well(found), found
    assert found["refused"] > 0


@pytest.mark.parametrize("program", PROGRAMS)
def test_a_folder_that_may_not_be_written_is_named(tmp_path, program):
    found = no_permission(program, tmp_path, "build")
    assert ended_well(found), found
    assert found["refused"] == 2
