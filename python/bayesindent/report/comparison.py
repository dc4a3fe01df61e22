"""Several posteriors side by side: their constants, and, of the same measurements, how well each
model predicts them.
"""

import math
import os
import warnings
from collections.abc import Sequence
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np

from ..common.result_files import whole_file, write_csv, write_json
from ..core import InputError
from ..inference.extract import inference_data
from ..settings.keywords import warn_of
from .formatting import number
from .results import Results


class Run(Results):
    """Results with a posterior of their present inputs, under a name that differs from those of the
    others.
    """

    def __init__(self, source: Any, label: str):
        super().__init__(source)
        self.label, folder = label, self.folder
        if "extract" in self.outdated:
            raise InputError(
                f"{folder}: the posterior there is of other inputs than were used last; run "
                "'bayesindent extract' on its file again"
            )
        if not self.documents["extract"]:
            raise InputError(
                f"{folder}: there is no posterior in it; 'bayesindent extract FILE.nml --output "
                f"{folder}' makes one"
            )
        if not self.posterior:
            raise InputError(
                f"{folder}: has no posterior.bin that belongs to its summary.json; 'bayesindent "
                "extract' writes both"
            )
        self.parameters = {
            name: self.documents["extract"]["parameters"][name] for name in self.constants
        }

    @cached_property
    def measured(self) -> tuple:
        """What the likelihood is a density of: kind, moduli, sds and angles."""
        sd = np.where(self.posterior["sd_gpa"] > 0, self.posterior["sd_gpa"], 1.0)
        return self.kind, *(
            values.tolist()
            for values in (
                self.posterior["modulus_gpa"],
                sd,
                np.nan_to_num(self.posterior["euler_deg"]),
            )
        )

    @cached_property
    def leave_one_out(self) -> Any:
        """ArviZ' estimate of how well each grain is predicted by the others."""
        # Not above: importing it takes seconds, and only the comparison of models needs it.
        import arviz

        # The same draws of the constants, by whose effective size ArviZ judges the weights.
        draws = {
            name: (("chain", "draw"), chains[:, :: self.posterior["stride"]])
            for name, chains in self.samples.items()
        }
        density = {"modulus": (("chain", "draw", "grain"), self.posterior["log_likelihood"])}
        with warnings.catch_warnings():
            # `compare` has its own words for what it warns of.
            warnings.simplefilter("ignore")
            return arviz.loo(
                inference_data({"posterior": (draws, {}), "log_likelihood": (density, {})}),
                pointwise=True,
            )

    @property
    def pointwise(self) -> np.ndarray:
        """Its value for each grain."""
        found = self.leave_one_out
        return np.asarray(found.loo_i if hasattr(found, "loo_i") else found.elpd_i)


def read_runs(sources: Sequence) -> list[Run]:
    """The runs of two or more folders, each under the shortest name that tells it from the others,
    or results of `bi.extract` by their number.
    """
    if len(sources) < 2:
        raise InputError("compare: two or more results are needed")
    folders = [Path(source) for source in sources if not hasattr(source, "posterior")]
    paths = [folder.resolve() for folder in folders]
    for i, folder in enumerate(folders):
        if paths[i] in paths[:i]:
            raise InputError(f"{folder}: is named twice")
    depth = 1
    while len({path.parts[-depth:] for path in paths}) < len(paths):
        depth += 1
    names = iter(["/".join(path.parts[-depth:]) for path in paths])
    return [
        Run(source, f"result {n}" if hasattr(source, "posterior") else next(names))
        for n, source in enumerate(sources, start=1)
    ]


#: Above this shape of the tail of its importance weights (Pareto's k) a grain's leave-one-out
#: density is not to be relied on.
GREATEST_SHAPE = 0.7


def compare(*results: Any, output: str | os.PathLike | None = None, figures: str = "png") -> dict:
    """Posteriors of two or more `results` side by side, each compared with the first: folders, or
    what `bi.extract` gave.

    `runs`: mean, sd and 95 % interval of each constant; `differences`: of each constant from the
    first run's, in GPa and in sds of the difference; `models`: leave-one-out and, where it was
    estimated, evidence of runs of the same measurements. With `output`, a folder, comparison.csv,
    comparison.json and the figures forest and overlay ('png', 'pdf' or 'svg') are written into it.
    """
    document = compare_runs(read_runs(results), Path(output) if output else None, figures)
    warn_of(document)
    return document


def compare_runs(runs: Sequence[Run], output: Path | None, figures: str) -> dict:
    """The document of `compare`, and its files where there is a folder for them."""
    first = runs[0]
    same = all(run.measured == first.measured for run in runs)
    warnings = (
        []
        if same
        else ["the runs are of different measurements: evidence and leave-one-out are not compared"]
    )
    symmetries = dict.fromkeys(run.symmetry for run in runs)
    if len(symmetries) > 1:
        warnings.append(
            f"the runs are of different crystal classes ({', '.join(symmetries)}): constants of "
            "the same name are compared, which supposes "
            "the same crystal axes"
        )
    entries, differences, rows = [], [], []
    for run in runs:
        values = {
            name: {key: item[key] for key in ("mean", "sd", "hdi_95")}
            for name, item in run.parameters.items()
        }
        entry = {
            "folder": str(run.folder),
            "run": run.label,
            "title": run.title,
            "symmetry": run.symmetry,
            "grains": len(run.measured[1]),
        }
        entries.append(entry | {"parameters": values})
        warnings += [
            f"the result of {run.label} cannot be used: {reason}"
            for reason in run.documents["extract"]["reasons"]
        ]
        for name, item in values.items():
            rows.append([run.label, name, item["mean"], item["sd"], *item["hdi_95"], "", ""])
            if run is first or name not in first.parameters:
                continue
            reference = first.parameters[name]
            in_gpa = item["mean"] - reference["mean"]
            in_sds = in_gpa / math.hypot(item["sd"], reference["sd"])
            rows[-1][-2:] = [in_gpa, in_sds]
            differences.append(
                {
                    "run": run.label,
                    "constant": name,
                    "difference_gpa": in_gpa,
                    "difference_sd": in_sds,
                }
            )
            if abs(in_sds) > 3:
                warnings.append(
                    f"{name} of {run.label} differs from that of {first.label} by "
                    f"{number(abs(in_sds))} sd"
                )
    models = compare_models(runs, warnings) if same else []
    document = {
        "runs": entries,
        "same_data": same,
        "differences": differences,
        "models": models,
        "warnings": warnings,
        "figures": [],
    }
    if output:
        header = [
            "run",
            "constant",
            "mean_gpa",
            "sd_gpa",
            "hdi_95_low_gpa",
            "hdi_95_high_gpa",
            "difference_gpa",
            "difference_sd",
        ]
        shared = "; the runs share their measurements, and with them the errors of these" * same
        write_csv(
            output / "comparison.csv", header, rows, f"differences are from {first.label}{shared}"
        )
        document["figures"] = draw(runs, output, figures)
        write_json(output / "comparison.json", document)
    return document


def draw(runs: Sequence[Run], output: Path, kind: str) -> list[str]:
    """The names of the figures that are written."""
    # Not above: importing matplotlib is slow, and `import bayesindent` would.
    from .figures.comparison import forest, overlay
    from .figures.style import house_style, stamp_synthetic

    paths, names = [], list(dict.fromkeys(name for run in runs for name in run.parameters))
    with house_style():
        for function in (forest, overlay):
            figure = function(runs, names).figure
            if any(run.synthetic for run in runs):
                stamp_synthetic(figure)
            paths.append(output / f"{function.__name__}.{kind}")
            with whole_file(paths[-1]) as file:
                figure.savefig(file, format=kind)
    return list(map(str, paths))


def compare_models(runs: Sequence[Run], warnings: list[str]) -> list[dict]:
    """Evidence and leave-one-out of runs of the same measurements, each less the first's."""
    first = runs[0]
    evidence = {run.label: run.documents["extract"].get("evidence") or {} for run in runs}
    rows = []
    for run in runs:
        found, own, reference = run.leave_one_out, evidence[run.label], evidence[first.label]
        poor = int(np.sum(np.asarray(found.pareto_k) > GREATEST_SHAPE))
        if poor:
            warnings.append(
                f"{run.label}: leaving out {poor} of the grains one by one changes the "
                "posterior too much for draws of it to tell; "
                "its leave-one-out is not to be relied on"
            )
        row: dict = {"run": run.label, "elpd": float(run.pointwise.sum())}
        row |= {
            "p_loo": float(getattr(found, "p_loo", getattr(found, "p", math.nan))),
            "grains_not_told": poor,
        }
        row |= {"log_z": own.get("log_z"), "log_z_sd": own.get("sd")}
        row |= dict.fromkeys(
            ("elpd_difference", "elpd_difference_sd", "log_z_difference", "log_z_difference_sd")
        )
        if run is not first:
            each = run.pointwise - first.pointwise
            row |= {
                "elpd_difference": float(each.sum()),
                "elpd_difference_sd": float(np.sqrt(len(each) * each.var())),
            }
            if own and reference:
                row["log_z_difference"] = own["log_z"] - reference["log_z"]
                row["log_z_difference_sd"] = math.hypot(own["sd"], reference["sd"])
        rows.append(row)
    if missing := [label for label, own in evidence.items() if not own]:
        warnings.append(
            f"no evidence of {', '.join(missing)}: evidence = .true. in &sampler estimates it"
        )
    return rows
