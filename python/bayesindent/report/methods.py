"""The paragraph on methods with the numbers of a run, and the works that it cites."""

from ..version import __version__
from .figures.residuals import chi_square
from .results import Results
from .summary import measured_ranges, specimen, with_count, with_verdict
from .templates import read_data, render

__all__ = ["methods"]


def methods(results: Results) -> tuple[str, str]:
    """The paragraph in LaTeX, and the works that it cites in BibTeX."""
    document, parameters = results.documents["extract"], results.documents["extract"]["parameters"]
    moduli, sds = measured_ranges(results)
    chains = [item for item in parameters.values() if item["r_hat"] is not None]
    combinations = results.identifiability("combination")
    constants = [
        rf"${name[0]}_{{{name[1:]}}} = {item['mean']:.1f} \pm {item['sd']:.1f}$~GPa"
        if name in results.constants
        else f"{name} {item['mean']:.3g}"
        for name, item in parameters.items()
    ]
    prior, surrogate = results.prior_and_surrogate
    text = render(
        "methods.tex.j2", results=results, document=document, build=results.documents["build"], measurements=results.group("measurements"),
        version=__version__, grains=with_count(len(results.predicted), "grain"), moduli=moduli, sds=sds, specimen=specimen(results),
        prior=prior, surrogate=surrogate, chains=with_count(document["chains"], "chain"), r_hat=[item["r_hat"] for item in chains],
        effective=[min(item["ess_bulk"], item["ess_tail"]) for item in chains], constants=constants, combinations=len(combinations),
        determined=len(with_verdict(combinations, "determined")),
        chi_square=all(item.get("measured_sd") for item in results.predicted) and chi_square(results.predicted),
    )  # fmt: skip
    works = read_data("references.bib").replace("@VERSION@", __version__).rstrip().split("\n\n")
    cited = [work for work in works if work.partition("{")[2].partition(",")[0] in text]
    return text, "\n\n".join(cited) + "\n"
