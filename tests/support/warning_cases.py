"""Small problems that give warnings within seconds: a namelist and its canonical tables each."""

from pathlib import Path

import numpy as np

from bayesindent.crystal.elasticity import halfspace_modulus, stiffness_rows

__all__ = ["CASES", "measured", "write_case"]

COPPER, TITANIUM = (168.4, 121.4, 75.4), (162.4, 92.0, 46.7, 180.7, 69.0)
GRAINS = 20
NAMELIST = """\
&problem symmetry = '{symmetry}' /
&surrogate file = '{surrogate}' /
&measurements file = '{table}', modulus_kind = 'indentation_modulus'{technique}{measurements} /
&sampler samples = {samples}, burn_in = 500, chains = 2{sampler} /
{more}
"""
BOUNDS = "&prior c_min = {}, c_max = {} /"
BULK = "&knowledge quantity = 'bulk_modulus', mean = {}, sd = {} /"
BUILD = """\
&problem symmetry = 'cubic' /
&simulation simulator = 'theory' /
&surrogate degree = 2 /
&design candidates = '{table}', budget = 12, batch = 2 /
"""


def measured(symmetry="cubic", constants=COPPER, sd=0.02, noise=0.02, factor=1.0) -> dict:
    """The columns of a table of grains in random orientations on the half-space; the noise and the
    sds are relative.
    """
    rng = np.random.default_rng(4)
    angles = np.column_stack(
        [
            rng.uniform(0, 360, GRAINS),
            np.degrees(np.arccos(rng.uniform(-1, 1, GRAINS))),
            rng.uniform(0, 360, GRAINS),
        ]
    )
    modulus = factor * halfspace_modulus(stiffness_rows(symmetry, [constants])[0], angles)
    return {
        **dict(zip(("phi1_deg", "Phi_deg", "phi2_deg"), angles.T)),
        "modulus_gpa": modulus * (1 + noise * rng.normal(size=GRAINS)),
        "sd_gpa": sd * modulus,
    }


def changed(column, row, factor, **options) -> dict:
    """A table in which one value is another."""
    table = measured(**options)
    table[column][row] *= factor
    return table


def misread() -> dict:
    """Titanium whose moduli are one row off."""
    table = measured("hexagonal", TITANIUM)
    return table | {name: np.roll(table[name], 1) for name in ("modulus_gpa", "sd_gpa")}


def shuffled() -> dict:
    """Copper whose moduli are in no order."""
    table, order = measured(), np.random.default_rng(7).permutation(GRAINS)
    return table | {name: table[name][order] for name in ("modulus_gpa", "sd_gpa")}


def few(rows: int) -> dict:
    """The first grains of a table."""
    return {name: values[:rows] for name, values in measured().items()}


def candidates() -> dict:
    """Crystals for a build, one of them far outside of its domain."""
    rng = np.random.default_rng(5)
    constants = np.array(COPPER) * rng.uniform(0.9, 1.1, (12, 1))
    constants[-1] = 100, 99, 120
    table = measured()
    angles = {name: table[name][:12] for name in ("phi1_deg", "Phi_deg", "phi2_deg")}
    return dict(zip(("C11", "C12", "C44"), constants.T)) | angles


def repeated() -> dict:
    """Four tests of each grain, of which those of the last one disagree."""
    table = {name: np.repeat(values, 4) for name, values in measured(noise=0.0).items()}
    scatter = 1 + 0.02 * np.random.default_rng(6).normal(size=4 * GRAINS)
    scatter[-4:] = 1.0, 1.2, 0.8, 1.1
    grains = np.repeat(np.arange(GRAINS), 4)
    return {"grain": grains} | table | {"modulus_gpa": table["modulus_gpa"] * scatter}


#: The table of a case, and what of its namelist differs from the defaults of `write_case`.
CASES = {
    "misread": (misread, {"symmetry": "hexagonal"}),
    "unexplained": (shuffled, {}),
    "outlier": (lambda: changed("modulus_gpa", 6, 0.5), {}),
    "limits": (measured, {"more": BOUNDS.format("50, 40, 15", "250, 110, 120")}),
    "wrong": (
        measured,
        {"more": BOUNDS.format("50, 40, 15", "250, 150, 120") + BULK.format(300, 3.3)},
    ),
    "contradicting": (measured, {"more": BULK.format(1650, 3)}),
    "few": (measured, {"samples": 20}),
    "poor": (
        lambda: measured("hexagonal", TITANIUM),
        {"symmetry": "hexagonal", "samples": 20, "sampler": ", method = 'scmh'"},
    ),
    "small_sds": (lambda: measured(sd=0.0001), {"measurements": ", scale = 'inferred'"}),
    "sds_below": (lambda: measured(sd=0.004), {}),
    "sds_above": (lambda: measured(sd=0.2), {}),
    "large_sd": (lambda: changed("sd_gpa", 3, 40.0), {}),
    "one_grain": (lambda: few(1), {}),
    "two_grains": (lambda: few(2), {"symmetry": "hexagonal"}),
    "radians": (
        lambda: few(2) | {"phi1_deg": [1, 2], "Phi_deg": [0.2, 1.2], "phi2_deg": [3, 3]},
        {},
    ),
    "pressure": (lambda: measured() | {"contact_radius_um": np.full(GRAINS, 1.5)}, {}),
    "yields": (
        lambda: measured() | {"contact_radius_um": np.full(GRAINS, 1.5)},
        {"measurements": ", yield_gpa = 0.3"},
    ),
    "contact_radii": (
        lambda: measured(factor=1.1) | {"contact_radius_um": np.linspace(0.5, 1.0, GRAINS)},
        {"surrogate": "block", "more": BULK.format(137.1, 2)},
    ),
    "outside": (
        lambda: measured(constants=(129.1, 109.7, 82.4), factor=1.1),
        {"surrogate": "block", "more": BULK.format(116.2, 2)},
    ),
    "small_grains": (lambda: measured() | {"grain_radius_um": np.full(GRAINS, 1.0)}, {}),
    "tests": (repeated, {}),
    "technique": (measured, {"technique": ""}),
    "candidates": (candidates, {}),
}


def write_case(folder: Path, name: str, columns: dict, **stated) -> Path:
    """Write NAME.nml and its table NAME.csv into a folder."""
    lines = [",".join(map(str, row)) for row in zip(*columns.values(), strict=True)]
    (folder / f"{name}.csv").write_text("\n".join([",".join(columns), *lines]) + "\n")
    default = {"symmetry": "cubic", "surrogate": "halfspace", "samples": 200}
    default |= {"technique": ", technique = 'exact'"}
    text = dict.fromkeys(("measurements", "sampler", "more"), "") | default | stated
    template = BUILD if "C11" in columns else NAMELIST
    path = folder / f"{name}.nml"
    path.write_text(template.format(table=f"{name}.csv", **text))
    return path
