"""Embedded grains against the half-space where they are none, and near each other where they must
be.
"""

import numpy as np
import pytest

import bayesindent as bi
from bayesindent.crystal.elasticity import anisotropy_index
from support.paper_domains import DOMAINS

ZINC = bi.stiffness("hexagonal", C11=161.1, C12=34.2, C44=38.3, C33=61.1, C13=50.3)


def isotropic(young, nu):
    """Stiffness (6, 6) in GPa."""
    scale = young / ((1 + nu) * (1 - 2 * nu))
    return bi.stiffness("isotropic", C11=scale * (1 - nu), C12=scale * nu)


@pytest.mark.parametrize("estimator", ["stiffness", "stiffness_hertz"])
@pytest.mark.parametrize(
    "options",
    [{}, {"shape": "cone"}, {"shape": "sphere", "radius_um": 1.5}],
    ids=["paraboloid", "cone", "sphere"],
)
def test_every_estimator_gives_the_theory_of_the_half_space(estimator, options):
    result = bi.Indentation(estimator=estimator, depths=6, **options).run(
        isotropic(200, 0.3), [0, 0, 0]
    )
    assert result.indentation_modulus_gpa == pytest.approx(200 / 0.91, rel=5e-3)
    assert len(result.depth_um) == len(result.force_mn) == len(result.contact_radius_um) == 6


@pytest.mark.long
@pytest.mark.parametrize(
    "specimen",
    [
        {},
        {"geometry": "block"},
        {"geometry": "grain", "grain_radius_um": 2.5},
    ],
    ids=["half-space", "block", "grain"],
)
def test_no_crystal_of_the_hexagonal_domain_of_the_paper_fails(specimen):
    """The longest contacts: crystals whose exact modulus differs most from that of a circular
    contact.
    """
    domain = DOMAINS["hexagonal"]
    rng = np.random.default_rng(5)
    drawn = bi.stiffness(
        "hexagonal",
        **dict(
            zip(
                ("C11", "C12", "C44", "C33", "C13"),
                rng.uniform(domain["c_min"], domain["c_max"], (60000, 5)).T,
                strict=True,
            )
        ),
    )
    drawn = drawn[np.linalg.eigvalsh(drawn)[:, 0] > 0]
    index = anisotropy_index(drawn)
    drawn = drawn[(index > 20) & (index <= domain["anisotropy_cap"])]
    angles = np.zeros((len(drawn), 3))
    angles[:, 1] = rng.uniform(0, 90, len(drawn))
    theory = bi.halfspace_modulus(drawn, angles)
    longest = np.argsort(bi.halfspace_modulus(drawn, angles, circular=True) / theory)[:10]
    model = bi.Indentation(refine=0.75, **specimen)
    results = model.run_many(drawn[longest], angles[longest])
    assert sum(result.elements > 2 * model.elements for result in results) >= 8
    if not specimen:
        miss = np.abs([result.indentation_modulus_gpa for result in results] / theory[longest] - 1)
        assert (miss < model.largest_error(drawn[longest]) / 3).all(), miss


def test_alike():
    """Where grain and matrix are alike there is a half-space."""
    specimen = {"geometry": "grain", "grain_radius_um": 2.5, "matrix": "isotropic"}
    same = bi.Indentation(**specimen, matrix_young_gpa=200.0, matrix_nu=0.3, depths=5)
    half = bi.Indentation(depths=5)
    modulus, expected = (
        mesh.run(isotropic(200, 0.3), [0, 0, 0]).indentation_modulus_gpa for mesh in (same, half)
    )
    assert modulus == pytest.approx(expected, rel=2e-3)


@pytest.mark.long
def test_a_grain_in_its_own_polycrystal_is_a_halfspace_only_if_it_is_isotropic():
    """By default the matrix is Hill's average: nothing for an isotropic crystal, and softer or
    stiffer than a direction of another.
    """
    grain, half = (
        bi.Indentation(geometry="grain", grain_radius_um=2.5, depths=5),
        bi.Indentation(depths=5),
    )
    assert grain.run(isotropic(70, 0.33), [0, 0, 0]).indentation_modulus_gpa == pytest.approx(
        half.run(isotropic(70, 0.33), [0, 0, 0]).indentation_modulus_gpa, rel=2e-3
    )
    # Zinc is compliant along c: its neighbours are stiffer; in the plane the other way.
    along, across = ([0, phi, 0] for phi in (0, 90))
    for angles, sign in ((along, 1), (across, -1)):
        change = (
            grain.run(ZINC, angles).indentation_modulus_gpa
            / half.run(ZINC, angles).indentation_modulus_gpa
            - 1
        )
        assert 0.003 < sign * change < 0.1


@pytest.mark.parametrize(
    "settings, message",
    [
        (
            {"geometry": "film", "thickness_um": 1.0, "substrate_young_gpa": 100},
            "'film' has no mesh; allowed: halfspace, block, grain; films are computed by theory",
        ),
        ({"geometry": "grain", "grain_radius_um": 1.0}, "does not hold the refined zone"),
        (
            {"geometry": "grain", "grain_radius_um": 3.0, "matrix": "isotropic"},
            "matrix_young_gpa: the variable is missing",
        ),
    ],
)
def test_what_cannot_be_meshed(settings, message):
    with pytest.raises(bi.InputError, match=message):
        bi.Indentation(**settings)
