"""The training of a surrogate, step by step, by operations of the core; tests and benchmarks of the
choice of simulations use it.
"""

import json
import re
from collections.abc import Callable
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
from numpy.typing import ArrayLike

from bayesindent.settings.problem import Problem
from bayesindent.stages.stage import Job, run_stage
from bayesindent.surrogate.basis import Basis
from bayesindent.surrogate.surrogate import Surrogate
from support.testing_core import Held, inside

__all__ = [
    "Learner",
    "build",
    "spread_crystals",
    "spread_of",
    "surrogate_of",
    "terms_of",
    "to_modulus",
    "to_y",
]


def build(problem: Problem, output: Path, simulate: Callable[[Job], dict] | None = None) -> dict:
    """Step 1 of a problem: the surrogate in the output folder, and the document of `build`."""
    return run_stage(problem, "build", output, simulate)


class _Basis(Held, Basis):
    """A basis in the core of the tests."""


def of_tests(basis: Basis) -> _Basis:
    """The same basis in the core of the tests."""
    if "of_tests" not in basis.__dict__:
        facts = vars(basis)
        limits = {"c_min": facts["c_min"], "c_max": facts["c_max"]} if len(facts["c_min"]) else {}
        limits |= {
            name: facts[name]
            for name in ("anisotropy_cap", "log_anisotropy_max")
            if facts[name] < np.finfo(float).max
        }
        if not len(facts["c_min"]):
            limits |= {
                "classes": facts["classes"].split(", "),
                "poisson_min": facts["poisson"][0],
                "poisson_max": facts["poisson"][1],
            }
        if facts["stiffness"][1] < np.finfo(float).max:
            limits |= {
                "stiffness_min_gpa": facts["stiffness"][0],
                "stiffness_max_gpa": facts["stiffness"][1],
            }
        settings = {
            name: facts[name]
            for name in ("model", "truncation", "degree", "bandlimit", "prior_sd")
            if name in facts
        }
        with inside():
            problem = Problem.from_keywords(
                "Basis", problem={"symmetry": basis.symmetry}, domain=limits, surrogate=settings
            )
            facts["of_tests"] = _Basis(problem)
            del problem
    return basis.__dict__["of_tests"]


def spread_crystals(basis: Basis, n: int, seed: int) -> tuple[np.ndarray, np.ndarray]:
    """n crystals (n, k) in GPa spread over the domain, and angles (n, 3) in degrees, indentation
    directions uniform on the sphere.
    """
    found = of_tests(basis)._call("crystals", count=n, seed=seed)
    return found["constants"], found["euler_deg"]


def terms_of(
    basis: Basis, constants: ArrayLike, euler_deg: ArrayLike
) -> tuple[np.ndarray, np.ndarray]:
    """Terms (n_terms, n), not divided by the spread of the noise, and scales (n,) in GPa of stable
    crystals (n, k) in GPa at angles (n, 3) in degrees.
    """
    found = of_tests(basis)._call("terms", **basis.rows(constants, euler_deg))
    return found["values"].T, found["scale"]


def surrogate_of(
    basis: Basis,
    coefficients: ArrayLike,
    covariance: ArrayLike,
    *,
    beta: float,
    alpha: float = 1.0,
    fall: float = 1.0,
) -> Surrogate:
    """The surrogate with this posterior mean (n_terms,) and covariance (n_terms, n_terms) of the
    coefficients of a basis.
    """
    learner = Learner(basis)
    learner.add(*spread_crystals(basis, 2, 1), [100.0, 100.0])
    make, (text,) = learner.surrogate().__reduce__()
    for name, value in {"alpha": alpha, "beta": beta, "fall": fall}.items():
        text = re.sub(rf"^{name} .*", f"{name} {float(value)!r}", text, flags=re.MULTILINE)
    arrays = {
        "coefficients": np.asarray(coefficients),
        "covariance": np.asarray(covariance)[np.triu_indices(basis.n_terms)],
    }
    for name, values in arrays.items():
        numbers = [*map(repr, values.astype(float).tolist())]
        block = "\n".join(" ".join(numbers[i : i + 4]) for i in range(0, len(numbers), 4))
        text = re.sub(
            rf"^{name} \d+\n(.*\n)*?(?=[a-z])",
            f"{name} {len(numbers)}\n{block}\n",
            text,
            flags=re.MULTILINE,
        )
    text = text[: text.index("\nchecksum ") + 1]
    return make(f"{text}checksum {fnv_1a(text.encode()):016X}\n")


def fnv_1a(content: bytes) -> int:
    """The hash that ends a surrogate's file."""
    value = 0xCBF29CE484222325
    for byte in content:
        value = (value ^ byte) * 0x100000001B3 & 0xFFFFFFFFFFFFFFFF
    return value


def spread_of(basis: Basis, stiffness: ArrayLike) -> np.ndarray:
    """How the noise grows with the log-anisotropy, the norm of log K without its isotropic part, of
    stiffnesses (n, 6, 6).
    """
    roots, bulk = np.sqrt([1, 1, 1, 2, 2, 2]), np.diag([1.0, 1, 1, 0, 0, 0])
    bulk[:3, :3] = 1 / 3
    spreads = []
    for matrix in np.asarray(stiffness):
        values, vectors = np.linalg.eigh(matrix * np.outer(roots, roots))
        logarithm = vectors * np.log(values) @ vectors.T
        shear = np.eye(6) - bulk
        rest = (
            logarithm - np.trace(logarithm @ bulk) * bulk - np.trace(logarithm @ shear) / 5 * shear
        )
        spreads.append(1 + basis.noise_growth * np.linalg.norm(rest) ** 3)
    return np.array(spreads)


def to_y(basis: Basis, modulus_gpa: ArrayLike, scale: ArrayLike) -> np.ndarray:
    """The quantity that is linear in the coefficients: M/scale, or its logarithm."""
    y = np.asarray(modulus_gpa, dtype=float) / scale
    return np.log(y) if basis.logarithmic else y


def to_modulus(basis: Basis, y: ArrayLike, scale: ArrayLike) -> np.ndarray:
    """The modulus (GPa) of a y."""
    return scale * (np.exp(y) if basis.logarithmic else np.asarray(y))


class Learner(Held):
    """Evidence regression over a basis, and the choice of the next candidates by variance. Crystals
    are constants (n, k) in GPa.
    """

    kind = "learner"

    def __init__(self, basis: Basis):
        self.basis = basis
        self._hold(of_tests(basis)._call("learner")["handle"])

    def set_candidates(
        self,
        constants: ArrayLike,
        euler_deg: ArrayLike,
        variance_of: str = "imse",
        *,
        with_slopes: bool = False,
    ) -> None:
        """Crystals (n, k) at angles (n, 3) in degrees, all of them available, the rule of the
        choice, see &design, and whether their simulations will have derivatives.
        """
        rows = self.basis.rows(constants, euler_deg)
        self._call("set_candidates", rule=variance_of, with_slopes=with_slopes, **rows)

    def add(
        self,
        constants: ArrayLike,
        euler_deg: ArrayLike,
        modulus_gpa: ArrayLike,
        *,
        chosen: bool = False,
        by_stiffness: ArrayLike | None = None,
    ) -> None:
        """Train on moduli (n,) in GPa and their derivatives (n, 21), if any. If the choice asked
        for them the posterior follows with `fit` or `update`; else it is updated here.
        """
        if np.size(modulus_gpa):
            self._call(
                "add",
                modulus_gpa=modulus_gpa,
                chosen=chosen,
                **({} if by_stiffness is None else {"by_stiffness": by_stiffness}),
                **self.basis.rows(constants, euler_deg),
            )

    def fit(self, alpha: float | None = None, beta: float | None = None) -> None:
        """Posterior from all simulations at alpha and beta in units of y (default: those of largest
        evidence).
        """
        self._call("fit", **({} if alpha is None else {"alpha": float(alpha), "beta": float(beta)}))

    def choose(self, count: int, threads: int = 1) -> tuple[np.ndarray, np.ndarray]:
        """Numbers (count,) of the next candidates, and the variance of y at each when it was
        chosen.
        """
        found = self._call("choose", count=count, threads=threads)
        return found["chosen"], found["variance"]

    def update(self, exactly: bool = False) -> None:
        """The posterior mean once the moduli of all choices were added; `exactly` if one of them
        failed.
        """
        self._call("update", exactly=exactly)

    def leave_out(self, groups: ArrayLike) -> tuple[np.ndarray, np.ndarray, float]:
        """y of each simulation with its whole group left out, the error of y over its sd, and the
        mean absolute error of the modulus, GPa.
        """
        found = self._call("leave_out", numbers=np.ravel(groups))
        return *found["values"], found["error_gpa"]

    def precisions(self) -> dict[str, float]:
        """alpha, beta, fall, slope_noise, and log_evidence of the last `fit`, in units of y."""
        names = ("alpha", "beta", "fall", "slope_noise", "log_evidence")
        return {name: self.values(name) for name in names}

    def values(self, name: str) -> np.ndarray:
        """'mean' or 'prior_width' of the coefficients (n_terms,), and what `precisions` has."""
        return self._call("values")[name]

    def covariance(self) -> np.ndarray:
        """Posterior covariance (n_terms, n_terms) of the coefficients."""
        return self.values("covariance")

    def variances(self) -> np.ndarray:
        """Variance of y at each candidate, noise not included."""
        return self.values("variances")

    def surrogate(self, **provenance) -> Surrogate:
        """The trained surrogate."""
        handle = self._call("surrogate", provenance=json.dumps(provenance, indent=1))["handle"]
        with TemporaryDirectory() as folder:
            path = Path(folder, "surrogate.txt")
            with inside():
                made = Surrogate(handle)
                made.save(path)
                del made
            return Surrogate.load(path)
