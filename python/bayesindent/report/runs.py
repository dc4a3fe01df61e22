"""Folders with posteriors, to be compared."""

import warnings
from collections.abc import Sequence
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np

from ..core import InputError
from ..inference.extract import arviz_data
from .results import Results

__all__ = ["Run", "read_runs"]


class Run(Results):
    """The results of a folder that has a posterior of its present inputs, under a name that differs from those of the others."""

    def __init__(self, folder: Path, label: str):
        super().__init__(folder)
        self.label = label
        if "extract" in self.outdated:
            raise InputError(
                f"{folder}: the posterior there is of other inputs than were used last; run 'bayesindent extract' on its file again"
            )
        if not self.documents["extract"]:
            raise InputError(f"{folder}: there is no posterior in it; 'bayesindent extract FILE.nml --output {folder}' makes one")
        if not self.posterior:
            raise InputError(f"{folder}: has no posterior.bin that belongs to its summary.json; 'bayesindent extract' writes both")
        self.parameters = {name: self.documents["extract"]["parameters"][name] for name in self.constants}

    @cached_property
    def measured(self) -> tuple:
        """What the likelihood is a density of: kind, moduli, sds and angles."""
        conditions, observed = self.posterior["constant_data"][0], self.posterior["observed_data"][0]
        return self.kind, *(values.tolist() for values in (observed["modulus"], conditions["sd"], conditions["euler_deg"]))

    @cached_property
    def leave_one_out(self) -> Any:
        """ArviZ' estimate of how well each grain is predicted by the others."""
        # Not above: importing them takes seconds, and only the comparison of models needs them.
        import arviz
        import xarray

        likelihood = self.posterior["log_likelihood"][0]
        # The same draws of the constants, by whose effective size ArviZ judges the weights.
        draws = {name: (("chain", "draw"), chains[:, likelihood["draw"]]) for name, chains in self.samples.items()}
        density = {"modulus": (("chain", "draw", "grain"), likelihood["modulus"])}
        with warnings.catch_warnings():
            # `compare` has its own words for what it warns of.
            warnings.simplefilter("ignore")
            groups = {"posterior": xarray.Dataset(draws), "log_likelihood": xarray.Dataset(density)}
            return arviz.loo(arviz_data(groups), pointwise=True)

    @property
    def pointwise(self) -> np.ndarray:
        """Its value for each grain."""
        found = self.leave_one_out
        return np.asarray(found.loo_i if hasattr(found, "loo_i") else found.elpd_i)


def read_runs(folders: Sequence[Path]) -> list[Run]:
    """The runs of two or more folders, each under the shortest name that tells it from the others."""
    if len(folders) < 2:
        raise InputError("compare: two or more folders of results are needed")
    paths = [folder.resolve() for folder in folders]
    for i, folder in enumerate(folders):
        if not folder.is_dir():
            raise InputError(f"{folder}: there is no such folder of results")
        if paths[i] in paths[:i]:
            raise InputError(f"{folder}: is named twice")
    depth = 1
    while len({path.parts[-depth:] for path in paths}) < len(paths):
        depth += 1
    return [Run(folder, "/".join(path.parts[-depth:])) for folder, path in zip(folders, paths, strict=True)]
