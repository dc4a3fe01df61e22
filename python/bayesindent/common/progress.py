"""Progress on standard error, with an estimate of the time that is left; nothing where it is not wanted. The core counts and writes it."""

from collections.abc import Callable, Iterator
from contextlib import contextmanager

from ..core import call

__all__ = ["Progress"]


def advance(steps: int = 1) -> None:
    """So many more steps of the innermost loop are done."""
    call("file.advance_progress", steps=steps)


class Progress:
    """What a stage shows while it works. `Progress()`, the default of the library, is silent."""

    def __init__(self, enabled: bool = False):
        self.enabled = enabled
        call("file.show_progress", wanted=enabled)

    @contextmanager
    def bar(self, text: str, total: int) -> Iterator[Callable[..., object]]:
        """Yield `advance(n)`, which counts towards `total`."""
        call("file.begin_progress", name=text, steps=total)
        try:
            yield advance
        finally:
            call("file.end_progress")
