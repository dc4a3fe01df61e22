"""What speeds of surface waves add to moduli, linearised about the crystals of
tests/reference/crystals.csv, and speeds computed per CPU second.

Grains over the sphere with a modulus at 2 % and a speed at 0.5 % each; log K known to 0.3 before
along an orthonormal basis. For each crystal the number of combinations whose variance falls to less
than half, of moduli, speeds, both, with an error of the density of 1 %, and with a common factor of
the moduli of 5 %; singular values of both; the speeds that the rule of docs/waves.md leaves. Then
the sds of copper and titanium (GPa).

    ./bayesindent dev bench waves
"""

import argparse
import csv
import time

import numpy as np

import bayesindent as bi
from bayesindent.crystal.elasticity import rayleigh_modes
from support.tree import REFERENCE

ROOTS = np.sqrt([1, 1, 1, 2, 2, 2])
KELVIN = np.outer(ROOTS, ROOTS)
STEP, PRIOR = 1e-4, 0.3
CASES = ("moduli", "speeds", "both", "density 1 %", "factor 5 %")


def function_of(matrices, function):
    """A function of symmetric matrices (..., 6, 6)."""
    values, vectors = np.linalg.eigh(matrices)
    return (vectors * function(values)[..., None, :]) @ np.swapaxes(vectors, -1, -2)


def neighbours(symmetry, stiffness):
    """Crystals a step up and a step down along each coordinate of log K, (2, k, 6, 6)."""
    names = bi.constants(symmetry)
    units = [
        bi.stiffness(symmetry, **dict(zip(names, row, strict=True))) * KELVIN
        for row in np.eye(len(names))
    ]
    basis = np.linalg.qr(np.reshape(units, (len(names), 36)).T)[0].T.reshape(-1, 6, 6)
    centre = function_of(stiffness * KELVIN, np.log)
    return np.array([function_of(centre + step * basis, np.exp) / KELVIN for step in (STEP, -STEP)])


def slopes(symmetry, stiffness, angles, along):
    """Of the logarithms of moduli and of the speeds of detected waves, over the errors,
    (measurement, coordinate).
    """
    sides = neighbours(symmetry, stiffness)[:, :, None]
    speed, bulk, share = rayleigh_modes(stiffness, angles, along, 1e3)
    kept = (speed < 0.97 * bulk) & (share > 0.2)
    moduli = np.log(bi.halfspace_modulus(sides, angles))
    speeds = np.log(rayleigh_modes(sides, angles[kept], along[kept], 1e3)[0])
    return [
        ((values[0] - values[1]) / (2 * STEP)).T / sd
        for values, sd in ((moduli, 0.02), (speeds, 0.005))
    ]


def combined(moduli, speeds):
    """Of the cases, each with an error that is common to all of one kind where it says so."""

    def with_common(rows, sds):
        """Without what one common error of so many sds takes."""
        ones = np.full(len(rows), sds)
        pulled = ones @ rows
        return rows.T @ rows - np.outer(pulled, pulled) / (1 + ones @ ones)

    alone = moduli.T @ moduli, speeds.T @ speeds
    return [
        *alone,
        sum(alone),
        alone[0] + with_common(speeds, 1.0),
        with_common(moduli, 2.5) + alone[1],
    ]


def main(argv=None) -> int:
    """Print the tables."""
    parser = argparse.ArgumentParser(
        prog="bench waves",
        description=__doc__,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    parser.add_argument("--grains", type=int, default=30, help="grains (30)")
    parser.add_argument("--seed", type=int, default=1, help="of the orientations (1)")
    asked = parser.parse_args(argv)
    rng = np.random.default_rng(asked.seed)
    n = asked.grains
    angles = np.column_stack(
        [
            rng.uniform(0, 360, n),
            np.degrees(np.arccos(rng.uniform(-1, 1, n))),
            rng.uniform(0, 360, n),
        ]
    )
    along = rng.uniform(0, 180, n)
    lines = [
        line
        for line in (REFERENCE / "crystals.csv").read_text().splitlines()
        if not line.startswith("#")
    ]
    print(
        "crystal,class,constants,speeds,"
        + ",".join(f"visible of {case}" for case in CASES)
        + ",singular values of both"
    )
    tables = []
    for row in csv.DictReader(lines):
        names = bi.constants(row["symmetry"])
        stiffness = bi.stiffness(row["symmetry"], **{name: float(row[name] or 0) for name in names})
        moduli, speeds = slopes(row["symmetry"], stiffness, angles, along)
        found = combined(moduli, speeds)
        counts = [np.sum(PRIOR**2 * np.linalg.eigvalsh(information) > 1) for information in found]
        values = PRIOR * np.sqrt(np.linalg.eigvalsh(found[2])[::-1])
        print(
            row["name"],
            row["symmetry"],
            len(names),
            len(speeds),
            *counts,
            " ".join(f"{value:.1f}" for value in values),
            sep=",",
        )
        if row["name"] in ("copper", "Ti"):
            sides = neighbours(row["symmetry"], stiffness)
            constants = ((sides[0] - sides[1]) / (2 * STEP)).reshape(len(names), 36)[
                :, [places(name) for name in names]
            ]
            for case, information in zip(CASES, found, strict=True):
                covariance = np.linalg.inv(information + np.eye(len(names)) / PRIOR**2)
                sds = np.sqrt(np.einsum("ki,kl,li->i", constants, covariance, constants))
                tables.append(
                    [
                        row["name"],
                        case,
                        *(f"{name} {sd:.1f}" for name, sd in zip(names, sds, strict=True)),
                    ]
                )
    for table in tables:
        print(*table, sep=",")
    copper = bi.stiffness("cubic", 168.4, 121.4, 75.4)
    for name, crystals in (
        ("one crystal", copper),
        ("other crystals", copper * rng.uniform(0.9, 1.1, 20000)[:, None, None]),
    ):
        start = time.process_time()
        bi.rayleigh_velocity(
            crystals, rng.uniform(0, 180, (20000, 3)), rng.uniform(0, 180, 20000), 8960.0
        )
        print(f"{name},{20000 / (time.process_time() - start):.0f} speeds a CPU second")
    return 0


def places(name):
    """Of a constant in a stiffness by rows."""
    return 6 * (int(name[1]) - 1) + int(name[2]) - 1


if __name__ == "__main__":
    raise SystemExit(main())
