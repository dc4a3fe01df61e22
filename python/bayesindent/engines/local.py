"""Threads of this process; the core releases the interpreter's lock. And what all engines have in
common.
"""

import os
from collections.abc import Callable, Sequence
from concurrent.futures import FIRST_COMPLETED, Future, ThreadPoolExecutor, wait
from functools import partial
from itertools import islice


def complete(
    submit: Callable[..., Future],
    workers: Callable[[], int],
    items: Sequence,
    collect: Callable[[int, object], None],
) -> None:
    """Submit all items, one for each of the workers that are there at the time, and collect(number,
    result) in this thread for each as it is done.

    No worker waits for what is done with its result. An exception, or an interrupt, starts no more;
    what is done, or cannot be cancelled, is still collected.
    """
    waiting, under_way = iter(enumerate(items)), dict[Future, int]()
    done: set[Future] = set()
    try:
        while True:
            for number, item in islice(waiting, max(0, workers() + len(done) - len(under_way))):
                under_way[submit(item)] = number
            for future in done:
                result = future.result()
                collect(under_way.pop(future), result)
            if not under_way:
                return
            done = wait(under_way, return_when=FIRST_COMPLETED).done
    finally:
        for future, number in under_way.items():
            if not future.cancel() and future.exception() is None:
                collect(number, future.result())


class LocalEngine:
    """At most `workers` jobs at a time (0: the cores that this process may use)."""

    def __init__(self, workers: int = 0):
        self.workers = workers or len(os.sched_getaffinity(0))

    def map(self, job: Callable, items: Sequence, collect: Callable[[int, object], None]) -> None:
        """Call job(item) of all items, see `complete`."""
        with ThreadPoolExecutor(self.workers) as pool:
            complete(partial(pool.submit, job), lambda: self.workers, items, collect)
