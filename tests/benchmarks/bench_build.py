"""Choosing a simulation and learning from it, on one thread and in one run, beside numpy and
scikit-learn with like work.

A step is: a candidate is chosen by the variances of all, its modulus becomes data, and mean,
covariance and the variances of all candidates are those of the new posterior. Moduli are those of
the half-space theory, since no simulation is timed here. Times are CPU times of the process, which
other work on the machine disturbs less.

Alpha and beta frozen, the hexagonal paper case (729 terms, 3200 candidates):
- update: this package.
- Cholesky: numpy and scipy; the Gram matrix is updated, factored anew, and solved for the
candidates' variances. Alpha and beta anew, the paper case and the correction (141 terms, 20
points), of 3200 and of 100,000 candidates:
- step: this package, at frozen alpha and beta, the choice included; of a correction by the mean
variance that it leaves.
- refit: this package; the evidence is maximised (of a correction over the fall of the prior, too),
then the posterior and all variances.
- BayesianRidge: scikit-learn fits alpha, beta and the posterior, and predicts the sd of the
candidates. It has no prior that falls with the
  degree: the terms of a correction are given to it with the widths that this package has found.
"""

import argparse
import time
from contextlib import nullcontext

import numpy as np
from scipy.linalg import cho_factor, solve_triangular

from bayesindent.crystal.elasticity import halfspace_modulus, stiffness_rows
from bayesindent.surrogate.basis import Basis
from support.learner import Learner, spread_crystals, terms_of, to_y
from support.paper_domains import DOMAINS

#: Candidates of which scikit-learn predicts at a time.
BLOCK = 4000


def main(argv=None) -> int:
    """Run the benchmark and print a table."""
    parser = argparse.ArgumentParser(
        prog="bench build",
        description=__doc__,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    parser.add_argument(
        "--initial", type=int, default=760, help="points before the first step (760)"
    )
    parser.add_argument("--steps", type=int, default=2040, help="sequential steps (1440 + 600)")
    parser.add_argument(
        "--candidates", type=int, default=3200, help="points in all to choose from (3200)"
    )
    parser.add_argument(
        "--many",
        type=int,
        nargs="+",
        default=[3200, 100_000],
        help="numbers of candidates of a refit (3200 100000)",
    )
    parser.add_argument("--refits", type=int, default=3, help="refits timed of each (3)")
    arguments = parser.parse_args(argv)
    with one_thread():
        return run(arguments)


def one_thread():
    """All contestants' BLAS on one thread, where threadpoolctl (which comes with scikit-learn) can
    see to it.
    """
    try:
        from threadpoolctl import threadpool_limits
    except ImportError:
        return nullcontext()
    return threadpool_limits(1)


def run(arguments: argparse.Namespace) -> int:
    """Run the benchmark."""
    basis = Basis.from_keywords(
        "hexagonal", DOMAINS["hexagonal"], model="paper", truncation="tensor", degree=2, bandlimit=4
    )
    constants, angles = spread_crystals(basis, arguments.candidates, 1)
    # Of a uniform direction the declination's cosine is uniform; the paper's declination is.
    angles = np.column_stack(
        [0 * angles[:, 0], 90 * (1 - np.cos(np.radians(angles[:, 1]))), 0 * angles[:, 2]]
    )
    terms, _ = terms_of(basis, constants, angles)
    modulus = halfspace_modulus(stiffness_rows("hexagonal", constants), angles)
    print(
        f"{basis.n_terms} terms, {len(modulus)} candidates, {arguments.initial} + "
        f"{arguments.steps} points, one thread"
    )

    learner = Learner(basis)
    first = np.arange(arguments.initial)
    learner.set_candidates(constants[len(first) :], angles[len(first) :], "modulus")
    learner.add(constants[first], angles[first], modulus[first], chosen=True)
    learner.fit()
    order = list(first)
    start = time.process_time()
    for _ in range(arguments.steps):
        chosen = learner.choose(1)[0] + len(first)
        learner.add(constants[chosen], angles[chosen], modulus[chosen], chosen=True)
        learner.update()
        order.append(int(chosen[0]))
    step = (time.process_time() - start) / arguments.steps

    cholesky, difference = time_cholesky(terms, modulus, np.array(order), arguments.refits, learner)
    print(
        "largest difference of mean and variances from a refit after all steps: "
        f"{difference:.1e} (relative)"
    )
    print_table("alpha, beta frozen", {"update": step, "Cholesky refit": cholesky})
    points = arguments.initial + arguments.steps // 2
    for name, model, rule, n in (
        ("paper", basis, "variance", points),
        ("correction", Basis.from_keywords(), "imse", 20),
    ):
        for candidates in arguments.many:
            print_table(
                f"{name}: {model.n_terms} terms, {n} points, {candidates} candidates",
                time_fit(model, rule, n, candidates, arguments.refits),
            )
    return 0


def print_table(title: str, seconds: dict[str, float]) -> None:
    """Milliseconds of each, and how many times those of the refit, or of the first."""
    print(f"{title:60}{'ms':>10}{'times':>10}")
    first = seconds.get("refit", next(iter(seconds.values())))
    for name, value in seconds.items():
        print(f"  {name:58}{1e3 * value:10.2f}{value / first:10.2f}", flush=True)


def time_fit(basis: Basis, rule: str, n: int, candidates: int, repeats: int) -> dict[str, float]:
    """Seconds of what is done once, at a step, and at a refit, with n points and so many
    candidates.
    """
    constants, angles = spread_crystals(basis, n, 1)
    modulus = halfspace_modulus(stiffness_rows(basis.symmetry, constants), angles)
    learner, others = Learner(basis), spread_crystals(basis, candidates, 2)
    seconds = {"terms of the candidates": timed(lambda: learner.set_candidates(*others, rule), 1)}
    learner.add(constants, angles, modulus, chosen=True)
    seconds["refit"] = timed(learner.fit, repeats)
    width = learner.values("prior_width")

    def step() -> None:
        chosen, _ = learner.choose(1)
        learner.add(
            others[0][chosen],
            others[1][chosen],
            halfspace_modulus(stiffness_rows(basis.symmetry, others[0][chosen]), others[1][chosen]),
        )
        learner.update()

    seconds["step"] = timed(step, 3 * repeats)
    terms, scale = terms_of(basis, constants, angles)
    if (ridge := bayesian_ridge()) is not None:
        rows, y = np.ascontiguousarray((width[:, None] * terms).T), to_y(basis, modulus, scale)
        blocks = [slice(i, i + BLOCK) for i in range(0, candidates, BLOCK)]
        wide = [
            np.ascontiguousarray(
                (width[:, None] * terms_of(basis, others[0][block], others[1][block])[0]).T
            )
            for block in blocks
        ]

        def refit() -> None:
            fitted = ridge.fit(rows, y)
            for block in wide:
                fitted.predict(block, return_std=True)

        seconds["BayesianRidge"] = timed(refit, repeats)
    return seconds


def timed(work, repeats: int) -> float:
    """CPU seconds of some work, the mean of repeats."""
    start = time.process_time()
    for _ in range(repeats):
        work()
    return (time.process_time() - start) / repeats


def bayesian_ridge():
    """scikit-learn's, or None without it."""
    try:
        from sklearn.linear_model import BayesianRidge
    except ImportError:
        print("scikit-learn is not installed: no comparison with BayesianRidge")
        return None
    return BayesianRidge(fit_intercept=False)


def time_cholesky(terms, y, data, refits: int, learner: Learner) -> tuple[float, float]:
    """Seconds of a refit by Cholesky factorisation at the learner's alpha and beta, and how far the
    updated posterior is from it.
    """
    n, precisions = len(terms), learner.precisions()
    alpha, beta = precisions["alpha"], precisions["beta"]
    matrix = alpha * np.eye(n) + beta * terms[:, data] @ terms[:, data].T
    moment = beta * terms[:, data] @ y[data]
    last = terms[:, data[-1]]
    start = time.process_time()
    for _ in range(refits):
        # A rank-one change of the Gram matrix, taken away again so that every refit is the same.
        matrix += beta * np.outer(last, last)
        matrix -= beta * np.outer(last, last)
        factor, _ = cho_factor(matrix, lower=True)
        half = solve_triangular(factor, moment, lower=True)
        mean = solve_triangular(factor, half, lower=True, trans=1)
        variance = np.sum(solve_triangular(factor, terms, lower=True) ** 2, axis=0)
    seconds = (time.process_time() - start) / refits
    left = np.setdiff1d(np.arange(terms.shape[1]), data)
    differences = [np.abs(learner.values("mean") - mean).max() / np.abs(mean).max()]
    if len(left):
        # The candidates are the points after the first.
        of_left = learner.variances()[left - terms.shape[1]]
        differences.append(np.abs(of_left / variance[left] - 1).max())
    return seconds, max(differences)


if __name__ == "__main__":
    raise SystemExit(main())
