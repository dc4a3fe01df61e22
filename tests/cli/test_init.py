"""`init`: files to begin with, what is known of metals, and what commands say comes next."""

import json
import re

import numpy as np
import pytest

import bayesindent as bi
from bayesindent.crystal.metals import SPREAD, known_of, metals
from bayesindent.program.commands.init import template
from support.tree import SOURCE

#: Bulk moduli in GPa as another table of Kittel's Introduction to Solid State Physics lists them.
BULK = {
    "Ag": 100.7,
    "Al": 72.2,
    "Au": 173.2,
    "Cu": 137.0,
    "Ir": 355.0,
    "Ni": 186.0,
    "Pb": 43.0,
    "Pd": 180.8,
    "Pt": 278.3,
    "Fe": 168.3,
    "Nb": 170.2,
    "Ta": 200.0,
    "V": 161.9,
    "W": 323.2,
    "Be": 100.3,
    "Cd": 46.7,
    "Co": 191.4,
    "Hf": 109.0,
    "Mg": 35.4,
    "Ti": 105.1,
    "Zr": 83.3,
}


def test_what_is_known_of_metals():
    """The arithmetic by closed forms, and the constants against bulk moduli of another kind of
    measurement.
    """
    assert set(metals()) == set(BULK)
    for symbol, metal in metals().items():
        c = metal.constants
        if metal.structure == "hcp":
            d = c["C33"] * (c["C11"] + c["C12"]) - 2 * c["C13"] ** 2
            a, axial = (
                1000 * (c["C33"] - c["C13"]) / d,
                1000 * (c["C11"] + c["C12"] - 2 * c["C13"]) / d,
            )
            expected, bulk = (
                {"compressibility[100]": a, "compressibility[001]": axial},
                1000 / (2 * a + axial),
            )
        else:
            bulk = (c["C11"] + 2 * c["C12"]) / 3
            expected = {"bulk_modulus": bulk}
        known = known_of(metal)
        assert {name: mean for name, (mean, _) in known.items()} == pytest.approx(
            expected, rel=1e-9
        )
        assert {sd for _, sd in known.values()} == {
            SPREAD * max(mean for mean, _ in known.values())
        }
        assert bulk == pytest.approx(BULK[symbol], rel=0.16), symbol
        assert bi.log_anisotropy(bi.stiffness(metal.symmetry, **c)) < 2.5
        assert metal.source


def test_the_files_of_a_metal_run(bayesindent, tmp_path):
    done = bayesindent("init", "cubic", "--metal", "Cu")
    assert (done.returncode, done.stdout) == (0, "Written: grains.nml grains.csv\n"), done.stderr
    assert done.stderr == "next: fill in grains.csv, then bayesindent run grains.nml\n"
    # Without grains a line says so.
    empty = bayesindent("run", "grains.nml", "--check")
    assert (empty.returncode, empty.stderr.count("\n")) == (2, 1)
    assert "grains.csv" in empty.stderr
    rows = np.array([(0, 0, 0), (0, 45, 0), (0, 54.7, 45), (10, 20, 30)], dtype=float)
    moduli = bi.halfspace_modulus(bi.stiffness("cubic", C11=168.4, C12=121.4, C44=75.4), rows)
    with open(tmp_path / "grains.csv", "a") as file:
        file.writelines(
            f"{','.join(map(str, row))},{modulus:.2f},2\n"
            for row, modulus in zip(rows, moduli, strict=True)
        )
    # Which modulus it is must be stated.
    undecided = bayesindent("run", "grains.nml", "--check")
    assert (
        undecided.returncode == 2 and "does not say which modulus was measured" in undecided.stderr
    )
    text = (tmp_path / "grains.nml").read_text()
    assert "mean = 137.1 " in text
    (tmp_path / "grains.nml").write_text(
        text.replace(
            "! modulus_kind = 'indentation_modulus'", "modulus_kind = 'indentation_modulus'"
        ).replace("! samples = 10000", "samples = 300")
    )
    checked = bayesindent("run", "grains.nml", "--check")
    assert checked.stderr.splitlines()[-1] == "next: bayesindent run grains.nml", checked.stderr
    done = bayesindent("extract", "grains.nml", "--json")
    assert done.returncode == 0, done.stderr
    assert done.stderr.splitlines()[-1].startswith(
        "next: bayesindent report runs/grains, and bayesindent next grains.nml"
    )
    found = json.loads(done.stdout)["parameters"]
    for name, value in {"C11": 168.4, "C12": 121.4, "C44": 75.4}.items():
        assert abs(found[name]["mean"] - value) < 3 * found[name]["sd"]
    # Nothing is replaced.
    again = bayesindent("init", "cubic")
    assert again.returncode == 2
    assert again.stderr == "grains.nml: is there already; choose another folder with --output\n"


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (
            [],
            "init: the crystal class is missing; state one, such as fcc, hcp or mmm, or a --metal",
        ),
        (["hcp", "--metal", "Cu"], "init: --metal: copper is fcc (cubic), not hcp"),
        (["bcc", "--metal", "Cu"], "init: --metal: copper is fcc (cubic), not bcc"),
        (["cubic", "--metal", "Xx"], "init: --metal: Xx is not known; known are Ag, Al, "),
        (["cubist"], "cubist"),
    ],
)
def test_what_cannot_be_meant_is_refused(bayesindent, tmp_path, arguments, said):
    done = bayesindent("init", *arguments)
    assert (done.returncode, done.stdout) == (2, "")
    assert said in done.stderr
    assert done.stderr.count("\n") == 1
    assert not list(tmp_path.iterdir())


def test_every_class_and_structure_has_a_file_that_is_right(tmp_path):
    classes = re.findall(
        r"'([^']+)'",
        re.search(r"\| `symmetry` .*", (SOURCE / "docs" / "namelists.md").read_text())[0],
    )
    assert len(classes) > 15
    for word in (*classes, "fcc", "bcc", "hcp"):
        namelist, table = template(word, None).values()
        (tmp_path / "grains.csv").write_text(
            table.replace(",modulus_gpa", ",effective_modulus_gpa") + "0,0,0,150,2\n"
        )
        (tmp_path / "grains.nml").write_text(namelist)
        assert bi.Problem(tmp_path / "grains.nml").stages == ["extract", "next"]
        # Every comment that is taken away leaves a variable.
        for line in namelist.splitlines():
            assert not re.match(r" *! \w+ = $", line)
        # What most people change is on the first screen.
        screen = namelist[: namelist.index("! Every other variable")]
        assert screen.count("\n") < 60
        for variable in ("modulus_kind", "technique", "calibration_sd", "quantity"):
            assert f" {variable} = " in screen
