"""Embedded grains for `bench simulate`: against the half-space, and what they cost."""

import csv
import time
from collections.abc import Iterator

import numpy as np

import bayesindent as bi
from support.tree import REFERENCE

__all__ = [
    "CRYSTALS",
    "SPECIMENS",
    "alike",
    "around",
    "costs",
    "large",
]

#: Of three classes, each in a general orientation.
CRYSTALS = ("copper", "Zn", "Ti", "rutile", "quartz")
ANGLES = (200.0, 50.0, 25.0)
#: Specimens by what is printed of them, contact radius 0.5 um.
SPECIMENS: dict[str, dict] = {
    f"hemisphere, {r} um": {"geometry": "grain", "grain_radius_um": r}
    for r in (1.5, 2.5, 5.0, 10.0, 50.0)
}


def isotropic(young: float, nu: float) -> np.ndarray:
    """Stiffness (6, 6), GPa."""
    scale = young / ((1 + nu) * (1 - 2 * nu))
    return bi.stiffness("isotropic", C11=scale * (1 - nu), C12=scale * nu)


def hill(crystal) -> tuple[float, float]:
    """Young's modulus (GPa) and Poisson's ratio of the polycrystal, means of Voigt's and
    Reuss's.
    """
    average = bi.polycrystal_averages(crystal)
    bulk, shear = (
        float(average[f"{kind}_voigt"] + average[f"{kind}_reuss"]) / 2 for kind in ("bulk", "shear")
    )
    return 9 * bulk * shear / (3 * bulk + shear), (3 * bulk - 2 * shear) / (6 * bulk + 2 * shear)


def around(settings: dict, young: float, nu: float) -> dict:
    """The settings of a specimen with isotropic surroundings."""
    return settings | {"matrix": "isotropic", "matrix_young_gpa": young, "matrix_nu": nu}


def reference_rows(name: str) -> list[dict]:
    """Rows of a table of tests/reference."""
    with (REFERENCE / name).open() as stream:
        return list(csv.DictReader(line for line in stream if not line.startswith("#")))


def two_meshes(settings: dict, stiffness, angles) -> np.ndarray:
    """The modulus at the default and extrapolated, GPa: the finer mesh of an extrapolation is the
    default one.
    """
    result = bi.Indentation(**(settings | {"extrapolate": True})).run(stiffness, angles)
    return np.array([result.modulus_of_mesh_gpa[0], result.indentation_modulus_gpa])


def alike() -> Iterator[tuple]:
    """Where a specimen and its surroundings are alike it is a half-space, and has its modulus."""
    cases = [(200.0, nu, isotropic(200.0, nu)) for nu in (0.1, 0.3, 0.45)]
    expected = [
        two_meshes({"extrapolate": True}, stiffness, (0, 0, 0)) for _, _, stiffness in cases
    ]
    for name, settings in SPECIMENS.items():
        found = np.array(
            [
                100 * (two_meshes(around(settings, young, nu), c, (0, 0, 0)) / m - 1)
                for (young, nu, c), m in zip(cases, expected)
            ]
        )
        yield (
            name,
            *(f"{value:+.3f}" for value in found[:, 0]),
            *(f"{value:+.3f}" for value in found[:, 1]),
        )


def large() -> Iterator[tuple]:
    """Anisotropic crystals where the surroundings, of their average, are far away: a/R = 0.002."""
    rows = {row["name"]: row for row in reference_rows("crystals.csv")}
    for name in CRYSTALS:
        row = rows[name]
        crystal = bi.stiffness(
            row["symmetry"], **{c: float(row[c]) for c in bi.constants(row["symmetry"])}
        )
        average = hill(crystal)
        half, exact = (
            two_meshes({"extrapolate": True}, crystal, ANGLES),
            bi.halfspace_modulus(crystal, ANGLES),
        )
        for specimen, settings in (
            ("half-space", None),
            ("hemisphere, 250 um", {"geometry": "grain", "grain_radius_um": 250.0}),
        ):
            found = (
                half
                if settings is None
                else two_meshes(around(settings, *average), crystal, ANGLES)
            )
            yield (
                name,
                row["symmetry"],
                specimen,
                *(f"{100 * x:+.3f}" for x in found / half - 1),
                *(f"{100 * x:+.3f}" for x in found / exact - 1),
            )


def costs(crystal) -> Iterator[tuple]:
    """Set-up and one curve of each specimen, CPU time."""
    specimens = {"half-space": {}, "block, the paper's": {"geometry": "block"}}
    specimens |= {name: around(settings, 160.0, 0.25) for name, settings in SPECIMENS.items()}
    for name, settings in specimens.items():
        start = time.process_time()
        model = bi.Indentation(**settings)
        set_up = time.process_time() - start
        curve = []
        for _ in range(2):
            start = time.process_time()
            model.run(crystal, (0, 30, 0))
            curve.append(time.process_time() - start)
        yield (
            name,
            model.elements,
            model.unknowns,
            f"{1e-9 * model.factor_operations:.1f}",
            f"{1e-6 * model.workspace_bytes:.0f}",
            f"{set_up:.2f}",
            f"{min(curve):.2f}",
        )
