"""The engine of this process: threads, for which the core releases the interpreter's lock. And the
loop that all engines share.
"""

from collections.abc import Callable, Sequence
from concurrent.futures import FIRST_COMPLETED, Future, ThreadPoolExecutor, wait
from functools import partial
from itertools import islice

from ..core import cores


def complete(
    submit: Callable[..., Future],
    workers: Callable[[], int],
    items: Sequence,
    collect: Callable[[int, object], None],
) -> None:
    """Submit all items, one for each present worker at a time, and call collect(number, result) in
    this thread for each as it is done.

    No worker waits until its result is collected. After an exception or an interrupt no further
    item is submitted; results that are complete, or cannot be cancelled, are still collected.
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
        self.workers = workers or cores()

    def map(self, job: Callable, items: Sequence, collect: Callable[[int, object], None]) -> None:
        """Call job(item) for all items, see `complete`."""
        with ThreadPoolExecutor(self.workers) as pool:
            complete(partial(pool.submit, job), lambda: self.workers, items, collect)
