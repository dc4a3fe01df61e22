"""Indents near grain boundaries: constants where some may lie in the next grain, taken as mixtures, as certain, or left out.

    ./bayesindent bench boundary [--seeds 20] [--indents 6] [--probability 0.35]

Sixteen random grains of copper by the exact theory, noise and stated bulk modulus 2 %. Of the first `--indents` each lies in its other grain
with the probability that its table states. Root mean square of z, and mean sd in GPa, of C11, C12 and C44.
"""

import argparse
import warnings

import numpy as np

import bayesindent as bi
from bayesindent.crystal.elasticity import halfspace_modulus, stiffness_rows

COPPER, GRAINS, NOISE = (168.4, 121.4, 75.4), 16, 0.02
ANGLES = ("phi1_deg", "Phi_deg", "phi2_deg")
WAYS = ("mixture", "taken as certain", "left out")


def tables(seed, indents, probability):
    """The measurements of a data set in three ways, and what is known."""
    rng = np.random.default_rng(seed)

    def orientations():
        turns = rng.uniform(0, 360, (2, GRAINS))
        return np.column_stack([turns[0], np.degrees(np.arccos(rng.uniform(-1, 1, GRAINS))), turns[1]])

    own, other = orientations(), orientations()
    uncertain = np.where(np.arange(GRAINS) < indents, probability, 0.0)
    lies_in = np.where((rng.random(GRAINS) < uncertain)[:, None], other, own)
    moduli = halfspace_modulus(stiffness_rows("cubic", [COPPER])[0], lies_in)
    measured = moduli * (1 + NOISE * rng.normal(size=GRAINS))
    certain = dict(zip(ANGLES, own.T, strict=True)) | {"indentation_modulus_gpa": measured, "sd_gpa": NOISE * moduli}
    mixture = certain | {"other_probability": uncertain} | {f"other_{name}": values for name, values in zip(ANGLES, other.T, strict=True)}
    bulk = float(bi.quantities("cubic", COPPER, names=["bulk_modulus"])["bulk_modulus"])
    rows = (mixture, certain, {name: values[indents:] for name, values in certain.items()})
    return rows, {"bulk_modulus": (bulk * (1 + NOISE * rng.normal()), NOISE * bulk)}


def main(argv=None) -> None:
    parser = argparse.ArgumentParser(prog="bayesindent bench boundary", description=__doc__.splitlines()[0])
    parser.add_argument("--seeds", type=int, default=20)
    parser.add_argument("--indents", type=int, default=6)
    parser.add_argument("--probability", type=float, default=0.35)
    options = parser.parse_args(argv)
    warnings.simplefilter("ignore")
    found = np.zeros((len(WAYS), options.seeds, 2, len(COPPER)))
    for seed in range(options.seeds):
        rows, knowledge = tables(seed, options.indents, options.probability)
        for way, table in enumerate(rows):
            draws = bi.extract(table, "cubic", knowledge=knowledge, seed=seed).posterior
            for k, name in enumerate(bi.constants("cubic")):
                found[way, seed, :, k] = float(draws[name].mean()), float(draws[name].std())
    print("| way | z of C11, C12, C44 | sd, GPa |\n|---|---|---|")
    for way, (mean, sd) in zip(WAYS, found.transpose(0, 2, 1, 3), strict=True):
        z = np.sqrt(np.mean(((mean - COPPER) / sd) ** 2, axis=0))
        print(f"| {way} | {', '.join(f'{value:.2f}' for value in z)} | {', '.join(f'{value:.1f}' for value in sd.mean(axis=0))} |")


if __name__ == "__main__":
    main()
