"""Speeds of surface waves in both programs, from the namelist to the report.

Modules: velocity_tables.f90.
"""

import json

import numpy as np
import pytest

from bayesindent.stages.results_folder import read_posterior

#: A glass: a modulus of 74.4 GPa, and a speed of 3418 m/s.
NAMELIST = """
&problem symmetry = 'isotropic', density_kg_m3 = 2200, density_sd_kg_m3 = 10, synthetic = .true. /
&crystals points = 'points.csv' /
&simulation simulator = 'theory' /
&measurements file = 'moduli.csv', velocities = 'speeds.csv', velocity_calibration_sd = 0.002 /
&sampler samples = 200, burn_in = 100, chains = 2 /
"""
ANGLES = "phi1_deg,Phi_deg,phi2_deg"
TABLES = {
    "points.csv": f"C11,C12,{ANGLES},propagation_deg\n77.5,15.5,10,20,30,40\n",
    "moduli.csv": (
        f"{ANGLES},indentation_modulus_gpa,sd_gpa\n0,0,0,74,1.5\n10,50,7,75,1.5\n0,90,20,74.4,1.5\n"
    ),
    "speeds.csv": (
        f"grain,{ANGLES},propagation_deg,rayleigh_velocity_m_s,sd_m_s\na,0,0,0,0,3425,17\n"
        "b,20,70,300,15,3410,17\n"
    ),
}


@pytest.fixture(autouse=True)
def case(tmp_path):
    for name, text in {**TABLES, "a.nml": NAMELIST}.items():
        (tmp_path / name).write_text(text)


def test_both_programs_have_the_same_answer(bayesindent, batch, tmp_path, few_figures):
    done = bayesindent("run", "a.nml", "--output", "python")
    assert done.returncode == 0, done.stderr
    assert "measured: speeds of waves in 2 directions" in done.stdout
    done = batch("a.nml", "--output", "batch")
    assert done.returncode == 0, done.stderr
    theory, draws = [
        [(folder / "theory.csv").read_text(), read_posterior(folder)["draws"].tolist()]
        for folder in (tmp_path / "python", tmp_path / "batch")
    ]
    assert theory == draws
    found = [
        json.loads((tmp_path / folder / "summary.json").read_text())
        for folder in ("python", "batch")
    ]
    assert found[0]["predicted"] == found[1]["predicted"]
    assert [item.get("propagation_deg") for item in found[0]["predicted"]] == [
        None,
        None,
        None,
        0,
        15,
    ]
    assert found[0]["velocities_left_out"] == 0
    parameters = found[0]["parameters"]
    assert abs(parameters["C11"]["mean"] - 77.5) < 3 * parameters["C11"]["sd"] < 45
    budget = found[0]["error_budget"]["C11"]
    assert budget["velocities"] > 0
    assert np.isclose(sum(budget.values()), 1)
    theory = (tmp_path / "batch" / "theory.csv").read_text().splitlines()
    assert theory[0].endswith("rayleigh_velocity_m_s")
    # Rayleigh's equation.
    k = 31 / 77.5
    squares = np.roots([1, -8, 24 - 16 * k, -16 * (1 - k)])
    expected = np.sqrt(
        1e9 * 31 / 2200 * min(x.real for x in squares if abs(x.imag) < 1e-9 and 0 < x.real < 1)
    )
    assert np.isclose(float(theory[1].split(",")[-1]), expected, rtol=1e-6)


@pytest.mark.long
def test_they_are_in_the_report_and_the_paper(bayesindent, tmp_path):
    assert bayesindent("extract", "a.nml", "--output", "python").returncode == 0
    done = bayesindent("report", "python", "--figures", "png", "--paper")
    assert done.returncode == 0, done.stderr
    assert (tmp_path / "python" / "figures" / "velocities.png").stat().st_size > 10000
    assert "a" in (tmp_path / "python" / "paper" / "velocities.csv").read_text()
