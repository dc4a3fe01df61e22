"""Moduli and orientations in two files, joined by the names of the grains; `extract TABLE`."""

import json

import numpy as np
import pytest

import bayesindent as bi
from bayesindent.lab.joining import key_of
from bayesindent.settings.problem import Problem

NAMES = [f"G{number}" for number in range(1, 13)]
ANGLES = {name: (10.0 * i, 5.0 * i, 3.0 * i) for i, name in enumerate(NAMES)}


def problem(folder, moduli: str, orientations: str, **stated) -> Problem:
    (folder / "moduli.csv").write_text(moduli)
    (folder / "grains.txt").write_text(orientations)
    measurements = {"file": folder / "moduli.csv", "orientations_file": folder / "grains.txt"}
    return Problem.from_keywords(
        "f", problem={"symmetry": "cubic"}, measurements=measurements | stated
    )


def moduli_of(names) -> str:
    return "grain,Er (GPa),sd (GPa)\n" + "".join(
        f"{name},{150 + i},2\n" for i, name in enumerate(names)
    )


def orientations_of(names) -> str:
    return "Grain\tphi1\tPhi\tphi2\n" + "".join(
        "\t".join(map(str, (name, *ANGLES[name]))) + "\n" for name in names
    )


def test_rows_are_joined_by_name_in_any_order(tmp_path):
    # As a spreadsheet sorts names: G1, G10, G11, G12, G2, ..
    points = problem(tmp_path, moduli_of(sorted(NAMES)), orientations_of(NAMES)).measurements
    assert list(points.names) == sorted(NAMES)
    assert np.allclose(points.euler_deg, [ANGLES[name] for name in sorted(NAMES)])


@pytest.mark.parametrize(
    ("one", "other", "same"),
    [
        ("G1", "g 1", True),
        ("G-01", "G1", True),
        ("Grain 3", "G3", True),
        ("12", "012", True),
        ("1-1", "11", False),
        ("G1", "G10", False),
        ("G1", "H1", False),
        ("A", "B", False),
        ("10", "100", False),
    ],
)
def test_spelling_is_forgiven_and_nothing_is_guessed(one, other, same):
    assert (key_of(one) == key_of(other)) == same


def test_errors_and_sizes_come_with_the_orientations(tmp_path):
    lines = orientations_of(NAMES).splitlines()
    beside = ["orientation_sd_deg\tgrain radius (nm)", *(f"{i / 4}\t9000" for i in range(12))]
    orientations = "".join(f"{line}\t{more}\n" for line, more in zip(lines, beside, strict=True))
    table = problem(tmp_path, moduli_of(NAMES), orientations).table
    found = table.cells[[table.column("orientation_sd_deg"), table.column("grain_radius_um")]]
    expected = [[i / 4, 9.0] for i in range(12)]
    assert found.astype(float).to_numpy().tolist() == expected


@pytest.mark.parametrize(
    "header", ["x (pixels)", "E (MPa)", "Error (px)", "M (Taylor)", "Time (min)"]
)
def test_other_columns_of_a_list_of_orientations_are_not_read(tmp_path, header):
    lines = orientations_of(NAMES).splitlines()
    orientations = "".join(f"{line}\t{more}\n" for line, more in zip(lines, [header] + 12 * ["3"]))
    points = problem(tmp_path, moduli_of(NAMES), orientations).measurements
    assert np.allclose(points.euler_deg, [*ANGLES.values()])


def test_what_has_no_partner_is_named(tmp_path):
    found = problem(
        tmp_path, moduli_of([*NAMES[:5], "X7"]), orientations_of(NAMES[:4] + NAMES[8:9])
    )
    assert list(found.measurements.names) == NAMES[:4]
    said = " ".join(found.table.notes)
    assert "2 of 6 rows left out, no orientation in grains.txt: lines 6, 7" in said
    assert "no modulus of the grains G9" in said


@pytest.mark.parametrize(
    ("moduli", "orientations", "said"),
    [
        (moduli_of(["a", "b"]), orientations_of(NAMES[:2]), "no grain is in both tables: a, b"),
        (moduli_of(NAMES), orientations_of(["G1"]) + "g 1\t1\t2\t3\n", "has two orientations"),
        (moduli_of(NAMES).replace("grain", "other"), orientations_of(NAMES), "orientations_by"),
        (moduli_of(NAMES), "grain,colour\nG1,red\nG2,blue\n", "the angles phi1, Phi, phi2"),
        (
            "grain,phi1,Phi,phi2,Er,sd_gpa\nG1,1,2,3,150,2\n",
            orientations_of(NAMES),
            "states the orientation too",
        ),
    ],
)
def test_what_cannot_be_joined_is_refused(tmp_path, moduli, orientations, said):
    with pytest.raises(bi.InputError, match=f"orientations_file: .*{said}"):
        problem(tmp_path, moduli, orientations)


def test_the_order_joins_only_if_it_is_asked_for(tmp_path):
    moduli, orientations = moduli_of(reversed(NAMES)), orientations_of(NAMES)
    points = problem(tmp_path, moduli, orientations, orientations_by="order").measurements
    assert np.allclose(points.euler_deg, [*ANGLES.values()])
    with pytest.raises(bi.InputError, match="11 orientations for 12 rows"):
        problem(tmp_path, moduli, orientations_of(NAMES[1:]), orientations_by="order")


def written(folder) -> None:
    """Two files of twelve grains of nickel."""
    stiffness = bi.stiffness("cubic", C11=248, C12=154.9, C44=124.2)
    names = sorted(NAMES)
    euler = np.array([ANGLES[name] for name in names])
    moduli = bi.halfspace_modulus(stiffness, euler)
    rows = [f"{name},{value:.2f},2" for name, value in zip(names, moduli)]
    (folder / "moduli.csv").write_text(
        "\n".join(["grain,indentation_modulus_gpa,sd_gpa", *rows, ""])
    )
    (folder / "grains.txt").write_text(orientations_of(NAMES))


def test_two_files_and_one_command(bayesindent, tmp_path):
    written(tmp_path)
    words = ["extract", "moduli.csv", "--orientations", "grains.txt", "--samples", "2000"]
    refused = bayesindent(*words)
    assert refused.returncode == 2 and "state --symmetry: 'isotropic', 'cubic'" in refused.stderr
    done = bayesindent(*words, "--symmetry", "fcc", "--knowledge", "bulk_modulus=186,5", "--json")
    assert done.returncode == 0, done.stderr
    found = json.loads(done.stdout)["parameters"]["C44"]
    assert abs(found["mean"] - 124.2) < 3 * found["sd"] < 60
    # The namelist beside the results gives the same.
    again = bayesindent("extract", "runs/moduli/extract.nml", "--samples", "2000", "--json")
    assert json.loads(again.stdout)["parameters"]["C44"] == found
    wrong = bayesindent("extract", "runs/moduli/extract.nml", "--symmetry", "fcc")
    assert wrong.returncode == 2 and "--symmetry goes with a table" in wrong.stderr
    told = bayesindent("run", "moduli.csv")
    assert told.returncode == 2 and "bayesindent extract moduli.csv --symmetry CLASS" in told.stderr


def test_a_statement_of_knowledge_without_an_sd_is_refused(bayesindent, tmp_path):
    written(tmp_path)
    words = ["extract", "moduli.csv", "--symmetry", "fcc", "--knowledge", "bulk_modulus=186"]
    refused = bayesindent(*words)
    assert refused.returncode == 2 and "bulk_modulus=184,5" in refused.stderr
