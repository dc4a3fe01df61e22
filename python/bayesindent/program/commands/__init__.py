"""The commands, in the order of the help; those of stages are the core's, in the order of `run`, each with a module of its name."""

from importlib import import_module

from ...settings.problem import stages
from . import compare, completion, init, orientation_map, predict, report, run, source_tree, table

__all__ = ["COMMANDS"]

COMMANDS = (
    init.COMMAND,
    table.COMMAND,
    orientation_map.COMMAND,
    run.COMMAND,
    *(import_module(f".{row.name}", __package__).COMMAND for row in stages() if row.name != run.COMMAND.name),
    predict.COMMAND,
    report.COMMAND,
    compare.COMMAND,
    completion.COMMAND,
    *source_tree.COMMANDS,
)
