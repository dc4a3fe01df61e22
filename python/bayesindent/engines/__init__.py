"""Where simulations run: each engine maps a job over items and hands every result back as soon as
it is there.
"""

from collections.abc import Callable
from contextlib import AbstractContextManager, nullcontext

from .dask import DaskEngine
from .local import LocalEngine

#: By the word of &execution: from its workers and scheduler the engine, for a `with` statement.
ENGINES: dict[str, Callable[[int, str], AbstractContextManager]] = {
    "local": lambda workers, scheduler: nullcontext(LocalEngine(workers)),
    "dask": DaskEngine,
}
