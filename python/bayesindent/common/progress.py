"""Progress on standard error with an estimate of the remaining time, if the user asks for it. The
core counts and writes it.
"""

from collections.abc import Callable, Iterator
from contextlib import contextmanager

from ..core import call


def show_progress(wanted: bool) -> None:
    """Switch the lines of progress on or off; they are off by default."""
    call("file.show_progress", wanted=wanted)


@contextmanager
def progress_bar(text: str, total: int) -> Iterator[Callable[..., object]]:
    """Yield `advance(n)`, which counts towards `total`."""
    call("file.begin_progress", name=text, steps=total)
    try:
        yield lambda steps=1: call("file.advance_progress", steps=steps)
    finally:
        call("file.end_progress")
