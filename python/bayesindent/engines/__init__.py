"""Engines, on which simulations run: each maps a job over items and passes every result on as soon
as it is complete.
"""

from collections.abc import Callable
from contextlib import AbstractContextManager, nullcontext
from typing import Any

from .dask import DaskEngine
from .local import LocalEngine

#: Functions that make the engine of a name in &execution from its workers and scheduler and what a
#: job takes, for a `with` statement.
ENGINES: dict[str, Callable[..., AbstractContextManager]] = {
    "local": lambda workers, *_, **__: nullcontext(LocalEngine(workers)),
    "dask": DaskEngine,
}


def engine_of(execution: Any) -> AbstractContextManager:
    """The engine of the settings of &execution."""
    stated = {"cores": execution.cores, "memory": execution.memory, "walltime": execution.walltime}
    job = {name: value for name, value in stated.items() if value}
    return ENGINES[execution.engine](execution.workers, execution.scheduler, **job)
