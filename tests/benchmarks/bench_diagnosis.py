"""Whether other models of the measurements name injected faults, and whether clean tables are left
alone: a confusion matrix of injected against named groups.

Synthetic moduli by the exact theory, with normal noise of 2 %. The sizes of the faults were chosen
before any result; no threshold was chosen on these crystals.

    ./bayesindent dev bench diagnosis
    ./bayesindent dev bench diagnosis --sets 1 --clean 20 --size 0.5
    ./bayesindent dev bench diagnosis --evidence 20
"""

import argparse
import time
from collections import Counter

import numpy as np

from bayesindent.crystal.elasticity import constant_names, halfspace_modulus, stiffness_rows
from support.densities import Posterior
from support.evidence import THEORY, laplace_log_z, nested_log_z

#: Class and constants, GPa.
CRYSTALS = {
    "nickel": ("cubic", (248, 155, 124)),
    "lead": ("cubic", (49.5, 42.3, 14.9)),
    "cobalt": ("hexagonal", (307, 165, 75.5, 358, 103)),
    "rutile": ("tetragonal", (269, 177, 146, 480, 124, 192)),
    "quartz": ("trigonal", (86.8, 7.0, 11.9, -18.0, 105.8, 58.2)),
}
GRAINS, NOISE = 24, 0.02


def scaled(rows, factor):
    """A fault that multiplies the moduli of some rows."""

    def change(table, _, size):
        table["modulus_gpa"][rows] *= 1 + size * factor

    return change


def shaped(shape):
    """A fault that multiplies all moduli by a function of their place from -0.5 to 0.5."""

    def change(table, rng, size):
        place = np.linspace(-0.5, 0.5, GRAINS)
        table["modulus_gpa"] *= 1 + size * shape(place, rng)

    return change


def turned(reading):
    """A fault of the orientations."""

    def change(table, _rng, _size):
        table["euler_deg"] = reading(table["euler_deg"])

    return change


def inverted(euler):
    """Angles of the inverse rotations."""
    return np.column_stack([180 - euler[:, 2], euler[:, 1], 180 - euler[:, 0]])


def shuffle(table, rng, _size):
    """Rows in any order."""
    table["euler_deg"] = table["euler_deg"][rng.permutation(GRAINS)]


DRIFT, SESSION, OUTLIERS, PHASE = (
    "a drift",
    "another session",
    "outliers",
    "grains of a second phase",
)
#: The group, what names the fault, and what is done to a table of the right moduli, or the class
#: that is declared.
FAULTS = {
    "class above": ("symmetry", "", "isotropic"),
    "cubic declared": ("symmetry", "", "cubic"),
    "hexagonal declared": ("symmetry", "", "hexagonal"),
    "drift of 10 %": ("time", DRIFT, shaped(lambda place, _: 0.10 * place)),
    "drift of -15 %": ("time", DRIFT, shaped(lambda place, _: -0.15 * place)),
    "session of 8 %": ("time", SESSION, shaped(lambda place, _: 0.08 * (place > 0))),
    "session of -12 %": ("time", SESSION, shaped(lambda place, _: -0.12 * (place > 0.17))),
    "noise of 6 %": ("noise", "", shaped(lambda place, rng: 0.06 * rng.normal(size=place.size))),
    "noise of 10 %": ("noise", "", shaped(lambda place, rng: 0.10 * rng.normal(size=place.size))),
    "one outlier": ("noise", OUTLIERS, scaled([5], 0.4)),
    "two outliers": ("noise", OUTLIERS, scaled([3, 11], 0.3)),
    "an outlier below": ("noise", OUTLIERS, scaled([7], -0.4)),
    "five outliers": ("noise", OUTLIERS, scaled([1, 6, 9, 15, 20], 0.5)),
    "second phase": ("noise", PHASE, scaled(np.arange(0, GRAINS, 3), 0.6)),
    "softer phase": ("noise", PHASE, scaled(np.arange(1, GRAINS, 4), -0.35)),
    "reverse order": ("orientations", "reverse order", turned(lambda euler: euler[::-1])),
    "a row down": ("orientations", "one row", turned(lambda euler: np.roll(euler, 1, axis=0))),
    "a row up": ("orientations", "one row", turned(lambda euler: np.roll(euler, -1, axis=0))),
    "inverse": ("orientations", "the inverse", turned(inverted)),
    "any order": ("orientations", "in any other order", shuffle),
}


def measured(crystal: str, seed: int) -> tuple[dict, np.random.Generator]:
    """A right table."""
    symmetry, constants = CRYSTALS[crystal]
    rng = np.random.default_rng(seed)
    euler = np.column_stack(
        [
            rng.uniform(0, 360, GRAINS),
            np.degrees(np.arccos(rng.uniform(-1, 1, GRAINS))),
            rng.uniform(0, 360, GRAINS),
        ]
    )
    modulus = halfspace_modulus(stiffness_rows(symmetry, [constants])[0], euler)
    noise = 1 + NOISE * rng.normal(size=GRAINS)
    return {"euler_deg": euler, "modulus_gpa": modulus * noise, "sd_gpa": NOISE * modulus}, rng


def diagnosed(table: dict, symmetry: str) -> dict:
    """What explains a table, with `group` and `rival` of the best explanation: 'none' if it is not
    above 3.
    """
    settings = {"symmetry": symmetry, "modulus_kind": "indentation_modulus"}
    found = Posterior.of(table, surrogate=THEORY, **settings).diagnose()
    best = found["rivals"][0] if found["rivals"] and found["log_odds"][0] > 3 else "none: "
    found["group"], _, found["rival"] = best.partition(": ")
    return found


def is_refused(found: dict) -> bool:
    """Whether the result may be unusable, whatever the other model changes and however closely the
    moduli follow their order.
    """
    misfit = found["factor"] > 1.3 and (
        found["p"] < 1e-6 or (found["p"] < 1e-3 and found["order_odds"] > 0)
    )
    return misfit or found["log_odds"][0] > 7


def compare_evidence(count: int) -> None:
    """Print log Z of right tables within random bounds, and that of nested sampling."""
    print("| crystal | bounds relative to the constants | nested sampling | here |")
    print("|---|---|---|---|")
    for i in range(count):
        name = list(CRYSTALS)[i % 3]
        symmetry, constants = CRYSTALS[name]
        table, rng = measured(name, 7000 + i)
        low, high = 1 - rng.uniform(0.02, 0.5), 1 + rng.uniform(0.02, 0.5)
        bounds = {
            constant: (low * value, high * value)
            for constant, value in zip(constant_names(symmetry), constants, strict=True)
        }
        expected, error = nested_log_z(table, bounds, symmetry=symmetry)
        found = laplace_log_z(table, bounds, symmetry=symmetry)
        print(
            f"| {name} | {low:.2f} .. {high:.2f} | {expected:.2f} ± {error:.2f} | {found:.2f} |",
            flush=True,
        )


def main(argv=None) -> None:
    """Print the confusion matrix and what is said of clean tables."""
    parser = argparse.ArgumentParser(
        prog="bench diagnosis",
        description=__doc__,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    parser.add_argument("--sets", type=int, default=5, help="tables for a fault and crystal")
    parser.add_argument("--clean", type=int, default=200, help="tables without a fault")
    parser.add_argument("--size", type=float, default=1.0, help="factor on the sizes of the faults")
    parser.add_argument(
        "--evidence",
        type=int,
        default=0,
        help="tables whose log Z is compared; nothing else is done",
    )
    arguments = parser.parse_args(argv)
    if arguments.evidence:
        compare_evidence(arguments.evidence)
        return
    began = time.process_time()
    header = ["symmetry", "orientations", "time", "noise", "statements", "none"]
    print("| fault | group | " + " | ".join(header) + " |")
    print("|---|---|" + "---|" * len(header))
    groups = names = total = 0
    for fault, (group, name, change) in FAULTS.items():
        counts: Counter[str] = Counter()
        for crystal, (symmetry, _) in CRYSTALS.items():
            declared = change if isinstance(change, str) else symmetry
            if isinstance(change, str) and declared == symmetry:
                continue
            for seed in range(arguments.sets):
                table, rng = measured(crystal, 1000 + seed)
                if not isinstance(change, str):
                    change(table, rng, arguments.size)
                found = diagnosed(table, declared)
                counts[found["group"]] += 1
                expected = f"{symmetry} crystals" if isinstance(change, str) else name
                names += found["group"] == group and expected in found["rival"]
        groups += counts[group]
        total += sum(counts.values())
        cells = [str(counts[name] or "") for name in header]
        print(f"| {fault} | {group} | " + " | ".join(cells) + " |", flush=True)
    print(f"\nof {total}: right group first {groups}, the right explanation {names}", flush=True)
    crystals = list(CRYSTALS)
    documents = [
        diagnosed(measured(name, 5000 + i)[0], CRYSTALS[name][0])
        for i in range(arguments.clean)
        for name in [crystals[i % len(crystals)]]
    ]
    refused = sum(map(is_refused, documents))
    above = sum(each["group"] != "none" for each in documents)
    print(f"{arguments.clean} clean tables: {refused} refused, {above} with log odds above 3")
    print(f"{time.process_time() - began:.0f} CPU seconds")
