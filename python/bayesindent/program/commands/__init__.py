"""The commands, in the order of the help and of `run`."""

from . import build, compare, extract, init, next_grain, predict, report, run, simulate, size, source_tree, theory

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
    compare.COMMAND,
    *source_tree.COMMANDS,
)
