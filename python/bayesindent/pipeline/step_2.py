"""Step 2 of a problem: its posterior, kept in the output folder, and what to measure next."""

import json
from collections.abc import Iterator
from contextlib import contextmanager, nullcontext
from pathlib import Path

import numpy as np

from ..common.progress import Progress
from ..common.result_files import read_variables, write_groups
from ..core import call, native
from ..inference.extract import groups_of
from ..inference.posterior import EXTRACTION, Posterior
from ..settings.problem import stages
from ..surrogate.surrogate import surrogate_of
from .inputs_identity import inputs_of

__all__ = ["check_stage", "extract_stage", "next_stage", "stored_draws"]


def check_stage(problem, output: Path) -> None:
    """Refuse what `extract_stage` would refuse before it samples."""
    Posterior(problem, surrogate_of(problem, output))


def extract_stage(problem, output: Path, progress: Progress | None = None) -> dict:
    """Step 2 of a problem: posterior.nc, and the document of `extract`."""
    surrogate = surrogate_of(problem, output)
    with keeping_chains(problem, output):
        with (progress or Progress()).bar("sampling", 1) as advance:
            found = Posterior(problem, surrogate, EXTRACTION)
            advance(1)
        groups = groups_of(found)
        groups["posterior"][1]["inputs"] = json.dumps(step_2_inputs(problem, output))
        write_groups(output / "posterior.nc", groups)
    return found.document("extract")


@contextmanager
def keeping_chains(problem, output: Path) -> Iterator[None]:
    """Chains that are finished within stay in the folder until the end, or for the next time if there is none."""
    call("command_keep_chains", problem.handle, output)
    yield
    native.command_forget_chains(output)


def stored_draws(problem, output: Path, posterior: Posterior) -> np.ndarray | None:
    """The draws (n, dimension) that `extract` left in the output folder, if they were made from the present inputs; else None."""
    try:
        variables, facts = read_variables(output / "posterior.nc")["posterior"]
        if facts["inputs"] != json.dumps(step_2_inputs(problem, output)):
            return None
        return np.stack([variables[name].ravel() for name in (*posterior.names, "sd_factor")[: posterior.dimension]], axis=1)
    except (OSError, ValueError, KeyError):
        return None


def step_2_inputs(problem, output: Path) -> dict[str, str]:
    """Digests of what a posterior follows from: groups, tables and the surrogate."""
    groups = next(stage.groups for stage in stages() if stage.name == "extract")
    return inputs_of(problem, groups, output)


def next_stage(problem, output: Path, progress: Progress | None = None) -> dict:
    """The grains worth measuring next of a problem, after its posterior, which is sampled unless `extract` left it in the folder."""
    posterior = Posterior(problem, surrogate_of(problem, output))
    draws = stored_draws(problem, output, posterior)
    keeping = keeping_chains(problem, output) if draws is None else nullcontext()
    with (progress or Progress()).bar("next grain", 1) as advance, keeping:
        if draws is None:
            posterior = Posterior(problem, posterior.surrogate, EXTRACTION)
            draws = posterior.values("found_draws").reshape(posterior.dimension, -1, order="F").T
        document = posterior.suggest(problem, draws)
        advance(1)
    return document
