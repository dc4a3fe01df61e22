"""A second core with the operations that tests alone need (tests/fortran/test_operations.f90), and
objects in it.

It is a core of its own, with its own handles. `inside` lets Python's objects be made in it; `Held`
are those that stay there.
"""

import ctypes
import gc
import subprocess
import sys
from contextlib import contextmanager
from pathlib import Path

import numpy as np

from bayesindent import core
from support import tree

__all__ = ["Held", "inside"]

#: An installed package is tested with the operations of the build in the source tree.
FOLDER = tree.BUILD or tree.SOURCE / "build"


class _Core:
    """The interface of the compiled core, offered by the library of the tests."""

    def __init__(self):
        library = FOLDER / "tests" / "fortran" / "test_operations.so"
        if not library.exists():
            # Set-up does not build what only tests need.
            subprocess.run(
                [Path(sys.executable).with_name("ninja"), "-C", FOLDER, "meson-test-prereq"],
                check=True,
                stdout=subprocess.DEVNULL,
            )
        # Python's lock is kept: gfortran's texts are not safe on two threads.
        self.library = ctypes.PyDLL(library)

    def core_do(
        self, operation: bytes, handle: int, request: np.ndarray
    ) -> tuple[int, int, int, int]:
        """See fortran/facade/core.f90."""
        reply, address, words, status = (
            ctypes.c_int64(),
            ctypes.c_int64(),
            ctypes.c_int64(),
            ctypes.c_int(),
        )
        given = [ctypes.c_int64(number) for number in (len(operation), handle, len(request))]
        self.library.bayesindent_test_do(
            operation,
            *given,
            request.ctypes.data_as(ctypes.c_void_p),
            *map(ctypes.byref, (reply, address, words, status)),
        )
        return reply.value, address.value, words.value, status.value

    core_do_long = core_do

    def core_release(self, handle: int) -> None:
        """Free an object."""
        self.library.bayesindent_test_release(ctypes.c_int64(handle))


_cores: list[_Core] = []


@contextmanager
def inside():
    """Use the core of the tests within this context. All objects made in it must be freed in it,
    except those that are `Held`.
    """
    if not _cores:
        _cores.append(_Core())
    # An object of the other core must not be freed within the context.
    collects, before = gc.isenabled(), core.native
    gc.disable()
    core.native = _cores[0]
    try:
        yield
    finally:
        core.native = before
        if collects:
            gc.enable()


class Held(core.NativeObject):
    """An object of the core of the tests."""

    def _call(self, verb: str, /, **values) -> dict:
        with inside():
            return super()._call(verb, **values)

    def __del__(self):
        with inside():
            super().__del__()
