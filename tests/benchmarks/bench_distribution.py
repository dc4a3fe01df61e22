"""Grains of unknown orientation: measured moduli of twelve grains of glaucophane against its
published constants.

    ./bayesindent dev bench distribution

The moduli and their errors are those of Step 0 (inputs/case_studies/glaucophane_curves.nml). Data
sets of as many grains are made up from the constants: random directions, the errors that grains
share, and their own. p is the share of them that is as far from the expected distribution.
"""

import argparse
from pathlib import Path

import numpy as np
from scipy import stats

import bayesindent as bi

STUDY = Path(__file__).resolve().parents[2] / "inputs" / "case_studies"
#: Bezacier et al., Tectonophysics 494, 201 (2010), GPa; C35 is -2.37 in the compilation of
#: Telewavesim.
PUBLISHED = {
    "C11": 122.28,
    "C12": 45.69,
    "C13": 37.24,
    "C15": 2.33,
    "C22": 231.5,
    "C23": 74.91,
    "C25": -4.81,
    "C33": 254.57,
    "C35": -23.71,
    "C44": 79.67,
    "C46": 8.89,
    "C55": 52.82,
    "C66": 51.24,
}
#: Of diamond, 1/GPa.
INDENTER = (1 - 0.07**2) / 1140.0


def distances(sets: np.ndarray, moduli: np.ndarray, sd: np.ndarray) -> np.ndarray:
    """Anderson and Darling's distance of each set (set, grain) from the distribution of moduli with
    errors of these sds, all errors together.
    """
    scores = np.empty_like(sets)
    for i in range(sets.shape[1]):
        grid = np.linspace(sets[:, i].min(), sets[:, i].max(), 400)
        scores[:, i] = np.interp(
            sets[:, i],
            grid,
            stats.norm.cdf((grid[:, None] - moduli) / (sd[i] * moduli)).mean(axis=1),
        )
    u = np.clip(np.sort(scores, axis=1), 1e-12, 1 - 1e-12)
    n = u.shape[1]
    return -n - ((2 * np.arange(n) + 1) * (np.log(u) + np.log1p(-u[:, ::-1]))).sum(axis=1) / n


def compare_glaucophane(sets: int, factors=(1.0, 0.9, 1.1), constants=PUBLISHED):
    """Of each factor on all constants the moduli that are expected, those measured, and p with and
    without shared errors.
    """
    found = bi.curves(
        STUDY / "glaucophane_curves.csv",
        STUDY / "glaucophane_tests.csv",
        {"quartz": (72.0, 0.5, 0.17)},
        radius_um=6.0,
    )
    table = found.measurements()
    measured, shared = np.array(table["effective_modulus_gpa"], dtype=float), found.shared_errors
    own = np.array(table["sd_gpa"], dtype=float) / measured
    rng = np.random.default_rng(1)
    angles = np.column_stack(
        [np.zeros(4000), np.degrees(np.arccos(rng.uniform(-1, 1, 4000))), rng.uniform(0, 360, 4000)]
    )
    moduli = 1 / (
        1 / bi.halfspace_modulus(bi.stiffness("monoclinic", **constants), angles) + INDENTER
    )
    for factor in factors:
        p = []
        for columns in (shared, 0 * shared):
            sd = np.sqrt(own**2 + (columns**2).sum(axis=1))
            truth = factor * rng.choice(moduli, (sets, len(measured)))
            errors = rng.normal(size=(sets, columns.shape[1])) @ columns.T + own * rng.normal(
                size=truth.shape
            )
            there = distances(measured[None], factor * moduli, sd)
            p.append(np.mean(distances(truth * (1 + errors), factor * moduli, sd) >= there))
        yield factor * moduli, measured, p


def main(argv=None):
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--sets", type=int, default=20000)
    sets = parser.parse_args(argv).sets
    print(
        "| constants | expected, GPa | measured, GPa | p, shared errors counted | p, without them |"
    )
    print("|---|---|---|---|---|")
    cases = {
        "published": (1.0, {}),
        "0.9 times": (0.9, {}),
        "1.1 times": (1.1, {}),
        "C35 = -2.37": (1.0, {"C35": -2.37}),
    }
    for name, (factor, other) in cases.items():
        for moduli, measured, p in compare_glaucophane(sets, (factor,), PUBLISHED | other):
            words = (
                f"{moduli.mean():.1f} ± {moduli.std():.1f} | {measured.mean():.1f} ± "
                f"{measured.std(ddof=1):.1f}"
            )
            print(f"| {name} | {words} | {p[0]:.2g} | {p[1]:.2g} |")


if __name__ == "__main__":
    main()
