"""The paragraph on methods with the numbers of a run, and the works that it cites."""

from collections.abc import Sequence

from ..version import __version__
from .figures.residuals import chi_square
from .results import Results
from .summary import DECIDED, counted, span, specimen_in_words
from .words import latex, listed, number

__all__ = ["bibliography", "methods"]

WORKS = {
    "bayesindent": rf"""@software{{bayesindent,
  author = {{{{The bayesindent developers}}}},
  title = {{bayesindent: single-crystal elastic constants from spherical indentation}},
  version = {{{__version__}}},
}}
""",
    "castillo2019": """@article{castillo2019,
  author = {Castillo, Andrew and Kalidindi, Surya R.},
  title = {A {Bayesian} Framework for the Estimation of the Single Crystal Elastic Parameters From Spherical Indentation Stress-Strain Measurements},
  journal = {Frontiers in Materials},
  volume = {6},
  pages = {136},
  year = {2019},
  doi = {10.3389/fmats.2019.00136},
}
""",
    "willis1966": """@article{willis1966,
  author = {Willis, J. R.},
  title = {Hertzian contact of anisotropic bodies},
  journal = {Journal of the Mechanics and Physics of Solids},
  volume = {14},
  number = {3},
  pages = {163--176},
  year = {1966},
}
""",
    "vlassak1993": """@article{vlassak1993,
  author = {Vlassak, J. J. and Nix, W. D.},
  title = {Indentation modulus of elastically anisotropic half spaces},
  journal = {Philosophical Magazine A},
  volume = {67},
  number = {5},
  pages = {1045--1056},
  year = {1993},
}
""",
    "vehtari2021": r"""@article{vehtari2021,
  author = {Vehtari, Aki and Gelman, Andrew and Simpson, Daniel and Carpenter, Bob and B{\"u}rkner, Paul-Christian},
  title = {Rank-Normalization, Folding, and Localization: An Improved {$\widehat{R}$} for Assessing Convergence of {MCMC}},
  journal = {Bayesian Analysis},
  volume = {16},
  number = {2},
  pages = {667--718},
  year = {2021},
}
""",
}

SAMPLERS = {
    "ensemble": "an independence sampler whose proposal, a mixture fitted to a population that sequential Monte Carlo brought to the posterior, is fixed before the first sample",
    "scmh": r"single-component Metropolis--Hastings steps as in Ref.~\cite{castillo2019}",
}


def bibliography(keys: Sequence[str]) -> str:
    """The works of these keys in BibTeX."""
    return "\n".join(WORKS[key] for key in WORKS if key in keys)


def methods(results: Results) -> tuple[str, list[str]]:
    """The paragraph in LaTeX, and the keys of what it cites."""
    sentences = [*problem(results), *model(results), *prior(results), *sampling(results), *outcome(results)]
    text = "\n".join(sentences) + "\n"
    return text, [key for key in WORKS if key in text]


def problem(results: Results) -> list[str]:
    """What was measured."""
    predicted = results.documents["extract"]["predicted"]
    moduli, sds = ([item[name] for item in predicted if item.get(name)] for name in ("measured", "measured_sd"))
    error = rf", with standard deviations of {span(sds)}~GPa" if sds else ", whose common scatter was inferred"
    made_up = ["% The data are synthetic: made up, to show or to test the method."] if results.synthetic else []
    return [
        *made_up,
        rf"The elastic constants of the {latex(results.symmetry)} crystal, {listed(results.constants)}, were inferred from the {results.kind} of "
        rf"{counted(len(predicted), 'grain')} of known orientation ({span(moduli)}~GPa{error}) with bayesindent~{__version__}~\cite{{bayesindent}}, "
        r"which follows Castillo and Kalidindi~\cite{castillo2019}.",
    ]


def model(results: Results) -> list[str]:
    """What predicts a modulus."""
    document, build = results.documents["extract"], results.documents["build"]
    sentences = []
    if document.get("theory"):
        sentences.append(
            r"The indentation modulus of a crystal is that of the exact theory of an anisotropic half-space with an elliptic "
            r"contact~\cite{willis1966,vlassak1993}, "
            f"expanded in surface harmonics up to degree {document['theory']['degree']}, "
            f"which is off by at most {100 * document['theory']['largest_error_sd']:.1f}\\,\\% of the standard deviation of a measurement."
        )
    if build and document.get("theory_alone"):
        sentences.append(
            rf"It is multiplied by a correction for the specimen ({latex(specimen_in_words(results))}), learnt from {build['simulations']} finite "
            "element simulations of frictionless contact, each chosen where the correction was known least; a crystal left out of the fit "
            rf"is predicted with a mean absolute error of {number(build['leave_crystal_out_gpa'], 2)}~GPa."
        )
    elif not document.get("theory") or document.get("theory_alone"):
        sentences.append(rf"The model of the indentation modulus: {latex(document['prior']['words'][-1].removeprefix('surrogate: '))}.")
    group = results.group("measurements")
    if results.kind == "effective modulus":
        sentences.append(
            f"The compliance of the indenter (Young's modulus {group['indenter_modulus_gpa']:g}~GPa, Poisson's ratio "
            f"{group['indenter_nu']:g}) was added to it."
        )
    elif results.kind == "sample modulus":
        sentences.append(f"The sample modulus assumes a Poisson's ratio of {group['sample_nu']:g}.")
    return sentences


def prior(results: Results) -> list[str]:
    """What was known before."""
    words = results.documents["extract"]["prior"]["words"][:-1]
    return [f"The prior was {latex('; '.join(words))}."]


def sampling(results: Results) -> list[str]:
    """The chains and their convergence."""
    document, sampler = results.documents["extract"], results.group("sampler")
    kinds = [item for item in document["parameters"].values() if item["r_hat"] is not None]
    mixed = (
        rf" The largest $\widehat{{R}}$ was {max(item['r_hat'] for item in kinds):.3f}, the smallest effective sample size "
        rf"{min(min(item['ess_bulk'], item['ess_tail']) for item in kinds):.0f}~\cite{{vehtari2021}}."
        if kinds
        else ""
    )
    return [
        f"The posterior was sampled by {SAMPLERS.get(document['method'], document['method'])}: {counted(document['chains'], 'chain')} of "
        f"{document['samples']} samples after {sampler.get('burn_in', 0)} sweeps of burn-in.{mixed}"
    ]


def outcome(results: Results) -> list[str]:
    """What came out."""
    document = results.documents["extract"]
    said = listed([rf"${name[0]}_{{{name[1:]}}} = {item['mean']:.1f} \pm {item['sd']:.1f}$~GPa" if name in results.constants else
                   f"{name} {item['mean']:.3g}" for name, item in document["parameters"].items()])  # fmt: skip
    sentences = [f"Mean and standard deviation of the posterior are {said}."]
    combined = [row for row in document["identifiability"] if row["kind"] == "combination"]
    decided = sum(row["contraction"] >= DECIDED for row in combined)
    if combined:
        sentences.append(
            f"The measurements decided {decided} of the {len(combined)} combinations of the constants, in that they halved the standard "
            "deviation of the prior."
        )
    if all(item.get("measured_sd") for item in document["predicted"]):
        total, expected = chi_square(document["predicted"])
        sentences.append(
            rf"The residuals have $\chi^2 = {total:.1f}$, about {expected:.1f} being expected of {len(document['predicted'])} grains."
        )
    return sentences
