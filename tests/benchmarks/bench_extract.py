"""Bulk effective samples per CPU second of the worst constant (ArviZ): Step 2 with the exact theory
against emcee, on one thread.

Crystals of three to nine constants. emcee has stretch moves or differential evolution (not its
DESnookerMove: that of 3.1.6 does not leave a density as it is), ensembles of several sizes, starts
at the best of many points of the prior, and takes all walkers of a half ensemble in one call. It
has the model twice:

- exact theory: the core's half-space theory of every walker and grain (`bi.halfspace_modulus`,
compiled), and the core's prior
- same density: all of the compiled density, which reads the theory as Step 2 does
(`Posterior.evaluate`)

The density is the same up to the error of that reading, and so is what emcee does with it: the
chains are run with the second, and what the first would have cost more on the points of the support
is added. emcee's burn-in, a fifth of its steps, is left out. Of ours it counts with all that
adapts; beside the chains there is `extract` whole: the run that chooses how finely theory is read,
the chains of the prior and every summary too. An ensemble of which R-hat is above 1.05 is not
sampling yet and does not count.
"""

import argparse
import json
import time

import arviz as az
import numpy as np

import bayesindent as bi
from bayesindent.crystal.elasticity import constant_names, halfspace_modulus, stiffness_rows
from support.densities import EXTRACTION, PRIOR, Posterior
from support.measured_tables import read_measurements
from support.theory_cases import FILES, REFERENCE

CASES = {**FILES, "trigonal": "trigonal_quartz", "orthorhombic": "orthorhombic_forsterite"}
MOVES = {"stretch": "StretchMove", "evolution": "DEMove"}
#: R-hat up to which emcee's rate counts; generous, ours ends at 1.00.
MIXED = 1.05
#: Without bounds in the data set: relative half-width about the truth, which is at least that of a
#: fifth of the largest constant.
HALF_WIDTH, LEAST = 0.3, 0.2


def main(argv=None) -> int:
    """Run the benchmark and print its table."""
    parser = argparse.ArgumentParser(
        prog="bench extract",
        description=__doc__,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    parser.add_argument(
        "--case", choices=tuple(CASES), action="append", help="only this one; may be given again"
    )
    parser.add_argument(
        "--samples", type=int, default=50000, help="samples of each of our four chains (50000)"
    )
    parser.add_argument(
        "--walkers", type=int, nargs="*", default=[100, 500, 2000], help="sizes of emcee's ensemble"
    )
    parser.add_argument(
        "--moves", nargs="*", choices=MOVES, default=list(MOVES), help="moves of emcee (all)"
    )
    parser.add_argument(
        "--seconds", type=float, default=10.0, help="CPU seconds that emcee gets for each row (10)"
    )
    arguments = parser.parse_args(argv)
    print(
        f"{'':34}{'seconds':>9}{'effective samples':>19}{'R-hat':>8}"
        f"{'per second':>12}{'exact theory':>14}"
    )
    for name in arguments.case or CASES:
        compare(name, arguments)
    return 0


def compare(name: str, arguments) -> None:
    """The rows of one data set."""
    path, document = (
        REFERENCE / f"{CASES[name]}.csv",
        json.loads((REFERENCE / f"{CASES[name]}.json").read_text()),
    )
    table, truth = (
        read_measurements(path, name, modulus_kind="indentation_modulus"),
        np.array(document["truth"]),
    )
    width = HALF_WIDTH * np.maximum(np.abs(truth), LEAST * truth.max())
    low, high = document.get("bounds", (truth - width, truth + width))
    settings = {
        "bounds": dict(zip(constant_names(name), zip(low, high, strict=True), strict=True)),
        "surrogate": bi.Surrogate.load("halfspace"),
        "modulus_kind": "indentation_modulus",
    }
    settings |= (
        {"symmetry": name, "anisotropy_cap": document["anisotropy_cap"]}
        if "anisotropy_cap" in document
        else {"symmetry": name}
    )
    print(f"{name}, {len(truth)} constants, {len(table.modulus_gpa)} grains")
    start = time.process_time()
    found = Posterior.of(
        path, what=EXTRACTION, samples=arguments.samples, chains=4, workers=1, seed=1, **settings
    ).values["draws"]
    show("extract, 4 chains", time.process_time() - start, found)
    ours = Posterior.of(path, **settings)
    ours.read_theory(found[:, :: max(1, arguments.samples // 100)].reshape(-1, len(truth)))
    start = time.process_time()
    draws, _, _ = ours.sample(
        method="ensemble", samples=arguments.samples, burn_in=8000, chains=4, threads=1, seed=1
    )
    own = show("its chains alone", time.process_time() - start, draws)
    prior = Posterior.of(path, what=PRIOR, **settings)

    def exact(points):
        """The logarithm of the density by the theory of each grain."""
        modulus = halfspace_modulus(stiffness_rows(name, points)[:, None], table.euler_deg)
        return prior.evaluate(points)[0] - 0.5 * (
            ((modulus - table.modulus_gpa) / table.sd_gpa) ** 2
        ).sum(axis=1)

    def same(points):
        return ours.evaluate(points)[0]

    points = draws[:, :: max(1, arguments.samples // 500)].reshape(-1, len(truth))
    if np.ptp(exact(points) - same(points)) > 0.2:
        raise RuntimeError("the two densities differ")
    cost = [seconds_of(density, points) / len(points) for density in (exact, same)]
    print(
        f"  microseconds of a density: exact theory {1e6 * cost[0]:.1f}, as Step 2 reads it "
        f"{1e6 * cost[1]:.1f}"
    )
    start_points = prior.sample(
        method="ensemble", samples=5000, burn_in=4000, chains=4, threads=1, seed=2
    )[0].reshape(-1, len(truth))
    best = {}
    for move in arguments.moves:
        for walkers in arguments.walkers:
            begin = start_points[np.argsort(-same(start_points))[:walkers]]
            seconds, inside, chains = run_emcee(same, begin, arguments.seconds, move)
            row = show(f"emcee, {move}, {walkers}", seconds, chains, inside * (cost[0] - cost[1]))
            best = {kind: max(rate, row.get(kind, 0.0)) for kind, rate in best.items()} or row
    if best and own:
        ratios = (f"{kind} {own['same density'] / rate:.0f}" for kind, rate in best.items())
        print(f"  our chains against the best of emcee: {', '.join(ratios)} times")


def seconds_of(density, points) -> float:
    """Least CPU seconds of three calls."""
    seconds = []
    for _ in range(3):
        start = time.process_time()
        density(points)
        seconds.append(time.process_time() - start)
    return min(seconds)


def show(words: str, seconds: float, chains, more: float | None = None) -> dict[str, float]:
    """Print a row; effective samples per second of the worst constant, those too if each run took
    `more` seconds. None if not mixed.
    """
    ess = min(float(az.ess(chains[:, :, j])) for j in range(chains.shape[2]))
    r_hat = max(float(az.rhat(chains[:, :, j])) for j in range(chains.shape[2]))
    rates = {"same density": ess / seconds} | (
        {} if more is None else {"exact theory": ess / (seconds + more)}
    )
    print(
        f"  {words:32}{seconds:9.2f}{ess:19.0f}{r_hat:8.3f}"
        + "".join(f"{rate:{12 + 2 * k}.0f}" for k, rate in enumerate(rates.values())),
        flush=True,
    )
    return rates if r_hat <= MIXED else {}


def run_emcee(density, start, budget: float, move: str):
    """CPU seconds of emcee from some points, how many points of the support it asked for, and its
    chains (walker, step, constant).
    """
    import emcee

    walkers, k = start.shape
    inside = 0

    def counted(points):
        nonlocal inside
        values = density(points)
        inside += np.count_nonzero(np.isfinite(values))
        return values

    sampler = emcee.EnsembleSampler(
        walkers, k, counted, moves=getattr(emcee.moves, MOVES[move])(), vectorize=True
    )
    sampler.random_state = np.random.RandomState(walkers).get_state()
    begin = time.process_time()
    state = sampler.run_mcmc(start, 20)
    steps = int(20 * budget / max(time.process_time() - begin, 1e-3))
    state = sampler.run_mcmc(state, steps // 5)
    sampler.reset()
    inside = 0
    begin = time.process_time()
    sampler.run_mcmc(state, steps - steps // 5)
    return time.process_time() - begin, inside, np.swapaxes(sampler.get_chain(), 0, 1)


if __name__ == "__main__":
    raise SystemExit(main())
