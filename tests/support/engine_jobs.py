"""A job for engines whose results end in another order than the items."""

import time

import bayesindent as bi

__all__ = ["job"]


def job(item: int) -> tuple[int, float, float]:
    """The square of an item, and when it began and ended, s. Items end late if they are even. A
    negative item fails.
    """
    begin = time.time()
    time.sleep(0.03 if item % 2 else 0.12)
    if item < 0:
        raise bi.InputError("less than nothing")
    return item**2, begin, time.time()
