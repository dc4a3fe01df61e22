"""Moduli of the exact half-space theory per CPU second on one thread, and the posterior's density
beside separate calls of the theory.

One crystal in many directions, for each of the seventeen crystals of tests/reference/crystals.csv;
different crystals, each in a direction of its own (those seventeen, their stiffness changed by up
to 10 %); and the posterior's density of 50 grains measured to 2 % at many crystals near the true
one, the theory read from a field of degree 12, beside the exact moduli of these crystals: rows of
one call, and a call each. `Posterior.evaluate` gives density and likelihood, each from moduli of
its own, so half of its time is that of a density. Times are CPU seconds of the process, the best of
several repeats.
"""

import argparse
import time

import numpy as np

from bayesindent.crystal.elasticity import (
    anisotropy_index,
    constant_names,
    halfspace_modulus,
    stiffness,
    stiffness_rows,
)
from bayesindent.surrogate.surrogate import Surrogate
from support.csv_tables import numbers, read_rows
from support.densities import Posterior
from support.tree import REFERENCE

#: Crystals whose density is timed.
MEASURED = ("copper", "Zn", "albite")
GRAINS = 50


def main(argv=None) -> int:
    """Print the two tables."""
    parser = argparse.ArgumentParser(
        prog="bench theory",
        description=__doc__,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    parser.add_argument("--moduli", type=int, default=4000, help="moduli of one call (4000)")
    parser.add_argument(
        "--densities",
        type=int,
        default=1000,
        help="crystals at which the density is computed (1000)",
    )
    parser.add_argument(
        "--repeats", type=int, default=9, help="repeats of each timing; the best counts (9)"
    )
    arguments = parser.parse_args(argv)
    rng = np.random.default_rng(1)
    crystals = reference_crystals()
    moduli_table(crystals, arguments, rng)
    density_table(crystals, arguments, rng)
    return 0


def reference_crystals() -> dict[str, tuple[str, np.ndarray]]:
    """Class and constants of each by its name."""
    found = {}
    for row in read_rows(REFERENCE / "crystals.csv"):
        found[row["name"]] = (row["symmetry"], numbers([row], constant_names(row["symmetry"]))[0])
    return found


def random_angles(n: int, rng) -> np.ndarray:
    """Euler angles (n, 3) in degrees of even orientations."""
    return np.column_stack(
        [
            rng.uniform(0, 360, n),
            np.degrees(np.arccos(rng.uniform(-1, 1, n))),
            rng.uniform(0, 360, n),
        ]
    )


def seconds(call, repeats: int) -> float:
    """CPU seconds of a call, the least of some repeats."""
    call()
    times = []
    for _ in range(repeats):
        start = time.process_time()
        call()
        times.append(time.process_time() - start)
    return min(times)


def moduli_table(crystals: dict, arguments, rng) -> None:
    """Rates of one crystal in many directions, and of different crystals."""
    angles = random_angles(arguments.moduli, rng)
    print(f"{'moduli per second':20}{'class':>12}{'index':>8}{'rate':>10}")
    matrices = []
    for name, (symmetry, constants) in crystals.items():
        matrix = stiffness(symmetry, **dict(zip(constant_names(symmetry), constants, strict=True)))
        matrices.append(matrix)
        rate = arguments.moduli / seconds(
            lambda matrix=matrix: halfspace_modulus(matrix, angles), arguments.repeats
        )
        print(f"{name:20}{symmetry:>12}{anisotropy_index(matrix):8.2f}{rate:10,.0f}")
    several = np.array(matrices)[rng.integers(0, len(matrices), arguments.moduli)]
    several = several * rng.uniform(0.9, 1.1, (arguments.moduli, 1, 1))
    rate = arguments.moduli / seconds(lambda: halfspace_modulus(several, angles), arguments.repeats)
    print(f"{'different crystals':40}{rate:10,.0f}")
    halfspace = Surrogate.load("halfspace")
    rate = arguments.moduli / seconds(lambda: halfspace.predict(several, angles), arguments.repeats)
    print(f"{'the same by predict':40}{rate:10,.0f}")


def density_table(crystals: dict, arguments, rng) -> None:
    """Times of the density and of the theory's moduli for the same grains."""
    header = [
        f"{'us a crystal':24}",
        *(
            f"{word:>10}"
            for word in ("density", "one call", "ratio", f"{GRAINS} calls", "ratio", "error, %")
        ),
    ]
    print(f"\n{GRAINS} grains\n{''.join(header)}")
    angles = random_angles(GRAINS, rng)
    for name in MEASURED:
        symmetry, constants = crystals[name]
        exact = halfspace_modulus(stiffness_rows(symmetry, [constants])[0], angles)
        table = dict(zip(("phi1_deg", "Phi_deg", "phi2_deg"), angles.T, strict=True)) | {
            "modulus_gpa": exact,
            "sd_gpa": 0.02 * exact,
        }
        posterior = Posterior.of(
            table,
            symmetry=symmetry,
            surrogate=Surrogate.load("halfspace"),
            modulus_kind="indentation_modulus",
        )
        points = constants * (1 + 0.003 * rng.normal(size=(arguments.densities, len(constants))))
        matrices = stiffness_rows(symmetry, points)
        density = (
            seconds(lambda p=posterior, x=points: p.evaluate(x), arguments.repeats)
            / len(points)
            / 2
        )
        together = seconds(lambda m=matrices: halfspace_modulus(m[:, None], angles), 3) / len(
            points
        )
        first = matrices[0]
        calls = seconds(
            lambda c=first: [halfspace_modulus(c, row) for row in angles], arguments.repeats
        )
        error = np.abs(
            posterior.moduli(points[:1], angles)[0][0] / halfspace_modulus(first, angles) - 1
        ).max()
        of_posterior = f"{1e6 * density:10.1f}{1e6 * together:10.1f}{together / density:10.1f}"
        of_calls = f"{1e6 * calls:10.0f}{calls / density:10.0f}"
        print(f"{name:12}{symmetry:>12}{of_posterior}{of_calls}{100 * error:10.3f}")


if __name__ == "__main__":
    raise SystemExit(main())
