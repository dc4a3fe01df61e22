"""Bulk effective samples per second of the worst constant (ArviZ), default sampler and the paper's against emcee, on one thread.

Both reference data sets, flat prior, surrogate uncertainty off, the same surrogate for all: dimensionless, fitted to the half-space
theory. emcee has its default move (stretch), differential evolution with snooker moves, and a kernel density, each with ensembles of several
sizes, on two densities: the core's, which both samplers here use, and one of vectorised NumPy, checked against it. Both are evaluated
for all walkers of a half ensemble in one call. What the samplers here are measured by is emcee's best on the core's density, of the
ensembles whose R-hat is below 1.05; the NumPy one tells what the language costs. emcee's burn-in, a fifth of the steps, is left out of its time and samples; ours, with all
that adapts, counts. Seconds are CPU seconds of the process, which other work on the machine disturbs less; the timings on two threads
at the end are wall clock.
"""

import argparse
import itertools
import time
import warnings

import arviz as az
import numpy as np
from theory_cases import SYMMETRIES, Case

from bayesindent.inference.posterior import Posterior

#: Moves of emcee and their weights; those of differential evolution are what emcee's documentation recommends for hard targets.
MOVES = {"stretch": [("StretchMove", 1.0)], "evolution": [("DEMove", 0.8), ("DESnookerMove", 0.2)], "kernel density": [("KDEMove", 1.0)]}


#: R-hat below which emcee's rate counts; ours ends at 1.000.
MIXED = 1.05


def main(argv=None) -> int:
    """Run the benchmark and print its tables."""
    parser = argparse.ArgumentParser(prog="bench extract", description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--samples", type=int, default=50000, help="samples per chain of the two samplers here (50000)")
    parser.add_argument("--walkers", type=int, nargs="*", default=[32, 100, 300, 1000], help="sizes of emcee's ensemble")
    parser.add_argument("--moves", nargs="*", choices=MOVES, default=list(MOVES), help="moves of emcee (all)")
    parser.add_argument("--seconds", type=float, default=5.0, help="CPU seconds that emcee gets for each row (5)")
    parser.add_argument("--repeats", type=int, default=3, help="runs of each timing on two threads; the fastest counts (3)")
    arguments = parser.parse_args(argv)
    print(f"{'':36}{'seconds':>9}{'effective samples':>19}{'per second':>12}{'R-hat':>8}{'of best emcee':>15}")
    cases = {symmetry: Case(symmetry) for symmetry in SYMMETRIES}
    for case in cases.values():
        compare(case, arguments)
    print()
    print("4 chains of 50,000 samples of the paper's sampler, wall clock:")
    for case in cases.values():
        threads_table(case, arguments)
    return 0


def compare(case: Case, arguments) -> None:
    """Effective samples per second of all contestants on one data set."""
    posterior = Posterior.of(case.table, surrogate=case.surrogate, surrogate_variance="none", **case.settings)
    log_posterior = numpy_posterior(case)
    agree(case, posterior, log_posterior)
    print(f"{case.symmetry}, {len(case.modulus_gpa)} grains")
    densities = {"core": lambda points: posterior.evaluate(points)[0], "NumPy": log_posterior}
    best = dict.fromkeys(densities)
    for (language, density), move, walkers in itertools.product(densities.items(), arguments.moves, arguments.walkers):
        try:
            row = run_emcee(case, density, walkers, arguments.seconds, move)
        except ImportError:
            print("  emcee is not installed")
            break
        show(f"emcee, {language}, {move}, {walkers}", row, None)
        # An ensemble that is far from mixed has no effective samples to speak of; the limit is generous.
        if row[2] < MIXED and (best[language] is None or row[1] / row[0] > best[language][1] / best[language][0]):
            best[language] = row
    for language, row in best.items():
        if row:
            show(f"best of emcee, {language}", row, best["core"])
    for method, words in (("ensemble", "default sampler, 4 chains"), ("scmh", "the paper's sampler, 4 chains")):
        start = time.process_time()
        draws, _, _ = posterior.sample(method=method, samples=arguments.samples, burn_in=20000, chains=4, threads=1, seed=1)
        show(words, worst(draws, time.process_time() - start), best["core"])


def worst(chains, seconds: float) -> tuple[float, float, float]:
    """CPU seconds, effective samples and R-hat of the constant that has mixed worst."""
    ess = min(float(az.ess(chains[:, :, j])) for j in range(chains.shape[2]))
    return seconds, ess, max(float(az.rhat(chains[:, :, j])) for j in range(chains.shape[2]))


def show(name: str, row: tuple, reference: tuple | None) -> None:
    """Print one line."""
    seconds, ess, r_hat = row
    ratio = f"{ess / seconds / (reference[1] / reference[0]):15.2f}" if reference else ""
    print(f"  {name:34}{seconds:9.3f}{ess:19.0f}{ess / seconds:12.0f}{r_hat:8.3f}{ratio}", flush=True)


def run_emcee(case: Case, log_posterior, walkers: int, budget: float, move: str) -> tuple[float, float, float]:
    """emcee from the best of many points drawn from the prior."""
    import emcee

    moves = [(getattr(emcee.moves, name)(), weight) for name, weight in MOVES[move]]
    rng = np.random.default_rng(walkers)
    points = case.lower + (case.upper - case.lower) * rng.random((20 * walkers, len(case.names)))
    start = points[np.argsort(-log_posterior(points))[:walkers]]
    sampler = emcee.EnsembleSampler(walkers, len(case.names), log_posterior, moves=moves, vectorize=True)
    sampler.random_state = np.random.RandomState(walkers).get_state()
    begin = time.process_time()
    state = sampler.run_mcmc(start, 100)
    steps = int(budget / max(time.process_time() - begin, 1e-3) * 100)
    state = sampler.run_mcmc(state, steps // 5)
    sampler.reset()
    begin = time.process_time()
    sampler.run_mcmc(state, steps - steps // 5)
    seconds = time.process_time() - begin
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        return worst(np.swapaxes(sampler.get_chain(), 0, 1), seconds)


def numpy_posterior(case: Case):
    """The log posterior of many points at once, as a NumPy user would write it with care."""
    surrogate, basis = case.surrogate, case.surrogate.basis
    m, degree = len(basis.lower), basis.degree
    # The order of the products: by total degree, the last coordinate fastest.
    degrees = np.array(sorted((c for c in itertools.product(range(degree + 1), repeat=m) if sum(c) <= degree), key=lambda c: (sum(c), c)))
    # The first terms are the harmonics, since the first polynomial is 1.
    n_harmonics = np.count_nonzero(basis.polynomial_degrees == 0)
    harmonics = basis.terms(np.tile(case.truth, (len(case.euler_deg), 1)), case.euler_deg)[0][:n_harmonics]
    matrix = harmonics.T @ surrogate.coefficients.reshape(-1, n_harmonics).T
    norms = np.sqrt(2 * np.arange(degree + 1) + 1)[:, None, None]
    middle, half = (basis.lower + basis.upper)[:, None] / 2, (basis.upper - basis.lower)[:, None] / 2
    weight = 1 / case.sd_gpa[:, None]
    prepare = {"cubic": prepare_cubic, "hexagonal": prepare_hexagonal}[case.symmetry]
    cap = case.settings["anisotropy_cap"]

    def log_posterior(points):
        result = np.full(len(points), -np.inf)
        inside = np.flatnonzero(((points >= case.lower) & (points <= case.upper)).all(axis=1))
        chosen, scale, raw = prepare(points[inside].T, cap)
        inside = inside[chosen]
        if not len(inside):
            return result
        x = (raw - middle) / half
        factors = np.ones((degree + 1, *x.shape))
        factors[1] = x
        for n in range(1, degree):
            factors[n + 1] = ((2 * n + 1) * x * factors[n] - n * factors[n - 1]) / (n + 1)
        factors *= norms
        products = factors[degrees[:, 0], 0]
        for i in range(1, m):
            products = products * factors[degrees[:, i], i]
        residual = (scale * np.exp(matrix @ products) - case.modulus_gpa[:, None]) * weight
        result[inside] = np.where((np.abs(x) <= 1).all(axis=0), -0.5 * np.einsum("ij,ij->j", residual, residual), -np.inf)
        return result

    return log_posterior


def prepare_cubic(c, cap: float):
    """Which crystals are admissible, and of these the scale and the raw coordinates."""
    c11, c12, c44 = c
    shear = 0.5 * (c11 - c12)
    with np.errstate(all="ignore"):
        zener = c44 / shear
        chosen = (shear > 0) & (c11 + 2 * c12 > 0) & (1.2 * (np.sqrt(zener) - 1 / np.sqrt(zener)) ** 2 <= cap)
    c11, c12, c44 = c[:, chosen]
    bulk, scale = (c11 + 2 * c12) / 3, (c11 - c12 + 3 * c44) / 5
    return chosen, scale, np.array([bulk / (bulk + scale), np.log(zener[chosen])])


def prepare_hexagonal(c, cap: float):
    """Which crystals are admissible, and of these the scale and the raw coordinates."""
    c11, c12, c44, c33, c13 = c
    c66, basal = 0.5 * (c11 - c12), c11 + c12
    det, shear = basal * c33 - 2 * c13**2, basal + 2 * c33 - 4 * c13
    with np.errstate(all="ignore"):
        kv, gv, kr = (2 * basal + 4 * c13 + c33) / 9, (shear + 12 * c44 + 12 * c66) / 30, det / shear
        gr = 2.5 * det * c44 * c66 / (3 * kv * c44 * c66 + det * (c44 + c66))
        chosen = (c66 > 0) & (det > 0) & (5 * gv / gr + kv / kr - 6 <= cap)
    c11, c12, c44, c33, c13 = c[:, chosen]
    c66 = c66[chosen]
    r = np.sqrt(c11 * c33)
    a, b = r - c13, r + c13
    shears = c44 * c66
    return chosen, (a * b * shears) ** 0.25, np.array([np.log(a / b), np.log(c44 / c66), np.log(a * b / shears), np.log(c33 / c11)])


def agree(case: Case, posterior: Posterior, log_posterior) -> None:
    """Both densities are the same up to a constant."""
    points = case.lower + (case.upper - case.lower) * np.random.default_rng(0).random((2000, len(case.names)))
    ours, theirs = posterior.evaluate(points)[0], log_posterior(points)
    if (np.isfinite(ours) != np.isfinite(theirs)).any():
        raise RuntimeError("the two densities have different supports")
    inside = np.isfinite(ours)
    difference = ours[inside] - theirs[inside]
    if np.ptp(difference) > 1e-6 * np.abs(ours[inside]).max():
        raise RuntimeError("the two densities differ")


def threads_table(case: Case, arguments) -> None:
    """The paper's sampler on one thread and two, with and without the surrogate's uncertainty: wall clock, and CPU seconds of all threads,
    which are the same where threads do not disturb each other and which a busy machine leaves alone."""
    for variance in ("none", "full"):
        posterior = Posterior.of(case.table, surrogate=case.surrogate, surrogate_variance=variance, **case.settings)
        wall, cpu = {}, {}
        for threads in (1, 2) * arguments.repeats:
            start, used = time.perf_counter(), time.process_time()
            posterior.sample(method="scmh", samples=50000, burn_in=5000, chains=4, threads=threads, seed=1)
            wall[threads] = min(wall.get(threads, np.inf), time.perf_counter() - start)
            cpu[threads] = min(cpu.get(threads, np.inf), time.process_time() - used)
        print(
            f"  {case.symmetry}, {len(case.modulus_gpa)} grains, surrogate_variance '{variance}': one thread {wall[1]:.2f} s (CPU "
            f"{cpu[1]:.2f}), two threads {wall[2]:.2f} s (CPU {cpu[2]:.2f}), {wall[1] / wall[2]:.2f} times as fast",
            flush=True,
        )


if __name__ == "__main__":
    raise SystemExit(main())
