"""What any engine does, by the list of the package."""

import threading
import time

import pytest

import bayesindent as bi
from bayesindent.engines import ENGINES
from support.engine_jobs import job

WORKERS, MANY = 2, 60


@pytest.fixture(scope="module", params=ENGINES)
def engine(request):
    """An engine with two workers; it is left out if its packages are not installed."""
    try:
        made = ENGINES[request.param](WORKERS, "local")
    except bi.InputError as error:
        if "needs the package" not in str(error):
            raise
        pytest.skip(str(error))
    with made as engine:
        yield engine


def test_any_engine_gives_every_result_once(engine):
    """It says how many workers it has. Each result comes with the number of its item as soon as it
    is there, one after another in the caller's thread, in whatever order jobs end. As many jobs run
    at a time as there are workers, and no more. No items are no work.
    """
    assert engine.workers == WORKERS
    engine.map(job, [], pytest.fail)
    found, threads = [], set()

    def collect(number, result):
        found.append((number, result))
        threads.add(threading.get_ident())

    items = [*range(10, 22)]
    engine.map(job, items, collect)
    assert sorted(number for number, _ in found) == list(range(12))
    assert all(result[0] == items[number] ** 2 for number, result in found)
    assert [number for number, _ in found] != list(range(12))
    assert threads == {threading.get_ident()}
    begins, ends = zip(*(result[1:] for _, result in found), strict=True)
    together = [sum(a <= begin < b for a, b in zip(begins, ends, strict=True)) for begin in begins]
    assert max(together) == WORKERS


def test_any_engine_that_fails_keeps_the_other_results(engine):
    """The error of a job is that of `map`. What ended before it, or runs when it fails, is
    collected. No further job begins, and the engine still works.
    """
    found = {}
    items = [1, 2, 3, 4, -1, *range(5, MANY)]
    with pytest.raises(bi.InputError, match="less than nothing"):
        engine.map(job, items, found.__setitem__)
    assert {0, 1, 2} <= set(found) and 4 not in found and len(found) < MANY / 2
    assert all(result[0] == items[number] ** 2 for number, result in found.items())
    engine.map(job, [3], lambda number, result: found.__setitem__("again", result[0]))
    assert found["again"] == 9


def test_any_engine_that_is_stopped_keeps_what_is_complete(engine):
    """An interrupt comes out of `map`. Every result that is complete by then is collected, and no
    other job begins.
    """
    found = {}

    def collect(number, result):
        found[number] = result
        if len(found) == 5:
            # All that is under way ends.
            time.sleep(0.5)
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        engine.map(job, range(MANY), collect)
    assert 5 <= len(found) <= 5 + 2 * WORKERS and set(found) == set(range(len(found)))
    assert all(result[0] == number**2 for number, result in found.items())
