"""The one door to the compiled core: its procedures, with status integers turned into exceptions."""

from . import _core

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
