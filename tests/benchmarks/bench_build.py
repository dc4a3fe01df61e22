"""Sequential updates of the hexagonal paper case (729 terms, 3200 candidates) against refits, on one thread and in one run.

A step is: the candidate of largest predictive variance is chosen, its modulus becomes data, and mean, covariance and the variances of
all candidates are those of the new posterior. Moduli are those of the half-space theory, since no simulation is timed here.

Alpha and beta frozen:
- updates: this package.
- Cholesky: numpy and scipy; the Gram matrix is updated, factored anew, and solved for the candidates' variances.

Alpha and beta maximised anew, from all data, halfway through the steps:
- refit: this package, and the variances of all candidates.
- BayesianRidge: scikit-learn, and the sd of all candidates.
"""

import argparse
import time
from contextlib import nullcontext

import numpy as np
from scipy.linalg import cho_factor, solve_triangular

from bayesindent.crystal.elasticity import halfspace_modulus, stiffness_rows
from bayesindent.surrogate.domain import Domain
from bayesindent.surrogate.surrogate import Basis, Design


def main(argv=None) -> int:
    """Run the benchmark and print a table."""
    parser = argparse.ArgumentParser(prog="bench build", description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--initial", type=int, default=760, help="points before the first step (760)")
    parser.add_argument("--steps", type=int, default=2040, help="sequential steps (1440 + 600)")
    parser.add_argument("--candidates", type=int, default=3200, help="points in all to choose from (3200)")
    parser.add_argument("--refits", type=int, default=3, help="refits timed of each peer (3)")
    arguments = parser.parse_args(argv)
    with one_thread():
        return run(arguments)


def one_thread():
    """All contestants' BLAS on one thread, where threadpoolctl (which comes with scikit-learn) can see to it."""
    try:
        from threadpoolctl import threadpool_limits
    except ImportError:
        return nullcontext()
    return threadpool_limits(1)


def run(arguments: argparse.Namespace) -> int:
    """Run the benchmark."""
    domain = Domain.default("hexagonal")
    points = domain.latin(arguments.candidates, 1, n_angles=1)
    constants, angles = points[:, :-1], np.column_stack([np.zeros(len(points)), 90 * points[:, -1], np.zeros(len(points))])
    basis = Basis("hexagonal", "box", "tensor", 2, 4, *domain.ranges("box"))
    terms, _ = basis.terms(constants, angles)
    y = halfspace_modulus(stiffness_rows("hexagonal", constants), angles)
    print(f"{basis.n_terms} terms, {len(y)} candidates, {arguments.initial} + {arguments.steps} points, one thread")

    design = Design(np.ones(basis.n_terms), np.zeros(basis.n_terms), 0.05)
    design.set_candidates(terms)
    first = np.arange(arguments.initial)
    design.exclude(first)
    design.add(terms[:, first], y[first])
    alpha, beta, _ = design.fit()
    order = list(first)
    start = time.perf_counter()
    for _ in range(arguments.steps):
        chosen, _ = design.choose(1)
        design.add(terms[:, chosen], y[chosen])
        design.settle()
        order.append(int(chosen[0]))
    step = (time.perf_counter() - start) / arguments.steps

    middle = np.array(order[: arguments.initial + arguments.steps // 2])
    refit = time_refit(terms, y, middle, arguments.refits)
    ridge = time_bayesian_ridge(terms, y, middle, arguments.refits)
    cholesky, difference = time_cholesky(terms, y, np.array(order), alpha, beta, arguments.refits, design)
    print(f"largest difference of mean and variances from a refit after all steps: {difference:.1e} (relative)")
    print(f"{'':42}{'ms':>12}{'times ours':>14}")
    rows = [
        ("alpha, beta frozen: update", step, step),
        ("alpha, beta frozen: Cholesky", cholesky, step),
        ("alpha, beta anew: refit", refit, refit),
        ("alpha, beta anew: BayesianRidge", ridge, refit),
    ]
    for name, seconds, ours in rows:
        if seconds is not None:
            print(f"{name:42}{1e3 * seconds:12.2f}{seconds / ours:14.1f}")
    return 0


def time_refit(terms, y, data, refits: int) -> float:
    """Seconds of a refit by this package and the variances of all candidates, from data to numbers."""
    seconds = []
    for _ in range(refits):
        design = Design(np.ones(len(terms)), np.zeros(len(terms)), 0.05)
        start = time.perf_counter()
        design.set_candidates(terms)
        design.add(terms[:, data], y[data])
        design.fit()
        design.variances()
        seconds.append(time.perf_counter() - start)
    return float(np.mean(seconds))


def time_bayesian_ridge(terms, y, data, refits: int) -> float | None:
    """Seconds of a refit by scikit-learn and the sd of all candidates, halfway through the steps."""
    try:
        from sklearn.linear_model import BayesianRidge
    except ImportError:
        print("scikit-learn is not installed: no comparison with BayesianRidge")
        return None
    rows, candidates = np.ascontiguousarray(terms[:, data].T), np.ascontiguousarray(terms.T)
    start = time.perf_counter()
    for _ in range(refits):
        BayesianRidge(fit_intercept=False).fit(rows, y[data]).predict(candidates, return_std=True)
    return (time.perf_counter() - start) / refits


def time_cholesky(terms, y, data, alpha: float, beta: float, refits: int, design: Design) -> tuple[float, float]:
    """Seconds of a refit by Cholesky factorisation, and how far the updated posterior is from it."""
    n = len(terms)
    matrix = alpha * np.eye(n) + beta * terms[:, data] @ terms[:, data].T
    moment = beta * terms[:, data] @ y[data]
    last = terms[:, data[-1]]
    start = time.perf_counter()
    for _ in range(refits):
        # A rank-one change of the Gram matrix, taken away again so that every refit is the same.
        matrix += beta * np.outer(last, last)
        matrix -= beta * np.outer(last, last)
        factor, _ = cho_factor(matrix, lower=True)
        half = solve_triangular(factor, moment, lower=True)
        mean = solve_triangular(factor, half, lower=True, trans=1)
        variance = np.sum(solve_triangular(factor, terms, lower=True) ** 2, axis=0)
    seconds = (time.perf_counter() - start) / refits
    left = np.setdiff1d(np.arange(terms.shape[1]), data)
    differences = [np.abs(design.mean() - mean).max() / np.abs(mean).max()]
    if len(left):
        differences.append(np.abs(design.variances()[left] / variance[left] - 1).max())
    return seconds, max(differences)


if __name__ == "__main__":
    raise SystemExit(main())
