"""The one door to the compiled core: its procedures, with status integers turned into exceptions."""

import ctypes
import json
import os
import warnings
from collections.abc import Callable
from importlib import import_module
from importlib.util import find_spec
from pathlib import Path

# One thread in each call of BLAS: more would change the last bits of results with the number of cores. Threads are the core's own.
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")


def _choose_kernels() -> str:
    """Name the vector kernels that OpenBLAS shall use, before it is loaded; the module of the core that uses like instructions.

    What the batch program does, too (cpp/processor.cpp). A user's own choice stands.
    """
    found = find_spec("._processor", __package__)
    processor = ctypes.CDLL(found.origin if found else None)
    processor.bayesindent_blas_kernels.restype = ctypes.c_char_p
    kernels = processor.bayesindent_blas_kernels().decode()
    if kernels:
        os.environ.setdefault("OPENBLAS_CORETYPE", kernels)
    wide = processor.bayesindent_is_wide(os.environ.get("OPENBLAS_CORETYPE", "").encode())
    return ".x86_64_v3._core" if wide and Path(__file__).with_name("x86_64_v3").is_dir() else "._core"


_MODULE = _choose_kernels()

import numpy as np  # noqa: E402

__all__ = [
    "BayesindentError",
    "BayesindentWarning",
    "InputError",
    "MachineError",
    "NativeObject",
    "call",
    "check",
    "document",
    "native",
    "warn_of",
]


class Core:
    """The f2py module, with texts and paths in UTF-8 both ways: by itself f2py takes ASCII alone, and gives bytes.

    A name of a file that is not UTF-8 comes back as Python itself has it (surrogateescape).
    """

    def __init__(self, module):
        self._module = module

    def __getattr__(self, name: str):
        found = getattr(self._module, name)
        if not callable(found):
            return found
        procedure = _with_texts(found)
        setattr(self, name, procedure)
        return procedure


def _with_texts(procedure: Callable) -> Callable:
    """The same procedure, which takes and gives texts."""

    def called(*arguments):
        found = procedure(*map(_as_bytes, arguments))
        return tuple(map(_as_text, found)) if isinstance(found, tuple) else _as_text(found)

    called.__doc__ = procedure.__doc__
    return called


def _as_bytes(value):
    """A text or a path as the core has it."""
    if isinstance(value, os.PathLike):
        value = os.fspath(value)
    return value.encode("utf-8", "surrogateescape") if isinstance(value, str) else value


def _as_text(value):
    """Bytes of the core, padded with blanks, or an array of characters, as a text."""
    if isinstance(value, np.ndarray) and value.dtype.kind == "S":
        return value.tobytes().decode("utf-8", "surrogateescape")
    return value.rstrip().decode("utf-8", "surrogateescape") if isinstance(value, bytes) else value


#: The compiled core.
native = Core(import_module(_MODULE, __package__))


class BayesindentError(RuntimeError):
    """A computation could not be done; the message says why."""


class InputError(BayesindentError, ValueError):
    """The input cannot be meant; the message says what, the value, and what is allowed."""


class MachineError(BayesindentError):
    """The machine could not do it (memory, disk): no result about the input; it may work next time."""


class BayesindentWarning(UserWarning):
    """What is to be known of a result before it is used."""


def warn_of(document: dict) -> None:
    """The warnings of a document, as Python's; they name the line that called the library's function."""
    for line in document.get("warnings", []):
        warnings.warn(line, BayesindentWarning, stacklevel=3)


def check(status: int, message: str) -> None:
    """Raise the exception that a status and a message of the core stand for; return on status 0."""
    if status:
        raise {2: InputError, 3: MachineError}.get(status, BayesindentError)(message)


def call(procedure: str, *arguments):
    """What a procedure of the core gives back, without its status and message, which become an exception."""
    *results, status, message = getattr(native, procedure)(*arguments)
    check(status, message)
    return results[0] if len(results) == 1 else results


def document(handle: int, kind: str) -> dict:
    """Numbers and texts of an object of the core, arrays by their lengths; or, without a handle, what 'settings' there are."""
    room = 1 << 16
    text, length = call("object_document", handle, kind, room)
    if length > room:
        text, _ = call("object_document", handle, kind, length)
    return json.loads(text)


class NativeObject:
    """What the core holds for Python: one handle, freed with the last reference to this object.

    A subclass sets the handle with `_hold` in its constructor; from then on it is frozen, or once `_frozen` is set. Copies and pickles carry
    no handle: `__reduce__` of a subclass says how the object is made anew, and without one they are refused.
    """

    #: What the core calls it: 'surrogate', 'posterior', ..
    kind = ""
    _handle: int
    _frozen = False

    def _hold(self, handle: int, *, frozen: bool = True) -> None:
        self._handle, self._frozen = int(handle), frozen

    @property
    def handle(self) -> int:
        """The number that the core knows the object by."""
        return self.__dict__.get("_handle", 0)

    def __setattr__(self, name: str, value) -> None:
        if self._frozen:
            raise AttributeError(f"{type(self).__name__} is frozen: make a new one with another '{name}'")
        object.__setattr__(self, name, value)

    def __delattr__(self, name: str):
        raise AttributeError(f"{type(self).__name__} is frozen: '{name}' stays")

    def __del__(self):
        handle = self.__dict__.pop("_handle", 0)
        if handle:
            native.object_release(handle)

    def _document(self) -> dict:
        """Numbers and texts of the core's object; arrays by their lengths."""
        return document(self._handle, self.kind)

    def _array(self, label: str, length: int) -> np.ndarray:
        """An array (length,) of the core's object, which cannot be written to."""
        values = call("object_values", self._handle, self.kind, label, length)
        values.flags.writeable = False
        return values

    def __reduce__(self):
        raise TypeError(f"a {type(self).__name__} lives in this process alone: it cannot be copied or pickled; make a new one")
