"""A build that was killed within a batch ends as if it had not been, whichever simulations of the
batch were stored.
"""

import sqlite3
from contextlib import closing

import pytest

from support.build_problems import CORRECTION, PAPER, make_problem, numbers_of, posterior_of, stored
from support.campaigns import past_trigger
from support.learner import build

#: Positions that are missing: of the initial set, of the batches that follow (six each), of what
#: validates.
MISSING = [
    {1, 4, *range(6, 31)},
    {17, 18, 20, *range(22, 31)},
    {22, 25, *range(28, 31)},
    {28, 30},
    {29},
]


def remove(folder, positions) -> None:
    """Let the campaign never have had the rows of these positions."""
    with closing(sqlite3.connect(folder / "campaign.sqlite")) as file:
        listed = ", ".join(map(str, positions))
        past_trigger(
            file,
            "simulation_is_not_deleted",
            f"DELETE FROM simulation WHERE position IN ({listed})",
        )


@pytest.mark.parametrize("model", [PAPER, CORRECTION], ids=["paper", "correction"])
def test_a_batch_that_was_killed(tmp_path, model):
    design = {"n_candidates": 200, "initial": 16, "budget": 28, "batch": 6, "validation": 3}
    whole = build(make_problem(tmp_path, model=model, design=design), tmp_path)
    rows, posterior = stored(tmp_path), posterior_of(tmp_path)
    assert len(rows) == 31
    for missing in MISSING:
        remove(tmp_path, missing)
        document = build(make_problem(tmp_path, model=model, design=design), tmp_path)
        assert document["new_simulations"] == len(missing)
        assert stored(tmp_path) == rows
        assert posterior_of(tmp_path) == posterior
        assert numbers_of(document) == numbers_of(whole)


def test_another_design_takes_the_rows_as_they_are(tmp_path):
    """What a batch of another size left is learnt, and none of it is simulated again."""
    design = {"n_candidates": 200, "initial": 16, "budget": 28, "batch": 6}
    build(make_problem(tmp_path, design=design), tmp_path)
    rows = stored(tmp_path)
    remove(tmp_path, {17, *range(19, 28)})
    left = stored(tmp_path)
    document = build(
        make_problem(tmp_path, design=design | {"n_candidates": 150, "batch": 4}), tmp_path
    )
    again = stored(tmp_path)
    assert (document["simulations"], document["new_simulations"]) == (28, 28 - len(left))
    assert set(left) <= set(again)
    assert len({row[1:3] for row in again}) == len(again) == len(rows)
