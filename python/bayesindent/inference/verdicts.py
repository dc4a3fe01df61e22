"""What a person should know of a posterior before believing it, in plain words."""

import json

import numpy as np

from ..crystal.directions import all_alike, indentation_direction
from ..crystal.elasticity import constant_names

__all__ = ["orientation_verdicts", "verdicts"]

#: Chains have mixed if R-hat is below and the effective sample sizes are above (Vehtari et al., Bayesian Anal. 16, 667, 2021).
R_HAT, ESS_PER_CHAIN = 1.01, 100

#: A combination is decided by the data above, by the prior below this contraction.
DATA_DECIDED, PRIOR_DECIDED = 0.9, 0.5


def verdicts(result, document: dict) -> list[str]:
    """Warnings about a result of `extract` and its document."""
    attributes = result.posterior.attrs
    lines = []
    if attributes["share_inside"] < 0.99:
        lines.append(
            f"the surrogate knows {100 * attributes['share_inside']:.0f} % of the crystals within the stated bounds; "
            "the posterior is cut to these"
        )
    lines += mixing_verdicts(document)
    lines += ridge_verdicts(document, constant_names(attributes["symmetry"]))
    bounds = json.loads(attributes["bounds"])
    for name, (low, high) in bounds.items():
        lines += bound_verdicts(name, result.posterior[name].values.ravel(), low, high)
    observed = result.observed_data
    lines += orientation_verdicts(attributes["symmetry"], observed["euler_deg"].values)
    lines += grain_verdicts(result)
    return lines


def mixing_verdicts(document: dict) -> list[str]:
    """Poor R-hat and effective sample sizes."""
    remedy = "take more samples" if document["method"] == "ensemble" else "take more samples, or method 'ensemble'"
    lines = []
    for name, item in document["parameters"].items():
        ess = min(item["ess_bulk"], item["ess_tail"])
        unmixed = item["r_hat"] is not None and not item["r_hat"] < R_HAT
        if unmixed or not ess > ESS_PER_CHAIN * document["chains"]:
            said = f"R-hat is {item['r_hat']:.3f} (below {R_HAT} is well)" if item["r_hat"] is not None else "there is one chain"
            lines.append(f"the chains of {name} have not mixed: {said}, and they are worth {ess:.0f} independent samples; {remedy}")
    return lines


def ridge_verdicts(document: dict, names) -> list[str]:
    """The constants that trade off, with what the data decided and what the prior did."""
    combinations = [row for row in document["identifiability"] if row["kind"] == "combination"]
    hidden = [row["name"] for row in combinations if row["contraction"] < PRIOR_DECIDED]
    if not hidden:
        return []
    known = [row["name"] for row in combinations if row["contraction"] > DATA_DECIDED]
    correlation = np.array(document["correlation"])
    pairs = [
        f"{names[i]} and {names[j]} trade off (correlation {correlation[i, j]:.2f})"
        for i in range(len(names))
        for j in range(i)
        if abs(correlation[i, j]) > 0.7
    ]
    decided = f"the data decided {', '.join(known) if known else 'no combination by themselves'}"
    return [f"{'; '.join([*pairs, decided])}; the prior decided {', '.join(hidden)}"]


def bound_verdicts(name: str, values, low: float, high: float) -> list[str]:
    """Draws that crowd at a bound."""
    counts, edges = np.histogram(values, bins=20, range=(values.min(), values.max()))
    lines = []
    for bound, edge, share, word in ((low, edges[0], counts[0], "lower"), (high, edges[-1], counts[-1], "upper")):
        at_bound = abs(edge - bound) < 0.01 * (edges[-1] - edges[0])
        if at_bound and share > 0.35 * counts.max():
            lines.append(f"{name} piles up at its bound of {bound:g} GPa: the {word} bound, not the data, ends its distribution there")
    return lines


def orientation_verdicts(symmetry: str, euler_deg) -> list[str]:
    """Too few or too similar orientations."""
    if len(euler_deg) == 1:
        return ["there is one grain: one modulus cannot decide the constants"]
    lines = []
    if all_alike(symmetry, indentation_direction(euler_deg), 5.0):
        lines.append("the orientations are all alike (within 5 degrees of one): they cannot tell how the modulus depends on orientation")
    if 0.0 < np.abs(euler_deg).max() <= 2 * np.pi:
        lines.append("no angle is above 2 pi: angles are in degrees, and these look like radians")
    return lines


def grain_verdicts(result) -> list[str]:
    """Grains whose modulus disagrees with all others."""
    attributes, observed = result.posterior.attrs, result.observed_data
    predictions = result.predictions["modulus"].values * result.predictions["calibration_factor"].values[..., None]
    predictions = predictions.reshape(-1, observed.sizes["grain"])
    factor = result.posterior["sd_factor"].values.mean() if "sd_factor" in result.posterior else 1.0
    residual = (observed["modulus"].values - predictions.mean(axis=0)) / (factor * observed["sd"].values)
    lines = []
    for i in np.flatnonzero(np.abs(residual) > 3.0):
        advice = "" if attributes["student_t"] else "; likelihood 'student' gives such grains less weight"
        lines.append(
            f"grain {i + 1} disagrees with the others: its modulus is {abs(residual[i]):.1f} sd {'above' if residual[i] > 0 else 'below'}"
            f" what all grains together predict{advice}"
        )
    return lines
