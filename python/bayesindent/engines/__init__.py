"""Engines, on which simulations run: each maps a job over items and passes every result on as soon
as it is complete.
"""

from collections.abc import Callable
from contextlib import AbstractContextManager, nullcontext

from .dask import DaskEngine
from .local import LocalEngine

#: Functions that make the engine of a name in &execution from its workers and scheduler, for a
#: `with` statement.
ENGINES: dict[str, Callable[[int, str], AbstractContextManager]] = {
    "local": lambda workers, scheduler: nullcontext(LocalEngine(workers)),
    "dask": DaskEngine,
}
