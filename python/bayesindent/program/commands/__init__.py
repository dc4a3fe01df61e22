"""The commands, in the order of the help."""

from . import compare, completion, init, orientation_map, report, source_tree, stages, tables

__all__ = ["COMMANDS"]

COMMANDS = (
    init.COMMAND,
    tables.TABLE,
    orientation_map.COMMAND,
    stages.RUN,
    *stages.COMMANDS,
    tables.PREDICT,
    report.COMMAND,
    compare.COMMAND,
    completion.COMMAND,
    *source_tree.COMMANDS,
)
