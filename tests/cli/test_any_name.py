"""Folders, files, grains and titles of any name: every command, both programs, and the library."""

import csv
import json
import os
import shutil
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

import bayesindent as bi
from bayesindent.settings.problem import read_crystals

NAMES = {
    "umlaut": "jürgen",
    "symbols": "µ-Härte [Å] (α→β) 中文 漢字",
    "decomposed": "e\u0301tude a\u030angstro\u0308m",
    "blanks and quotes": " it's 'so'  ",
    "long": "ü" * 100,
    "two hundred": "x" * 200,
}
COPPER = {"C11": 168.4, "C12": 121.4, "C44": 75.4}
MODULUS = "indentation_modulus_gpa"
ANGLES = [(0, 0, 0), (0, 45, 0), (0, 54.7, 45), (10, 20, 30)]


def quoted(text: str) -> str:
    """A text as a namelist has it."""
    return "'" + text.replace("'", "''") + "'"


def write(folder: Path, name: str) -> str:
    """A namelist of all stages and its tables, which have this name too."""
    moduli = bi.halfspace_modulus(bi.stiffness("cubic", **COPPER), np.array(ANGLES, dtype=float))
    with open(folder / f"{name}.csv", "w", newline="", encoding="utf-8") as file:
        writer = csv.writer(file)
        writer.writerow(
            [
                "grain",
                *COPPER,
                "phi1_deg",
                "Phi_deg",
                "phi2_deg",
                MODULUS,
                "sd_gpa",
            ]
        )
        rows = zip(ANGLES, moduli.tolist(), strict=True)
        writer.writerows(
            [f"{name[:20]} {k}", *COPPER.values(), *angles, modulus, 2]
            for k, (angles, modulus) in enumerate(rows)
        )
    table, measured = quoted(f"{name}.csv"), quoted(f"{name}.dat")
    with open(folder / f"{name}.dat", "w", newline="", encoding="utf-8") as file:
        writer = csv.writer(file)
        writer.writerow(["grain", "phi1_deg", "Phi_deg", "phi2_deg", MODULUS, "sd_gpa"])
        for k, (angles, modulus) in enumerate(zip(ANGLES, moduli.tolist(), strict=True)):
            writer.writerow([f"{name[:20]} {k}", *angles, modulus, 2])
    (folder / f"{name}.nml").write_bytes(
        os.fsencode(
            f"&problem symmetry = 'cubic', title = {quoted(name)} /\n"
            f"&crystals points = {table} /\n"
            "&simulation simulator = 'theory' /\n"
            "&design n_candidates = 60, budget = 8 /\n"
            f"&surrogate degree = 1, file = {quoted(name[:100] + '.txt')} /\n"
            f"&measurements file = {measured} /\n"
            "&sampler samples = 400, burn_in = 1000, chains = 2 /\n"
            "&next count = 1 /\n"
        )
    )
    return f"{name}.nml"


@pytest.mark.long_where("symbols", "decomposed", "blanks and quotes", "long", "two hundred")
@pytest.mark.parametrize("name", NAMES)
def test_every_command(bayesindent, batch, tmp_path, name, few_figures):
    name = NAMES[name]
    folder = tmp_path / name
    folder.mkdir()
    file = f"{name}/{write(folder, name)}"

    def done(*arguments, program=bayesindent) -> str:
        found = program(*arguments)
        assert found.returncode == 0, found.stderr
        return found.stdout

    assert "it asks for" in done("run", file, "--check") + done(file, "--check", program=batch)
    for command in ("simulate", "theory", "build", "extract", "next"):
        document = json.loads(done(command, file, "--output", f"{name}/out", "--json"))
        assert "results" in document or {"simulations", "parameters", "suggestions"} & set(document)
    done(file, "--output", f"{name}/batch", program=batch)
    # Both programs have chosen and learnt the same.
    surrogate = f"{name[:100]}.txt"
    learnt = [
        bi.Surrogate.load(folder / output / surrogate).coefficients for output in ("out", "batch")
    ]
    assert np.array_equal(*learnt)
    points = ("--points", f"{name}/{name}.csv", "--symmetry", "cubic")
    assert len(done("predict", "--surrogate", f"{name}/out/{surrogate}", *points).splitlines()) == 5
    done("report", f"{name}/out")
    page = (folder / "out" / "report.html").read_text(encoding="utf-8")
    assert name.strip().replace("'", "&#39;") in page
    summary = json.loads((folder / "out" / "summary.json").read_text())
    assert [row.get("grain") for row in summary["predicted"]] == [
        f"{name[:20]} {k}".strip() for k in range(4)
    ]
    shutil.copytree(folder / "out", folder / "other")
    done("compare", f"{name}/out", f"{name}/other", "--output", f"{name}/both")
    done("init", "cubic", "--metal", "Cu", "--output", f"{name}/new")
    assert (folder / "new" / "grains.nml").exists()
    # What is wrong is told in one line that names the file.
    (folder / f"{name}.csv").unlink()
    for found in (bayesindent("run", file), batch(file)):
        assert (found.returncode, found.stderr.count("\n")) == (2, 1)
        assert found.stderr.startswith(f"{file}: &crystals points: ")


@pytest.mark.parametrize("name", NAMES)
def test_the_library(tmp_path, name, few_figures):
    folder = tmp_path / NAMES[name]
    folder.mkdir()
    problem = bi.Problem(folder / write(folder, NAMES[name]))
    assert problem.stages[0] == "simulate"
    assert Path(problem.settings.crystals.points).name == f"{NAMES[name]}.csv"
    table = folder / f"{NAMES[name]}.csv"
    assert read_crystals(table, "cubic").euler_deg.tolist() == [
        list(map(float, angles)) for angles in ANGLES
    ]
    surrogate = bi.Surrogate.load("block")
    file = folder / f"{NAMES[name][:100]}.txt"
    surrogate.save(file)
    assert np.array_equal(bi.Surrogate.load(file).coefficients, surrogate.coefficients)
    assert np.array_equal(
        bi.Surrogate.load(file.name, folder=folder).coefficients, surrogate.coefficients
    )
    bi.build(problem, folder / "out")
    assert bi.report(folder / "out").exists()
    with pytest.raises(bi.InputError, match="there is no such surrogate"):
        bi.Surrogate.load(NAMES[name])


def test_a_folder_whose_name_is_not_utf8(tmp_path):
    folder = tmp_path / os.fsdecode(b"J\xfcrgen")
    folder.mkdir()
    assert len(bi.Problem(folder / write(folder, "plain")).measurements) == 4
    bi.Surrogate.load("block").save(folder / "block.txt")
    assert bi.Surrogate.load(folder / "block.txt").basis.n_terms > 0


def test_what_is_told_is_utf8(tmp_path):
    with pytest.raises(bi.InputError) as told:
        bi.Problem(tmp_path / "größe.nml")
    assert "größe.nml: the file does not exist" in str(told.value)
    with pytest.raises(bi.InputError) as told:
        bi.quantities("cubic", list(COPPER.values()), ["Härte"])
    assert "Härte" in str(told.value)
    with pytest.raises(bi.InputError) as told:
        bi.stiffness("würfel", **COPPER)
    assert "würfel" in str(told.value)


def test_a_terminal_without_the_signs(tmp_path):
    """What it cannot show is written as an escape; nothing fails."""
    (tmp_path / "a.csv").write_text(
        "phi1,Phi,phi2,Er (GPa)\n4,5,6,130 ± 2\n7,80,9,131 ± 2\n", encoding="utf-8"
    )
    command = [sys.executable, "-m", "bayesindent", "table", str(tmp_path / "a.csv")]
    done = subprocess.run(
        command, capture_output=True, env=os.environ | {"PYTHONIOENCODING": "ascii"}, check=False
    )
    assert done.returncode == 0 and b"\\xb1" in done.stdout + done.stderr, done.stderr
