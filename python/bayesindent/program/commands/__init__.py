"""The commands, in the order of the help."""

from . import compare, completion, init, orientation_map, predict, report, source_tree, stages, table

__all__ = ["COMMANDS"]

COMMANDS = (
    init.COMMAND,
    table.COMMAND,
    orientation_map.COMMAND,
    stages.RUN,
    *stages.COMMANDS,
    predict.COMMAND,
    report.COMMAND,
    compare.COMMAND,
    completion.COMMAND,
    *source_tree.COMMANDS,
)
