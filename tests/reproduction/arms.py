"""What choosing the simulations brings, and why degree 3 fails: arms that differ in their points
alone, and priors that differ in their widths alone, judged on independent crystals.
"""

from itertools import product
from pathlib import Path

import numpy as np
from scipy.stats import qmc

from bayesindent.crystal.elasticity import stiffness_rows
from bayesindent.surrogate.surrogate import Surrogate
from reproduction.published import STUDIES
from reproduction.regression import Terms, choose, fit
from reproduction.studies import (
    Pool,
    build,
    by_theory,
    independent_crystals,
    kept,
    namelist_of,
)
from support.paper_domains import DOMAINS

__all__ = [
    "ARMS",
    "FURTHER",
    "PRIORS",
    "SIZES",
    "TRAINED",
    "arms_by_theory",
    "arms_of",
    "degree_3",
    "derivatives",
    "theory_pool",
]

#: Numbers of simulations.
SIZES = {"cubic": (123, 150, 200, 250, 300), "hexagonal": (760, 1240, 1720, 2200)}

#: Further numbers of random simulations, among which that with the sequence's error is found.
FURTHER = {"cubic": (400, 500, 700, 1000, 2000), "hexagonal": (2500, 2800, 3200)}

#: Arms, by what their points are.
ARMS = {
    "random": "random",
    "latin": "Latin hypercube",
    "start": "the paper's first set, then random",
    "sequence": "the paper's sequence",
}

#: Numbers of simulations with and without derivatives: the sequence begins with its first set.
FEWER = {
    "cubic": (40, 80, 123, 150, 200, 300),
    "hexagonal": (200, 400, 760, 1240, 2200),
}

#: What the model is trained on, and whether derivatives are among it.
TRAINED = {"the moduli": False, "moduli and derivatives": True}

#: Number of independent crystals on which arms by theory are judged, and their seed.
JUDGES, JUDGES_SEED = 3000, 20190

#: Priors of the coefficients: whether the mean is unpenalised, whether the polynomials are
#: normalised, and the ratio of the sds from degree to degree.
PRIORS = {
    "Eq. 6": (False, True, 1.0),
    "mean unpenalised": (True, True, 1.0),
    "not normalised, mean unpenalised": (True, False, 1.0),
    "sd falls by 0.4 a degree, mean unpenalised": (True, True, 0.4),
}


def theory_pool(symmetry: str, seed: int, folder: Path) -> Pool:
    """All candidates of a case study with moduli by theory, in the order of the paper's sequence
    for this seed.
    """
    paper = STUDIES[symmetry]
    namelist = namelist_of(symmetry, 1, problem={"seed": seed}, **by_theory())
    namelist["design"]["validation"] = paper["pool"] - paper["chosen"]
    del namelist["surrogate"]["scan"]
    return Pool.of_build(symmetry, folder, build(namelist, folder), paper["initial"])


def rows_of(arm: str, pool: Pool, size: int, seed: int) -> np.ndarray:
    """The rows of the pool that an arm trains on."""
    many = len(pool.modulus)
    if arm == "sequence":
        return np.arange(size)
    if arm == "latin":
        return latin_rows(pool, size, seed)
    order = np.random.default_rng(seed).permutation(many)
    if arm == "start":
        order = np.concatenate([np.arange(pool.initial), order[order >= pool.initial]])
    return order[:size]


def latin_rows(pool: Pool, size: int, seed: int) -> np.ndarray:
    """For each point of a Latin hypercube over constants and directions the nearest candidate that
    is not taken.
    """
    if pool.symmetry == "cubic":
        # The candidates have nine directions: one coordinate that counts them.
        _, number = np.unique(pool.euler_deg.round(6), axis=0, return_inverse=True)
        angular = 2 * number.ravel() / number.max() - 1
    else:
        angular = pool.euler_deg[:, 1] / 45 - 1
    places = np.column_stack([pool.coordinates, angular])
    wanted = 2 * qmc.LatinHypercube(places.shape[1], rng=seed).random(size) - 1
    left, rows = np.ones(len(places), bool), []
    for point in wanted:
        distance = np.where(left, ((places - point) ** 2).sum(axis=1), np.inf)
        rows.append(int(np.argmin(distance)))
        left[rows[-1]] = False
    return np.array(rows)


def errors(terms: Terms, pool: Pool, rows: np.ndarray, judges: tuple, width=1.0) -> dict:
    """Leave-one-out error of a fit to some rows, and mean, rms and largest error on the judges:
    their terms and moduli.
    """
    found = fit(terms.values[rows], pool.modulus[rows], width)
    return {"loocv": found.loocv} | sizes_of(judges[0] @ found.coefficients - judges[1])


def sizes_of(error: np.ndarray) -> dict:
    """Mean, rms and largest of some errors (n,)."""
    return {
        "mean": float(np.abs(error).mean()),
        "rms": float(np.sqrt((error**2).mean())),
        "worst": float(np.abs(error).max()),
    }


def arms_of(pool: Pool, judges: Pool, seed: int, sizes: tuple) -> dict:
    """Errors by arm and number of simulations, of the truncation that the paper chose."""
    paper = STUDIES[pool.symmetry]
    terms, other = (part.terms(paper["degree"], paper["bandlimit"]) for part in (pool, judges))
    judged = other.values, judges.modulus
    found: dict[str, list] = {arm: [] for arm in ARMS}
    for arm, size in product(ARMS, sizes):
        found[arm].append(errors(terms, pool, rows_of(arm, pool, size, seed), judged))
    return found


def derivatives(pool: Pool, judges: Pool, folder: Path) -> dict:
    """Errors of the paper's model by the number of simulations of its sequence, trained by the
    program on their moduli, and on their derivatives as well; kept in the folder.
    """
    paper = STUDIES[pool.symmetry]
    many = len(pool.modulus) - pool.unseen
    sizes = [size for size in FEWER[pool.symmetry] if size < many] + [many]
    stiffness = stiffness_rows(pool.symmetry, judges.constants)
    settings = {"degree": paper["degree"], "bandlimit": paper["bandlimit"], "model": "paper"}

    def compute() -> dict:
        found: dict[str, list] = {name: [] for name in TRAINED}
        for (name, is_used), size in product(TRAINED.items(), sizes):
            surrogate = Surrogate.fit(
                pool.constants[:size],
                pool.euler_deg[:size],
                pool.modulus[:size],
                pool.by_stiffness[:size] if is_used else None,
                symmetry=pool.symmetry,
                domain=DOMAINS[pool.symmetry],
                **settings,
            )
            modulus, _ = surrogate.predict(stiffness, judges.euler_deg)
            found[name].append(sizes_of(modulus - judges.modulus))
        return {"sizes": sizes, "judges": len(judges.modulus), "errors": found}

    inputs = [pool.symmetry, sizes, pool.modulus, judges.modulus]
    return kept(folder / "derivatives.json", inputs, compute)


def further_random(pool: Pool, judges: Pool, seed: int) -> list[dict]:
    """Errors of more random simulations, see `FURTHER`."""
    paper = STUDIES[pool.symmetry]
    terms, other = (part.terms(paper["degree"], paper["bandlimit"]) for part in (pool, judges))
    judged = other.values, judges.modulus
    return [
        errors(terms, pool, rows_of("random", pool, size, seed), judged)
        for size in FURTHER[pool.symmetry]
    ]


def judges_by_theory(symmetry: str, count: int = JUDGES) -> Pool:
    """Independent crystals with moduli by theory."""
    return Pool.of_theory(symmetry, *independent_crystals(symmetry, count, JUDGES_SEED))


def arms_by_theory(symmetry: str, seed: int, folder: Path) -> dict:
    """The arms of one seed, kept in the folder."""

    def compute() -> dict:
        pool, judges = theory_pool(symmetry, seed, folder), judges_by_theory(symmetry)
        found = arms_of(pool, judges, seed, SIZES[symmetry])
        return found | {"further": further_random(pool, judges, seed)}

    inputs = [symmetry, seed, SIZES[symmetry], FURTHER[symmetry]]
    return kept(folder / "arms.json", inputs, compute)


def degree_3(symmetry: str, seed: int, folder: Path, truncations: list) -> list[dict]:
    """Errors by truncation, prior and points at the paper's last number of simulations, kept in the
    folder. The points: those of the paper's own truncation, those that each truncation and prior
    chooses for itself (cubic alone), and random ones.
    """

    def compute() -> list[dict]:
        paper, pool = STUDIES[symmetry], theory_pool(symmetry, seed, folder)
        size, judges, found = paper["chosen"], judges_by_theory(symmetry), []
        for degree, bandlimit in truncations:
            terms, other = (part.terms(degree, bandlimit) for part in (pool, judges))
            for prior, choice in PRIORS.items():
                width = terms.width(*choice)
                points = {arm: rows_of(arm, pool, size, seed) for arm in ("sequence", "random")}
                if symmetry == "cubic":
                    start = np.arange(pool.initial)
                    points["own"] = choose(terms.values, pool.modulus, start, size, 10, width)
                for name, rows in points.items():
                    entry = {"degree": degree, "bandlimit": bandlimit, "prior": prior}
                    entry |= {"points": name, "terms": terms.values.shape[1]}
                    judged = other.values, judges.modulus
                    found.append(entry | errors(terms, pool, rows, judged, width))
        return found

    return kept(folder / "degree_3.json", [symmetry, seed, truncations, PRIORS], compute)
