"""Whether advice holds when it is followed: the sds that `extract` promises for further knowledge,
against those of a run that has it.

    ./bayesindent dev bench advice [--cases 20] [--first 0] [--others]

Twenty sets of synthetic moduli of crystals that no test uses, of 8 to 40 grains with noise of 1 to
5 %. The knowledge that would narrow a constant the most is stated in a second run, with a value
drawn about the truth.
"""

import argparse
import warnings

import numpy as np

import bayesindent as bi
from bayesindent.crystal.elasticity import stiffness_rows

#: GPa, in the order of their class.
CRYSTALS = {
    "nickel": ("cubic", (246.5, 147.3, 124.7)),
    "tungsten": ("cubic", (522.4, 204.4, 160.8)),
    "silver": ("cubic", (124.0, 93.4, 46.1)),
    "niobium": ("cubic", (246.5, 134.5, 28.7)),
    "magnesium": ("hexagonal", (59.3, 25.7, 16.4, 61.5, 21.4)),
    "cobalt": ("hexagonal", (307.0, 165.0, 75.5, 358.1, 103.0)),
    "zirconium": ("hexagonal", (143.4, 72.8, 32.0, 164.8, 65.3)),
    "titanium": ("hexagonal", (162.0, 92.0, 47.0, 180.0, 69.0)),
    "zircon": ("tetragonal", (424.0, 70.0, 149.0, 489.0, 113.0, 48.5)),
    "haematite": ("trigonal", (242.4, 54.6, 15.7, -12.5, 227.3, 85.3)),
}
#: Others, which the choice of the method did not see.
OTHERS = {
    "gold": ("cubic", (192.9, 163.8, 41.5)),
    "silicon": ("cubic", (165.7, 63.9, 79.6)),
    "iron": ("cubic", (230.0, 135.0, 117.0)),
    "vanadium": ("cubic", (228.7, 119.0, 43.2)),
    "beryl": ("hexagonal", (308.5, 128.9, 66.1, 283.4, 118.5)),
    "cadmium": ("hexagonal", (115.8, 39.8, 20.4, 51.4, 40.6)),
    "yttrium": ("hexagonal", (77.9, 28.5, 24.3, 76.9, 21.0)),
    "gallium nitride": ("hexagonal", (390.0, 145.0, 105.0, 398.0, 106.0)),
    "stishovite": ("tetragonal", (453.0, 211.0, 203.0, 776.0, 252.0, 302.0)),
    "corundum": ("trigonal", (497.0, 164.0, 111.0, -23.5, 498.0, 147.0)),
}


def measured(symmetry, constants, rng):
    n, noise = int(rng.integers(8, 41)), rng.uniform(0.01, 0.05)
    euler = np.column_stack(
        [
            rng.uniform(0, 360, n),
            np.degrees(np.arccos(rng.uniform(-1, 1, n))),
            rng.uniform(0, 360, n),
        ]
    )
    moduli = bi.halfspace_modulus(stiffness_rows(symmetry, [constants])[0], euler)
    return {
        "euler_deg": euler,
        "modulus_gpa": moduli * (1 + noise * rng.normal(size=n)),
        "sd_gpa": noise * moduli,
    }


def follow(name, seed):
    """Constant, what was advised, and the sds now, promised and then."""
    symmetry, constants = (CRYSTALS | OTHERS)[name]
    rng = np.random.default_rng(seed)
    table = measured(symmetry, constants, rng)
    settings = {"symmetry": symmetry, "modulus_kind": "indentation_modulus", "samples": 2000}
    document = bi.summary(bi.extract(table, **settings))
    parameters = document["parameters"]
    rows = [row for row in document["identifiability"] if row["kind"] == "knowledge"]
    _, constant, row = min(
        ((row["sd_then"][c] / parameters[c]["sd"], c, row) for row in rows for c in row["sd_then"]),
        key=lambda item: item[:2],
    )
    named = row["name"].split(", ")
    true = bi.quantities(symmetry, constants, names=named)
    sds = {
        quantity: row.get("known_sd", row["relative_sd"] * abs(value))
        for quantity, value in true.items()
    }
    knowledge = {
        quantity: (value + sds[quantity] * rng.normal(), sds[quantity])
        for quantity, value in true.items()
    }
    then = bi.summary(bi.extract(table, **settings, knowledge=knowledge))["parameters"]
    return (
        constant,
        row["name"],
        parameters[constant]["sd"],
        row["sd_then"][constant],
        then[constant]["sd"],
    )


def main(argv=None) -> None:
    parser = argparse.ArgumentParser(
        prog="bayesindent dev bench advice", description=__doc__.splitlines()[0]
    )
    parser.add_argument("--cases", type=int, default=20)
    parser.add_argument("--first", type=int, default=0, help="number of the first case")
    parser.add_argument("--others", action="store_true", help="another set of crystals")
    warnings.simplefilter("ignore")
    options = parser.parse_args(argv)
    crystals, cases = list(OTHERS if options.others else CRYSTALS), options.cases
    held = 0
    for i in range(options.first, options.first + cases):
        name = crystals[i % len(crystals)]
        constant, advice, now, promised, then = follow(name, (200 if options.others else 100) + i)
        held += abs(then / promised - 1) <= 0.25
        print(
            f"{name:10} {constant}  {advice:30.30}  sd {now:6.1f} GPa, promised "
            f"{promised:5.1f}, then {then:5.1f}",
            flush=True,
        )
    print(f"within 25 %: {held} of {cases}")


if __name__ == "__main__":
    main()
