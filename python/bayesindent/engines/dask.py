"""Workers of a Dask cluster: processes of this machine, those of a scheduler at an address, or jobs
of SLURM.
"""

import pickle
from collections.abc import Callable, Sequence
from contextlib import AbstractContextManager
from functools import lru_cache, partial
from typing import Any

from ..core import InputError, MachineError
from .local import complete

#: How long a scheduler may take to answer, s.
PATIENCE_S = 10


class DaskEngine(AbstractContextManager):
    """`workers` processes with one thread each (0: one for each core, or one job of SLURM), or all
    workers of a scheduler.

    `scheduler` is 'local', 'slurm' (as configured in Dask's `jobqueue.yaml`) or an address such as
    'tcp://head:8786'. Raises `InputError` if the packages are missing and `MachineError` if no
    scheduler answers. If a worker dies, another one repeats its simulation.
    """

    def __init__(self, workers: int = 0, scheduler: str = "local"):
        try:
            self._client, self._cluster = _connect(workers, scheduler)
        except ModuleNotFoundError as error:
            raise InputError(
                f"'dask' needs the package {error.name}: pip install 'bayesindent[dask]'",
                group="execution",
                variable="engine",
            ) from None
        except (OSError, TimeoutError) as error:
            raise MachineError(
                f"no scheduler answers at {scheduler}: {error}",
                group="execution",
                variable="scheduler",
            ) from None

    def __exit__(self, *_: object) -> None:
        self._client.close()
        if self._cluster is not None:
            self._cluster.close()

    @property
    def workers(self) -> int:
        """The number of threads of all present workers, at least one."""
        return max(1, sum(self._client.nthreads().values()))

    def map(self, job: Callable, items: Sequence, collect: Callable[[int, object], None]) -> None:
        """Call job(item) for all items, see `complete`. Each worker unpickles the job only
        once.
        """
        import cloudpickle
        from distributed.scheduler import KilledWorker

        submit = partial(self._client.get_executor(pure=False).submit, _run, cloudpickle.dumps(job))
        try:
            complete(submit, lambda: self.workers, items, collect)
        except KilledWorker as error:
            raise MachineError(
                f"workers died again and again at the same simulation: {error}",
                group="execution",
                variable="engine",
            ) from None


#: Unpickle a job; the last one is retained.
_job = lru_cache(maxsize=1)(pickle.loads)


def _run(pickled: bytes, item: object) -> object:
    return _job(pickled)(item)


def _connect(workers: int, scheduler: str) -> tuple:
    """A client, and its own cluster or None."""
    from distributed import Client, LocalCluster

    cluster: Any
    if scheduler == "local":
        cluster = LocalCluster(
            n_workers=workers or None, threads_per_worker=1, dashboard_address=None, silence_logs=50
        )
    elif scheduler == "slurm":
        from dask_jobqueue import SLURMCluster

        cluster = SLURMCluster()
        cluster.scale(workers or 1)
    else:
        return Client(scheduler, timeout=PATIENCE_S, set_as_default=False), None
    return Client(cluster, set_as_default=False), cluster
