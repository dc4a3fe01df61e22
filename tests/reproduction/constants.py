"""The chapters of the page on Step 2: iron and titanium."""

import numpy as np

from bayesindent.crystal.elasticity import halfspace_modulus, stiffness
from bayesindent.report.figures.style import stamp_synthetic
from reproduction.page import Page, fixed
from reproduction.posterior_figures import marginals, predictions, ridges
from reproduction.published import CUBIC, LITERATURE
from reproduction.run import Results
from reproduction.step_2 import BLOCK, DECLINATIONS, EXACT, METHOD, SAME, Study

__all__ = ["step_2"]

TITLES = {
    "cubic": "Iron (section 3.3, Table 1, Fig. 4)",
    "hexagonal": "Titanium (section 4.3, Figs. 9, 10)",
}

#: Two crystals that have the same modulus in every direction.
TWINS = {
    "cubic": ((225, 135, 124), (209.3, 110, 126.9)),
    "hexagonal": ((162, 92, 47, 180, 69), (138.7, 50, 45.2, 190.8, 69)),
}


def step_2(page: Page, results: Results, symmetry: str) -> None:
    """Table 1, Figs. 4, 9 and 10, with the ridge that explains them."""
    study = results.studies[symmetry]
    truth = ", ".join(f"{value:g}" for value in study.truth)
    page.heading(TITLES[symmetry])
    page.text(
        f"The paper's measured moduli are not published in a form that we found. Those here are "
        f"**synthetic**: exact half-space theory at {', '.join(study.names)} = {truth} GPa in "
        f"{len(study.measured)} orientations, with noise of {study.measured.sd_gpa[0]:g} GPa. So "
        "the paper's numbers are beside ours without being a target. Step 1 is trained on the "
        "exact theory, since these moduli are those of a half-space. The result differs from the "
        "exact posterior by the paper's method alone. Four chains in place of one, so that they "
        "can be compared."
    )
    page.table("GPa, mean ± sd:", ["", *study.names], constant_rows(study))
    page.table(
        "Median sd within stretches of a chain of the paper's method, GPa:",
        ["samples", *study.names],
        [[n, *fixed(sds, 1)] for n, sds in study.stretches().items()],
    )
    for name, draw, caption in (
        (
            "marginals",
            marginals,
            f"Fig. {4 if symmetry == 'cubic' else 9}: distributions of the constants.",
        ),
        ("ridges", ridges, "Pairs of constants: the ridges along which no grain tells apart."),
    ):
        page.figure(f"paper_{study.metal}_{name}", marked(draw(study)), caption)
    explain(page, results, study)


def marked(figure):
    """A figure with the mark of synthetic data."""
    stamp_synthetic(figure)
    return figure


def constant_rows(study: Study) -> list[list[str]]:
    """The constants by the paper, by others, and by each posterior."""

    def row(label: str, mean, sd=None) -> list[str]:
        if sd is None:
            return [label, *(f"{value:g}" for value in mean)]
        return [label, *(f"{m:.1f} ± {s:.1f}" for m, s in zip(mean, sd, strict=True))]

    mean, sd = study.published
    rows = [row("paper, measured moduli", mean, sd)]
    if study.symmetry == "cubic":
        rows += [row("paper, Table 1", CUBIC["table_1"])]
        rows += [row("its earlier study, by regression (Table 1)", CUBIC["earlier"])]
    rows += [
        row("literature, as the paper has it", LITERATURE[study.symmetry]),
        row("truth of the synthetic moduli", study.truth),
    ]
    for label in study.documents:
        means, sds = (study.parameters(label, name) for name in ("mean", "sd"))
        rows.append(row(f"**{label}**", means, sds))
        if label in (METHOD, SAME):
            ess, r_hat = (study.parameters(label, name) for name in ("ess_bulk", "r_hat"))
            cells = [f"{n:.0f}, {r:.2f}" for n, r in zip(ess, r_hat, strict=True)]
            rows.append(["effective samples, R-hat", *cells])
        if label == METHOD:
            of_chains = study.draws[label].mean(axis=1)
            ends = zip(of_chains.min(axis=0), of_chains.max(axis=0), strict=True)
            rows.append(["means of its chains", *(f"{a:.1f} to {b:.1f}" for a, b in ends)])
    reference = study.reference
    rows.append(row("exact, by another program on a grid or by sampling", *posterior_of(reference)))
    return rows


def posterior_of(reference: dict) -> tuple:
    """Mean and sd of a reference posterior."""
    return reference["mean"], reference["sd"]


def explain(page: Page, results: Results, study: Study) -> None:
    """What differs from the paper, and why."""
    names, symmetry = study.names, study.symmetry
    sds = {label: study.parameters(label, "sd") for label in study.documents}
    ess = study.parameters(METHOD, "ess_bulk")
    second = names.index("C12")
    samples = study.draws[METHOD].shape[0] * study.draws[METHOD].shape[1]
    moduli = [
        halfspace_modulus(stiffness(symmetry, *twin), directions()) for twin in TWINS[symmetry]
    ]
    alike = np.abs(moduli[0] - moduli[1]).max()
    first, other = (str(twin)[1:-1] for twin in TWINS[symmetry])
    shift = np.abs(
        np.subtract(study.parameters(METHOD, "mean"), study.parameters(EXACT, "mean"))
    ) / np.array(sds[EXACT])
    page.text(
        f"**The sampler is slow.** The {samples} samples have an effective sample size of "
        f"{ess[second]:.0f} for C12, one chain of the paper's length a quarter. Its means lie "
        f"within {shift.max():.1f} sd of the exact posterior's.",
        f"**The sds are the difference.** The exact sd of C12 is {sds[EXACT][second]:.1f} GPa"
        + (f"; the paper has {study.published[1][second]}. " if study.published[1] else ". ")
        + f"The crystals {{{first}}} and {{{other}}} GPa have the same modulus in every direction "
        f"to {alike:.3f} GPa. Along that line only the bounds end the posterior. A chain that was "
        "stopped early does not explain it: see the stretches above."
        if symmetry == "cubic"
        else f"**Hidden combinations.** The exact sd of C12 is {sds[EXACT][second]:.1f} GPa, and a "
        f"flat distribution over its bounds has {80 / 12**0.5:.1f}. The crystals {{{first}}} and "
        f"{{{other}}} GPa have the same modulus in every direction to {alike:.3f} GPa. The paper "
        "finds C13 the most uncertain and calls it insensitive; no grain sees it. Its mean of 55 "
        "GPa lies within the bounds' own mean and sd, 65 ± 14.4.",
    )
    precision_table(page, results.precisions[symmetry], names)
    {"cubic": explain_iron, "hexagonal": explain_titanium}[symmetry](page, study)


def directions() -> np.ndarray:
    """Angles (n, 3) in degrees over the sphere."""
    tilts, turns = np.meshgrid(np.linspace(0, 90, 31), np.linspace(0, 90, 31))
    return np.column_stack([np.zeros(tilts.size), tilts.ravel(), turns.ravel()])


def precision_table(page: Page, rows: list[dict], names) -> None:
    """Sds that better measurements would leave."""
    if rows:
        page.table(
            "Better measurements do not help. Sds in GPa from moduli without noise, by the sd that "
            "is stated of them; the surrogate's own error is left out of the likelihood, as in the "
            "paper, and bends the ridge:",
            ["stated sd, model", *names],
            [[f"{row['stated']:g}, {row['model']}", *fixed(row["sds"], 1)] for row in rows],
        )


def explain_iron(page: Page, study: Study) -> None:
    """Bounds, block, and the paper's two tables."""
    moved = next(label for label in study.documents if label.startswith("exact, C44"))
    third = study.names.index("C44")
    exact, free = (study.parameters(label, "mean")[third] for label in (EXACT, moved))
    if BLOCK in study.documents:
        mean, sd = (study.parameters(BLOCK, name)[third] for name in ("mean", "sd"))
        page.text(
            f"**The block matters.** Trained on the paper's block, the same method has C44 = "
            f"{mean:.1f} ± {sd:.1f} GPa for a truth of {study.truth[third]:g}, and nothing in the "
            "posterior shows it. The paper does not say how its constants came out near the "
            "literature's nevertheless.",
        )
    page.text(
        f"**C44 is truncated by its bound.** The box ends at 120 GPa, and the literature's 124 "
        f"lies outside. The exact mean is {exact:.1f} for a truth of {study.truth[third]:g}; with "
        f"the bound at 250 it is {free:.1f}. The paper takes its low C44 (114) for an error of "
        "measurement; the bound alone gives as much.",
        "**The highest relative uncertainty** is that of C12, not of C44 as in the paper. A "
        "further grain does not help; a bulk modulus does "
        "([further knowledge](../inference.md#further-knowledge)).",
        f"**Table 1 and Fig. 4 of the paper** differ: a mean of C12 of {CUBIC['table_1'][1]} in "
        f"one, {CUBIC['mean'][1]} in the other.",
    )


def explain_titanium(page: Page, study: Study) -> None:
    """Fig. 10."""
    page.figure(
        "paper_titanium_predictions",
        marked(predictions(study)),
        "Fig. 10: the modulus over the declination, with the measurements, and its distribution at "
        "seven declinations (solid: the paper's method, broken: exact).",
    )
    rows = [
        [label, *fixed(study.moduli(label, DECLINATIONS).std(axis=0), 2)]
        for label in (METHOD, EXACT)
    ]
    page.table("sd of the modulus by declination, GPa:", ["degrees", *DECLINATIONS], rows)
    page.text(
        "The paper's method gives the right modulus and sd in every direction although its chains "
        "have not mixed: the modulus does not change along the ridge. As in the paper it is least "
        "certain at low declinations, where few grains are. More grains there would sharpen the "
        "modulus and the visible combinations, not C12 or C13. Linear compressibilities determine "
        "these ([further knowledge](../inference.md#further-knowledge))."
    )
