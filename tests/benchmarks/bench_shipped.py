"""The surrogates that come with the package against the exact half-space theory, on random crystals of the paper's domains.

The error is that of truncation, of learning and of the finite elements together. sd is what the surrogate states for one simulation,
which the theory is not; so the share within 1 and 2 sd tells how the bias of the mesh compares with it.
"""

import argparse
import time

import numpy as np
from paper_domains import DOMAINS

from bayesindent.crystal.elasticity import halfspace_modulus, stiffness_rows
from bayesindent.surrogate.lookup import SHIPPED
from bayesindent.surrogate.surrogate import Surrogate


def main(argv=None) -> int:
    """Compare, and print a table."""
    parser = argparse.ArgumentParser(prog="bench shipped", description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--crystals", type=int, default=2000, help="random crystals of each domain, in random orientations (2000)")
    parser.add_argument("--seed", type=int, default=7)
    arguments = parser.parse_args(argv)
    header = ["mean GPa", "99 % GPa", "largest GPa", "mean %", "bias %", "within 1 sd", "within 2 sd", "us each"]
    print(f"{'':12}" + "".join(f"{name:>13}" for name in header))
    for name in SHIPPED:
        constants, angles = DOMAINS[name].crystals(arguments.crystals, arguments.seed)
        stiffness = stiffness_rows(name, constants)
        surrogate = Surrogate.load(name)
        start = time.perf_counter()
        mean, sd = surrogate.predict(stiffness, angles)
        seconds = time.perf_counter() - start
        theory = halfspace_modulus(stiffness, angles)
        error, relative, z = np.abs(mean - theory), mean / theory - 1, np.abs(mean - theory) / sd
        values = [error.mean(), np.quantile(error, 0.99), error.max(), 100 * np.abs(relative).mean(), 100 * relative.mean(),
                  np.mean(z <= 1), np.mean(z <= 2), 1e6 * seconds / len(theory)]  # fmt: skip
        print(f"{name:12}" + "".join(f"{value:13.3f}" for value in values))
    return 0


if __name__ == "__main__":
    raise SystemExit(main())
