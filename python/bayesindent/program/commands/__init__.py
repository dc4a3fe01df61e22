"""The commands, in the order of the help and of `run`."""

from . import build, extract, init, next_grain, predict, report, run, simulate, size, source_tree, theory

__all__ = ["COMMANDS"]

COMMANDS = (
    init.COMMAND,
    run.COMMAND,
    simulate.COMMAND,
    theory.COMMAND,
    size.COMMAND,
    build.COMMAND,
    extract.COMMAND,
    next_grain.COMMAND,
    predict.COMMAND,
    report.COMMAND,
    *source_tree.COMMANDS,
)
