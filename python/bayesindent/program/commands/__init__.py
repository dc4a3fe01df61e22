"""The commands, in the order of the help."""

from . import compare, completion, init, predict, report, run, source_tree, stages, table

__all__ = ["COMMANDS"]

COMMANDS = (
    init.COMMAND,
    table.COMMAND,
    run.COMMAND,
    *stages.COMMANDS,
    predict.COMMAND,
    report.COMMAND,
    compare.COMMAND,
    completion.COMMAND,
    *source_tree.COMMANDS,
)
