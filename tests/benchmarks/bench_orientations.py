"""How often orientations that are not those of the grains are noticed, and how often right ones are
questioned.

Synthetic moduli by the exact theory, with normal noise. The check is written out here once more
(tests compare it with the program's): least squares of the harmonics up to degree 4, chi-square,
and the same of shuffled grains.

    ./bayesindent bench orientations
    ./bayesindent bench orientations --repeats 1000
"""

import argparse

import numpy as np
from scipy import stats
from scipy.spatial.transform import Rotation

from bayesindent.crystal.elasticity import halfspace_modulus, stiffness_rows

#: Class, constants (GPa), grains and relative noise; none of them was used to choose the
#: thresholds.
CASES = {
    "copper, 11": ("cubic", (169, 122, 75.3), 11, 0.02),
    "copper, 15": ("cubic", (169, 122, 75.3), 15, 0.02),
    "copper, 20": ("cubic", (169, 122, 75.3), 20, 0.02),
    "silver, 15": ("cubic", (124, 93.4, 46.1), 15, 0.02),
    "nickel, 15": ("cubic", (248, 155, 124), 15, 0.02),
    "lead, 12": ("cubic", (49.5, 42.3, 14.9), 12, 0.02),
    "titanium, 30": ("hexagonal", (160, 90, 46.5, 181, 66), 30, 0.02),
    "titanium, 30, noise 5 %": ("hexagonal", (160, 90, 46.5, 181, 66), 30, 0.05),
    "zirconium, 30": ("hexagonal", (144, 73, 32, 165, 65), 30, 0.02),
    "cobalt, 20": ("hexagonal", (307, 165, 75.5, 358, 103), 20, 0.02),
    "niobium, 20": ("cubic", (246, 134, 28.7), 20, 0.02),
    "molybdenum, 20": ("cubic", (460, 176, 110), 20, 0.02),
    "tungsten, 20": ("cubic", (523, 203, 160), 20, 0.02),
}
KINDS = "right", "shuffled", "map mirrored", "inverse", "x for z"
#: As in the program.
RARE, POWER, CLEARLY = 0.005, 0.5, 12.0


def harmonics(symmetry: str, z: np.ndarray) -> np.ndarray:
    """Fields of degree 0, 2 and 4 of a cubic or a hexagonal class at directions (n, 3), (n,
    fields).
    """
    if symmetry == "cubic":
        return np.column_stack([np.ones(len(z)), (z**4).sum(axis=1)])
    return np.column_stack([np.ones(len(z)), z[:, 2] ** 2, z[:, 2] ** 4])


def misfits(rows: np.ndarray, values: np.ndarray) -> np.ndarray:
    """Chi-square of values (n,) about each of the spaces that rows (.., n, fields) span."""
    q = np.linalg.qr(rows)[0]
    return values @ values - ((np.swapaxes(q, -1, -2) @ values) ** 2).sum(axis=-1)


def directions(kind: str, rotations: Rotation, rng: np.random.Generator) -> np.ndarray:
    """The direction that each grain is said to be indented along, in crystal axes."""
    z = rotations.inv().apply([0, 0, 1])
    if kind == "shuffled":
        return z[rng.permutation(len(z))]
    if kind == "map mirrored":
        # A Voronoi map, indents in the middle of its grains: the grain at the mirrored place.
        middle = rng.random((len(z), 2))
        return z[
            np.argmin(
                (((np.array([1, 0]) + [-1, 1] * middle)[:, None] - middle) ** 2).sum(axis=-1),
                axis=1,
            )
        ]
    if kind == "inverse":
        return rotations.apply([0, 0, 1])
    return rotations.inv().apply([1, 0, 0]) if kind == "x for z" else z


def study(
    case: tuple, kind: str, repeats: int, shuffles: int, rng: np.random.Generator
) -> tuple[float, float, float]:
    """Share of data sets of which the program warns, the mean of the power that it states, and the
    share in which it names a reading.
    """
    symmetry, constants, n, noise = case
    stiffness, warned, power, named = stiffness_rows(symmetry, [constants])[0], 0, 0.0, 0.0
    for _ in range(repeats):
        euler = np.column_stack(
            [
                rng.uniform(0, 360, n),
                np.degrees(np.arccos(rng.uniform(-1, 1, n))),
                rng.uniform(0, 360, n),
            ]
        )
        modulus, rotations = (
            halfspace_modulus(stiffness, euler),
            Rotation.from_euler("ZXZ", euler, degrees=True),
        )
        sd = noise * modulus
        values = (modulus + sd * rng.normal(size=n)) / sd
        rows = harmonics(symmetry, directions(kind, rotations, rng))
        limit = stats.chi2(n - rows.shape[1]).isf(RARE)
        found = misfits(rows / sd[:, None], values)
        others = misfits(
            np.array([rows[rng.permutation(n)] for _ in range(shuffles)]) / sd[:, None], values
        )
        # The program tries other readings itself: one that fits clearly better is named.
        tried = KINDS[2:] if kind == "right" else KINDS[:1]
        fits = min(
            misfits(harmonics(symmetry, directions(other, rotations, rng)) / sd[:, None], values)
            for other in tried
        )
        better = kind != "shuffled" and fits < min(found - CLEARLY, others.min()) and fits <= limit
        stated = np.mean(others > limit)
        shuffled = (1 + np.sum(others <= found)) / (shuffles + 1)
        warned += better or (found > limit and stated > POWER and shuffled > RARE)
        named += better / repeats
        power += stated / repeats
    return warned / repeats, power, named


def main(argv=None) -> int:
    """A row for each case; 1 if right orientations are questioned in more than 1 %."""
    parser = argparse.ArgumentParser(
        prog="bench orientations",
        description=__doc__,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    parser.add_argument("--repeats", type=int, default=200, help="data sets of a case (200)")
    parser.add_argument("--shuffles", type=int, default=399, help="of each (399)")
    parser.add_argument("--seed", type=int, default=1)
    arguments = parser.parse_args(argv)
    rng, questioned = np.random.default_rng(arguments.seed), []
    print(
        "| crystal, grains | "
        + " | ".join(KINDS)
        + " | mirrored and named | power stated (shuffled) |",
        flush=True,
    )
    for name, case in CASES.items():
        found = {
            kind: study(case, kind, arguments.repeats, arguments.shuffles, rng) for kind in KINDS
        }
        questioned.append(found["right"][0])
        cells = [found[kind][0] for kind in KINDS] + [found["map mirrored"][2]]
        print(
            f"| {name} | "
            + " | ".join(f"{cell:.3g}" for cell in cells)
            + f" | {found['shuffled'][1]:.2f} |",
            flush=True,
        )
    print(
        f"right orientations are questioned in {100 * np.mean(questioned):.2g} % of "
        f"{len(CASES) * arguments.repeats} data sets"
    )
    return int(np.mean(questioned) > 0.01)


if __name__ == "__main__":
    raise SystemExit(main())
