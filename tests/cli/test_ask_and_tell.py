"""`build --ask` and `build --tell`: points out, moduli of others in."""

import csv
import io
import json

import numpy as np
import pytest

import bayesindent as bi
from support.csv_tables import numbers
from support.small_builds import IMPORTED


def test_ask_and_tell(bayesindent, tmp_path):
    file = tmp_path / "mine.nml"
    file.write_text(IMPORTED)
    asked = bayesindent("build", file, "--ask", "10")
    assert asked.returncode == 0, asked.stderr
    header, *rows = csv.reader(io.StringIO(asked.stdout))
    assert (header, len(rows)) == (["C11", "C12", "C44", "phi1_deg", "Phi_deg", "phi2_deg"], 10)
    document = json.loads(bayesindent("build", file, "--ask", "10", "--json").stdout)
    assert numbers(document["points"], header).tolist() == np.array(rows, float).tolist()
    results = tmp_path / "results.csv"
    with open(results, "w", newline="") as stream:
        writer = csv.writer(stream)
        writer.writerow([*header, "modulus_gpa"])
        for row in rows:
            c11, c12, c44, *euler = map(float, row)
            writer.writerow(
                [
                    *row,
                    float(
                        bi.halfspace_modulus(
                            bi.stiffness("cubic", C11=c11, C12=c12, C44=c44), euler
                        )
                    ),
                ]
            )
    told = bayesindent("build", file, "--tell", results)
    assert (told.returncode, told.stdout) == (
        0,
        "Campaign: 10 results imported, 10 simulations in all, 0 failed\n",
    ), told.stderr
    assert (
        json.loads(bayesindent("build", file, "--tell", results, "--json").stdout)["imported"] == 0
    )
    built = json.loads(bayesindent("build", file, "--json").stdout)
    assert (built["simulations"], built["new_simulations"]) == (10, 0)
    # The same points with other moduli: refused as a whole.
    lines = results.read_text().splitlines()
    results.write_text(
        "\n".join([lines[0], *(f"{line.rsplit(',', 1)[0]},77.5" for line in lines[1:])]) + "\n"
    )
    refused = bayesindent("build", file, "--tell", results)
    assert refused.returncode == 2
    assert refused.stderr.startswith(f"{results}: row 1 ")
    assert "one of them is wrong or of another physics" in refused.stderr


@pytest.mark.parametrize(
    ("symmetry", "domain", "is_cubic"),
    [
        ("symmetry = 'cubic'", "", True),
        ("symmetry = 'cubic'", "&domain classes = 'hexagonal' /", False),
        ("", "", False),
    ],
)
def test_a_stated_class_is_asked_for(bayesindent, tmp_path, symmetry, domain, is_cubic):
    file = tmp_path / "own.nml"
    file.write_text(
        f"&problem {symmetry} /\n&specimen geometry = 'block' /\n&design budget = 10 /\n{domain}"
    )
    asked = json.loads(bayesindent("build", file, "--ask", "4", "--json").stdout)["points"]
    c = numbers(asked, ["C11", "C22", "C33", "C44", "C55", "C66"])
    deviation = np.abs(c / c[:, [0, 0, 0, 3, 3, 3]] - 1).max()
    assert (deviation < 1e-12) == is_cubic
