"""What is said of measurements whose depths, or whose grains' sizes, are given."""

import numpy as np
import pytest

import bayesindent as bi
from support.diagnostics import codes, of_code

RNG = np.random.default_rng(3)
N = 12
ANGLES = np.column_stack(
    [RNG.uniform(0, 360, N), np.degrees(np.arccos(RNG.uniform(-1, 1, N))), RNG.uniform(0, 360, N)]
)
COPPER = bi.stiffness("cubic", C11=168.4, C12=121.4, C44=75.4)
MODULI = bi.halfspace_modulus(np.array(N * [COPPER]), ANGLES)


#: Diagnostics of the mean contact pressure.
PRESSURES = ("plastic_contact", "yielding_contact")


def warnings_of(surrogate="halfspace", moduli=MODULI, yield_gpa=None, **columns):
    """The warnings of a short Step 2."""
    table = {
        "phi1_deg": ANGLES[:, 0],
        "Phi_deg": ANGLES[:, 1],
        "phi2_deg": ANGLES[:, 2],
        "modulus_gpa": moduli,
        "sd_gpa": np.full(N, 2.0),
    }
    posterior = bi.extract(
        table | columns,
        symmetry="cubic",
        modulus_kind="indentation_modulus",
        surrogate=surrogate,
        samples=500,
        chains=2,
        yield_gpa=yield_gpa,
    )
    return bi.summary(posterior)["warnings"]


@pytest.mark.long
def test_small_grains():
    """(mean/modulus)^(0.95 a/R) - 1 of the worst grain; large grains, and grains without a size,
    are not warned of.
    """
    radius = np.full(N, 1000.0)
    worst = int(np.argmax(np.abs(np.log(MODULI.mean() / MODULI))))
    radius[worst] = 1.5
    bias = (MODULI.mean() / MODULI[worst]) ** (0.95 * 0.5 / 1.5) - 1
    assert abs(bias) > 0.01
    (found,) = of_code(warnings_of(grain_radius_um=radius), "small_grains")
    assert found["subject"] == f"{worst + 1}"
    assert found["numbers"] == pytest.approx(
        {"small": 1, "grains": N, "percent": 100 * bias}, abs=0.05
    )
    assert "small_grains" not in codes(warnings_of(grain_radius_um=np.full(N, 1000.0)))
    assert "small_grains" not in codes(warnings_of())


@pytest.mark.long
def test_another_depth():
    """The surrogate of the block is of a contact radius of 0.5 um; a depth four times as large has
    twice that.
    """
    block = bi.Surrogate.load("block")
    for factor, warned in ((1.0, False), (4.0, True)):
        depth = np.full(N, factor * 0.5**2 / 16)
        found = of_code(warnings_of(block, 1.1 * MODULI, depth_um=depth), "other_contact")
        assert bool(found) == warned
    numbers = found[0]["numbers"]
    assert [numbers[f"{name}_um"] for name in ("least", "greatest", "surrogate")] == pytest.approx(
        [1.0, 1.0, 0.5], rel=1e-3
    )
    # 11 % on average, times 1/0.5 - 1.
    assert 9 < numbers["error_percent"] < 13
    for columns in ({"contact_radius_um": np.full(N, 1.0)}, {"depth_nm": np.full(N, 1000 / 16)}):
        (same,) = of_code(warnings_of(block, 1.1 * MODULI, **columns), "other_contact")
        assert same["numbers"] == pytest.approx(numbers, rel=1e-3)


@pytest.mark.long
def test_a_contact_pressure_that_few_metals_carry():
    """The mean pressure of Hertz' contact is 4/(3 pi) M a/R."""
    assert not of_code(warnings_of(contact_radius_um=np.full(N, 1.2)), *PRESSURES)
    (found,) = of_code(warnings_of(contact_radius_um=np.full(N, 1.5)), *PRESSURES)
    assert found["code"] == "plastic_contact"
    share = 4 / (3 * np.pi) * 1.5 / 16
    assert found["numbers"]["pressure_gpa"] == pytest.approx(share * MODULI.max(), rel=0.01)
    assert found["numbers"]["percent"] == pytest.approx(100 * share, rel=0.02)
    # First yield below a sphere: 1.07 times the yield stress (Johnson, Contact Mechanics).
    for factor in (0.99, 1.01):
        found = warnings_of(
            contact_radius_um=np.full(N, 1.5), yield_gpa=share * MODULI.max() / 1.07 * factor
        )
        assert codes(of_code(found, *PRESSURES)) == ["yielding_contact"] * (factor < 1)


def test_what_cannot_be_a_size():
    with pytest.raises(bi.InputError, match=r"grain_radius_um.*allowed"):
        warnings_of(grain_radius_um=np.full(N, -1.0))
