"""Studies of Step 2 that are too long for the tests; their results are in
docs/verification/inference.md.

- sbc: simulation-based calibration (Talts et al. 2018). Truths are drawn from the prior,
measurements of the reference grains from the
  model, and the rank of each truth among its posterior's draws must be uniform: of every constant,
  of the combinations that the reference data identify, and of the log likelihood. Also the coverage
  of the 90 % intervals of the moduli.
- truths: coverage at the two fixed truths of the reference sets, with data from the exact theory.
- next: five more grains chosen by `next`, against five random ones.
"""

import argparse
import time
from pathlib import Path

import numpy as np
from scipy import stats

from bayesindent.crystal.elasticity import stiffness_rows
from bayesindent.step_2 import extract, summary
from support.densities import PRIOR, Posterior
from support.theory_cases import SYMMETRIES, Case

FIGURES = Path(__file__).parents[2] / "docs" / "figures"

#: Draws among which a truth is ranked, and bins of the test of uniformity.
DRAWS, BINS = 99, 10

#: What five more grains are to tell.
TARGETS = {"cubic": "C44", "hexagonal": "all"}


def main(argv=None) -> int:
    """Run a study, print its table and, with --figures, write its figure."""
    parser = argparse.ArgumentParser(
        prog="bench studies",
        description=__doc__,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    parser.add_argument("study", choices=("sbc", "truths", "next"))
    parser.add_argument("--repeats", type=int, help="data sets (sbc and truths: 200, next: 40)")
    parser.add_argument("--symmetry", choices=SYMMETRIES, help="only this one")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--threads", type=int, default=2)
    parser.add_argument("--figures", action="store_true", help=f"write the figure into {FIGURES}")
    arguments = parser.parse_args(argv)
    cases = [Case(symmetry) for symmetry in SYMMETRIES if arguments.symmetry in (None, symmetry)]
    return {"sbc": study_sbc, "truths": study_truths, "next": study_next}[arguments.study](
        cases, arguments
    )


def identified_exponents(case: Case, arguments) -> dict[str, np.ndarray]:
    """The combinations of log constants that the reference data determine, if weakly."""
    result = extract(
        case.table, surrogate=case.surrogate, seed=1, workers=arguments.threads, **case.settings
    )
    rows = [
        row
        for row in summary(result)["identifiability"]
        if row["kind"] == "combination" and row["verdict"] != "not_determined"
    ]
    return {row["name"]: np.array(list(row["exponents"].values())) for row in rows}


def sample(
    case: Case, euler_deg, measured, sd, seed: int, threads: int, samples: int = 5000, **settings
):
    """The posterior of one data set and its draws (chains, samples, k)."""
    table = {"euler_deg": euler_deg, "modulus_gpa": measured, "sd_gpa": sd}
    posterior = Posterior.of(
        table, surrogate=case.surrogate, seed=seed, workers=threads, **case.settings, **settings
    )
    draws, _, _ = posterior.sample(
        method="ensemble", samples=samples, burn_in=8000, chains=4, threads=threads, seed=seed
    )
    return posterior, draws


def prior_draws(case: Case, count: int, seed: int) -> np.ndarray:
    """Independent points of the flat prior, by rejection."""
    prior = Posterior.of(case.table, surrogate=case.surrogate, what=PRIOR, **case.settings)
    points = case.lower + (case.upper - case.lower) * np.random.default_rng(seed).random(
        (50 * count, len(case.names))
    )
    return points[np.isfinite(prior.evaluate(points)[0])][:count]


def effective_size(draws) -> float:
    """Smallest bulk effective sample size of the constants."""
    import arviz as az

    return min(float(az.ess(draws[:, :, j])) for j in range(draws.shape[2]))


def study_sbc(cases, arguments) -> int:
    """Ranks, p-values after Holm's correction, coverage of the moduli."""
    repeats = arguments.repeats or 200
    ranks, p_values = {}, {}
    for case in cases:
        start = time.perf_counter()
        exponents = identified_exponents(case, arguments)
        rng = np.random.default_rng(arguments.seed)
        names = [*case.names, *exponents, "log likelihood"]
        table, covered, least = [], [], np.inf
        for k, truth in enumerate(prior_draws(case, repeats, arguments.seed)):
            moduli, _ = case.surrogate.predict(
                stiffness_rows(case.symmetry, [truth])[0], case.euler_deg
            )
            measured = moduli + case.sd_gpa * rng.normal(size=len(moduli))
            # The measurements are drawn without the error of the series.
            asked = {
                "seed": 1000 * arguments.seed + k,
                "threads": arguments.threads,
                "surrogate_variance": "none",
            }
            posterior, draws = sample(case, case.euler_deg, measured, case.sd_gpa, **asked)
            size = effective_size(draws)
            least = min(least, size)
            flat = draws.reshape(-1, len(truth))
            # Thinned to draws that are as good as independent.
            chosen = flat[np.linspace(0, len(flat) - 1, min(DRAWS, int(size))).astype(int)]
            logs = np.array(list(exponents.values()))
            values = np.column_stack(
                [chosen, np.log(chosen) @ logs.T, posterior.evaluate(chosen)[1]]
            )
            true = np.concatenate([truth, logs @ np.log(truth), posterior.evaluate(truth)[1]])
            table.append((values < true).mean(axis=0))
            predicted, _ = posterior.moduli(flat[:: len(flat) // 1000], case.euler_deg)
            low, high = np.quantile(predicted, [0.05, 0.95], axis=0)
            covered.append(np.mean((moduli >= low) & (moduli <= high)))
        ranks[case.symmetry] = names, np.array(table)
        for name, column in zip(names, np.array(table).T, strict=True):
            counts = np.histogram(column, BINS, (0, 1 + 1e-9))[0]
            p_values[case.symmetry, name] = stats.chisquare(counts).pvalue
        error = np.std(covered) / np.sqrt(len(covered))
        print(
            f"{case.symmetry}: {repeats} data sets in {time.perf_counter() - start:.0f} s, "
            f"least effective size {least:.0f}"
        )
        print(
            f"  90 % intervals of the moduli cover {100 * np.mean(covered):.1f} ± "
            f"{100 * error:.1f} %"
        )
    corrected = holm(p_values)
    for (symmetry, name), p in p_values.items():
        print(f"  {symmetry:10} {name:52} p = {p:.3f}, corrected {corrected[symmetry, name]:.3f}")
    print(
        "uniform" if min(corrected.values()) > 0.01 else "NOT uniform",
        "at p > 0.01 after Holm's correction",
    )
    if arguments.figures:
        draw_ranks(ranks, repeats)
    return int(min(corrected.values()) <= 0.01)


def holm(p_values: dict) -> dict:
    """Holm's step-down correction."""
    corrected, largest = {}, 0.0
    for rank, (key, p) in enumerate(sorted(p_values.items(), key=lambda item: item[1])):
        largest = max(largest, min(1.0, (len(p_values) - rank) * p))
        corrected[key] = largest
    return corrected


def draw_ranks(ranks: dict, repeats: int) -> None:
    """Empirical distribution of the ranks less the uniform one, with the band that holds 99 % of
    uniform ones.
    """
    import matplotlib

    matplotlib.use("Agg")
    import matplotlib.pyplot as plt

    figure, panels = plt.subplots(
        1,
        len(ranks),
        figsize=(4.6 * len(ranks), 4.4),
        sharey=True,
        squeeze=False,
        layout="constrained",
    )
    x = np.linspace(0, 1, 201)
    uniform = np.sort(np.random.default_rng(0).random((4000, repeats)), axis=1)
    largest = np.abs(
        np.array([np.searchsorted(row, x, side="right") / repeats for row in uniform]) - x
    ).max(axis=1)
    band = np.quantile(largest, 0.99)
    for axes, (symmetry, (names, table)) in zip(panels[0], ranks.items(), strict=True):
        axes.axhspan(-band, band, color="#dddddd", lw=0, label="99 % of uniform ranks")
        for name, column in zip(names, table.T, strict=True):
            axes.plot(
                x,
                np.searchsorted(np.sort(column), x, side="right") / repeats - x,
                lw=1.2,
                label=name,
            )
        axes.set(title=f"{symmetry}, {repeats} data sets", xlabel="rank of the truth", xlim=(0, 1))
        axes.legend(
            fontsize=6, loc="upper center", bbox_to_anchor=(0.5, -0.18), ncols=2, frameon=False
        )
    panels[0][0].set_ylabel("share of ranks below, less the rank")
    FIGURES.mkdir(parents=True, exist_ok=True)
    figure.savefig(FIGURES / "sbc.png", dpi=110)
    print(f"wrote {FIGURES.name}/sbc.png")


def study_truths(cases, arguments) -> int:
    """How often 90 % intervals hold the truth at one fixed crystal."""
    repeats = arguments.repeats or 200
    for case in cases:
        rng = np.random.default_rng(arguments.seed)
        moduli = case.theory(case.truth, case.euler_deg)
        of_constants, of_moduli = [], []
        for k in range(repeats):
            measured = moduli + case.sd_gpa * rng.normal(size=len(moduli))
            posterior, draws = sample(
                case, case.euler_deg, measured, case.sd_gpa, k, arguments.threads
            )
            flat = draws.reshape(-1, len(case.truth))
            low, high = np.quantile(flat, [0.05, 0.95], axis=0)
            of_constants.append((case.truth >= low) & (case.truth <= high))
            predicted, _ = posterior.moduli(flat[:: len(flat) // 1000], case.euler_deg)
            low, high = np.quantile(predicted, [0.05, 0.95], axis=0)
            of_moduli.append(np.mean((moduli >= low) & (moduli <= high)))
        shares = ", ".join(
            f"{name} {100 * share:.0f}"
            for name, share in zip(case.names, np.mean(of_constants, axis=0), strict=True)
        )
        print(
            f"{case.symmetry} at {case.truth}: coverage of 90 % intervals in %: {shares}; "
            f"moduli {100 * np.mean(of_moduli):.1f}",
            flush=True,
        )
    return 0


def random_angles(rng, count: int) -> np.ndarray:
    """Random orientations, degrees."""
    u = rng.random((count, 3))
    return np.column_stack([360 * u[:, 0], np.degrees(np.arccos(1 - 2 * u[:, 1])), 360 * u[:, 2]])


def study_next(cases, arguments) -> int:
    """Posterior after five more grains, chosen against random, with the same noise."""
    repeats, first, more = arguments.repeats or 40, 6, 5
    for case in cases:
        rng = np.random.default_rng(arguments.seed)
        exponents = np.array(list(identified_exponents(case, arguments).values()))
        sd = case.sd_gpa[0]
        sds, determinants = [], []
        for k in range(repeats):
            start, others = random_angles(rng, first), random_angles(rng, more)
            noise, later = sd * rng.normal(size=first), sd * rng.normal(size=more)
            measured = case.theory(case.truth, start) + noise
            asked = {"sd_gpa": sd, "target": TARGETS[case.symmetry], "count": more}
            posterior, draws = sample(
                case, start, measured, np.full(first, sd), k, arguments.threads, **asked
            )
            found = posterior.suggest(posterior.problem, draws.reshape(-1, len(case.truth)))
            chosen = np.array([item["euler_deg"] for item in found["suggestions"]])
            pair = []
            for angles in (chosen, others):
                after = np.append(measured, case.theory(case.truth, angles) + later)
                _, draws = sample(
                    case,
                    np.vstack([start, angles]),
                    after,
                    np.full(first + more, sd),
                    k,
                    arguments.threads,
                )
                flat = draws.reshape(-1, len(case.truth))
                block = np.cov(exponents @ np.log(flat).T)
                pair.append((flat[:, 2].std(), np.linalg.slogdet(block)[1]))
            sds.append(pair[0][0] / pair[1][0])
            determinants.append(pair[0][1] - pair[1][1])
        logs = np.log(sds)
        error, factor = logs.std(ddof=1) / np.sqrt(repeats), np.exp(logs.mean())
        print(
            f"{case.symmetry}: {repeats} repeats, {first} grains and {more} more, sd {sd:g} GPa, "
            f"chosen against random: sd of C44 {factor:.3f} (± {error * factor:.3f}) times; "
            f"log-determinant of the identified block {np.mean(determinants):+.2f} "
            f"(± {np.std(determinants, ddof=1) / np.sqrt(repeats):.2f})",
            flush=True,
        )
    return 0


if __name__ == "__main__":
    raise SystemExit(main())
