"""Sequential updates of the hexagonal paper case (729 terms, 3200 candidates) beside refits, on one thread and in one run.

A step is: the candidate of largest predictive variance is chosen, its modulus becomes data, and mean, covariance and the variances of
all candidates are those of the new posterior. Moduli are those of the half-space theory, since no simulation is timed here. Times are
CPU times of the process, which other work on the machine disturbs less.

Alpha and beta frozen:
- update: this package.
- Cholesky: numpy and scipy; the Gram matrix is updated, factored anew, and solved for the candidates' variances.
Alpha and beta anew, the same data and candidates:
- refit: this package; the evidence is maximised, then mean, covariance and the candidates' variances.
- BayesianRidge: scikit-learn fits alpha, beta and the posterior, and predicts the sd of the candidates.
"""

import argparse
import time
from contextlib import nullcontext

import numpy as np
from paper_domains import DOMAINS
from scipy.linalg import cho_factor, solve_triangular

from bayesindent.crystal.elasticity import halfspace_modulus, stiffness_rows
from bayesindent.surrogate.basis import Basis
from bayesindent.surrogate.learner import Learner


def main(argv=None) -> int:
    """Run the benchmark and print a table."""
    parser = argparse.ArgumentParser(prog="bench build", description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--initial", type=int, default=760, help="points before the first step (760)")
    parser.add_argument("--steps", type=int, default=2040, help="sequential steps (1440 + 600)")
    parser.add_argument("--candidates", type=int, default=3200, help="points in all to choose from (3200)")
    parser.add_argument("--refits", type=int, default=3, help="refits timed of each (3)")
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
    basis = Basis.from_keywords("hexagonal", DOMAINS["hexagonal"], model="paper", truncation="tensor", degree=2, bandlimit=4)
    constants, angles = basis.crystals(arguments.candidates, 1)
    # Of a uniform direction the declination's cosine is uniform; the paper's declination is.
    angles = np.column_stack([0 * angles[:, 0], 90 * (1 - np.cos(np.radians(angles[:, 1]))), 0 * angles[:, 2]])
    terms, _ = basis.terms(constants, angles)
    modulus = halfspace_modulus(stiffness_rows("hexagonal", constants), angles)
    print(f"{basis.n_terms} terms, {len(modulus)} candidates, {arguments.initial} + {arguments.steps} points, one thread")

    learner = Learner(basis)
    learner.set_candidates(constants, angles, "modulus")
    first = np.arange(arguments.initial)
    learner.exclude(first)
    learner.add(constants[first], angles[first], modulus[first], chosen=True)
    learner.fit()
    order = list(first)
    start = time.process_time()
    for _ in range(arguments.steps):
        chosen, _ = learner.choose(1)
        learner.add(constants[chosen], angles[chosen], modulus[chosen], chosen=True)
        learner.update()
        order.append(int(chosen[0]))
    step = (time.process_time() - start) / arguments.steps

    cholesky, difference = time_cholesky(terms, modulus, np.array(order), arguments.refits, learner)
    print(f"largest difference of mean and variances from a refit after all steps: {difference:.1e} (relative)")
    middle = np.array(order[: arguments.initial + arguments.steps // 2])
    refit = time_refit(basis, constants, angles, modulus, middle, arguments.refits)
    ridge = time_bayesian_ridge(terms, modulus, middle, arguments.refits)
    print_table("alpha, beta frozen", {"update": step, "Cholesky refit": cholesky})
    print_table(f"alpha, beta anew, {len(middle)} points", {"refit": refit} | ({} if ridge is None else {"BayesianRidge": ridge}))
    return 0


def print_table(title: str, seconds: dict[str, float]) -> None:
    """Milliseconds of each, and how many times those of the first."""
    print(f"{title:36}{'ms':>10}{'times':>10}")
    first = next(iter(seconds.values()))
    for name, value in seconds.items():
        print(f"  {name:34}{1e3 * value:10.2f}{value / first:10.1f}")


def time_refit(basis: Basis, constants, angles, modulus, data, refits: int) -> float:
    """Seconds in which this package learns alpha, beta and the posterior, and the variances of all candidates, halfway through the steps."""
    learner = Learner(basis)
    learner.set_candidates(constants, angles, "modulus")
    learner.add(constants[data], angles[data], modulus[data], chosen=True)
    start = time.process_time()
    for _ in range(refits):
        learner.fit()
    return (time.process_time() - start) / refits


def time_bayesian_ridge(terms, y, data, refits: int) -> float | None:
    """Seconds of the same by scikit-learn."""
    try:
        from sklearn.linear_model import BayesianRidge
    except ImportError:
        print("scikit-learn is not installed: no comparison with BayesianRidge")
        return None
    rows, candidates = np.ascontiguousarray(terms[:, data].T), np.ascontiguousarray(terms.T)
    start = time.process_time()
    for _ in range(refits):
        BayesianRidge(fit_intercept=False).fit(rows, y[data]).predict(candidates, return_std=True)
    return (time.process_time() - start) / refits


def time_cholesky(terms, y, data, refits: int, learner: Learner) -> tuple[float, float]:
    """Seconds of a refit by Cholesky factorisation at the learner's alpha and beta, and how far the updated posterior is from it."""
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
        differences.append(np.abs(learner.variances(terms.shape[1])[left] / variance[left] - 1).max())
    return seconds, max(differences)


if __name__ == "__main__":
    raise SystemExit(main())
