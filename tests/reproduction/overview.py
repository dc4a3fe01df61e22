"""The first table of the page: each equation, figure and table of the paper, its number, ours, the
difference and its cause.
"""

import numpy as np

from bayesindent.crystal.elasticity import anisotropy_index, stiffness_rows
from reproduction.page import Page
from reproduction.published import PLACES, STUDIES
from reproduction.regression import fit
from reproduction.run import Results
from reproduction.step_2 import EXACT, METHOD, Study
from reproduction.studies import Pool

__all__ = ["overview", "regression_checks"]


def overview(page: Page, results: Results) -> None:
    """The table."""
    rows = [*equations(results), *figures(results)]
    for study in results.studies.values():
        rows += constants(study)
    page.table(
        "Numbers of the paper with their sections, and ours. GPa unless another unit is named.",
        ["of the paper", "paper", "here", "difference", "cause"],
        rows,
        prose=True,
    )


def difference(paper: float, ours: float) -> str:
    """Ours less the paper's."""
    return f"{ours - paper:+.2f}"


def regression_checks(pool: Pool, surrogate, degree: int, bandlimit: int) -> dict[str, float]:
    """Relative differences between the program's surrogate and the same equations in NumPy: the
    coefficients (Eq. 3-7), alpha and beta (Eq. 8, 9), predictive sds (Eq. 10), and the covariance
    updated point by point (Eq. 11).
    """
    size = len(surrogate.data["modulus_gpa"])
    terms = pool.terms(degree, bandlimit).values
    known = fit(terms[:size], pool.modulus[:size])
    precision = known.alpha * np.eye(terms.shape[1]) + known.beta * terms[:size].T @ terms[:size]
    covariance = np.linalg.inv(precision)
    later = slice(size, size + 50)
    wanted = np.einsum("ij,jk,ik->i", terms[later], covariance, terms[later]) + 1 / known.beta
    matrices = stiffness_rows(pool.symmetry, pool.constants[later])
    mean, sd = surrogate.predict(matrices, pool.euler_deg[later])
    updated = np.eye(terms.shape[1]) / known.alpha
    for row in terms[:size]:
        change = updated @ row
        updated -= np.outer(change, change) / (1 / known.beta + row @ change)
    return {
        "Eq. 3-7": float(np.abs(terms[later] @ known.coefficients / mean - 1).max()),
        "Eq. 8-9": max(
            abs(known.alpha / surrogate.alpha - 1), abs(known.beta / surrogate.beta - 1)
        ),
        "Eq. 10": float(np.abs(np.sqrt(wanted) / sd - 1).max()),
        "Eq. 11": float(np.abs(updated - covariance).max() / np.abs(covariance).max()),
    }


def equations(results: Results) -> list[list[str]]:
    """Rows of Eq. 1-11 and 14."""
    pools, hexagonal = results.pools, STUDIES["hexagonal"]
    terms = results.documents["hexagonal"]["terms"]
    cubic = STUDIES["cubic"]
    checks = regression_checks(
        pools["cubic"], results.surrogate("cubic"), cubic["degree"], cubic["bandlimit"]
    )
    ends = [np.abs(pool.coordinates).max() for pool in pools.values()]
    rows = [
        [
            f"Eq. 1, terms at Q = 2, L = 4 ({PLACES['terms']})",
            str(hexagonal["terms"]),
            str(terms),
            str(terms - hexagonal["terms"]),
            "none",
        ],
        ["Eq. 2, largest coordinate", "1", f"{max(ends):.4f}", "", "none: inside the bounds"],
    ]
    what = {
        "Eq. 3-7": "predictions",
        "Eq. 8-9": "alpha, beta",
        "Eq. 10": "predictive sd",
        "Eq. 11": "covariance, updated point by point",
    }
    for name, value in checks.items():
        cause = "rounding: the program against the same equations in NumPy"
        rows.append([f"{name}, {what[name]}", "", "", f"{value:.0e} (relative)", cause])
    for symmetry, pool in pools.items():
        largest = anisotropy_index(stiffness_rows(symmetry, pool.constants)).max()
        paper = STUDIES[symmetry]["anisotropy"]
        rows.append(
            [
                f"Eq. 14, largest index, {symmetry} ({PLACES['anisotropy']})",
                f"{paper}",
                f"{largest:.1f}",
                difference(paper, largest),
                "other hypercubes; stated as `anisotropy_cap`, since the index is unbounded",
            ]
        )
    return rows


def figures(results: Results) -> list[list[str]]:
    """Rows of Figs. 1-3 and 5-8."""
    cubic, hexagonal = results.documents["cubic"], results.documents["hexagonal"]
    rows = []
    texts = {
        "cubic": ("Figs. 1, 2", "Fig. 3"),
        "hexagonal": ("Figs. 6, 7", "Fig. 8"),
    }
    causes = {
        "cubic": "other crystals and directions, which the paper does not list",
        "hexagonal": "other hypercubes: a few nearly unstable crystals have the large errors",
    }
    for symmetry, document in (("cubic", cubic), ("hexagonal", hexagonal)):
        paper, (first, last) = STUDIES[symmetry], texts[symmetry]
        cause = causes[symmetry]
        if results.plan.is_quick:
            cause = "--quick: fewer simulations, or theory in their place"
        ours = document["loocv_gpa"]
        rows.append(
            [
                f"{first}, leave-one-out at {paper['chosen']} ({symmetry})",
                f"{paper['loocv']}",
                f"{ours:.2f}",
                difference(paper["loocv"], ours),
                cause,
            ]
        )
        unseen = document["validation"]["mean_absolute_gpa"]
        rows.append(
            [
                f"{last}, {paper['unseen']} unseen ({symmetry})",
                f"{paper['unseen_error']}",
                f"{unseen:.2f}",
                difference(paper["unseen_error"], unseen),
                cause,
            ]
        )
    rows.insert(
        2,
        ["Fig. 1, errors of Q = 3", "little improvement", "larger by factors", "", DEGREE_3],
    )
    rows.append(
        ["Fig. 6, errors of Q = 3", "within 0.3 after 2200", "larger by factors", "", DEGREE_3]
    )
    ratio = np.array(results.zinc["C3D8, default"]["modulus"])
    ratio = 100 * (ratio / np.array(results.zinc["Vlassak-Nix"]) - 1)
    rows.append(
        [
            "Fig. 5, zinc: block over Vlassak-Nix, %",
            "validated (drawn)",
            f"{ratio.min():.0f} to {ratio.max():.0f}",
            "",
            "the clamped bottom of the block, and its elements (section on the model)",
        ]
    )
    return rows


DEGREE_3 = "the prior of Eq. 6 (section on degree 3)"


def constants(study: Study) -> list[list[str]]:
    """Rows of Table 1 and Figs. 4, 9, 10."""
    metal, figure = study.metal, "Fig. 4" if study.symmetry == "cubic" else "Fig. 9"
    mean, sd = study.published
    ours, spread = study.parameters(METHOD, "mean"), study.parameters(METHOD, "sd")
    rows = []
    for k, name in enumerate(study.names):
        paper = f"{mean[k]}" + (f" ± {sd[k]}" if sd else "")
        rows.append(
            [
                f"{figure}, {name} of {metal}",
                paper,
                f"{ours[k]:.1f} ± {spread[k]:.1f}",
                difference(mean[k], ours[k]),
                CAUSES[study.symmetry].get(name, OTHER_MODULI),
            ]
        )
    exact = study.parameters(EXACT, "mean")
    off = np.abs(np.subtract(ours, exact) / study.parameters(EXACT, "sd")).max()
    rows.append(
        [
            f"Eq. 12, 13, {metal}: means",
            "",
            f"{off:.2f} sd from exact",
            "",
            "form of the surrogate, and chains that have not mixed",
        ]
    )
    accepted = np.mean(study.documents[METHOD]["acceptance"])
    target = study.paper["acceptance"]
    rows.append(
        [
            f"acceptance of the sampler, {metal} ({PLACES['acceptance']})",
            f"{target}",
            f"{accepted:.2f}",
            difference(target, accepted),
            "tuned during the burn-in, then fixed",
        ]
    )
    r_hat = max(study.parameters(METHOD, "r_hat"))
    rows.append(
        [
            f"R-hat of four chains, {metal}",
            "one chain",
            f"{r_hat:.2f}",
            "",
            "one constant at a time along a ridge",
        ]
    )
    return rows


OTHER_MODULI = "other measured moduli (ours are synthetic)"
CAUSES = {
    "cubic": {
        "C12": "the ridge: no grain tells C12 from C11; only bounds end it",
        "C44": "its bound of 120 truncates it, there and here",
    },
    "hexagonal": {
        "C12": "hidden: its sd is that of its bounds",
        "C13": "hidden: its sd is that of its bounds",
    },
}
