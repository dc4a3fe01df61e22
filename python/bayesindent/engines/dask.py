"""Workers of a Dask cluster: processes of this machine, those of a scheduler at an address, or jobs
of SLURM.
"""

import pickle
import subprocess
from collections.abc import Callable, Sequence
from contextlib import AbstractContextManager
from functools import lru_cache, partial
from typing import Any

from ..common.packages import installation
from ..core import InputError, MachineError
from .local import complete

#: How long a scheduler may take to answer, s.
PATIENCE_S = 10


class DaskEngine(AbstractContextManager):
    """`workers` processes with one thread each (0: one for each core, or one job of SLURM), or all
    workers of a scheduler.

    `scheduler` is 'local', 'slurm' (as configured in Dask's `jobqueue.yaml`), an address such as
    'tcp://head:8786', or 'address': that of Dask's configuration. `job` is what a job of SLURM
    takes beside its `jobqueue.yaml`. Raises `InputError` if packages, address or memory are missing
    and `MachineError` if no scheduler answers or it has no worker. If a worker dies, another one
    repeats its simulation.
    """

    def __init__(self, workers: int = 0, scheduler: str = "local", **job: Any):
        try:
            self._client, self._cluster = _connect(workers, scheduler, job)
        except ModuleNotFoundError as error:
            raise InputError(
                f"'dask' needs the package {error.name}: {installation(str(error.name))}",
                group="execution",
                variable="engine",
            ) from None
        except (OSError, TimeoutError) as error:
            raise MachineError(
                f"no scheduler with workers answers at {scheduler}: {error}",
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


def _connect(workers: int, scheduler: str, job: dict) -> tuple:
    """A client, and its own cluster or None."""
    import dask
    from distributed import Client, LocalCluster

    # Other users of the machine reach the ports of a cluster, but do not have its certificate.
    own: dict[str, Any] = {"protocol": "tls://", "security": True}
    cluster: Any
    if scheduler == "local":
        cluster = LocalCluster(
            n_workers=workers or None,
            threads_per_worker=1,
            dashboard_address=None,
            silence_logs=50,
            **own,
        )
    elif scheduler == "slurm":
        from dask_jobqueue import SLURMCluster

        try:
            cluster = SLURMCluster(**job, **own)
        except ValueError:
            raise InputError(
                "'slurm' needs the cores and the memory of a job, such as cores = 8, memory = "
                "'16GB', here or in Dask's jobqueue.yaml",
                group="execution",
                variable="scheduler",
            ) from None
        # A job that SLURM refuses would be submitted again and again.
        tried = subprocess.run(
            ["sbatch", "--test-only"], input=cluster.job_script(), text=True, capture_output=True
        )
        if tried.returncode:
            raise InputError(
                f"SLURM refuses the job: {' '.join(tried.stderr.split())}",
                group="execution",
                variable="scheduler",
            )
        cluster.scale(workers or 1)
    else:
        if scheduler == "address" and not (scheduler := dask.config.get("scheduler-address", "")):
            raise InputError(
                "'address' needs the option --scheduler ADDRESS, or scheduler-address in Dask's "
                "configuration",
                group="execution",
                variable="scheduler",
            )
        client = Client(scheduler, timeout=PATIENCE_S, set_as_default=False)
        client.wait_for_workers(1, timeout=PATIENCE_S)
        return client, None
    return Client(cluster, set_as_default=False), cluster
