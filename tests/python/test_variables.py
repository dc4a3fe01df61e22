"""Every variable of a namelist has an effect: changed alone, it changes what a user sees."""

import json
from functools import cache

import numpy as np
import pytest

import bayesindent as bi
from bayesindent.engines import engine_of
from bayesindent.program.cli import main
from bayesindent.report.results import Results
from bayesindent.settings.problem import schema
from bayesindent.stages.stage import run_stage
from support.densities import Posterior
from support.learner import build
from support.step_2_cases import rough_correction
from support.synthetic_curves import sneddon
from support.theory_cases import theory_surrogate

#: In one process, which looks at each default once.
pytestmark = pytest.mark.xdist_group("variables")

COPPER = bi.stiffness("cubic", C11=168.4, C12=121.4, C44=75.4)
POINTS = "C11,C12,C44,phi1_deg,Phi_deg,phi2_deg\n168.4,121.4,75.4,10,20,30\n"
#: Grains of copper, whose moduli are not quite those of the theory.
GRAINS = {
    "phi1_deg": [0.0, 0, 0, 10, 50],
    "Phi_deg": [0.0, 45, 54.7, 20, 70],
    "phi2_deg": [0.0, 0, 45, 30, 80],
    "modulus_gpa": [120.0, 140, 146, 130, 139],
    "sd_gpa": [2.0, 3, 2, 3, 2],
}
CSV = "".join(
    ",".join(map(str, row)) + "\n" for row in [[*GRAINS], *zip(*GRAINS.values(), strict=True)]
)
#: Further tables of one grain.
TABLES = [
    ("fewer", "phi1,Phi,phi2,modulus_gpa,sd_gpa", "1,2,3,120,2"),
    ("radians", "phi1,Phi,phi2,modulus_gpa,sd_gpa", "0.1,0.2,0.3,120,2"),
    ("planes", "h,k,l,modulus_gpa,sd_gpa", "1,0,1,120,2"),
    ("named", "phi1,Phi,phi2,first,second,sd_gpa", "1,2,3,120,130,2"),
]
KIND = {"modulus_kind": "indentation_modulus", "technique": "exact"}


def spelled(values: dict) -> str:
    """The lines of a group."""
    return "".join(
        f"{name} = {value!r}\n" if not isinstance(value, list) else f"{name} = {str(value)[1:-1]}\n"
        for name, value in values.items()
    )


def written(folder, groups: dict, command: str = "run") -> bi.Problem:
    """The problem of these groups in a file."""
    folder.mkdir(exist_ok=True)
    (folder / "points.csv").write_text(POINTS)
    (folder / "others.csv").write_text(POINTS.replace("10,20,30", "0,45,0"))
    (folder / "along.csv").write_text(
        POINTS.replace("phi2_deg\n", "phi2_deg,propagation_deg\n").replace(
            "10,20,30", "10,20,30,15"
        )
    )
    (folder / "grains.csv").write_text(CSV)
    for name, header, row in TABLES:
        (folder / f"{name}.csv").write_text(f"{header}\n{row}\n")
    text = "".join(f"&{group}\n{spelled(values)}/\n" for group, values in groups.items())
    (folder / "a.nml").write_text(text.replace("True", ".true.").replace("False", ".false."))
    return bi.Problem(folder / "a.nml", command)


def simulated(folder, groups):
    """One indentation."""
    flat = {
        "refine": 0.6,
        "depths": 2,
        **{name: value for values in groups.values() for name, value in values.items()},
    }
    found = bi.Indentation(**flat).run(COPPER, [10, 20, 30])
    return found.indentation_modulus_gpa, found.elements, found.force_mn.tolist()


def film(folder, groups):
    """The modulus of a film by theory."""
    flat = {name: value for values in groups.values() for name, value in values.items()}
    flat.pop("geometry")
    return float(bi.film_modulus(COPPER, [10, 20, 30], **flat))


def layered(folder, groups):
    """The modulus of a film whose layers are in a file."""
    folder.mkdir(exist_ok=True)
    (folder / "layers.csv").write_text(
        "layer,thickness_um,young_gpa,nu\noxide,0.1,300,0.2\ncrystal,,,\n"
    )
    if "layers" in groups["specimen"]:
        groups = {"specimen": {"geometry": "film", "layers": "layers.csv"}}
    defaults = {"problem": {"symmetry": "cubic"}, "crystals": {"points": "points.csv"}}
    problem = written(folder, merged(defaults, groups))
    assert main(["theory", str(problem.path), "--output", str(folder / "out")]) == 0
    return (folder / "out" / "theory.csv").read_text()


def files(folder, groups):
    """What `simulate` leaves."""
    defaults = {
        "problem": {"symmetry": "cubic"},
        "crystals": {"points": "points.csv"},
        "simulation": {"refine": 0.6, "depths": 2},
    }
    problem = written(folder, merged(defaults, groups))
    assert main(["simulate", str(problem.path), "--output", str(folder / "out")]) == 0
    kept = {path.name for path in (folder / "out").iterdir()}
    return sorted(kept), [
        line.split(",")[:7] for line in (folder / "out" / "moduli.csv").read_text().splitlines()
    ]


def files_of_theory(folder, groups):
    """What `theory` says of a direction of propagation."""
    problem = written(folder, merged({"crystals": {"points": "along.csv"}}, groups))
    assert main(["theory", str(problem.path), "--output", str(folder / "out")]) == 0
    return (folder / "out" / "theory.csv").read_text()


def built(folder, groups):
    """A surrogate of simulations by theory."""
    defaults = {
        "problem": {"symmetry": "cubic"},
        "simulation": {"simulator": "theory"},
        "surrogate": {"degree": 1},
        "design": {"n_candidates": 60, "budget": 12, "initial": 8},
    }
    groups = merged(defaults, groups)
    document = build(written(folder, groups, "build"), folder / "out")
    file = folder / "out" / groups["surrogate"].get("file", "surrogate.txt")
    angles = bi.Surrogate.load(file).data["euler_deg"].tolist()
    return (
        angles,
        file.name,
        json.dumps({name: value for name, value in document.items() if name != "file"}),
    )


def density(folder, groups):
    """The density of Step 2 at a few points, with a correction that is known badly."""
    settings = {name: value for values in groups.values() for name, value in values.items()}
    x = np.array([168.4, 121.4, 75.4]) * np.array([0.9, 1.0, 1.05])[:, None]
    beside = [0.1] * (settings.get("technique", "exact") != "exact" or "contrast_sd" in settings)
    beside += [-4.0] * (settings.get("scatter") == "inferred")
    beside += [0.2] * (settings.get("scale") == "inferred")
    x = np.column_stack([x, np.tile(beside, (3, 1))])
    posterior = Posterior.of(GRAINS, symmetry="cubic", surrogate=surrogate(), **KIND | settings)
    return posterior.evaluate(x)[0].round(9).tolist()


def density_of_waves(folder, groups):
    """The density of Step 2 with speeds at a few points."""
    speeds = (
        "phi1_deg,Phi_deg,phi2_deg,propagation_deg,rayleigh_velocity_m_s,sd_m_s,group\n"
        "0,0,0,0,2012,10,a\n0,10,20,5,2050,10,a\n"
    )
    folder.mkdir(exist_ok=True)
    (folder / "speeds.csv").write_text(speeds)
    (folder / "faster.csv").write_text(speeds.replace("2012", "2040"))
    defaults = {
        "problem": {"symmetry": "cubic", "density_kg_m3": 8960.0},
        "measurements": {"velocities": "speeds.csv"},
    }
    problem = written(folder, merged(defaults, groups), "extract")
    return (
        Posterior(problem, bi.Surrogate.load("halfspace"))
        .evaluate([[168.4, 121.4, 75.4]])[0]
        .round(9)
        .tolist()
    )


def read(folder, groups):
    """The table of measurements as it is understood."""
    defaults = {"problem": {"symmetry": "cubic"}, "measurements": {"file": "grains.csv"} | KIND}
    points = written(folder, merged(defaults, groups)).measurements
    return points.euler_deg.tolist(), points.modulus_gpa.tolist(), points.modulus_kind


def moduli(folder, groups):
    """What curves give: the grain, and how well it is known; or the refusal."""
    folder.mkdir(exist_ok=True)
    rng = np.random.default_rng(1)
    for file, modulus in (("curves.csv", 100.0), ("softer.csv", 90.0)):
        rows = [
            row
            for test in "abq"
            for row in curve_rows(test, 69.64 if test == "q" else modulus, rng)
        ]
        (folder / file).write_text("test,time_s,depth_nm,load_mn\n" + "".join(rows))
    header = "test,grain,reference,drift_nm_s\n"
    (folder / "tests.csv").write_text(header + "a,g,,0.2\nb,g,,\nq,,quartz,\n")
    (folder / "few_tests.csv").write_text(header + "a,g,,\nb,,quartz,\nq,,quartz,\n")
    (folder / "copper_tests.csv").write_text(header + "a,g,,\nb,g,,\nq,,copper,\n")
    isotropic = {"name": ["quartz"], "young_gpa": [72.0], "young_sd_gpa": [0.5], "nu": [0.17]}
    defaults = {
        "problem": {"symmetry": "cubic"},
        "curves": {"file": "curves.csv", "tests": "tests.csv", "radius_um": 5.0},
    }
    groups = merged(
        merged(
            defaults,
            {"references": {} if "crystals" in groups.get("references", {}) else isotropic},
        ),
        groups,
    )
    for file in ("points.csv", "others.csv"):
        place = "10,20,30" if file == "points.csv" else "0,45,0"
        (folder / file).write_text(
            POINTS.replace("10,20,30", place)
            .replace("phi2_deg\n", "phi2_deg,reference\n")
            .replace(place, f"{place},copper")
        )
    text = "".join(f"&{group}\n{spelled(values)}/\n" for group, values in groups.items())
    (folder / "a.nml").write_text(text.replace("True", ".true.").replace("False", ".false."))
    try:
        document = run_stage(bi.Problem(folder / "a.nml", "curves"), "curves", folder / "out")
    except bi.InputError as error:
        return str(error).replace(str(folder), "")
    return document["grains"], document["tip"]


def curve_rows(test, modulus, rng):
    """Lines of a noisy elastic curve."""
    load = np.linspace(0.2, 40, 150)
    depth = 1e3 * sneddon(load, modulus, 5.0, 1.0) + 0.2 * rng.normal(size=150)
    return [
        f"{test},{t:.3f},{h:.3f},{p:.4f}\n"
        for t, h, p in zip(np.linspace(0, 20, 150), depth, load, strict=True)
    ]


def sampled(folder, groups):
    """Chains."""
    settings = {"method": "scmh", "samples": 12, "burn_in": 20, "chains": 2} | {
        name: value for values in groups.values() for name, value in values.items()
    }
    with pytest.warns(bi.BayesindentWarning):
        result = bi.extract(GRAINS, surrogate=of_cubic_crystals(), **KIND | settings)
    return {name: values.values.tolist() for name, values in result.posterior.items()}


def files_of_extract(folder, groups):
    """What `extract` leaves."""
    defaults = {
        "problem": {"symmetry": "cubic"},
        "measurements": {"file": "grains.csv"} | KIND,
        "sampler": {"samples": 12, "burn_in": 20, "chains": 2},
    }
    problem = written(folder, merged(defaults, groups))
    run_stage(problem, "extract", folder / "out")
    return sorted(path.name for path in (folder / "out").iterdir())


def asked_for(folder, groups):
    """What is sampled."""
    problem = written(
        folder,
        merged(
            {"problem": {"symmetry": "cubic"}, "measurements": {"file": "grains.csv"} | KIND},
            groups,
        ),
    )
    return Posterior(problem, bi.Surrogate.load("halfspace")).names


def suggested(folder, groups):
    """What to measure next."""
    settings = {"count": 2} | {
        name: value for values in groups.values() for name, value in values.items()
    }
    if "candidates" in settings:
        settings["candidates"] = str(folder / settings["candidates"])
        folder.mkdir(exist_ok=True)
        (folder / "mine.csv").write_text("phi1_deg,Phi_deg,phi2_deg\n1,2,3\n40,50,60\n")
    return json.dumps(
        bi.next_grain(GRAINS, surrogate=of_cubic_crystals(), result=drawn(), **KIND | settings)
    )


def planned(folder, groups):
    """The expected sds."""
    folder.mkdir(exist_ok=True)
    defaults = {
        "problem": {"symmetry": "isotropic"},
        "plan": {"constants": [250.0, 110.0], "grains": [5], "noise": [0.02]},
    }
    problem = written(folder, merged(defaults, groups), "plan")
    return run_stage(problem, "plan", folder / "out")["results"]


def engine(folder, groups):
    """Where simulations run."""
    execution = written(
        folder, {"problem": {"symmetry": "cubic"}, "crystals": {"points": "points.csv"}} | groups
    ).settings.execution
    with engine_of(execution) as made:
        return type(made).__name__, getattr(made, "workers", None)


def reported(folder, groups):
    """The title of the report, whether its figures say that the data are made up, what the
    constants are compared with, whence knowledge is.
    """
    problem = written(
        folder,
        merged(
            {"problem": {"symmetry": "cubic"}, "measurements": {"file": "grains.csv"} | KIND},
            groups,
        ),
    )
    (folder / "resolved.nml").write_text(problem.resolved)
    results = Results(folder)
    return (
        results.title,
        results.synthetic,
        results.reference,
        results.settings["knowledge"].get("source"),
    )


@cache
def surrogate():
    return rough_correction()


@cache
def of_cubic_crystals():
    """The paper's model, whose chains take no time."""
    return theory_surrogate("cubic", 1, 4, points=200)


@cache
def drawn():
    with pytest.warns(bi.BayesindentWarning):
        return bi.extract(
            GRAINS,
            surrogate=of_cubic_crystals(),
            method="scmh",
            samples=50,
            burn_in=500,
            chains=2,
            **KIND,
        )


def merged(groups: dict, more: dict) -> dict:
    return groups | {name: groups.get(name, {}) | values for name, values in more.items()}


OF_A_CRYSTAL = {"curves": {"tests": "copper_tests.csv"}, "references": {"crystals": "points.csv"}}
BLOCK = {"specimen": {"geometry": "block"}, "simulation": {"refine": 0.66}}
FILM = {"specimen": {"geometry": "film", "thickness_um": 1.0, "substrate_young_gpa": 160.0}}
ON_CRYSTAL = {
    "specimen": {
        "geometry": "film",
        "thickness_um": 1.0,
        "substrate_symmetry": "cubic",
        "substrate_constants": [350.0, 68.0, 101.0],
    }
}
GRAIN = {
    "specimen": {
        "geometry": "grain",
        "grain_radius_um": 2.0,
        "matrix": "isotropic",
        "matrix_young_gpa": 200.0,
    }
}
CONE = {"indenter": {"shape": "cone"}}
BOUNDED = {"domain": {"c_min": [100, 60, 40], "c_max": [250, 150, 120]}}
PAPER = BOUNDED | {"surrogate": {"model": "paper", "degree": 1, "bandlimit": 4}}
FACTORIAL = BOUNDED | {"design": {"candidates": "factorial", "n_candidates": 40, "n_directions": 3}}
WAVES = {"problem": {"density_kg_m3": 8960.0}, "next": {"velocity_sd_m_s": 10.0}}
REDUCED = {"measurements": {"modulus_kind": "effective_modulus"}}

#: Simulations that have derivatives.
COARSE = {
    "simulation": {"simulator": "fe", "refine": 0.7},
    "specimen": {"geometry": "block"},
}

#: What is looked at, in which problem, and the value that is another than the default.
EFFECTS = {
    "problem": {
        "symmetry": (asked_for, {}, "tetragonal"),
        "lattice": (
            read,
            {
                "problem": {"symmetry": "tetragonal", "lattice": [4.6, 4.6]},
                "measurements": {"file": "planes.csv"},
            },
            [4.6, 2.96],
        ),
        "title": (reported, {}, "mine"),
        "reference_gpa": (reported, {}, [168.4, 121.4, 75.4]),
        "synthetic": (reported, {}, True),
        "seed": (sampled, {}, 2),
        "density_kg_m3": (files_of_theory, {"problem": {"symmetry": "cubic"}}, 8960.0),
        "density_sd_kg_m3": (density_of_waves, {}, 100.0),
    },
    "crystals": {"points": (files, {}, "others.csv")},
    "curves": {
        "file": (moduli, {}, "softer.csv"),
        "files": None,  # test_curves_files: files of an instrument in a namelist
        "tests": (moduli, {}, "few_tests.csv"),
        "radius_um": (moduli, {}, 5.5),
        "radius_sd_um": (moduli, {}, 0.1),
        "tip_beta": (moduli, {}, 0.0),
        "tip_beta_sd": (moduli, {}, 0.1),
        "compliance_sd_nm_mn": (moduli, {}, 0.2),
        "drift_removed": (moduli, {}, False),
        "drift_sd_nm_s": (moduli, {}, 1.0),
        "load_sd_mn": (moduli, {}, 0.2),
        "transient_sd_nm": (moduli, {}, 0.1),
        "transient_s": (moduli, {}, 4.0),
        "session_sd": (moduli, {}, 0.05),
        "indenter_modulus_gpa": (moduli, {}, 800.0),
        "indenter_nu": (moduli, {}, 0.3),
    },
    "references": {
        "name": (moduli, {}, ["glass"]),
        "young_gpa": (moduli, {}, [80.0]),
        "young_sd_gpa": (moduli, {}, [3.0]),
        "nu": (moduli, {}, [0.3]),
        "crystals": (moduli, OF_A_CRYSTAL, "others.csv"),
        "crystal_sd": (moduli, OF_A_CRYSTAL, 0.1),
    },
    "specimen": {
        "geometry": (simulated, {"simulation": {"refine": 0.66}}, "block"),
        "estimator": (film, FILM, "stiffness_hertz"),
        "width_um": (simulated, BLOCK, 7.0),
        "height_um": (simulated, BLOCK, 4.0),
        "thickness_um": (film, FILM, 2.0),
        "substrate": None,  # test_films: a rigid one has no stiffness
        "substrate_young_gpa": (film, FILM, 80.0),
        "substrate_nu": (film, FILM, 0.2),
        "substrate_symmetry": None,  # test_films: it goes with its constants
        "substrate_constants": (film, ON_CRYSTAL, [300.0, 68.0, 101.0]),
        "substrate_euler_deg": (film, ON_CRYSTAL, [0.0, 45.0, 0.0]),
        "layers": (layered, FILM, "layers.csv"),
        "grain_radius_um": (simulated, GRAIN, 3.0),
        "matrix": (
            simulated,
            {"specimen": {"geometry": "grain", "grain_radius_um": 2.0, "matrix_young_gpa": 200.0}},
            "isotropic",
        ),
        "matrix_young_gpa": (simulated, GRAIN, 90.0),
        "matrix_nu": (simulated, GRAIN, 0.2),
    },
    "indenter": {
        "shape": (simulated, {}, "sphere"),
        "radius_um": (simulated, {}, 10.0),
        "half_angle_deg": (simulated, CONE, 60.0),
        "depth_um": (simulated, {}, 0.01),
        "contact_radius_um": (simulated, {}, 0.4),
    },
    "simulation": {
        "simulator": (files, {}, "theory"),
        "element": (simulated, {}, "c3d8"),
        "integration": (simulated, {"simulation": {"element": "c3d8"}}, "full"),
        "refine": (simulated, {}, 0.7),
        "extrapolate": (simulated, {"simulation": {"refine": 0.9}}, True),
        "outer": (simulated, {}, 4.0),
        "growth": (simulated, {}, 1.2),
        "depths": (simulated, {}, 3),
        "vtu": (files, {}, True),
        "inp": (files, {}, True),
    },
    "domain": {
        "classes": (built, {}, ["cubic"]),
        "log_anisotropy_max": (built, {}, 0.8),
        "poisson_min": (built, {}, 0.2),
        "poisson_max": (built, {}, 0.35),
        "stiffness_min_gpa": (
            built,
            {"domain": {"stiffness_max_gpa": 300.0, "stiffness_min_gpa": 50.0}},
            100.0,
        ),
        "stiffness_max_gpa": (
            built,
            {"domain": {"stiffness_min_gpa": 50.0, "stiffness_max_gpa": 300.0}},
            200.0,
        ),
        "c_min": (built, BOUNDED, [120, 60, 40]),
        "c_max": (built, BOUNDED, [240, 150, 120]),
        "anisotropy_cap": (built, BOUNDED, 1.0),
    },
    "surrogate": {
        "file": (built, {}, "mine.txt"),
        "model": (
            built,
            BOUNDED | {"surrogate": {"degree": 1, "bandlimit": 4}, "design": {"budget": 20}},
            "paper",
        ),
        "degree": (built, {}, 2),
        "derivatives": (built, {"design": {"budget": 9}} | COARSE, False),
        "bandlimit": (built, PAPER | {"design": {"budget": 20}}, 0),
        "truncation": (built, PAPER | {"design": {"budget": 20}}, "total"),
        "prior_sd": (built, PAPER | {"design": {"budget": 20}}, "equal"),
        "scan": (built, PAPER | {"design": {"budget": 20}}, "0, 1 x 0, 4"),
    },
    "design": {
        "focus": None,  # test_focus: where the posterior is
        "candidates": (built, BOUNDED, "factorial"),
        "n_candidates": (built, {}, 80),
        "initial": (built, {}, 5),
        "initial_set": (built, {}, "latin"),
        "orientations": (built, BOUNDED, "declination"),
        "n_directions": (built, FACTORIAL, 5),
        "variance_of": (built, {"design": {"budget": 20}}, "variance"),
        "budget": (built, {}, 14),
        "batch": (built, {"design": {"budget": 20, "initial": 2}}, 6),
        "refit": (built, {"design": {"budget": 20}}, 7),
        "validation": (built, {}, 3),
        "reuse": None,  # test_build: a surrogate of what other models chose
    },
    "measurements": {
        "velocities": (density_of_waves, {}, "faster.csv"),
        "velocity_calibration_sd": (density_of_waves, {}, 0.02),
        "file": (read, {}, "fewer.csv"),
        "columns": (
            read,
            {"measurements": {"file": "named.csv", "columns": ["modulus_gpa = first"]}},
            ["modulus_gpa = second"],
        ),
        "sheet": None,  # test_spreadsheets: the second sheet of a workbook
        "ebsd": None,  # test_orientation_maps: orientations of a map
        "crystal_axes": None,  # test_map_axes: two makers' files of one crystal
        "orientations": None,  # test_unknown_orientations: a table without angles
        # test_unknown_orientations: another texture is another likelihood and another input
        "texture": None,
        "orientations_file": None,  # test_joining
        "orientations_by": None,  # test_joining
        "ebsd_points": None,  # test_map_registration: the indents of a turned stage
        "modulus_kind": (density, {}, "effective_modulus"),
        "angles": (read, {"measurements": {"file": "radians.csv", "angles": "degrees"}}, "radians"),
        "indenter_modulus_gpa": (density, REDUCED, 600.0),
        "indenter_nu": (density, REDUCED, 0.3),
        "sample_nu": (density, {"measurements": {"modulus_kind": "sample_modulus"}}, 0.2),
        "technique": (density, {}, "oliver_pharr"),
        "calibration_mean": (density, {}, 0.03),
        "calibration_sd": (density, {}, 0.03),
        "contrast_mean": (density, {}, 0.1),
        "contrast_sd": (density, {}, 0.1),
        "orientation_sd_deg": (density, {}, 2.0),
        "misalignment_sd_deg": (density, {}, 2.0),
        "zero_sd_nm": None,  # test_tables: with depths
        "shared_errors": None,  # test_curves
        "yield_gpa": None,  # test_specimen_warnings: pressure of the contacts
        "scatter": (density, {}, "inferred"),
        "scatter_sd": (density, {}, 0.03),
        "scale": (density, {}, "inferred"),
        "likelihood": (density, {}, "student"),
        "student_dof": (density, {"measurements": {"likelihood": "student"}}, 9.0),
    },
    "prior": {
        "c_min": (density, {}, [160, 60, 40]),
        "c_max": (density, {}, [165, 150, 120]),
        "anisotropy_cap": (
            density,
            {"prior": {"bounds": {"C11": (50, 300), "C12": (50, 300), "C44": (20, 200)}}},
            0.1,
        ),
    },
    "knowledge": {
        "quantity": (density, {"knowledge": {"knowledge": {"C44": (80, 5)}}}, {"C12": (80, 5)}),
        "mean": (density, {"knowledge": {"knowledge": {"C44": (80, 5)}}}, {"C44": (85, 5)}),
        "sd": (density, {"knowledge": {"knowledge": {"C44": (80, 5)}}}, {"C44": (80, 9)}),
        "stiffness_file": (density, {}, {"stiffness": ([168, 121, 75], np.diag([9.0, 9, 9]))}),
        "stiffness_relative_sd": None,  # test_files_of_makers: a matrix beside its table
        "source": (reported, {"knowledge": {"quantity": "C44", "mean": 80, "sd": 5}}, "a work"),
    },
    "sampler": {
        "method": (sampled, {}, "ensemble"),
        "samples": (sampled, {}, 14),
        "burn_in": (sampled, {}, 40),
        "chains": (sampled, {}, 3),
        "surrogate_variance": (density, {}, "none"),
        "draws": (files_of_extract, {}, "csv"),
    },
    "next": {
        "sd_gpa": (suggested, {}, 9.0),
        "target": (suggested, {}, "C44"),
        "candidates": (suggested, {}, "mine.csv"),
        "count": (suggested, {}, 3),
        "velocity_cost": (suggested, WAVES, 0.01),
        "velocity_sd_m_s": (
            suggested,
            WAVES | {"next": {"velocity_cost": 0.01, "velocity_sd_m_s": 10.0}},
            50.0,
        ),
    },
    "plan": {
        "constants": (planned, {}, [250.0, 100.0]),
        "grains": (planned, {}, [6]),
        "noise": (planned, {}, [0.03]),
        "velocity_noise": (planned, {"problem": {"density_kg_m3": 8960.0}}, 0.005),
    },
    "execution": {
        "workers": (engine, {"execution": {"workers": 1}}, 3),
        "engine": (engine, {}, "dask"),
        "scheduler": None,  # test_dask: a scheduler at an address
        # test_dask: the script of a job
        **dict.fromkeys(("cores", "memory", "walltime")),
    },
}


def test_every_variable_is_here():
    assert {(variable.group, variable.name) for variable in schema()} == {
        (group, name) for group in EFFECTS for name in EFFECTS[group]
    }


@pytest.mark.long_where(
    "simulation-extrapolate",
    "sampler-method",
    "sampler-samples",
    "sampler-chains",
    "execution-engine",
    "problem-seed",
    "next-target",
    "plan-constants",
    "plan-grains",
    "plan-noise",
    "plan-velocity_noise",
    "next-sd_gpa",
    "specimen-width_um",
    "specimen-height_um",
)
@pytest.mark.parametrize(
    ("group", "name"),
    [(group, name) for group in EFFECTS for name in EFFECTS[group] if EFFECTS[group][name]],
)
def test_has_an_effect(tmp_path, capsys, group, name):
    look, common, value = EFFECTS[group][name]
    changed = merged(
        common,
        {"knowledge": {"knowledge": value}}
        if look is density and group == "knowledge"
        else {group: {name: value}},
    )
    assert at_default(look, common, tmp_path / "default") != look(tmp_path / "changed", changed)


DEFAULTS: dict = {}


def at_default(look, common, folder):
    """What is looked at before the change, once for all variables."""
    key = look, repr(common)
    if key not in DEFAULTS:
        DEFAULTS[key] = look(folder, common)
    return DEFAULTS[key]
