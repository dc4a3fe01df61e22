"""Whether the orientations explain the moduli: shuffled and misread tables, bad values, and tables
that are right.
"""

import numpy as np
import pytest
from scipy import stats
from scipy.spatial.transform import Rotation

import bayesindent as bi
from bayesindent.crystal.elasticity import constant_names, halfspace_modulus, stiffness_rows
from benchmarks.bench_orientations import RARE, harmonics, misfits
from support.densities import Posterior
from support.diagnostics import codes, of_code
from support.step_2_cases import KIND, crystal

SHORT = {"samples": 25, "burn_in": 400, "chains": 2} | KIND
#: Beside those of the reference files: constants of other crystals, GPa.
OTHERS = {
    "iron": ("cubic", (231, 135, 116)),
    "nickel": ("cubic", (246.5, 147.3, 124.7)),
    "tungsten": ("cubic", (523, 203, 160)),
    "zirconium": ("hexagonal", (144, 73, 32, 165, 65)),
}


def measured(name, grains, seed, noise=0.02):
    """A table of grains in random orientations, measured with noise."""
    symmetry, constants = OTHERS[name] if name in OTHERS else crystal(name)
    rng = np.random.default_rng(seed)
    euler = np.column_stack(
        [
            rng.uniform(0, 360, grains),
            np.degrees(np.arccos(rng.uniform(-1, 1, grains))),
            rng.uniform(0, 360, grains),
        ]
    )
    modulus = halfspace_modulus(stiffness_rows(symmetry, [constants])[0], euler)
    table = {
        "euler_deg": euler,
        "modulus_gpa": modulus * (1 + noise * rng.normal(size=grains)),
        "sd_gpa": noise * modulus,
    }
    return symmetry, table, rng


#: What is said of orientations and grains.
SUSPECT = (
    "misread",
    "unexplained",
    "orientations_alike",
    "outlier",
    "residuals_large",
    "scale_hides",
    "tests_disagree",
    "tests_scatter_more",
    "tests_scatter_less",
)


def checked(symmetry, table, **settings):
    """What the document says of orientations, and the diagnostics of them and of grains."""
    document = bi.summary(bi.extract(table, symmetry=symmetry, **SHORT | settings))
    named = of_code(document["warnings"], "misread")
    # What is named cannot be used as it is.
    reading = document["checks"]["orientations"]["better_reading"]
    assert [found["subject"] for found in named] == [reading] * bool(reading)
    assert all(found["severity"] == "unusable" for found in named)
    assert all(found["text"] in "\n".join(document["reasons"]) for found in named)
    return document["checks"]["orientations"], of_code(document["warnings"], *SUSPECT)


def test_orientations_that_are_all_alike_have_no_order():
    symmetry, table, _ = measured("copper", 20, 1)
    table["euler_deg"] = np.tile([10.0, 20.0, 30.0], (20, 1))
    found, suspect = checked(symmetry, table)
    assert found["p_shuffled"] == 1
    assert not of_code(suspect, "misread", "unexplained")


@pytest.mark.long_where("Ti")
@pytest.mark.parametrize(("name", "grains"), [("copper", 20), ("Ti", 30)])
def test_shuffled_orientations(name, grains):
    """Against least squares and shuffles of our own, with sds that are those of the
    measurements.
    """
    symmetry, table, rng = measured(name, grains, 1)
    table["euler_deg"] = table["euler_deg"][rng.permutation(grains)]
    found, suspect = checked(symmetry, table)
    assert codes(suspect) == ["unexplained"]
    assert suspect[0]["numbers"] == pytest.approx(
        {
            "chi_square": found["chi_square"],
            "grains": grains,
            "constant_chi_square": found["constant_chi_square"],
            "percent": 100 * found["p_shuffled"],
        }
    )
    rows = harmonics(
        symmetry,
        Rotation.from_euler("ZXZ", table["euler_deg"], degrees=True).inv().apply([0, 0, 1]),
    )

    def misfit(some):
        return misfits(some / table["sd_gpa"][:, None], table["modulus_gpa"] / table["sd_gpa"])

    shuffled = np.array([misfit(rows[rng.permutation(grains)]) for _ in range(2000)])
    freedom = grains - rows.shape[1]
    assert found["freedom"] == freedom
    # The crystal bends by 0.16 % of M at most beyond these fields: 0.08 sds of a grain.
    assert found["chi_square"] == pytest.approx(misfit(rows), abs=2 * 0.08 * np.sqrt(misfit(rows)))
    # Four sds of the shuffles.
    assert found["p_shuffled"] == pytest.approx(
        np.mean(shuffled <= misfit(rows)), abs=4 * np.sqrt(0.25 / 1000 + 0.25 / 2000)
    )
    assert found["power"] == pytest.approx(
        np.mean(stats.chi2(freedom).sf(shuffled) < RARE), abs=0.05
    )


@pytest.mark.long
@pytest.mark.parametrize(("name", "grains"), [("copper", 20), ("Ti", 30), ("quartz", 20)])
def test_right_orientations(name, grains):
    found, suspect = checked(*measured(name, grains, 1)[:2])
    assert not suspect and found["power"] > 0.5 and found["p_shuffled"] < 0.01 < found["p"]


@pytest.mark.long
def test_other_readings_of_a_table_are_tried():
    symmetry, table, _ = measured("Ti", 30, 2)
    _, suspect = checked(symmetry, table | {"euler_deg": np.roll(table["euler_deg"], 1, axis=0)})
    assert codes(suspect) == ["misread"]
    assert suspect[0]["subject"] == "the orientations one row further up"
    symmetry, table, _ = measured("iron", 20, 2, noise=0.01)
    phi1, phi, phi2 = table["euler_deg"].T
    found, suspect = checked(
        symmetry, table | {"euler_deg": np.column_stack([180 - phi2, phi, 180 - phi1])}
    )
    assert found["better_reading"] == "rotations from crystal to sample axes (the inverse)"
    assert suspect[0]["subject"] == found["better_reading"]


def map_of(path, name, grains, seed, way):
    """A square map of Voronoi grains in which the ways of the check name the way back, and indents
    in the middle of some of them.
    """
    pytest.importorskip("orix.io")
    from support.orientation_maps import write

    symmetry, table, rng = measured(name, 3 * grains, seed)
    y, x = (part.ravel().astype(float) for part in np.mgrid[:49, :49])
    places = np.column_stack([x, y])
    grain = np.argmin(
        ((places[:, None] - 48 * rng.random((3 * grains, 2))) ** 2).sum(axis=-1), axis=1
    )
    seen = places[:, ::-1] if way & 4 else places
    seen = np.where([way & 1, way & 2], 48 - seen, seen)
    order = np.lexsort(seen.T)
    write(
        path,
        *seen[order].T,
        table["euler_deg"][grain[order]],
        point_group={"cubic": "m-3m", "hexagonal": "6/mmm"}[symmetry],
    )
    large = np.flatnonzero(np.bincount(grain) > 12)[:grains]
    centres = [places[grain == k].mean(axis=0) for k in large]
    nearest = [
        places[grain == k][np.argmin(((places[grain == k] - c) ** 2).sum(axis=1))]
        for k, c in zip(large, centres, strict=True)
    ]
    columns = dict(zip(("x_um", "y_um"), np.array(nearest).T.tolist(), strict=True))
    return symmetry, columns | {
        column: table[column][large].tolist() for column in ("modulus_gpa", "sd_gpa")
    }


@pytest.mark.long_where("Ti")
@pytest.mark.parametrize(
    ("name", "grains", "way", "told"),
    [
        ("copper", 20, 0, ""),
        ("copper", 20, 1, "the map with x reversed"),
        ("Ti", 24, 0, ""),
        ("Ti", 24, 2, "the map with y reversed"),
        ("Ti", 24, 3, "the map with x and y reversed"),
        ("Ti", 24, 4, "the map with x and y exchanged"),
        ("Ti", 24, 5, "the map with x and y exchanged, then x reversed"),
    ],
)
def test_a_flipped_map_is_named(tmp_path, name, grains, way, told):
    path = tmp_path / "map.h5"
    found, suspect = checked(
        *map_of(path, name, grains, {"copper": 7, "Ti": 8}[name], way), ebsd=path
    )
    assert found["better_reading"] == told
    # Indents that a flipped map puts into one grain are taken for tests of it, which scatter.
    explained = of_code(suspect, "misread", "unexplained")
    assert [each["subject"] for each in explained] == [told] * bool(told)


def test_tests_that_a_flipped_map_puts_into_one_grain_count_with_all_their_directions(tmp_path):
    """With the direction of the first test of each grain alone this map is not named."""
    found, _ = checked(*map_of(tmp_path / "map.h5", "copper", 20, 12, 1), ebsd=tmp_path / "map.h5")
    assert found["better_reading"] == "the map with x reversed"


@pytest.mark.long
def test_mistaken_crystal_axes_are_named_where_they_matter():
    """Angles for x along a* in place of a: phi2 is a quarter of a turn off."""
    # A mirror of quartz reverses x.
    for name, grains, told in (
        ("quartz", 24, "the crystal axes with x and y exchanged"),
        ("Ti", 24, ""),
    ):
        symmetry, table, _ = measured(name, grains, 3)
        found, suspect = checked(symmetry, table | {"euler_deg": table["euler_deg"] + [0, 0, 90]})
        assert found["better_reading"] == told and len(suspect) == bool(told)


def test_a_nearly_isotropic_crystal_has_no_power():
    symmetry, table, rng = measured("tungsten", 20, 3)
    found, suspect = checked(
        symmetry, table | {"euler_deg": table["euler_deg"][rng.permutation(20)]}
    )
    assert not suspect and found["power"] < 0.1


def warnings_of(document) -> list[dict]:
    """The warnings without what makes the result of such short chains unusable."""
    return [found for found in document["warnings"] if found["severity"] != "unusable"]


@pytest.mark.long_where("zirconium")
@pytest.mark.parametrize("name", ["copper", "zirconium"])
def test_one_bad_value_is_named_first_and_alone(name):
    symmetry, table, _ = measured(name, 20, 4)
    table["modulus_gpa"][6] /= 10
    document = bi.summary(bi.extract(table, symmetry=symmetry, **SHORT))
    first, *others = warnings_of(document)
    assert (first["code"], first["subject"]) == ("outlier", "7")
    assert not of_code(others, *SUSPECT)
    found = document["checks"]["orientations"]
    assert found["outliers"] == [7]
    assert first["numbers"] == pytest.approx(
        {"distance_sd": found["distances_sd"][0], "modulus_gpa": table["modulus_gpa"][6]}
    )
    # A tenth is 0.9/0.02 sds less, of which some are the others' own.
    assert -45.5 < found["distances_sd"][0] < -36


@pytest.mark.long
def test_a_bad_value_that_bends_the_crystal_is_named_first():
    """About the crystal that fits it no other grains agree; what is stated rightly is not
    blamed.
    """
    symmetry, table, _ = measured("nickel", 20, 77)
    table["modulus_gpa"][7] /= 10
    document = bi.summary(
        bi.extract(table, symmetry=symmetry, knowledge={"bulk_modulus": (180, 4)}, **SHORT)
    )
    first, *others = warnings_of(document)
    assert (first["code"], first["subject"]) == ("outlier", "8")
    assert not of_code(
        others, "knowledge_wrong", "knowledge_contradicts", "knowledge_conflict", *SUSPECT
    )


@pytest.mark.long
def test_sds_that_are_inferred_leave_the_shuffles_alone():
    symmetry, table, rng = measured("Ti", 30, 1)
    found, _ = checked(
        symmetry, table | {"euler_deg": table["euler_deg"][rng.permutation(30)]}, scale="inferred"
    )
    assert found["p"] is None and found["power"] is None and found["p_shuffled"] > 0.01


def test_a_turn_that_all_orientations_share():
    """Against the covariance written out, its columns by finite rotations of the sample about its
    three axes.
    """
    symmetry, constants = crystal("Zn")
    _, table, _ = measured("Zn", 8, 5)
    stiffness, sd = stiffness_rows(symmetry, [constants])[0], 2.0
    modulus, columns, step = halfspace_modulus(stiffness, table["euler_deg"]), [], np.radians(0.5)
    for axis in np.eye(3):
        sides = []
        for sign in (1, -1):
            # From crystal to sample, then the turn of the sample.
            turned = Rotation.from_rotvec(sign * step * axis) * Rotation.from_euler(
                "ZXZ", table["euler_deg"], degrees=True
            )
            sides.append(halfspace_modulus(stiffness, turned.as_euler("ZXZ", degrees=True)))
        columns.append(np.radians(sd) * (sides[0] - sides[1]) / (2 * step))
    assert abs(columns[2]).max() < 1e-6 < abs(columns[0]).max()
    covariance = (
        np.diag(table["sd_gpa"] ** 2 + (0.01 * modulus) ** 2) + np.transpose(columns) @ columns
    )
    residual, theory = table["modulus_gpa"] - modulus, bi.Surrogate.load("halfspace")
    posterior = Posterior.of(
        table, symmetry=symmetry, surrogate=theory, misalignment_sd_deg=sd, scatter_sd=0.01, **KIND
    )
    expected = stats.multivariate_normal(np.zeros(8), covariance).logpdf(residual)
    assert posterior.evaluate(constants)[1][0] == pytest.approx(expected, abs=0.02)
    without = Posterior.of(
        table, symmetry=symmetry, surrogate=theory, scatter_sd=0.01, **KIND
    ).evaluate(constants)[1][0]
    assert abs(without - expected) > 0.5


def test_a_shared_turn_needs_angles():
    table = {
        "u": [0, 1, 1],
        "v": [0, 1, 2],
        "w": [1, 1, 3],
        "indentation_modulus_gpa": [130, 140, 150],
        "sd_gpa": [3, 3, 3],
    }
    with pytest.raises(bi.InputError, match="misalignment_sd_deg = 2.0 needs Euler angles"):
        bi.Problem.from_keywords(
            "f",
            {"measurements": table},
            problem={"symmetry": "cubic"},
            measurements={"misalignment_sd_deg": 2.0},
        )


@pytest.mark.long
def test_the_error_budget_has_the_shared_turn():
    symmetry, table, _ = measured("Zn", 12, 6, noise=0.005)
    bounds = {
        name: (0.7 * value, 1.3 * value)
        for name, value in zip(constant_names(symmetry), crystal("Zn")[1], strict=True)
    }
    settings = SHORT | {"bounds": bounds, "samples": 400, "burn_in": 2000}
    budgets = [
        bi.summary(bi.extract(table, symmetry=symmetry, **settings, misalignment_sd_deg=sd))[
            "error_budget"
        ]["C44"]
        for sd in (0.0, 5.0)
    ]
    assert budgets[0]["orientation"] == 0.0 < budgets[1]["orientation"]
