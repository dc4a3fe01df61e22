"""The crystal functions against the reference moduli and against each other.

Modules: space_groups.f90.
"""

import numpy as np
import pytest

import bayesindent as bi
from bayesindent.crystal.elasticity import class_name, stiffness_rows
from support.csv_tables import ANGLES, named_numbers, numbers, read_rows
from support.reference_theory import direct_modulus
from support.tree import REFERENCE


def stiffness_of(row):
    return bi.stiffness(row["symmetry"], **named_numbers(row, bi.constants(row["symmetry"])))


def reference_rows():
    return read_rows(REFERENCE / "halfspace_moduli.csv")


@pytest.mark.parametrize(
    "row", reference_rows(), ids=lambda row: f"{row['material']}-{row['orientation']}"
)
def test_theory_meets_reference(row):
    stiffness = stiffness_of(row)
    euler = numbers([row], ANGLES)[0]
    assert bi.halfspace_modulus(stiffness, euler) == pytest.approx(
        float(row["M_elliptic"]), rel=2e-6
    )
    assert bi.halfspace_modulus(stiffness, euler, circular=True) == pytest.approx(
        float(row["M_vn"]), rel=2e-6
    )
    assert bi.anisotropy_index(stiffness) == pytest.approx(float(row["A_U"]), abs=1e-6)


def crystals():
    """Rows of moduli with the crystal that each is of."""
    of = {row["name"]: row for row in read_rows(REFERENCE / "crystals.csv")}
    return [row | of[row["name"]] for row in read_rows(REFERENCE / "crystal_moduli.csv")]


@pytest.mark.parametrize("row", crystals(), ids=lambda row: f"{row['name']}-{row['phi1_deg']}")
def test_theory_of_every_class(row):
    modulus = bi.halfspace_modulus(stiffness_of(row), numbers([row], ANGLES)[0])
    assert modulus == pytest.approx(float(row["M_elliptic"]), rel=1e-6)


@pytest.mark.parametrize(
    "symmetry, constants",
    [
        ("cubic", [129.1, 109.7, 82.4]),
        ("cubic", [100.0, 96.5, 95.0]),
        ("hexagonal", [300.0, 120.0, 1.5, 6.0, 12.0]),
    ],
)
def test_theory_of_very_anisotropic_crystals(symmetry, constants):
    """Indices 8, 63 and 91 against sums over many angles and a general minimiser."""
    stiffness = stiffness_rows(symmetry, [constants])[0]
    angles = np.array([[10.0, 50.0, 20.0]])
    assert bi.halfspace_modulus(stiffness, angles) == pytest.approx(
        direct_modulus(stiffness, angles, points=256, angles=192), rel=2e-6
    )


def test_rows_of_an_array_do_not_depend_on_each_other():
    rows = crystals()
    stiffness = np.array([stiffness_of(row) for row in rows])
    angles = numbers(rows, ANGLES)
    moduli = bi.halfspace_modulus(stiffness, angles)
    assert (
        moduli == [bi.halfspace_modulus(*row) for row in zip(stiffness, angles, strict=True)]
    ).all()
    assert (moduli[::-1] == bi.halfspace_modulus(stiffness[::-1], angles[::-1], threads=2)).all()
    assert (moduli == bi.Surrogate.load("halfspace").predict(stiffness, angles)[0]).all()


def test_names_of_classes():
    assert bi.constants("M-3m") == bi.constants("cubic") == ("C11", "C12", "C44")
    assert bi.constants("-1") == tuple(f"C{i}{j}" for i in range(1, 7) for j in range(i, 7))
    with pytest.raises(
        bi.InputError, match="'kubic' is no crystal class; allowed isotropic, cubic, m-3m"
    ):
        bi.stiffness("kubic", C11=1)
    with pytest.raises(bi.InputError, match="takes the constants C11, C12, not C11"):
        bi.stiffness("isotropic", C11=1)


def test_averages_of_arrays():
    copper = bi.stiffness("cubic", C11=[[168.4], [100.0]], C12=121.4, C44=75.4)
    index, logarithmic, averages = (
        bi.anisotropy_index(copper),
        bi.log_anisotropy(copper),
        bi.polycrystal_averages(copper),
    )
    assert index.shape == logarithmic.shape == averages["bulk_voigt"].shape == (2, 1)
    assert index[0, 0] == pytest.approx(1.824218, abs=1e-6) and logarithmic[0, 0] == pytest.approx(
        1.28, abs=0.005
    )
    assert averages["bulk_reuss"][0, 0] == pytest.approx((168.4 + 2 * 121.4) / 3)
    assert np.isnan([index[1, 0], logarithmic[1, 0], averages["shear_reuss"][1, 0]]).all()


def test_arrays_broadcast():
    matrices = bi.stiffness("cubic", C11=[168.4, 225.0], C12=[121.4, 135.0], C44=[75.4, 124.0])
    assert matrices.shape == (2, 6, 6)
    moduli = bi.halfspace_modulus(matrices[:, None], np.zeros((3, 3)))
    assert moduli.shape == (2, 3)
    assert moduli[:, 0] == pytest.approx([134.0130407, 214.1138571], rel=1e-6)


def test_unstable_crystal_is_refused():
    with pytest.raises(bi.InputError, match="unstable"):
        bi.halfspace_modulus(bi.stiffness("cubic", C11=100, C12=120, C44=50), [0, 0, 0])


@pytest.mark.parametrize(
    "stiffness, angles, message",
    [
        (np.eye(3), [0, 0, 0], "a stiffness has the shape"),
        (np.triu(np.ones((6, 6))), [0, 0, 0], "not symmetric"),
        (np.eye(6), [0, 0], "a crystal has 3 Euler angles"),
        (np.eye(6), [0, np.nan, 0], "angle is not finite"),
        (np.ones((2, 6, 6)), np.zeros((3, 3)), "do not broadcast"),
    ],
)
def test_arrays_that_are_no_oriented_crystals_are_refused(stiffness, angles, message):
    with pytest.raises(bi.InputError, match=message):
        bi.halfspace_modulus(stiffness, angles)


def test_wrappers_keep_double_precision():
    for name in dir(bi.core.native):
        documentation = getattr(bi.core.native, name).__doc__ or ""
        assert "array('f')" not in documentation, name


#: Laue classes with more than one name in their crystal system, by the point groups of diffpy.
LAUE = {
    **dict.fromkeys(("PG4", "PG4bar", "PG4/m"), "4/m"),
    **dict.fromkeys(("PG3", "PG3bar"), "-3"),
}


@pytest.mark.parametrize("number", range(1, 231))
def test_space_groups_have_their_class(number):
    """By number and by symbol, as diffpy has them."""
    group = pytest.importorskip("diffpy.structure.spacegroups").GetSpaceGroup(number)
    expected = LAUE.get(group.point_group_name, group.crystal_system.lower())
    if number in (2, 3, 4, 6, 23, 32, 222):
        # They are point groups of other classes, too.
        with pytest.raises(bi.InputError, match="is no crystal class"):
            class_name(str(number))
    else:
        assert class_name(str(number)) == expected
    assert class_name(group.short_name) == class_name(group.short_name.replace(" ", "")) == expected


@pytest.mark.parametrize(
    ("word", "expected"),
    [("Fm3m", "cubic"), ("Ia3d", "cubic"), ("F43m", "cubic"), ("Pa3", "cubic"), ("P3112", "-3m")],
)
def test_older_symbols_of_space_groups(word, expected):
    assert class_name(word) == class_name(expected)


@pytest.mark.parametrize("word", ["P112", "P 1 1 2/m", "P1121/b", "P 2/m 1 1", "B2/b", "P21/b"])
def test_monoclinic_cells_with_another_unique_axis_are_refused(word):
    with pytest.raises(bi.InputError, match="is no crystal class"):
        class_name(word)


@pytest.mark.parametrize("word", ["0", "231", "cubik", "Qm-3m", "P", "F m", "bcd", "hexa"])
def test_other_words_are_no_space_groups(word):
    if word == "F m":
        assert class_name(word) == "monoclinic"
    else:
        with pytest.raises(bi.InputError, match="is no crystal class"):
            class_name(word)
