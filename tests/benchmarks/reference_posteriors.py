"""Reference posteriors of three synthetic data sets, by a theory and a sampler that share nothing
with the package.

Nothing here imports bayesindent: the theory is that of reference_theory.py, the density that of
reference_density.py, and emcee samples.

Data: a trigonal, an orthorhombic and a triclinic crystal of `crystals.csv` in random orientations,
direct quadrature plus normal noise of 2 %. Prior: that of Step 2 where no bounds are stated, from
its documentation (docs/inference.md), by SciPy's densities. Sampling: coordinates of log K in an
orthonormal basis. The posteriors are ridges that bend, since the data leave 2, 3 and 6 axes open;
so a pilot run is followed by a triangular map that straightens the ridge, fitted after some of the
first rounds of 500 steps and then fixed. With 21 constants half of the steps propose, from a round
on, points of a mixture of Student's t that is fitted to the same draws, wherever a walker is (an
independence sampler; steps of differential evolution alone need thousands to forget). All before
`burn_in` is dropped. Four independent ensembles; R-hat compares their halves. The autocorrelation
time is emcee's, with the variance of all walkers; beside it stands what the variance of the
walkers' means shows, and the larger counts; both are those of the coordinates. The constants have
long tails, since the prior of log K has. So what is sampled is a root of the density, and in the
end a part of the draws is weighted by the ratio of the density with a field of degree 20 to 24,
double precision and finer quadrature, to that of the run. Effective samples are those of the
weighted means. `sd_disagreement` compares the sds of the ensembles: where tails decide it is large,
and the quantiles are what to compare.

emcee's moves are those of differential evolution, without DESnookerMove: up to emcee 3.1.6 it
divides by the root of a norm where the norm belongs and leaves a wrong distribution (variances of a
normal in ten dimensions 11 % too small; mended upstream by pull request 531).

    pip install emcee scikit-learn export OMP_NUM_THREADS=1 OPENBLAS_NUM_THREADS=1 PYTHONPATH=tests
    python -m benchmarks.reference_posteriors check          # theory and prior; a minute
    PYTHONPATH=tests python -m benchmarks.reference_posteriors trigonal       #
    tests/reference/trigonal_quartz.csv and .json PYTHONPATH=tests python -m
    benchmarks.reference_posteriors orthorhombic   # tests/reference/orthorhombic_forsterite.csv and
    .json PYTHONPATH=tests python -m benchmarks.reference_posteriors triclinic --minutes 60
    --checkpoint albite.npz   # goes on from the checkpoint
"""

import argparse
import json
import math
import time
from datetime import datetime, timezone
from pathlib import Path
from typing import NamedTuple

import numpy as np

from benchmarks.reference_density import PRIOR, LogPosterior, plain_log_prior
from support.csv_tables import ANGLES, numbers, read_rows, row_named
from support.reference_theory import (
    NAMES,
    FieldTheory,
    direct_modulus,
    kelvin,
    rotations,
    stiffness,
)
from support.tree import REFERENCE

#: Words of crystals.csv for the classes.
SYNONYMS = {
    "4/mmm": "tetragonal",
    "4/m": "tetragonal 4/m",
    "-3m": "trigonal",
    "-3": "trigonal -3",
    "mmm": "orthorhombic",
    "2/m": "monoclinic",
    "-1": "triclinic",
}


#: Moves of differential evolution: gamma0 times root 2 k, and weight.
LARGE_STEPS = ((2.38, 0.6), (1.2, 0.4))
SMALL_STEPS = ((2.38, 0.2), (1.2, 0.4), (0.6, 0.3), (0.2, 0.1))


class Case(NamedTuple):
    """A data set and the settings of its run."""

    crystal: str  # of crystals.csv
    grains: int
    seed: int
    degree: int  # of the field, and the nodes in its fundamental region
    nodes: int
    walkers: int
    burn_in: int  # steps
    # rounds after which the coordinates are fitted to the half of the chain before
    fits: tuple[int, ...]
    open: int  # axes that the data leave open, and the degree of the ridge's polynomials in them
    bends: int
    moves: tuple = SMALL_STEPS
    # of the mixture that half of the steps propose, and the round from which on they do
    parts: int = 0
    mixed: int = 0
    # degree of the field by which the draws are weighted in the end, and how many of them
    fine: int = 24
    weighted: int = 40000
    temperature: float = 2.0  # divides the logarithm of the density that is sampled


#: Degrees of freedom of the mixture's parts: tails heavier than those of a density with limits.
DOF = 12

CASES = {
    "trigonal": Case(
        "quartz",
        30,
        61,
        14,
        30,
        walkers=240,
        burn_in=3000,
        fits=(2, 4, 6),
        open=2,
        bends=4,
        moves=LARGE_STEPS,
    ),
    "orthorhombic": Case(
        "forsterite",
        40,
        62,
        12,
        36,
        walkers=120,
        burn_in=4000,
        fits=(2, 4, 8),
        open=4,
        bends=4,
        fine=20,
        weighted=40000,
    ),
    "triclinic": Case(
        "albite",
        100,
        63,
        12,
        120,
        walkers=80,
        burn_in=8000,
        fits=(2, 4, 8, 16),
        open=6,
        bends=3,
        parts=16,
        mixed=8,
        weighted=80000,
        temperature=1.4,
    ),
}
ENSEMBLES = 4
#: Steps of a round, after which the chains are saved; every which step is kept.
ROUND, THIN = 500, 5
CHECK_DEGREE = 24
NOISE = 0.02
#: Quantiles in the document.
SHARES = (0.05, 0.16, 0.5, 0.84, 0.95)


def literature(crystal: str) -> tuple[str, np.ndarray]:
    """Class and constants of a crystal of crystals.csv."""
    row = row_named(REFERENCE / "crystals.csv", crystal)
    symmetry = SYNONYMS.get(row["symmetry"], row["symmetry"])
    return symmetry, np.array([float(row[name] or 0) for name in NAMES[symmetry]])


def make_data(symmetry: str) -> str:
    """The text of a synthetic data set."""
    case = CASES[symmetry]
    _, truth = literature(case.crystal)
    rng = np.random.default_rng(case.seed)
    turn, height, spin = rng.random((3, case.grains))
    euler = np.round(
        np.column_stack([360 * turn, np.degrees(np.arccos(1 - 2 * height)), 360 * spin]), 4
    )
    modulus = direct_modulus(stiffness(symmetry, truth), euler)
    sd = np.round(NOISE * modulus, 3)
    measured = modulus + sd * rng.standard_normal(len(sd))
    listed = ", ".join(
        f"{name} {value:g}" for name, value in zip(NAMES[symmetry], truth, strict=True)
    )
    lines = [
        f"# synthetic: exact half-space theory of {case.crystal} plus normal noise of 2 %, seed "
        f"{case.seed}; indentation modulus",
        f"# truth, GPa: {listed}",
        "phi1_deg,Phi_deg,phi2_deg,modulus_gpa,sd_gpa",
    ]
    lines += [
        f"{a:.4f},{b:.4f},{c:.4f},{m:.3f},{s:.3f}"
        for (a, b, c), m, s in zip(euler, measured, sd, strict=True)
    ]
    return "\n".join(lines) + "\n"


def posterior_of(symmetry: str, data: Path, **settings) -> LogPosterior:
    """The density of a data set."""
    rows = read_rows(data)
    table = numbers(rows, rows[0])
    degree, nodes = (
        settings.pop("degree", CASES[symmetry].degree),
        settings.pop("nodes", CASES[symmetry].nodes),
    )
    return LogPosterior(
        symmetry,
        FieldTheory(symmetry, table[:, :3], degree, nodes, **settings),
        table[:, 3],
        table[:, 4],
    )


def scattered_start(
    posterior: LogPosterior, truth: np.ndarray, walkers: int, rng: np.random.Generator
) -> np.ndarray:
    """Points (walkers, k) about the truth: 1.5 times the linearised posterior, with a prior sd of
    0.5 on log K.
    """
    x0 = posterior.coordinates(truth[None])
    k, step = x0.shape[1], 1e-3
    shifted = np.concatenate([x0 + step * np.eye(k), x0 - step * np.eye(k)])
    moduli = posterior.theory.moduli(posterior.crystals(shifted))
    slope = (moduli[:k] - moduli[k:]) / (2 * step * posterior.sd)
    root = np.linalg.cholesky(np.linalg.inv(slope @ slope.T + np.eye(k) / 0.25))
    found = np.empty((0, k))
    while len(found) < walkers:
        trial = x0 + 1.5 * rng.standard_normal((walkers, k)) @ root.T
        found = np.concatenate([found, trial[np.isfinite(posterior(trial))]])
    return found[:walkers]


class Warp:
    """Coordinates y in which the posterior's ridge is straight: a triangular map fitted to draws of
    a pilot run, then fixed.

    Of the principal axes z of x, the first `open_axes` are kept; each of the others becomes (z - m)
    / s, with m and log s polynomials of the kept ones. Its Jacobian is the product of the s.
    """

    def __init__(self, x: np.ndarray, open_axes: int, degree: int):
        self.open, self.degree, self.center = open_axes, degree, x.mean(axis=0)
        values, vectors = np.linalg.eigh(np.cov(x.T))
        self.scale, self.axes = np.sqrt(values[::-1]), vectors[:, ::-1]
        z = (x - self.center) @ self.axes / self.scale
        self.span = np.abs(z[:, :open_axes]).max(axis=0)
        terms = self.terms(z[:, :open_axes], degree)
        self.mean = np.linalg.lstsq(terms, z[:, open_axes:], rcond=None)[0]
        rest = z[:, open_axes:] - terms @ self.mean
        # The mean of the logarithm of a squared normal is -1.27, a constant factor of y that
        # differential evolution does not notice.
        self.spread = np.linalg.lstsq(
            self.terms(z[:, :open_axes], 2), 0.5 * np.log(rest**2 + 1e-12), rcond=None
        )[0]

    def terms(self, z: np.ndarray, degree: int) -> np.ndarray:
        """Monomials of the kept axes up to a total degree; beyond the pilot's draws they stay what
        they were at its edge.
        """
        z = np.clip(z / self.span, -1, 1)
        columns = np.ones((1, len(z)))
        total = np.zeros(1, int)
        for axis in z.T:
            columns = np.concatenate(
                [columns[total + power <= degree] * axis**power for power in range(degree + 1)]
            )
            total = np.concatenate(
                [total[total + power <= degree] + power for power in range(degree + 1)]
            )
        return columns.T

    def forward(self, y: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """The coordinates x of y, and the log Jacobian |dx/dy| up to a constant."""
        kept = y[:, : self.open]
        log_spread = self.terms(kept, 2) @ self.spread
        z = np.column_stack(
            [
                kept,
                self.terms(kept, self.degree) @ self.mean + np.exp(log_spread) * y[:, self.open :],
            ]
        )
        return self.center + (z * self.scale) @ self.axes.T, log_spread.sum(axis=1)

    def backward(self, x: np.ndarray) -> np.ndarray:
        """The coordinates y of x."""
        z = (x - self.center) @ self.axes / self.scale
        kept = z[:, : self.open]
        return np.column_stack(
            [
                kept,
                (z[:, self.open :] - self.terms(kept, self.degree) @ self.mean)
                / np.exp(self.terms(kept, 2) @ self.spread),
            ]
        )


class Mixture:
    """A mixture of multivariate Student's t, its parts those of a normal mixture fitted to draws
    (n, k).
    """

    def __init__(self, draws: np.ndarray, parts: int):
        from sklearn.mixture import GaussianMixture

        fitted = GaussianMixture(parts, reg_covar=1e-4, max_iter=200, random_state=1).fit(draws)
        self.shares, self.means, self.roots = (
            fitted.weights_,
            fitted.means_,
            np.linalg.cholesky(fitted.covariances_),
        )
        self.inverses = np.linalg.inv(self.roots)
        self.log_scale = np.log(self.shares) - np.log(
            np.diagonal(self.roots, axis1=1, axis2=2)
        ).sum(axis=1)

    def propose(self, y: np.ndarray, rng) -> tuple[np.ndarray, np.ndarray]:
        """Points (walkers, k) that do not depend on those there are, and the log ratio of the
        densities of proposing these and those.
        """
        part = rng.choice(len(self.means), len(y), p=self.shares)
        normal = rng.standard_normal(y.shape) * np.sqrt(DOF / rng.chisquare(DOF, len(y)))[:, None]
        new = self.means[part] + np.einsum("wij,wj->wi", self.roots[part], normal)
        return new, self.log_density(y) - self.log_density(new)

    def log_density(self, y: np.ndarray) -> np.ndarray:
        """Log density (n,) at y (n, k), without a constant."""
        z = np.einsum("pij,pnj->pni", self.inverses, y - self.means[:, None])
        terms = self.log_scale[:, None] - 0.5 * (DOF + y.shape[1]) * np.log1p(
            (z**2).sum(axis=2) / DOF
        )
        top = terms.max(axis=0)
        return top + np.log(np.exp(terms - top).sum(axis=0))


class Run:
    """Independent ensembles of emcee, advanced in rounds and saved after each."""

    def __init__(
        self, symmetry: str, posterior: LogPosterior, truth: np.ndarray, checkpoint: Path | None
    ):
        self.case, self.posterior, self.checkpoint = CASES[symmetry], posterior, checkpoint
        self.mixture: Mixture | None = None
        walkers, seed = self.case.walkers, self.case.seed
        if checkpoint and checkpoint.exists():
            saved = np.load(checkpoint)
            self.chain, self.last, self.rounds, self.seconds = (
                saved["chain"],
                saved["last"],
                int(saved["rounds"]),
                float(saved["seconds"]),
            )
            self.accepted = float(saved["accepted"])
            return
        starts = [
            scattered_start(posterior, truth, walkers, np.random.default_rng([seed, e]))
            for e in range(ENSEMBLES)
        ]
        self.last = np.array(starts)  # ensembles, walkers, k
        # ensembles, kept steps, walkers, k
        self.chain = np.empty((ENSEMBLES, 0, walkers, self.last.shape[2]))
        self.rounds, self.seconds, self.accepted = 0, 0.0, 0.0

    def warp(self) -> Warp | None:
        """The map for the next round: from the half of the chain before the latest fit, which the
        chain determines.
        """
        x = self.pilot()
        return Warp(x, self.case.open, self.case.bends) if len(x) else None

    def pilot(self) -> np.ndarray:
        """The draws (n, k) to which the next round's proposals are fitted, none before the first
        fit.
        """
        fits = [0, *(fit for fit in self.case.fits if fit <= self.rounds)]
        x = self.chain[:, fits[-1] // 2 * ROUND // THIN : fits[-1] * ROUND // THIN].reshape(
            -1, self.last.shape[2]
        )
        return x[:: 1 + len(x) // 60000]

    def moves(self, warp: Warp | None) -> list:
        """emcee's moves for the next round, with their weights."""
        import emcee

        k = self.last.shape[2]
        local = [
            (emcee.moves.DEMove(gamma0=gamma / math.sqrt(2 * k)), weight)
            for gamma, weight in self.case.moves
        ]
        if not self.case.parts or self.rounds < self.case.mixed:
            return local
        if self.mixture is None or self.rounds in self.case.fits:
            self.mixture = Mixture(warp.backward(self.pilot()), self.case.parts)
        return [
            *((move, 0.5 * weight) for move, weight in local),
            (emcee.moves.MHMove(self.mixture.propose), 0.5),
        ]

    def advance(self) -> None:
        """One round: each ensemble goes on from where it was, with a random stream of its own."""
        import emcee

        begin, kept, warp = time.process_time(), [], self.warp()

        def density(y):
            x, log_jacobian = warp.forward(y) if warp else (y, 0.0)
            return self.posterior(x) / self.case.temperature + log_jacobian

        k, moves = self.last.shape[2], self.moves(warp)
        for e in range(ENSEMBLES):
            sampler = emcee.EnsembleSampler(
                self.case.walkers, k, density, moves=moves, vectorize=True
            )
            sampler.random_state = np.random.RandomState(
                [self.case.seed, e, self.rounds]
            ).get_state()
            start = warp.backward(self.last[e]) if warp else self.last[e]
            sampler.run_mcmc(start, ROUND // THIN, thin_by=THIN, skip_initial_state_check=True)
            y = sampler.get_chain()
            x = warp.forward(y.reshape(-1, k))[0].reshape(y.shape) if warp else y
            self.last[e] = x[-1]
            kept.append(x)
            self.accepted = sampler.acceptance_fraction.mean()
        self.chain = np.concatenate([self.chain, np.array(kept)], axis=1)
        self.rounds += 1
        self.seconds += time.process_time() - begin
        if self.checkpoint:
            beside = self.checkpoint.with_suffix(".new.npz")
            np.savez(
                beside,
                chain=self.chain,
                last=self.last,
                rounds=self.rounds,
                seconds=self.seconds,
                accepted=self.accepted,
            )
            beside.replace(self.checkpoint)

    def draws(self) -> np.ndarray:
        """Coordinates (ensembles, kept steps, walkers, k) after the burn-in."""
        return self.chain[:, self.case.burn_in // THIN :]


def autocorrelation(draws: np.ndarray) -> np.ndarray:
    """Integrated autocorrelation time of each coordinate, in kept steps: emcee's, with mean and
    variance of all walkers, not of each its own.

    A walker that does not move counts in full, and short chains are not flattered: infinite where
    the sum ends before five times itself.
    """
    steps, k = draws.shape[1], draws.shape[3]
    length = 2 ** math.ceil(math.log2(2 * steps))
    times = np.empty(k)
    for constant in range(k):
        series = draws[..., constant] - draws[..., constant].mean()
        spectrum = np.abs(np.fft.rfft(series, length, axis=1)) ** 2
        covariance = np.fft.irfft(spectrum.mean(axis=(0, 2)), length)[:steps] / np.arange(
            steps, 0, -1
        )
        summed = 2 * np.cumsum(covariance / covariance[0]) - 1
        wide = np.flatnonzero(np.arange(steps) >= 5 * summed)
        times[constant] = max(summed[wide[0]], 1.0) if len(wide) else np.inf
    return times


def walkers_disagree(draws: np.ndarray) -> np.ndarray:
    """The autocorrelation time, in kept steps, that the variance of the walkers' means shows: no
    window, no assumption on its form.
    """
    means = draws.mean(axis=1).reshape(-1, draws.shape[3])
    return (
        draws.shape[1] * means.var(axis=0, ddof=1) / draws.reshape(-1, draws.shape[3]).var(axis=0)
    )


def split_r_hat(draws: np.ndarray) -> np.ndarray:
    """R-hat of each coordinate over the halves in time of the ensembles, the walkers of one
    pooled.
    """
    half = draws.shape[1] // 2
    chains = np.concatenate([draws[:, :half], draws[:, half : 2 * half]])
    chains = chains.reshape(len(chains), -1, draws.shape[3])
    within = chains.var(axis=1, ddof=1).mean(axis=0)
    return np.sqrt(1 + chains.mean(axis=1).var(axis=0, ddof=1) / within)


def sample(symmetry: str, arguments) -> None:
    """Make the data if they are missing, sample until there is enough, write the document."""
    name = f"{symmetry}_{CASES[symmetry].crystal}"
    data = arguments.output / f"{name}.csv"
    if not data.exists():
        data.write_text(make_data(symmetry), encoding="utf-8")
    posterior, truth = posterior_of(symmetry, data), literature(CASES[symmetry].crystal)[1]
    run = Run(symmetry, posterior, truth, arguments.checkpoint)
    end = time.monotonic() + 60 * arguments.minutes
    while True:
        steps = run.rounds * ROUND - run.case.burn_in
        line = f"{run.rounds * ROUND} steps, {run.seconds:.0f} s, acceptance {run.accepted:.3f}"
        if steps >= ROUND and (run.rounds % 4 == 0 or time.monotonic() > end):
            draws = run.draws()
            tau, means = THIN * autocorrelation(draws), THIN * walkers_disagree(draws)
            effective = ENSEMBLES * steps * run.case.walkers / np.maximum(tau, means)
            line += (
                f", autocorrelation {tau.max():.1f} ({means.max():.1f}), effective "
                f"{effective.min():.0f}"
            )
            line += f", R-hat {split_r_hat(draws).max():.4f}"
            if time.monotonic() > end or (
                effective.min() >= arguments.effective and steps >= 20 * means.max()
            ):
                break
        print(line, flush=True)
        run.advance()
    print(line)
    document = document_of(symmetry, posterior, run, draws)
    (arguments.output / f"{name}.json").write_text(
        json.dumps(document, indent=1) + "\n", encoding="utf-8"
    )


class Weighted:
    """Constants of draws (ensembles, kept steps, walkers, k), weighted by the ratio of the density
    with a fine theory to that of the run.
    """

    def __init__(self, case: Case, posterior: LogPosterior, draws: np.ndarray):
        x = draws[:, :: max(1, draws[..., 0].size // case.weighted)]
        flat = self.flat = posterior.crystals(x.reshape(-1, x.shape[3]))
        self.draws = flat.reshape(x.shape)
        symmetry, euler = posterior.theory.symmetry, posterior.theory.euler_deg
        nodes = 3 * (case.fine + 1) * (case.fine + 2) // (4 * len(rotations(symmetry)))
        fine = FieldTheory(
            symmetry, euler, case.fine, nodes, points=32, angles=32, newton=6, precision=float
        )
        self.moduli = np.concatenate(
            [fine.moduli(part) for part in np.array_split(flat, math.ceil(len(flat) / 200))]
        )
        exact = -0.5 * (((self.moduli - posterior.modulus) / posterior.sd) ** 2).sum(axis=1)
        sampled = posterior.log_likelihood(flat)
        change = exact - sampled
        prior = posterior.log_prior(x.reshape(-1, x.shape[3]))
        log_weight = exact + prior - (sampled + prior) / case.temperature
        self.weight = np.exp(log_weight - log_weight.max())
        self.weight /= self.weight.mean()
        self.change_sd, self.change_most = (
            float(change.std()),
            float(np.abs(change - change.mean()).max()),
        )
        self.mean, self.covariance = (
            np.average(flat, axis=0, weights=self.weight),
            np.cov(flat.T, aweights=self.weight),
        )
        self.sd = np.sqrt(np.diag(self.covariance))

    def predicted(self) -> tuple[np.ndarray, np.ndarray]:
        """Posterior mean and sd of each grain's modulus, by the fine theory."""
        mean = np.average(self.moduli, axis=0, weights=self.weight)
        return mean, np.sqrt(np.average((self.moduli - mean) ** 2, axis=0, weights=self.weight))

    def effective(self) -> np.ndarray:
        """Effective samples of each constant's mean: its variance over that of the weighted mean,
        autocorrelation included.
        """
        influence = (self.draws - self.mean) * self.weight.reshape(*self.draws.shape[:3], 1)
        time = np.maximum(autocorrelation(influence), walkers_disagree(influence))
        return self.sd**2 * len(self.flat) / (influence.reshape(self.flat.shape).var(axis=0) * time)

    def quantiles(self, shares: tuple[float, ...]) -> np.ndarray:
        """(shares, k) of the constants."""
        order = np.argsort(self.flat, axis=0)
        below = np.cumsum(self.weight[order], axis=0) / self.weight.sum()
        columns = zip(np.take_along_axis(self.flat, order, axis=0).T, below.T, strict=True)
        return np.array([np.interp(shares, summed, values) for values, summed in columns]).T

    def disagreement(self) -> np.ndarray:
        """Largest relative difference of the sd of one ensemble from that of all."""
        weights = self.weight.reshape(len(self.draws), -1)
        parts = self.draws.reshape(len(self.draws), -1, self.draws.shape[3])
        sds = [
            np.sqrt(np.diag(np.cov(part.T, aweights=weight)))
            for part, weight in zip(parts, weights, strict=True)
        ]
        return np.abs(np.array(sds) / self.sd - 1).max(axis=0)


def document_of(symmetry: str, posterior: LogPosterior, run: Run, draws: np.ndarray) -> dict:
    """What the reference says, and how it was come by."""
    case, weighted = CASES[symmetry], Weighted(CASES[symmetry], posterior, draws)
    sd, effective = weighted.sd, weighted.effective()
    predicted_mean, predicted_sd = weighted.predicted()
    values = {
        "mean": weighted.mean,
        "sd": sd,
        "sd_disagreement": weighted.disagreement(),
        "quantiles": weighted.quantiles(SHARES),
        "corr": weighted.covariance / np.outer(sd, sd),
        "predicted_mean": predicted_mean,
        "predicted_sd": predicted_sd,
        "mean_standard_error": sd / np.sqrt(effective),
        "effective_samples": np.floor(effective),
        "autocorrelation_steps": THIN * autocorrelation(draws),
        "autocorrelation_steps_by_walkers": THIN * walkers_disagree(draws),
        "split_r_hat": split_r_hat(draws),
    }
    return {
        "symmetry": symmetry,
        "crystal": case.crystal,
        "modulus_kind": "indentation_modulus",
        "order": NAMES[symmetry],
        "truth": literature(case.crystal)[1].tolist(),
        "prior": {**PRIOR, "scale_mean": round(posterior.middle, 4)},
        "quantile_shares": SHARES,
        **{key: np.round(value, 4).tolist() for key, value in values.items()},
        "weights": {
            "draws": len(weighted.flat),
            "field_degree": case.fine,
            "temperature": case.temperature,
            "log_theory_sd": round(weighted.change_sd, 4),
            "log_theory_largest": round(weighted.change_most, 4),
            "effective_share": round(1 / float((weighted.weight**2).mean()), 4),
        },
        "method": (
            f"emcee, differential evolution{' and an independence sampler' * bool(case.parts)}; "
            "draws weighted by the density with a finer theory"
        ),
        "settings": {
            "ensembles": ENSEMBLES,
            "walkers": case.walkers,
            "steps": run.rounds * ROUND,
            "burn_in": case.burn_in,
            "kept_every": THIN,
            "moves": [
                {"DEMove_gamma0": f"{gamma} / sqrt(2 k)", "weight": weight}
                for gamma, weight in case.moves
            ],
            **(
                {
                    "independence": {
                        "parts": case.parts,
                        "share": 0.5,
                        "from_step": case.mixed * ROUND,
                    }
                }
                if case.parts
                else {}
            ),
            "acceptance": round(run.accepted, 3),
            "field_degree": case.degree,
            "field_nodes": case.nodes,
            "seed": case.seed,
            "cpu_seconds": round(run.seconds),
            "date": datetime.now(timezone.utc).strftime("%Y-%m-%d"),
        },
        "note": (
            "synthetic; GPa; predicted_* are the posterior mean and sd of the modulus of each grain"
        ),
    }


def check() -> None:
    """Theory against the table of moduli and itself, the Jacobian against finite differences, the
    prior against its definition.
    """
    table = read_rows(REFERENCE / "crystal_moduli.csv")
    print(f"{'largest relative difference':32}{'direct, table':>15}{'field, direct':>15}")
    for crystal in dict.fromkeys(row["name"] for row in table):
        rows = [row for row in table if row["name"] == crystal]
        euler = numbers(rows, ANGLES)
        expected = np.array([float(row["M_elliptic"]) for row in rows])
        symmetry, constants = literature(crystal)
        direct = direct_modulus(stiffness(symmetry, constants), euler)
        nodes = 500 // len(rotations(symmetry))
        field = FieldTheory(
            symmetry, euler, CHECK_DEGREE, nodes, points=32, angles=32, newton=6, precision=float
        ).moduli(constants[None])[0]
        of_direct = np.abs(direct / expected - 1).max()
        of_field = np.abs(field / direct - 1).max()
        print(f"{crystal:20}{symmetry:15}{of_direct:12.1e}{of_field:15.1e}")
    for symmetry in CASES:
        check_density(symmetry)


def check_density(symmetry: str) -> None:
    """The density of one class at scattered crystals."""
    rng = np.random.default_rng(5)
    _, truth = literature(CASES[symmetry].crystal)
    euler = np.degrees(rng.random((20, 3)) * [2 * math.pi, math.pi, 2 * math.pi])
    modulus = direct_modulus(stiffness(symmetry, truth), euler)
    posterior = LogPosterior(
        symmetry,
        FieldTheory(symmetry, euler, CASES[symmetry].degree, CASES[symmetry].nodes),
        modulus,
        NOISE * modulus,
    )
    x = posterior.coordinates(truth[None])
    round_trip = np.abs(posterior.crystals(x) - truth).max()
    x = x + 0.15 * rng.standard_normal((20, x.shape[1]))
    constants = posterior.crystals(x)
    theory = np.array([direct_modulus(stiffness(symmetry, c), euler[:5]) for c in constants])
    error = np.abs(posterior.theory.moduli(constants)[:, :5] / theory - 1).max()
    prior = np.abs(
        posterior.log_prior(x)
        - [
            plain_log_prior(kelvin(stiffness(symmetry, c)), len(c), modulus.mean())
            for c in constants
        ]
    )
    print(
        f"{symmetry}: constants there and back {round_trip:.1e} GPa, log prior "
        f"{prior.max():.1e}, theory as sampled {error:.1e}"
    )


def main(argv=None) -> int:
    """Run the checks or one of the cases."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("what", choices=["check", *CASES])
    parser.add_argument(
        "--output",
        type=Path,
        default=REFERENCE,
        help="folder of the data and the documents (tests/reference)",
    )
    parser.add_argument(
        "--minutes",
        type=float,
        default=30.0,
        help="end after the round that exceeds this time (30)",
    )
    parser.add_argument(
        "--effective",
        type=float,
        default=15000.0,
        help="effective samples of the worst coordinate that are enough (15000)",
    )
    parser.add_argument(
        "--checkpoint", type=Path, help="file (.npz) of the chains, from which a run goes on"
    )
    arguments = parser.parse_args(argv)
    if arguments.what == "check":
        check()
    else:
        sample(arguments.what, arguments)
    return 0


if __name__ == "__main__":
    raise SystemExit(main())
