"""Several posteriors side by side: their constants, and, of the same measurements, which model these speak for."""

import math
import os
import warnings
from collections.abc import Sequence
from functools import cached_property
from pathlib import Path

import numpy as np

from ..common.result_files import whole_file, write_csv, write_json
from ..core import InputError, warn_of
from ..inference.extract import arviz_data
from .results import Results
from .words import number

__all__ = ["Run", "compare", "compare_runs", "read_runs"]

#: Above this shape of the tail of its importance weights (Pareto's k) a grain's leave-one-out density is not to be relied on.
GREATEST_SHAPE = 0.7


def compare(*folders: str | os.PathLike, output: str | os.PathLike | None = None, figures: str = "png") -> dict:
    """Posteriors of two or more folders of results side by side, each compared with the first.

    `runs`: mean, sd and 95 % interval of each constant; `differences`: of each constant from the first run's, in GPa and in sds of the
    difference; `models`: leave-one-out and, where it was estimated, evidence of runs of the same measurements. With `output`, a folder,
    comparison.csv, comparison.json and the figures forest and overlay ('png', 'pdf' or 'svg') are written into it.
    """
    document = compare_runs(read_runs([Path(folder) for folder in folders]), Path(output) if output else None, figures)
    warn_of(document)
    return document


class Run:
    """What one folder says: the document of `extract`, and draws by constant."""

    def __init__(self, folder: Path, label: str):
        self.folder, self.label = folder, label
        results = Results(folder)
        self.document = results.documents["extract"]
        if "extract" in results.outdated:
            raise InputError(
                f"{folder}: the posterior there is of other inputs than were used last; run 'bayesindent extract' on its file again"
            )
        if not self.document:
            raise InputError(f"{folder}: there is no posterior in it; 'bayesindent extract FILE.nml --output {folder}' makes one")
        if not results.posterior:
            raise InputError(f"{folder}: has no posterior.bin that belongs to its summary.json; 'bayesindent extract' writes both")
        self.title, self.symmetry, self.synthetic, self.kind = results.title, results.symmetry, results.synthetic, results.kind
        self.samples = results.samples
        self.groups = {name: variables for name, (variables, _) in results.posterior.items()}
        self.parameters = {name: self.document["parameters"][name] for name in results.constants}

    @cached_property
    def measured(self) -> tuple:
        """What the likelihood is a density of: kind, moduli, sds and angles."""
        conditions = self.groups["constant_data"]
        return self.kind, *(
            values.tolist() for values in (self.groups["observed_data"]["modulus"], conditions["sd"], conditions["euler_deg"])
        )

    @cached_property
    def leave_one_out(self):
        """ArviZ' estimate of how well each grain is predicted by the others."""
        import arviz
        import xarray

        likelihood = self.groups["log_likelihood"]
        # The same draws of the constants, by whose effective size ArviZ judges the weights.
        draws = {name: (("chain", "draw"), chains[:, likelihood["draw"]]) for name, chains in self.samples.items()}
        density = {"modulus": (("chain", "draw", "grain"), likelihood["modulus"])}
        with warnings.catch_warnings():
            # What is to be said of it is said below.
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
    for folder in folders:
        if not folder.is_dir():
            raise InputError(f"{folder}: there is no such folder of results")
    paths = [folder.resolve() for folder in folders]
    for i, path in enumerate(paths):
        if path in paths[:i]:
            raise InputError(f"{folders[i]}: is named twice")
    depth = 1
    while len({path.parts[-depth:] for path in paths}) < len(paths):
        depth += 1
    return [Run(folder, "/".join(path.parts[-depth:])) for folder, path in zip(folders, paths, strict=True)]


def compare_runs(runs: Sequence[Run], output: Path | None, figures: str) -> dict:
    """The document of `compare`, and its files where there is a folder for them."""
    first = runs[0]
    names = list(dict.fromkeys(name for run in runs for name in run.parameters))
    same = all(run.measured == first.measured for run in runs)
    told = []
    if not same:
        told.append("the runs are of different measurements: evidence and leave-one-out are not compared")
    if len({run.symmetry for run in runs}) > 1:
        told.append(
            "the runs are of different crystal classes ("
            + ", ".join(dict.fromkeys(run.symmetry for run in runs))
            + "): constants of the same name are compared, which supposes the same crystal axes"
        )
    entries, differences, rows = [], [], []
    for run in runs:
        entry = {"folder": str(run.folder), "run": run.label, "title": run.title, "symmetry": run.symmetry, "grains": len(run.measured[1])}
        entry["parameters"] = {name: {key: item[key] for key in ("mean", "sd", "hdi_95")} for name, item in run.parameters.items()}
        entries.append(entry)
        for name in names:
            if name not in run.parameters:
                continue
            item, difference, in_sds = run.parameters[name], None, None
            if run is not first and name in first.parameters:
                reference = first.parameters[name]
                difference = item["mean"] - reference["mean"]
                in_sds = difference / math.hypot(item["sd"], reference["sd"])
                differences.append({"run": run.label, "constant": name, "difference_gpa": difference, "difference_sd": in_sds})
                if abs(in_sds) > 3:
                    told.append(f"{name} of {run.label} differs from that of {first.label} by {number(abs(in_sds))} sd")
            rows.append(
                [run.label, name, item["mean"], item["sd"], *item["hdi_95"], *("" if v is None else v for v in (difference, in_sds))]
            )
    header = ["run", "constant", "mean_gpa", "sd_gpa", "hdi_95_low_gpa", "hdi_95_high_gpa", "difference_gpa", "difference_sd"]
    document = {"runs": entries, "same_data": same, "differences": differences, "models": compare_models(runs, told) if same else []}
    document |= {"warnings": told, "figures": []}
    if output:
        output.mkdir(parents=True, exist_ok=True)
        write_csv(output / "comparison.csv", header, rows, f"differences are from {first.label}")
        document["figures"] = draw(runs, output, figures)
        write_json(output / "comparison.json", document)
    return document


def draw(runs: Sequence[Run], output: Path, kind: str) -> list[str]:
    """The names of the figures that are written."""
    from .figures.comparison import forest, overlay
    from .figures.style import house_style, stamp_synthetic

    paths = []
    with house_style():
        for function in (forest, overlay):
            figure = function(runs).figure
            if any(run.synthetic for run in runs):
                stamp_synthetic(figure)
            path = output / f"{function.__name__}.{kind}"
            with whole_file(path) as beside:
                figure.savefig(beside, format=kind)
            paths.append(str(path))
    return paths


def compare_models(runs: Sequence[Run], told: list[str]) -> list[dict]:
    """Evidence and leave-one-out of runs of the same measurements, each less the first's."""
    first = runs[0]
    rows = []
    for run in runs:
        evidence, found = run.document.get("evidence"), run.leave_one_out
        poor = int(np.sum(np.asarray(found.pareto_k) > GREATEST_SHAPE))
        if poor:
            told.append(f"{run.label}: leaving out {poor} of the grains one by one changes the posterior too much for draws of it to tell; "
                        "its leave-one-out is not to be relied on")  # fmt: skip
        row: dict = {
            "run": run.label,
            "elpd": float(run.pointwise.sum()),
            "p_loo": float(getattr(found, "p_loo", getattr(found, "p", math.nan))),
        }
        row |= {"grains_not_told": poor, "log_z": evidence and evidence["log_z"], "log_z_sd": evidence and evidence["sd"]}
        row |= dict.fromkeys(("elpd_difference", "elpd_difference_sd", "log_z_difference", "log_z_difference_sd"))
        if run is not first:
            each = run.pointwise - first.pointwise
            row |= {"elpd_difference": float(each.sum()), "elpd_difference_sd": float(np.sqrt(len(each) * each.var()))}
            if evidence and (reference := first.document.get("evidence")):
                row["log_z_difference"] = evidence["log_z"] - reference["log_z"]
                row["log_z_difference_sd"] = math.hypot(evidence["sd"], reference["sd"])
        rows.append(row)
    if missing := [run.label for run in runs if not run.document.get("evidence")]:
        told.append(f"no evidence of {', '.join(missing)}: evidence = .true. in &sampler estimates it")
    return rows
