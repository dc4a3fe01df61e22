"""Progress on standard error: bars on a terminal, sparse lines elsewhere, nothing at all where it is not wanted."""

import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from functools import partial

__all__ = ["Progress"]

#: Seconds between two lines of one bar where standard error is no terminal.
LINE_INTERVAL_S = 10.0


class Progress:
    """What a stage tells while it works. `Progress()`, the default of the library, is silent."""

    def __init__(self, enabled: bool = False):
        self.enabled = enabled

    @contextmanager
    def bar(self, text: str, total: int) -> Iterator[Callable[[int], None]]:
        """Yield `advance(n)`, which counts towards `total`; it may be called from any thread."""
        if not self.enabled or total <= 0:
            yield ignore
        elif sys.stderr.isatty():
            # Not above: most commands show no bar, and importing it is slow.
            from rich import progress
            from rich.console import Console

            columns = progress.BarColumn(), progress.MofNCompleteColumn(), progress.TimeElapsedColumn(), progress.TimeRemainingColumn()
            with progress.Progress(progress.TextColumn("{task.description}"), *columns, console=Console(stderr=True)) as bars:
                task = bars.add_task(text, total=total)
                yield partial(bars.advance, task)
        else:
            lines = Lines(text, total)
            yield lines.advance
            lines.finish()


def ignore(steps: int = 1) -> None:
    """Show nothing."""


class Lines:
    """The bar of a log file: a line now and then."""

    def __init__(self, text: str, total: int):
        self.text, self.total, self.done = text, total, 0
        self.start = self.last = time.monotonic()
        self.printed = -1

    def advance(self, steps: int = 1) -> None:
        self.done += steps
        if time.monotonic() - self.last >= LINE_INTERVAL_S:
            self.last = time.monotonic()
            self.print()

    def finish(self) -> None:
        if self.printed != self.done:
            self.print()

    def print(self) -> None:
        self.printed = self.done
        seconds = time.monotonic() - self.start
        print(f"{self.text}: {self.done}/{self.total} in {seconds:.0f} s", file=sys.stderr, flush=True)
