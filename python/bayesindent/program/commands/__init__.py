"""The commands, in the order of the help. The module of a command is imported when it is asked for: numpy and the core take a tenth of a second."""

from importlib import import_module
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from ..command import Command

__all__ = ["SUMMARIES", "command_of"]

#: The module of each command, whose `COMMANDS` has it, and one line on it.
SUMMARIES = {
    "init": ("init", "a namelist to begin with, every variable explained, and a table to fill in"),
    "table": ("tables", "what is read of a table of measurements"),
    "map": ("orientation_map", "a picture of the orientation map with its indents"),
    "run": ("stages", "all that the groups of a namelist ask for, in order, resuming what is done"),
    "simulate": ("stages", "finite element indentation of the crystals in a namelist"),
    "theory": ("stages", "exact half-space theory of the same crystals"),
    "size": ("stages", "how thick a film, or how large a grain, must be"),
    "build": ("stages", "step 1: a surrogate, trained on simulations that are chosen one by one"),
    "plan": ("stages", "the sd that each constant is expected to have, before anything is measured"),
    "curves": ("stages", "step 0: moduli of grains from measured curves"),
    "extract": ("stages", "step 2: the constants behind measured moduli"),
    "next": ("stages", "the grain orientations worth measuring next"),
    "predict": ("tables", "mean and sd of the modulus for each row of a table"),
    "report": ("report", "report.html from what a folder holds"),
    "compare": ("compare", "posteriors of several runs side by side"),
    "completion": ("completion", "a script that completes commands and options in bash or zsh"),
    "bench": ("source_tree", "benchmarks against peers, and studies of accuracy, from a source tree"),
    "test": ("source_tree", "build and run the tests of a source tree"),
    "lint": ("source_tree", "formatters, linters and type checker of a source tree"),
    "wheel": ("source_tree", "portable wheels of a source tree, and a trial on a bare system"),
    "docs": ("source_tree", "the documentation of a source tree as a site"),
    "lines": ("source_tree", "code lines of a source tree by folder, and its largest parts"),
}


def command_of(name: str) -> "Command":
    """The command of a name."""
    module = import_module(f".{SUMMARIES[name][0]}", __name__)
    return next(command for command in module.COMMANDS if command.name == name)
