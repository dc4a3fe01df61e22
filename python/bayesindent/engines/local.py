"""Threads of this process; the core releases the interpreter's lock."""

import os
from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor, as_completed

__all__ = ["LocalEngine"]


class LocalEngine:
    """At most `workers` jobs at a time (0: the cores that this process may use)."""

    def __init__(self, workers: int = 0):
        self.workers = workers or len(os.sched_getaffinity(0))

    def map(self, job: Callable, items: Sequence, collect: Callable[[int, object], None]) -> None:
        """Call job(item) of all items, and collect(number, result) in this thread for each as it is done.

        An exception, or an interrupt, starts no more; what is under way is still collected.
        """
        with ThreadPoolExecutor(self.workers) as pool:
            left = {pool.submit(job, item): number for number, item in enumerate(items)}
            try:
                for future in as_completed(list(left)):
                    collect(left.pop(future), future.result())
            except BaseException:
                pool.shutdown(cancel_futures=True)
                for future, number in left.items():
                    if not future.cancelled() and future.exception() is None:
                        collect(number, future.result())
                raise
