"""Where simulations run: each engine maps a job over items and hands every result back as soon as it is there."""

from .local import LocalEngine

__all__ = ["ENGINES", "LocalEngine"]

#: Engine by the word of &execution.
ENGINES = {"local": LocalEngine}
