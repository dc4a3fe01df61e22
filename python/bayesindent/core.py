"""Call operations of the compiled core on named values; their errors become exceptions."""

import ctypes
import os
import struct
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from importlib import import_module
from importlib.util import find_spec
from pathlib import Path
from typing import Any, ClassVar

# One thread in each call of BLAS: more would change the last bits of results with the number of
# cores. Threads are the core's own.
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")


def _choose_kernels() -> str:
    """Choose the vector kernels of OpenBLAS before it is loaded, and return the name of the core's
    module that is compiled for the same instructions.

    The batch program does the same (cpp/processor.cpp). A choice of the user takes precedence.
    """
    found = find_spec("._processor", __package__)
    processor = ctypes.CDLL(found.origin if found else None)
    processor.bayesindent_blas_kernels.restype = ctypes.c_char_p
    kernels = processor.bayesindent_blas_kernels().decode()
    if kernels:
        os.environ.setdefault("OPENBLAS_CORETYPE", kernels)
    wide = processor.bayesindent_is_wide(os.environ.get("OPENBLAS_CORETYPE", "").encode())
    return (
        ".x86_64_v3._core" if wide and Path(__file__).with_name("x86_64_v3").is_dir() else "._core"
    )


_MODULE = _choose_kernels()

import numpy as np  # noqa: E402

#: The compiled core: it performs an operation on named values and returns its results, as bytes.
native = import_module(_MODULE, __package__)


@dataclass(eq=False)
class BayesindentError(RuntimeError):
    """A computation could not be done; the `message` says why.

    `file` is the file of a wrong input, or the function of this package that it was given to;
    `group` and `variable` are those of namelists; '' for what is not known. `code` is the kind of
    the error: 'failure', 'bad_input' or 'machine'.

    Examples
    --------
    >>> try:
    ...     bi.stiffness("cubic", 168.4, 121.4)
    ... except bi.BayesindentError as error:
    ...     print(error.code, error.message)
    bad_input a cubic crystal takes the constants C11, C12, C44, not 2 values
    """

    message: str = ""
    file: str = ""
    group: str = ""
    variable: str = ""
    #: The keyword of a function that replaces group and variable in the text; '' for none.
    keyword: str = ""
    code: ClassVar[str] = "failure"

    def __str__(self) -> str:
        name = self.keyword or (self.group and f"&{self.group} {self.variable}".strip())
        return ": ".join(filter(None, [self.file, name, self.message]))


class InputError(BayesindentError, ValueError):
    """The input is wrong; the message has the value, and the allowed values.

    Examples
    --------
    >>> bi.stiffness("cubic", 168.4, 121.4)
    Traceback (most recent call last):
    bayesindent.core.InputError: a cubic crystal takes the constants C11, C12, C44, not 2 values
    """

    code = "bad_input"


class MachineError(BayesindentError):
    """The machine lacks memory or disk space. The input may be right, and a second attempt may
    succeed.

    Examples
    --------
    >>> issubclass(bi.MachineError, bi.BayesindentError)
    True
    """

    code = "machine"


@contextmanager
def located(file: object, group: str = "", variable: str = "") -> Iterator[None]:
    """Say where an input is that is refused; see `locate_error` of fortran/common/errors.f90."""
    try:
        yield
    except InputError as error:
        if error.file and not error.group:
            error.message, error.file = str(error), ""
        if not error.file:
            error.file, error.group = str(file), error.group or group
            error.variable = error.variable or variable
        raise


class BayesindentWarning(UserWarning):
    """A caution that the user should read before using a result. `diagnostic` has its code,
    subject and numbers, see docs/diagnostics.md.

    Examples
    --------
    >>> import warnings
    >>> with warnings.catch_warnings(record=True) as caught:
    ...     warnings.simplefilter("always")
    ...     result = bi.extract("grains.csv", "cubic", technique="exact", samples=300)
    >>> "not_determined" in [each.message.diagnostic["code"] for each in caught]
    True
    """

    diagnostic: Mapping = {}


#: Kind, rank, length of the name, bytes of the value, shape; see fortran/common/named_values.f90.
HEADER = struct.Struct("<cBxxiq4q")


def encode(values: Mapping) -> bytes:
    """Encode named values for the core: texts and paths, logicals, integers, reals, and arrays of
    reals. Values that are None are left out.
    """
    pieces = []
    for name, value in values.items():
        shape: tuple[int, ...] = ()
        if value is None:
            continue
        if isinstance(value, str | os.PathLike):
            # File names that are not UTF-8 keep their bytes.
            kind, content = b"t", os.fspath(value).encode("utf-8", "surrogateescape")
        elif isinstance(value, bool | np.bool_ | int | np.integer):
            kind, content = b"i", int(value).to_bytes(8, "little", signed=True)
        else:
            array = np.asarray(value, dtype=float)
            # Fortran has the axes in reverse order.
            kind, content, shape = b"r", array.tobytes(), array.shape[::-1]
        label = name.encode()
        header = HEADER.pack(
            kind, len(shape), len(label), len(content), *shape, *[0] * (4 - len(shape))
        )
        pieces += [header, label, bytes(-len(label) % 8), content, bytes(-len(content) % 8)]
    return b"".join(pieces)


def decode(content: np.ndarray) -> dict:
    """Named values of the core; arrays are views of `content`, bytes, with the axes reversed."""
    found: dict = {}
    at = 0
    while at < len(content):
        kind, rank, length, size, *shape = HEADER.unpack_from(content.data, at)
        start = at + HEADER.size + length + -length % 8
        name = content[at + HEADER.size : at + HEADER.size + length].tobytes().decode()
        value, axes = content[start : start + size], shape[:rank][::-1]
        at = start + size + -size % 8
        if kind in b"tl":
            text = value.tobytes().decode("utf-8", "surrogateescape")
            found[name] = text if kind == b"t" else text.split("\0")[:-1]
        else:
            array = value.view(float if kind == b"r" else np.int64).reshape(axes)
            found[name] = array if rank else bool(array) if kind == b"b" else array.item()
    return found


#: Operations that give up Python's lock; see fortran/facade/core.f90 for why not all do.
LONG = {
    "crystal.theory",
    "crystal.waves",
    "indentation.run",
    "indentation.fields",
    "simulator.run",
    "surrogate.predict",
    "basis.fit",
}


def cores() -> int:
    """The number of cores that this process may use, or of all where the system does not say."""
    if hasattr(os, "sched_getaffinity"):
        return len(os.sched_getaffinity(0))
    return os.cpu_count() or 1


def call(operation: str, handle: int = 0, /, **values: Any) -> dict:
    """Perform an operation of the core, 'KIND.VERB', and return its named results. `handle` is that
    of the object it works on. Errors become exceptions.
    """
    do = native.core_do_long if operation in LONG else native.core_do
    reply, address, words, status = do(
        operation.encode(), handle, np.frombuffer(encode(values) or bytes(8), dtype=np.int64)
    )
    found = decode(np.array((ctypes.c_uint8 * (8 * words)).from_address(address)))
    native.core_release(reply)
    if status:
        raise {2: InputError, 3: MachineError}.get(status, BayesindentError)(**found)
    return found


class NativeObject:
    """An object of the core under a handle, which is freed with the last reference to this object.

    A subclass sets the handle with `_hold` in its constructor. The object is frozen from then on,
    or once `_frozen` is set. Copies and pickles carry no handle: `__reduce__` of a subclass makes
    the object anew, and without it they are refused.
    """

    #: The core's name of the type: 'surrogate', 'posterior', ..
    kind = ""
    _handle: int
    _frozen = False

    def _hold(self, handle: int, *, frozen: bool = True) -> None:
        self._handle, self._frozen = handle, frozen

    @property
    def handle(self) -> int:
        """The number under which the core holds the object."""
        return self.__dict__.get("_handle", 0)

    def _call(self, verb: str, /, **values: Any) -> dict:
        """Perform an operation on the object and return its named results."""
        return call(f"{self.kind}.{verb}", self._handle, **values)

    def __setattr__(self, name: str, value: Any) -> None:
        if self._frozen:
            raise AttributeError(
                f"{type(self).__name__} is frozen: make a new one with another '{name}'"
            )
        object.__setattr__(self, name, value)

    def __delattr__(self, name: str) -> None:
        raise AttributeError(f"{type(self).__name__} is frozen: '{name}' stays")

    def __del__(self) -> None:
        handle = self.__dict__.pop("_handle", 0)
        if handle:
            native.core_release(handle)

    def __reduce__(self) -> tuple:
        raise TypeError(
            f"a {type(self).__name__} lives in this process alone: it cannot be copied or "
            "pickled; make a new one"
        )
