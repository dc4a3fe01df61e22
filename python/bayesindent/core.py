"""The one door to the compiled core: its procedures, with status integers turned into exceptions."""

import os
import platform
from pathlib import Path

# One thread in each call of BLAS: more would change the last bits of results with the number of cores. Threads are the core's own.
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")


def _choose_blas_kernels() -> None:
    """Name the vector kernels that OpenBLAS shall use, before it is loaded.

    OpenBLAS picks its kernels from a list of the processors it knows and runs an unknown, younger one with the kernels of
    2004, five times slower. What counts is the instruction set, which the processor states itself. A user's own choice stands.
    """
    if platform.machine() != "x86_64" or "OPENBLAS_CORETYPE" in os.environ:
        return
    try:
        lines = Path("/proc/cpuinfo").read_text().splitlines()
    except OSError:
        return
    flags = set(next((line for line in lines if line.startswith("flags")), "").split())
    if {"avx512f", "avx512dq", "avx512bw", "avx512vl"} <= flags:
        os.environ["OPENBLAS_CORETYPE"] = "SKYLAKEX"
    elif {"avx2", "fma"} <= flags:
        os.environ["OPENBLAS_CORETYPE"] = "HASWELL"


_choose_blas_kernels()

from . import _core  # noqa: E402

__all__ = ["BayesindentError", "InputError", "check", "native"]

#: The f2py module itself.
native = _core


class BayesindentError(RuntimeError):
    """A computation could not be done; the message says why."""


class InputError(BayesindentError, ValueError):
    """The input cannot be meant; the message says what, the value, and what is allowed."""


def check(status: int, message: bytes | str) -> None:
    """Raise the exception that a status and a message of the core stand for; return on status 0."""
    if status == 0:
        return
    text = message.decode() if isinstance(message, bytes) else str(message)
    raise (InputError if status == 2 else BayesindentError)(text.strip())
