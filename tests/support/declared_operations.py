"""A core that compares the values of each call with the declared ones of its operation."""

import ctypes
from types import SimpleNamespace

import numpy as np

from support.tree import SOURCE
from tools.operations import Operation, operations

#: Of the tests' own operations.
ANY = Operation(("..",), ("..",), "")


def checked(core):
    """The compiled core of the module `core`, whose calls are checked."""
    native, declared = core.native, operations(SOURCE)

    def check(do):
        def checked_do(name, handle, request):
            reply, address, words, status = do(name, handle, request)
            operation = declared.get(name.decode(), ANY)
            result = np.array((ctypes.c_uint8 * (8 * words)).from_address(address))
            # An empty request is eight zeros.
            if request.any():
                within(name, core.decode(request.view(np.uint8)), operation.given)
            if not status:
                within(name, core.decode(result), operation.result)
            return reply, address, words, status

        return checked_do

    return SimpleNamespace(
        __file__=native.__file__,
        core_do=check(native.core_do),
        core_do_long=check(native.core_do_long),
        core_release=native.core_release,
    )


def within(operation: bytes, values: dict, names: tuple[str, ...]) -> None:
    """Fail if a value has a name that is not declared. An empty request or result has none."""
    others = {name for name in values if name} - set(names)
    assert ".." in names or not others, f"{operation.decode()} has no value {others}"
