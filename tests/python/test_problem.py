"""The one reader of namelists: what it refuses, what it resolves, what it loads.

Modules: measurement_checks.f90.
"""

import os
import random
import re

import f90nml
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import bayesindent as bi
from bayesindent.common.diagnostics import message
from bayesindent.crystal.elasticity import constant_names
from bayesindent.settings.problem import Problem, read_crystals, schema
from support.csv_tables import read_rows
from support.diagnostics import codes
from support.measured_tables import read_measurements
from support.paper_domains import DOMAIN
from support.step_2_cases import KIND
from support.tree import REFERENCE, SOURCE

#: The head of a file that asks for a surrogate.
HEAD = "&problem symmetry = 'cubic' /\n" + DOMAIN["cubic"]

BAD = sorted((SOURCE / "inputs" / "bad").glob("*.nml"))


def remark(path, key, default=None):
    """The text after `! key: ` at the head of a bad input."""
    for line in path.read_text().splitlines():
        if line.startswith(f"! {key}: "):
            return line.removeprefix(f"! {key}: ")
    return default


def write(folder, text, name="case.nml"):
    path = folder / name
    path.write_text(text)
    return path


@pytest.mark.parametrize("path", BAD, ids=lambda path: path.stem)
def test_bad_input_is_refused(path):
    with pytest.raises(bi.InputError) as caught:
        bi.Problem(path, remark(path, "command", "run"))
    assert str(caught.value).startswith(f"{path}: {remark(path, 'expect')}")
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize(
    "content", [b"", b"\n \n", b"\xff\xfe&\x00p\x00", b"\x00", b"\xef\xbb\xbf"], ids=repr
)
def test_no_text_is_refused(tmp_path, content):
    path = tmp_path / "case.nml"
    path.write_bytes(content)
    with pytest.raises(bi.InputError, match=r"empty|plain text"):
        bi.Problem(path)


def test_missing_file_and_folder(tmp_path):
    with pytest.raises(bi.InputError, match="does not exist"):
        bi.Problem(tmp_path / "none.nml")
    with pytest.raises(bi.InputError, match="folder"):
        bi.Problem(tmp_path)


def test_defaults_and_values(tmp_path):
    path = write(
        tmp_path,
        "&domain c_min=80,40,30,70,40 c_max=240,120,90,210,90 anisotropy_cap=66.2/! a comment\r\n"
        "&PROBLEM Symmetry = 'Hexagonal', title = 'It''s / \"x\" ! é' ! more\r\n seed=7/\r\n"
        "&design budget = 30, &end\n"
        "&indenter radius_um=1.6d1/\n"
        "&simulation VTU=t/\n"
        "&prior c_min = 2*20 3*1e1\n c_max = 5*500. /",
    )
    problem = bi.Problem(path, "build")
    settings = problem.settings
    about = settings.problem
    assert (about.symmetry, about.seed, about.title, about.synthetic) == (
        "hexagonal",
        7,
        'It\'s / "x" ! é',
        False,
    )
    assert settings.design.budget == 30
    assert settings.design.batch == 1
    assert settings.simulation.vtu is True
    assert settings.indenter.radius_um == 16.0
    assert settings.domain.anisotropy_cap == 66.2
    assert settings.domain.c_min.tolist() == [80, 40, 30, 70, 40]
    assert settings.prior.c_min.tolist() == [20, 20, 10, 10, 10]
    assert settings.prior.anisotropy_cap is None
    assert settings.next.count == 5
    assert settings.design.given
    assert not settings.sampler.given
    assert problem.stages == ["build"]
    assert problem.folder == tmp_path
    assert problem.crystals is None
    with pytest.raises(AttributeError):
        settings.design.budget = 1
    with pytest.raises(AttributeError):
        settings.design = None
    with pytest.raises(AttributeError, match="frozen"):
        problem.settings = None
    with pytest.raises(ValueError, match="read-only"):
        settings.domain.c_min[0] = 1


def test_resolved_file_resolves_to_itself(tmp_path):
    path = write(
        tmp_path, HEAD.replace("7.2", "0.1234567890123456789") + "&design /\n&prior c_max = 3*300/"
    )
    problem = bi.Problem(path)
    again = bi.Problem(write(tmp_path, problem.resolved, "again.nml"))
    assert problem.resolved.splitlines()[1:] == again.resolved.splitlines()[1:]
    assert again.settings.domain.anisotropy_cap == 0.1234567890123456789
    assert (again.settings.prior.c_min, again.settings.prior.c_max.tolist()) == (
        None,
        [300, 300, 300],
    ), "one bound may stand alone"


def test_reference_tables_load(tmp_path):
    path = write(
        tmp_path,
        "&problem symmetry = 'cubic' synthetic = .true. /\n"
        f"&crystals points = '{REFERENCE}/halfspace_moduli.csv' /\n"
        f"&measurements file = '{REFERENCE}/cubic_fe3si.csv', "
        "modulus_kind = 'indentation_modulus' /\n",
    )
    problem = bi.Problem(path)
    crystals = problem.crystals
    assert len(crystals) == 31
    assert crystals.constants[0] == {
        "C11": 161.1,
        "C12": 34.2,
        "C44": 38.3,
        "C33": 61.1,
        "C13": 50.3,
    }
    assert list(crystals.constants[-1]) == list(constant_names("cubic"))
    for i, name in enumerate(["hexagonal"] * 15 + ["cubic"] * 16):
        assert np.array_equal(crystals.stiffness[i], bi.stiffness(name, **crystals.constants[i]))
    moduli = bi.halfspace_modulus(crystals.stiffness, crystals.euler_deg)
    assert moduli == pytest.approx(
        [float(row["M_elliptic"]) for row in read_rows(REFERENCE / "halfspace_moduli.csv")],
        rel=1e-4,
    )
    assert len(problem.measurements) == 11
    assert problem.measurements.sd_gpa.tolist() == [4.5] * 11
    assert problem.measurements.modulus_gpa[0] == 219.025
    assert problem.warnings == []


def test_triclinic_rows(tmp_path):
    names = constant_names("triclinic")
    matrix = bi.stiffness("hexagonal", C11=161.1, C12=34.2, C44=38.3, C33=61.1, C13=50.3)
    values = [repr(float(matrix[int(n[1]) - 1, int(n[2]) - 1])) for n in names]
    path = write(
        tmp_path,
        ",".join([*names, "phi1_deg", "Phi_deg", "phi2_deg"])
        + "\n"
        + ",".join([*values, "1", "2", "30"]),
        "a.csv",
    )
    points = read_crystals(path, "cubic")
    assert tuple(points.constants[0]) == names
    assert points.modulus_gpa is None
    assert np.array_equal(points.stiffness[0], matrix)


def test_quoted_cells_and_comments(tmp_path):
    path = write(
        tmp_path,
        '\ufeff# head\r\n"note, too",phi1_deg,Phi_deg,phi2_deg,modulus_gpa\r\n\r\n'
        '"a ""b"", c" , 10,20 ,30, 210\r\n  # x\n,1e1,2d1,+30.,99.5',
        "a.csv",
    )
    points = read_measurements(path, "cubic", scale="inferred", **KIND)
    assert points.problem.table.names[0] == "note, too"
    assert points.problem.table.cells[0].tolist() == ['a "b", c', ""]
    assert points.euler_deg.tolist() == [[10, 20, 30]] * 2
    assert points.sd_gpa is None
    with pytest.raises(bi.InputError, match=r"a\.csv: the column sd_gpa is missing"):
        read_measurements(path, "cubic", **KIND)


@pytest.mark.parametrize(
    ("rows", "code"),
    [
        (["10,20,30,210,4"], "one_grain"),
        (["10,20,30,210,4"] * 3, "orientations_alike"),
        (["1,0.2,3,210,4", "2,1.2,3,211,4"], "angles_like_radians"),
        (["10,20,30,210,400", "10,40,30,210,4"], "large_sd"),
    ],
)
def test_warnings(tmp_path, rows, code):
    write(tmp_path, "\n".join(["phi1_deg,Phi_deg,phi2_deg,modulus_gpa,sd_gpa", *rows]), "m.csv")
    problem = bi.Problem(
        write(
            tmp_path,
            "&problem symmetry='cubic'/\n"
            "&measurements file='m.csv' modulus_kind='sample_modulus'/\n",
        )
    )
    assert codes(problem.warnings) == [code]
    assert "\n" not in message(problem.warnings[0])


def test_candidates_with_training_moduli(tmp_path):
    write(
        tmp_path,
        "C11,C12,C44,phi1_deg,Phi_deg,phi2_deg,modulus_gpa\n225,135,118,1,20,3,220.5\n"
        "500,135,118,1,20,3,\n",
        "c.csv",
    )
    problem = bi.Problem(write(tmp_path, HEAD + "&design candidates='c.csv'/\n"), "build")
    assert [list(row.values()) for row in problem.candidates.constants] == [
        [225, 135, 118],
        [500, 135, 118],
    ]
    assert problem.candidates.modulus_gpa[0] == 220.5
    assert np.isnan(problem.candidates.modulus_gpa[1])
    (found,) = problem.warnings
    assert found["code"] == "candidates_left_out"
    assert found["subject"] == "the table c.csv"
    assert found["numbers"] == {"outside": 1, "rows": 2}


def test_folder_of_the_file_and_odd_names(tmp_path):
    folder = tmp_path / "a b é"
    folder.mkdir()
    (folder / "m.csv").write_text("phi1_deg,Phi_deg,phi2_deg,modulus_gpa,sd_gpa\n10,20,30,210,4\n")
    path = write(
        folder,
        "&problem symmetry='cubic'/\n&measurements file='m.csv' modulus_kind='sample_modulus'/\n",
        "ü.nml",
    )
    assert len(bi.Problem(path).measurements) == 1
    os.chdir(folder)
    assert len(bi.Problem("ü.nml").measurements) == 1


def value_of(variable, symmetry, draw):
    if variable.name == "scheduler":
        return draw(st.sampled_from(["local", "slurm", "address"]))
    if variable.kind == "choice":
        return draw(st.sampled_from([word.strip(" '") for word in variable.allowed.split(",")]))
    if variable.kind == "logical":
        return draw(st.booleans())
    if variable.kind in ("integer", "real"):
        low, high = (float(bound) for bound in re.findall(r"[-+.\de]+\d|\d", variable.allowed))
        number = st.floats(0.001, 0.999).map(lambda u: low + u * (high - low))
        if variable.kind == "integer":
            number = number.map(round)
        return draw(number)
    return draw(
        st.text(
            st.characters(
                codec="utf-8", exclude_categories=("C", "Z"), include_characters=" '\"!/&=,"
            ),
            max_size=30,
        )
    )


#: Variables of one geometry alone, which is not drawn.
OF_GEOMETRY = [
    v.name for v in schema() if v.group == "specimen" and v.meaning.startswith(("film:", "grain:"))
]


@st.composite
def namelists(draw):
    """A valid file in one of its many spellings, and what it says."""
    symmetry = draw(st.sampled_from(["cubic", "hexagonal"]))
    k = len(constant_names(symmetry))
    content = {
        "problem": {"symmetry": symmetry, "reference_gpa": k * [100.0], "density_kg_m3": 5e3},
        "design": {"n_candidates": 100, "budget": 50},
    }
    content["domain"] = {"c_min": k * [10.0], "c_max": k * [300.0], "anisotropy_cap": 7.5}
    free = [
        v
        for v in schema()
        if v.default != "*"
        and v.kind not in ("file", "choice or file")
        and v.group
        not in ("crystals", "curves", "references", "measurements", "prior", "knowledge", "plan")
        and v.name
        not in (
            "symmetry",
            "c_min",
            "c_max",
            "anisotropy_cap",
            "classes",
            "poisson_min",
            "poisson_max",
            "stiffness_min_gpa",
            "stiffness_max_gpa",
            "n_candidates",
            "budget",
            "initial",
            "file",
            "scan",
            "target",
            "model",
            "degree",
            "bandlimit",
            "geometry",
            *OF_GEOMETRY,
            "shape",
            "contact_radius_um",
            "depth_um",
            "radius_um",
            "lattice",
            "reference_gpa",
            "density_kg_m3",
        )
    ]
    for variable in draw(st.lists(st.sampled_from(free), unique_by=lambda v: (v.group, v.name))):
        content.setdefault(variable.group, {})[variable.name] = value_of(variable, symmetry, draw)
    return content, spelled(content, random.Random(draw(st.integers(0, 2**32))))


def spelled(content, rng):
    def blank():
        return rng.choice([" ", "\n", "\t", " ! a 'comment' / = \n", "\r\n"])

    def word(value):
        if isinstance(value, bool):
            return rng.choice(
                [".true.", "T", ".t.", "true"] if value else [".false.", "F", ".F.", "False"]
            )
        if isinstance(value, str):
            quote = rng.choice("'\"")
            return quote + value.replace(quote, quote * 2) + quote
        return repr(value).replace("e", rng.choice("eEdD"))

    pieces = []
    for group in rng.sample(list(content), len(content)):
        pieces.append(
            rng.choice(["", "! head\n", "\n\n"]) + "&" + rng.choice([group, group.upper()])
        )
        for name, value in content[group].items():
            values = value if isinstance(value, list) else [value]
            separator = rng.choice([", ", " ", ",\n"])
            pieces.append(
                blank()
                + rng.choice([name, name.title()])
                + rng.choice(["=", " = ", " =\n"])
                + separator.join(map(word, values))
            )
            pieces.append(rng.choice(["", ","]))
        pieces.append(blank() + rng.choice(["/", "&end", "&END"]) + "\n")
    return "".join(pieces)


@pytest.mark.long
@settings(max_examples=150, deadline=None)
@given(namelists())
def test_valid_spellings_are_read(tmp_path_factory, case):
    content, text = case
    path = tmp_path_factory.getbasetemp() / "fuzz.nml"
    path.write_bytes(text.encode())
    problem = bi.Problem(path, "build")
    resolved, read = f90nml.reads(problem.resolved), f90nml.read(path)
    for group, variables in content.items():
        assert getattr(problem.settings, group).given
        for name, value in variables.items():
            # A text of blanks is an empty one.
            is_empty = isinstance(value, str) and not value.strip()
            for found in (resolved[group][name], read[group][name]):
                assert found == value or (is_empty and not (found or "").strip())


@settings(max_examples=300, deadline=None)
@given(st.text(st.sampled_from("&/=,'\"!() \n\t*.-+eEdD0159abpro;%#é"), max_size=60))
def test_any_text_gives_one_line(tmp_path_factory, text):
    path = tmp_path_factory.getbasetemp() / "noise.nml"
    path.write_bytes((HEAD + "&design " + text).encode())
    try:
        bi.Problem(path, "build")
    except bi.InputError as error:
        assert str(error).startswith(f"{path}: ")
        assert "\n" not in str(error)


def test_a_synonym_is_its_crystal_class(tmp_path):
    write(tmp_path, "C11,C12,C44,phi1_deg,Phi_deg,phi2_deg\n168,121,75,0,0,0\n", "p.csv")
    problem = bi.Problem(
        write(tmp_path, "&problem symmetry = 'M-3m' /\n&crystals points = 'p.csv' /\n"), "theory"
    )
    assert problem.settings.problem.symmetry == "cubic" and "symmetry = 'cubic'" in problem.resolved


@pytest.mark.parametrize("word", ["Fm-3m", "225", "fcc"])
def test_a_symmetry_may_be_a_space_group(word):
    problem = Problem.from_keywords("f", problem={"symmetry": word})
    assert problem.settings.problem.symmetry == "cubic"


@pytest.mark.parametrize("word", ["P-", "P--1", "P---", "Q-1"])
def test_what_is_no_space_group_is_refused(word):
    with pytest.raises(bi.InputError, match=f"symmetry: '{word}' is not known"):
        Problem.from_keywords("f", problem={"symmetry": word})
