"""Several posteriors side by side: constants, and how well each predicts the same measurements."""

from collections.abc import Iterable
from math import hypot
from pathlib import Path
from typing import Any

from ..common.diagnostics import diagnostic
from ..common.result_files import whole_file, write_csv, write_json
from ..core import InputError
from ..inference.arviz_groups import inference_data
from ..settings.keywords import warn_of
from ..stages.results_folder import using_documents
from .results import Results


def compare(*results: Any, output: Any = None) -> dict:
    """Compare two or more `results`: folders, or what `bi.extract` gave.

    `constants`: a row for each constant of each run, with mean, sd and 95 % interval, and its
    difference from the first run's in sds of the difference; `models`: `arviz.compare` of runs of
    the same moduli; `warnings`. `output`: a folder for comparison.csv, comparison.json and
    forest.png.

    Examples
    --------
    >>> known = {"bulk_modulus": (137, 3)}
    >>> with_it, without = (
    ...     bi.extract("grains.csv", "cubic", knowledge=each, technique="exact", samples=300)
    ...     for each in (known, None)
    ... )
    >>> len(bi.compare(with_it, without)["constants"])
    6
    """
    with using_documents(*(Path(each) for each in results if not hasattr(each, "posterior"))):
        return compare_all(results, output)


def compare_all(results: Iterable, output: Any) -> dict:
    """Compare as `compare` does."""
    # Imported here, since importing ArviZ takes seconds.
    import arviz

    rows, warnings, draws = [], [], {}
    runs = list(map(Results, results))
    for number, run in enumerate(runs, 1):
        name = str(run.folder) if run.result is None else f"result {number}"
        summary, posterior = run.extracted, run.posterior
        if not posterior:
            raise InputError(
                f"{name}: there is no posterior of its latest inputs in it; "
                f"'bayesindent extract FILE.nml --output {name}' makes one"
            )
        warnings += [
            diagnostic("compared_unusable", f"{name} cannot be used: {reason}")
            for reason in summary["reasons"]
        ]
        for constant in run.constants:
            item = summary["parameters"][constant]
            other = runs[0].extracted["parameters"].get(constant)
            low, high = item["hdi_95"]
            rows.append(
                {
                    "constant": constant,
                    "run": name,
                    "mean_gpa": item["mean"],
                    "sd_gpa": item["sd"],
                    "low_95_gpa": low,
                    "high_95_gpa": high,
                    "difference_sd": other
                    and (item["mean"] - other["mean"]) / hypot(item["sd"], other["sd"]),
                }
            )
        # The constants of those draws for which the likelihood of each grain is stored.
        axes, stored = ("chain", "draw"), slice(None, None, posterior["stride"])
        chains = {label: (axes, values[:, stored]) for label, values in run.samples.items()}
        density = {"modulus": ((*axes, "grain"), posterior["log_likelihood"])}
        draws[name] = inference_data({"posterior": (chains, {}), "log_likelihood": (density, {})})
    if len(draws) < 2:
        raise InputError("compare: two or more different results are needed")
    rows.sort(key=lambda row: row["constant"])
    document = {"constants": rows, "models": [], "warnings": warnings}
    if len({run.symmetry for run in runs}) > 1:
        warnings.append(diagnostic("compared_classes"))
    if len({repr([run.kind, run.posterior["modulus_gpa"].tolist()]) for run in runs}) > 1:
        warnings.append(diagnostic("compared_measurements"))
    else:
        document["models"] = arviz.compare(draws).reset_index(names="run").to_dict("records")
    if output:
        write_csv(Path(output, "comparison.csv"), rows[0], map(dict.values, rows))
        write_json(Path(output, "comparison.json"), document)
        draw_forest(draws, Path(output, "forest.png"), any(run.synthetic for run in runs))
    warn_of(document)
    return document


def draw_forest(draws: dict, path: Path, synthetic: bool) -> None:
    """Write the figure of medians and intervals that hold 50 % and 95 % of the draws."""
    import arviz

    from .figures.style import house_style, panels, stamp_synthetic

    with house_style(), whole_file(path) as file:
        if hasattr(arviz, "PlotCollection"):
            figure = arviz.plot_forest(draws, combined=True).viz["figure"].item()
            figure.set_layout_engine("constrained")
        else:
            figure, axes = panels(4.0)
            names = {"model_names": list(draws), "combined": True, "hdi_prob": 0.95}
            arviz.plot_forest(list(draws.values()), ax=axes, **names)
        figure.supxlabel("GPa")
        if synthetic:
            stamp_synthetic(figure)
        figure.savefig(file, format="png")
