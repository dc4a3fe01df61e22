"""Films by theory: moduli against exact values of isotropic layers, against the half-space where
there is no film, and Step 2 against an independent computation.

Modules: film_theory.f90, film_training.f90, surrogate_loading.f90, layer_table.f90.
"""

import json

import numpy as np
import pytest

import bayesindent as bi
from bayesindent.program.cli import main
from bayesindent.stages.results_folder import read_posterior
from support.diagnostics import of_code
from support.layered_halfspace import LayeredContact, random_pairs, thick_layer
from support.tree import REFERENCE

COATED = np.genfromtxt(
    REFERENCE / "coated_halfspace.csv", delimiter=",", names=True, comments="#", skip_header=2
)
ZINC = bi.stiffness("hexagonal", C11=161.1, C12=34.2, C44=38.3, C33=61.1, C13=50.3)
COPPER = bi.stiffness("cubic", C11=168.4, C12=121.4, C44=75.4)
#: Of a film of zinc, which has few symmetries in this orientation.
ANGLES = [[10, 40, 30], [200, 75, 110]]


def isotropic(young, nu):
    """Stiffness (6, 6) in GPa."""
    scale = young / ((1 + nu) * (1 - 2 * nu))
    return bi.stiffness("isotropic", C11=scale * (1 - nu), C12=scale * nu)


def modulus(layer, substrate, thickness, **settings):
    """Of a film; layer and substrate have Young's modulus in GPa, and Poisson's ratio."""
    return float(
        bi.film_modulus(
            isotropic(*layer),
            [0, 0, 0],
            thickness_um=thickness,
            substrate_young_gpa=substrate[0],
            substrate_nu=substrate[1],
            **settings,
        )
    )


def test_the_exact_contact_of_a_layer():
    """The solution that films are compared with, against the values computed elsewhere."""
    for case in COATED[[0, 9, 17]]:
        layer, substrate = (
            (case[f"{part}_young_gpa"], case[f"{part}_nu"]) for part in ("layer", "substrate")
        )
        depth, force, _ = LayeredContact(layer, substrate, case["thickness_um"]).at(
            case["contact_radius_um"]
        )
        assert (depth, force) == pytest.approx((case["depth_um"], case["force_mn"]), rel=1e-7)


def test_isotropic_films():
    """Every film computed elsewhere, by the force at its depth."""
    for case in COATED:
        found = modulus(
            (case["layer_young_gpa"], case["layer_nu"]),
            (case["substrate_young_gpa"], case["substrate_nu"]),
            case["thickness_um"],
            depth_um=case["depth_um"],
            depths=1,
        )
        assert found == pytest.approx(case["modulus_gpa"], rel=2e-5), case


@pytest.mark.parametrize(
    ("layer", "substrate", "thickness"),
    [
        ((70, 0.3), (200, 0.3), 0.1),
        ((70, 0.3), (200, 0.3), 1.0),
        *(((70 * ratio, nu), (70, below), 0.5 * t) for ratio, nu, below, t in random_pairs(4, 11)),
    ],
)
def test_every_estimator(layer, substrate, thickness):
    contact, depth = LayeredContact(layer, substrate, thickness), np.arange(1, 11) ** 2 / 6400
    (radius,), _, (slope,) = contact.curve(depth[-1:])
    expected = {
        "curve": contact.modulus_of_curve(depth),
        "stiffness": slope / (2 * radius),
        "stiffness_hertz": slope / (2 * 0.5),
    }
    for estimator, value in expected.items():
        found = modulus(layer, substrate, thickness, estimator=estimator)
        assert found == pytest.approx(value, rel=1e-5), estimator


@pytest.mark.parametrize("layer, substrate", [((200, 0.3), (70, 0.2)), ((70, 0.3), (400, 0.25))])
def test_a_contact_much_smaller_than_the_film_is_thick(layer, substrate):
    """At a/t = 0.01 the substrate adds a displacement that is known to the first order."""
    depth, force = thick_layer(layer, substrate, 50.0, 0.5, 16.0)
    found = modulus(layer, substrate, 50.0, depth_um=depth, depths=1)
    assert found * 4 / 3 * np.sqrt(16) * depth**1.5 == pytest.approx(force, rel=1e-5)


def test_a_film_of_its_own_substrate_is_a_half_space():
    """Also where both are turned; and where the crystal lies below layers of an isotropic one."""
    for i, angles in enumerate(ANGLES):
        found = bi.film_modulus(
            ZINC,
            angles,
            thickness_um=(0.1, 2.0)[i],
            substrate_symmetry="hcp",
            substrate_constants=[161.1, 34.2, 38.3, 61.1, 50.3],
            substrate_euler_deg=angles,
        )
        assert found == pytest.approx(float(bi.halfspace_modulus(ZINC, angles)), rel=1e-7)


def test_a_rigid_substrate_is_one_without_end():
    settings = {"thickness_um": 1.0, "depths": 2}
    rigid, stiff, stiffer = (
        float(bi.film_modulus(COPPER, [10, 40, 20], **settings, **substrate))
        for substrate in (
            {"substrate": "rigid"},
            {"substrate_young_gpa": 5e4},
            {"substrate_young_gpa": 1e5},
        )
    )
    # What is left falls with the compliance of the substrate.
    assert 2 * stiffer - stiff == pytest.approx(rigid, rel=1e-5)
    assert rigid > stiffer > stiff


def test_a_film_turns_with_the_sample():
    """Turning the crystal about the axis changes nothing on an isotropic substrate, but on a
    crystal it does, unless both are turned.
    """
    zinc = {
        "thickness_um": 0.4,
        "substrate_symmetry": "hcp",
        "substrate_constants": [161.1, 34.2, 38.3, 61.1, 50.3],
    }
    plain = [
        float(bi.film_modulus(ZINC, [phi, 50, 30], thickness_um=0.4, substrate_young_gpa=60))
        for phi in (15, 77)
    ]
    assert plain[0] == pytest.approx(plain[1], rel=1e-5)
    on_zinc = [
        float(bi.film_modulus(ZINC, [phi, 50, 30], substrate_euler_deg=[below, 90, 0], **zinc))
        for phi, below in ((15, 0), (77, 0), (77, 62))
    ]
    assert on_zinc[0] == pytest.approx(on_zinc[2], rel=1e-5)
    assert abs(on_zinc[1] / on_zinc[0] - 1) > 1e-4


@pytest.mark.parametrize("nu", [-0.5, 0.0, 0.4999])
@pytest.mark.parametrize("ratio", [0.01, 100.0])
@pytest.mark.parametrize("thickness", [25.0, 0.5, 0.06])
def test_extreme_substrates(nu, ratio, thickness):
    """Substrates a hundred times as stiff, or as compliant; auxetic and incompressible films."""
    layer, substrate = (70, nu), (70 * ratio, 0.3)
    depth = np.arange(1, 11) ** 2 / 6400
    expected = LayeredContact(layer, substrate, thickness).modulus_of_curve(depth)
    assert modulus(layer, substrate, thickness) == pytest.approx(expected, rel=1e-4)


def table_of(folder, name, text):
    (folder / name).write_text(text)


def test_layers(tmp_path, capsys):
    """The file of layers says the same as the variables; the crystal may lie below others."""
    table_of(tmp_path, "points.csv", "C11,C12,C44,phi1_deg,Phi_deg,phi2_deg\n168,121,75,10,40,30\n")
    silicon = "165.7,63.9,79.6,0,45,0"
    table_of(
        tmp_path,
        "film.csv",
        "layer,thickness_um,young_gpa,nu,symmetry,C11,C12,C44,phi1_deg,Phi_deg,phi2_deg\n"
        f"crystal,0.3,,,,,,,,,\nsubstrate,,,,cubic,{silicon}\n",
    )
    table_of(
        tmp_path,
        "split.csv",
        "layer,thickness_um,symmetry,C11,C12,C44,phi1_deg,Phi_deg,phi2_deg\n"
        f"crystal,0.3,,,,,,,\nupper,0.2,cubic,{silicon}\nsubstrate,,cubic,{silicon}\n",
    )
    table_of(
        tmp_path,
        "oxide.csv",
        "layer,thickness_um,young_gpa,nu\noxide,0.06,400,0.25\ncrystal,,,\n",
    )
    found = []
    plain = (
        "thickness_um = 0.3, substrate_symmetry = 'cubic', substrate_euler_deg = 0, 45, 0,"
        "substrate_constants = 165.7, 63.9, 79.6"
    )
    for specimen in (plain, *(f"layers = '{name}.csv'" for name in ("film", "split", "oxide"))):
        (tmp_path / "film.nml").write_text(
            "&problem symmetry = 'cubic' /\n&crystals points = 'points.csv' /\n"
            f"&specimen geometry = 'film', {specimen} /\n"
        )
        assert main(["theory", str(tmp_path / "film.nml"), "--output", str(tmp_path / "o")]) == 0
        document = json.loads((tmp_path / "o" / "theory.json").read_text())
        found.append(document["results"][0]["indentation_modulus_gpa"])
    capsys.readouterr()
    assert found[1] == pytest.approx(found[0], rel=1e-12)
    assert found[2] == pytest.approx(found[0], rel=1e-7)
    bulk = float(
        bi.halfspace_modulus(bi.stiffness("cubic", C11=168, C12=121, C44=75), [10, 40, 30])
    )
    assert 1.001 < found[3] / bulk < 1.1


@pytest.mark.parametrize(
    ("specimen", "layers", "message"),
    [
        ("layers = 'l.csv'", "layer,thickness_um\nfilm,1\n", "line 2: the column young_gpa is"),
        ("layers = 'l.csv'", "layer,thickness_um\ncrystal,1\ncrystal,\n", "is there twice"),
        ("layers = 'l.csv'", "layer,thickness_um\ncrystal,\n", "there is no layer on the half-"),
        ("layers = 'l.csv'", "layer,thickness_um\ncrystal,0\n", "um; allowed 1"),
        (
            "layers = 'l.csv'",
            "layer,thickness_um,young_gpa,nu\nx,1,-3,0.2\ncrystal,,,\n",
            "young_gpa = -3.0",
        ),
        (
            "layers = 'l.csv', thickness_um = 1",
            "layer,thickness_um\ncrystal,1\n",
            "&specimen thickness_um: contradicts layers; remove one of them",
        ),
        (
            "layers = 'l.csv', substrate = 'rigid'",
            "layer,thickness_um\ncrystal,1\n",
            "&specimen substrate: contradicts layers",
        ),
        (
            "layers = 'l.csv'",
            "layer,thickness_um,young_gpa,nu,symmetry\ncrystal,1,,,\nx,,70,0.2,cubic\n",
            "line 3: young_gpa and symmetry; one of them is allowed",
        ),
        (
            "layers = 'l.csv'",
            "layer,thickness_um,young_gpa,nu\ncrystal,1,70,0.2\nx,,70,0.2\n",
            "crystal is the layer that is indented; it has no constants",
        ),
        (
            "thickness_um = 1, substrate = 'rigid', substrate_young_gpa = 70",
            "",
            "&specimen substrate_young_gpa: contradicts substrate; remove one of them",
        ),
        (
            "thickness_um = 1, substrate_young_gpa = 70, substrate_euler_deg = 1, 2, 3",
            "",
            "&specimen substrate_symmetry: the variable is missing",
        ),
        ("substrate_young_gpa = 70", "", "&specimen thickness_um: the variable is missing; geom"),
        ("thickness_um = 1", "", "&specimen substrate_young_gpa: the variable is missing; geom"),
        (
            "thickness_um = 1, substrate_symmetry = 'cubic', substrate_constants = 1, 2, 3",
            "",
            "&specimen substrate_constants: ",
        ),
        (
            "thickness_um = 1, substrate_constants = 1, 2, 3",
            "",
            "&specimen substrate_symmetry: the variable is missing",
        ),
        (
            "thickness_um = 0.04, substrate = 'rigid'",
            "",
            "&specimen: crystal 1: the contact of radius 0.45 um on layers 0.04 um thick is beyond "
            "the theory: it is wider than 10.0 thicknesses",
        ),
    ],
)
def test_films_that_are_refused(tmp_path, capsys, specimen, layers, message):
    table_of(tmp_path, "l.csv", layers)
    table_of(tmp_path, "points.csv", "C11,C12,C44,phi1_deg,Phi_deg,phi2_deg\n168,121,75,10,40,30\n")
    (tmp_path / "film.nml").write_text(
        "&problem symmetry = 'cubic' /\n&crystals points = 'points.csv' /\n"
        f"&specimen geometry = 'film', {specimen} /\n"
    )
    assert main(["theory", str(tmp_path / "film.nml"), "--output", str(tmp_path / "out")]) == 2
    error = capsys.readouterr().err
    assert message in error and error.count("\n") == 1


FILM = "geometry = 'film', estimator = 'curve', thickness_um = 0.5, substrate_young_gpa = 200"


def film_of(folder, constants, more="", noise=0.02, seed=2):
    """A namelist of a synthetic film of a crystal, cubic or hexagonal by its number of constants;
    twelve grains, bulk modulus known.
    """
    symmetry = {3: "cubic", 5: "hexagonal"}[len(constants)]
    crystal = bi.stiffness(symmetry, *constants)
    rng = np.random.default_rng(seed)
    angles = np.column_stack(
        [360 * rng.random(12), np.degrees(np.arccos(rng.random(12))), 360 * rng.random(12)]
    ).round(3)
    exact = bi.film_modulus(
        crystal,
        angles,
        thickness_um=0.5,
        substrate_young_gpa=200,
        estimator="curve",
    )
    sd = noise * exact
    rows = np.column_stack([angles, exact + sd * rng.standard_normal(12), sd, np.arange(12)])
    header = "phi1_deg,Phi_deg,phi2_deg,indentation_modulus_gpa,sd_gpa,grain"
    np.savetxt(folder / "grains.csv", rows, "%.5f", ",", header=header, comments="")
    bulk = 1 / np.linalg.inv(crystal)[:3, :3].sum()
    (folder / "film.nml").write_text(
        f"&problem symmetry = '{symmetry}', synthetic = .true. /\n"
        f"&specimen {FILM} /\n&measurements file = 'grains.csv' /\n"
        f"&knowledge quantity = 'bulk_modulus', mean = {bulk}, sd = {0.02 * bulk} /\n"
        f"&sampler samples = 2000 /\n{more}"
    )
    return folder / "film.nml"


def run(file, command="extract", *options):
    return main([command, str(file), "--output", str(file.parent / "out"), *options])


def test_a_film_needs_no_simulations(tmp_path, capsys):
    file = film_of(tmp_path, (49.5, 42.3, 14.9))
    table_of(tmp_path, "points.csv", "C11,C12,C44,phi1_deg,Phi_deg,phi2_deg\n168,121,75,10,40,30\n")
    text = file.read_text() + "&crystals points = 'points.csv' /\n"
    for more, message in (
        ("", "&specimen geometry: a film needs no simulations; use the command theory"),
        ("&design /\n", "&design: a film needs no simulations and no surrogate of yours"),
        ("&domain /\n", "&domain: a film needs no simulations and no surrogate of yours"),
        ("&surrogate file = 'block' /\n", "&surrogate: a film needs no simulations and no"),
    ):
        file.write_text(text + more)
        assert run(file, "simulate") == 2
        assert message in capsys.readouterr().err


@pytest.mark.long
@pytest.mark.filterwarnings("ignore")
def test_the_constants_of_a_film(tmp_path, capsys):
    """The posterior is right, the correction has no share in it, its exact values at draws agree,
    and reweighting draws by exact values changes nothing. A second run reads the correction.
    """
    truth = (49.5, 42.3, 14.9)
    file = film_of(tmp_path, truth, "&next count = 2 /\n")
    assert run(file) == 0
    found = json.loads((tmp_path / "out" / "summary.json").read_text())
    assert found["usable"] and not of_code(found["warnings"], "truncated", "outside_surrogate")
    for (name, one), true in zip(found["parameters"].items(), truth, strict=True):
        assert abs(one["mean"] - true) < 3 * one["sd"], name
        assert found["error_budget"][name]["surrogate"] <= 0.01
    rows = np.genfromtxt(tmp_path / "grains.csv", delimiter=",", names=True)
    angles = np.column_stack([rows[name] for name in ("phi1_deg", "Phi_deg", "phi2_deg")])
    draws = read_posterior(tmp_path / "out")["draws"].reshape(-1, 3)
    draws = draws[:: len(draws) // 200]
    crystals = bi.stiffness("cubic", *draws.T)
    settings = {"thickness_um": 0.5, "substrate_young_gpa": 200, "estimator": "curve"}
    surrogate = bi.Surrogate.load(tmp_path / "out" / "surrogate.txt")
    log_weights, errors = np.zeros(len(draws)), []
    for i, crystal in enumerate(crystals):
        exact = bi.film_modulus(crystal, angles, **settings)
        predicted, _ = surrogate.predict(np.repeat(crystal[None], len(angles), 0), angles)
        errors.append(predicted / exact - 1)
        misfits = [
            (rows["indentation_modulus_gpa"] - m) / rows["sd_gpa"] for m in (predicted, exact)
        ]
        log_weights[i] = 0.5 * (misfits[0] @ misfits[0] - misfits[1] @ misfits[1])
    assert np.sqrt(np.mean(np.square(errors))) < 5e-4
    weights = np.exp(log_weights - log_weights.max())
    weights /= weights.sum()
    assert 1 / (weights**2).sum() > 0.95 * len(draws)
    shift = np.abs(weights @ draws - draws.mean(0)) / draws.std(0)
    assert (shift < 0.03).all()
    # The correction is not trained again.
    before = (tmp_path / "out" / "surrogate.txt").stat().st_mtime_ns
    assert run(file, "next") == 0
    assert (tmp_path / "out" / "surrogate.txt").stat().st_mtime_ns == before
    capsys.readouterr()


@pytest.mark.long
@pytest.mark.filterwarnings("ignore")
@pytest.mark.parametrize(
    "truth",
    [
        (580, 242, 256),
        (129.1, 109.7, 82.4),
        (161.1, 34.2, 38.3, 61.1, 50.3),
        (1060, 180, 4.5, 36.5, 15),
    ],
    ids=["iridium", "beta-brass", "zinc", "graphite"],
)
def test_no_limit_truncates_a_film(tmp_path, capsys, truth):
    """Stiff, strongly anisotropic and nearly unstable crystals beside lead, see above."""
    assert run(film_of(tmp_path, truth)) == 0
    found = json.loads((tmp_path / "out" / "summary.json").read_text())
    told = {one["code"] for one in found["warnings"]}
    assert found["usable"] and not told & {"truncated", "outside_surrogate", "other_model"}
    for (name, one), true in zip(found["parameters"].items(), truth, strict=True):
        assert abs(one["mean"] - true) < 3 * one["sd"], name
    capsys.readouterr()


@pytest.mark.long
@pytest.mark.filterwarnings("ignore")
def test_a_correction_is_the_same_on_one_thread(tmp_path, capsys):
    """And another thickness has another one, in the same folder."""
    file, contents = film_of(tmp_path, (168.4, 121.4, 75.4)), []
    text = file.read_text().replace("samples = 2000", "samples = 100, burn_in = 200")
    for more in ("", "&execution workers = 1 /\n"):
        file.write_text(text + more)
        assert run(file) in (0, 3)
        contents.append((tmp_path / "out" / "surrogate.txt").read_text())
        (tmp_path / "out" / "surrogate.txt").write_text("bayesindent-surrogate 0\n")
    assert contents[0] == contents[1]
    file.write_text(text.replace("thickness_um = 0.5", "thickness_um = 0.6"))
    assert run(file) in (0, 3)
    assert (tmp_path / "out" / "surrogate.txt").read_text() != contents[0]
    capsys.readouterr()


@pytest.mark.long
def test_a_plan_of_a_film(tmp_path, capsys):
    file = film_of(tmp_path, (168.4, 121.4, 75.4))
    file.write_text(
        "&problem symmetry = 'cubic' /\n"
        f"&specimen {FILM} /\n&plan constants = 168.4, 121.4, 75.4, grains = 12, noise = 0.02 /\n"
        "&knowledge quantity = 'bulk_modulus', mean = 137, sd = 3 /\n"
    )
    assert run(file, "plan") == 0
    (row,) = json.loads((tmp_path / "out" / "plan.json").read_text())["results"]
    assert 1 < row["sd"]["C44"] < 30
    capsys.readouterr()
