"""The loop of Step 1 with the half-space theory in place of simulations: resuming, stopping, importing, refusing."""

import itertools
import sqlite3
import time
from pathlib import Path

import numpy as np
import pytest
from paper_domains import DOMAINS

import bayesindent as bi
from bayesindent.common.result_files import as_csv
from bayesindent.crystal.elasticity import stiffness_rows
from bayesindent.pipeline import build as build_module
from bayesindent.pipeline.build import build
from bayesindent.pipeline.import_export import ask, tell
from bayesindent.pipeline.simulator import Simulator
from bayesindent.program.cli import main
from bayesindent.program.commands import simulate as simulate_module
from bayesindent.settings.problem import Problem, read_crystals
from bayesindent.surrogate.surrogate import Surrogate


def make_problem(folder: Path, **groups) -> Problem:
    groups = {
        "problem": {"symmetry": "'cubic'"},
        "simulation": {"simulator": "'theory'"},
        "domain": {"c_min": "50, 40, 15", "c_max": "250, 150, 120", "anisotropy_cap": "7.2"},
        "surrogate": {"degree": 2, "bandlimit": 4},
        "design": {"n_candidates": 200, "budget": 16},
        "execution": {"workers": 1},
        **groups,
    }
    lines = [f"&{group}\n" + "".join(f"  {name} = {value}\n" for name, value in values.items()) + "/\n" for group, values in groups.items()]
    folder.mkdir(parents=True, exist_ok=True)
    path = folder / "problem.nml"
    path.write_text("".join(lines))
    return Problem(path, "build")


def before_each_simulation(monkeypatch, act) -> None:
    """Call act() before each simulation; what it returns, if anything, stands for the simulation's result."""

    class Disturbed(Simulator):
        def __call__(self, stiffness, euler_deg):
            return act() or super().__call__(stiffness, euler_deg)

    for module in (build_module, simulate_module):
        monkeypatch.setattr(module, "Simulator", Disturbed)


def stored(output: Path) -> list:
    return (
        sqlite3.connect(output / "campaign.sqlite")
        .execute("SELECT position, constants, euler_deg, indentation_modulus_gpa FROM simulation ORDER BY position")
        .fetchall()
    )


def test_build_writes_what_it_promises(tmp_path):
    document = build(make_problem(tmp_path), tmp_path / "out")
    assert {"simulations", "new_simulations", "failed", "terms", "loocv_gpa", "alpha", "beta", "history"} <= set(document)
    assert (document["simulations"], document["new_simulations"], document["failed"], document["terms"]) == (16, 16, 0, 12)
    assert document["history"][-1]["simulations"] == 16
    surrogate = Surrogate.load(tmp_path / "out" / "surrogate.txt")
    data = surrogate.data
    assert len(data["modulus_gpa"]) == 16
    assert surrogate.provenance["physics"] == '{"simulator": "theory"}'
    assert np.mean(np.abs(surrogate.predict(stiffness_rows("cubic", data["constants"]), data["euler_deg"])[0] - data["modulus_gpa"])) < 2.0


@pytest.mark.parametrize("workers, batch", [(1, 1), (2, 4)])
def test_an_interrupted_build_goes_on_where_it_was(tmp_path, monkeypatch, workers, batch):
    def problem(folder, budget):
        return make_problem(folder, design={"n_candidates": 200, "budget": budget, "batch": batch}, execution={"workers": workers})

    whole = build(problem(tmp_path / "a", 24), tmp_path / "a")
    # Killed after eleven simulations, in the middle of a batch.
    made = []

    def dying():
        if len(made) == 11:
            raise KeyboardInterrupt
        made.append(1)

    with monkeypatch.context() as patch:
        before_each_simulation(patch, dying)
        with pytest.raises(KeyboardInterrupt):
            build(problem(tmp_path / "b", 24), tmp_path / "b")
    assert 10 <= len(stored(tmp_path / "b")) <= 11
    resumed = build(problem(tmp_path / "b", 24), tmp_path / "b")
    assert resumed["new_simulations"] + len(made) in (24, 25)
    assert {row[1:] for row in stored(tmp_path / "b")} == {row[1:] for row in stored(tmp_path / "a")}
    assert resumed["loocv_gpa"] == pytest.approx(whole["loocv_gpa"], rel=1e-5)
    # Once more: nothing new; then more points for a finished campaign, the same as with the larger budget at once.
    assert build(problem(tmp_path / "b", 24), tmp_path / "b")["new_simulations"] == 0
    assert build(problem(tmp_path / "b", 32), tmp_path / "b")["new_simulations"] == 8
    build(problem(tmp_path / "c", 32), tmp_path / "c")
    assert {row[1:] for row in stored(tmp_path / "b")} == {row[1:] for row in stored(tmp_path / "c")}


def test_an_interrupt_starts_no_more_and_keeps_what_is_done(tmp_path, monkeypatch):
    calls, numbers = [], itertools.count(1)

    def interrupted():
        number = next(numbers)
        calls.append(number)
        time.sleep(0.1)  # longer than it takes to store a row
        if number == 20:
            raise KeyboardInterrupt

    before_each_simulation(monkeypatch, interrupted)
    problem = make_problem(tmp_path, design={"n_candidates": 200, "budget": 150, "batch": 150}, execution={"workers": 2})
    with pytest.raises(KeyboardInterrupt):
        build(problem, tmp_path)
    assert 20 <= len(calls) <= 24
    assert len(stored(tmp_path)) == len(calls) - 1


def test_workers_do_not_change_the_numbers(tmp_path):
    results = []
    for workers in (1, 3):
        problem = make_problem(
            tmp_path / str(workers), design={"n_candidates": 200, "budget": 20, "batch": 4}, execution={"workers": workers}
        )
        build(problem, tmp_path / str(workers))
        results.append(stored(tmp_path / str(workers)))
    assert results[0] == results[1]


def test_a_failed_point_stays_failed(tmp_path, monkeypatch):
    calls = itertools.count(1)
    before_each_simulation(monkeypatch, lambda: {"message": "the contact did not converge"} if next(calls) in (3, 10) else None)
    document = build(make_problem(tmp_path), tmp_path)
    assert (document["simulations"], document["new_simulations"], document["failed"]) == (16, 18, 2)
    assert build(make_problem(tmp_path), tmp_path)["new_simulations"] == 0


@pytest.mark.parametrize("times", [1, 100])
def test_what_the_machine_could_not_do_is_no_result(tmp_path, monkeypatch, times):
    """Too little memory: tried once more; if that fails too nothing is stored of this crystal, and the next run goes on."""
    calls = itertools.count(1)

    def failing():
        if 3 <= next(calls) < 3 + times:
            raise bi.MachineError("there is not enough memory")

    before_each_simulation(monkeypatch, failing)
    if times == 1:
        document = build(make_problem(tmp_path), tmp_path)
        assert (document["simulations"], document["new_simulations"], document["failed"]) == (16, 16, 0)
        return
    with pytest.raises(bi.MachineError, match="not enough memory"):
        build(make_problem(tmp_path), tmp_path)
    assert len(stored(tmp_path)) == 2
    monkeypatch.undo()
    document = build(make_problem(tmp_path), tmp_path)
    assert (document["simulations"], document["new_simulations"], document["failed"]) == (16, 14, 0)


@pytest.mark.parametrize("machine, words", [(False, "every simulation failed"), (True, "no memory")])
@pytest.mark.parametrize("command", ["build", "simulate"])
def test_a_run_in_which_every_simulation_failed_says_so(tmp_path, monkeypatch, capsys, command, machine, words):
    def failing():
        if machine:
            raise bi.MachineError("no memory")
        return {"message": "no contact"}

    before_each_simulation(monkeypatch, failing)
    (tmp_path / "points.csv").write_text("C11,C12,C44,phi1_deg,Phi_deg,phi2_deg\n168.4,121.4,75.4,0,0,0\n168.4,121.4,75.4,0,45,0\n")
    problem = make_problem(tmp_path, crystals={"points": "'points.csv'"})
    for _ in range(2):
        assert main([command, str(problem.path), "--output", str(tmp_path / "out")]) == 1
        captured = capsys.readouterr()
        assert captured.out == ""
        assert words in captured.err.splitlines()[-1]
    assert (len(stored(tmp_path / "out")) == 0) == machine


def test_surrogates_share_a_campaign(tmp_path):
    build(make_problem(tmp_path), tmp_path)
    document = build(make_problem(tmp_path, surrogate={"degree": 3, "bandlimit": 4, "file": "'other.txt'"}), tmp_path)
    assert document["new_simulations"] == 0
    assert (tmp_path / "other.txt").exists()
    theory = build(make_problem(tmp_path, design={"n_candidates": 200, "budget": 8, "reuse": "'chosen'"}), tmp_path)
    assert theory["simulations"] == 8
    assert theory["new_simulations"] == 0


@pytest.mark.parametrize("initial_set", ["latin", "boundary", "variance"])
@pytest.mark.parametrize("candidates", ["latin", "factorial"])
def test_designs(tmp_path, initial_set, candidates):
    problem = make_problem(
        tmp_path,
        surrogate={"degree": 1, "bandlimit": 4, "truncation": "'tensor'", "coordinates": "'box'", "prior": "'zero'"},
        design={
            "candidates": f"'{candidates}'",
            "n_candidates": 120,
            "n_directions": 4,
            "initial": 20,
            "initial_set": f"'{initial_set}'",
            "budget": 26,
            "refit": 3,
            "validation": 5,
        },
    )
    document = build(problem, tmp_path)
    assert document["simulations"] == 26
    assert document["terms"] == 16
    assert document["history"][0]["simulations"] == 20
    validation = document["validation"]
    assert validation["points"] == 5
    theory = bi.halfspace_modulus(stiffness_rows("cubic", validation["constants"]), validation["euler_deg"])
    assert validation["simulated"] == pytest.approx(theory.tolist())
    again = build(problem, tmp_path)
    assert again["new_simulations"] == 0
    assert again["validation"]["simulated"] == document["validation"]["simulated"]


def test_stopping_at_a_target(tmp_path):
    problem = make_problem(
        tmp_path, surrogate={"degree": 3, "bandlimit": 6}, design={"n_candidates": 200, "budget": 100, "target_gpa": 2.0}
    )
    document = build(problem, tmp_path)
    assert document["simulations"] < 100
    assert "reached 2 GPa" in document["stopped"]
    # Never with fewer points than terms under a flat prior.
    problem = make_problem(
        tmp_path / "flat",
        surrogate={"degree": 2, "bandlimit": 4, "prior": "'zero'"},
        design={"n_candidates": 200, "initial": 4, "budget": 60, "target_gpa": 100.0},
    )
    assert build(problem, tmp_path / "flat")["simulations"] == 12


def test_more_terms_than_points_under_a_flat_prior_is_refused(tmp_path):
    with pytest.raises(bi.InputError, match="&design budget: 16 simulations are fewer than the 30 terms"):
        build(make_problem(tmp_path, surrogate={"degree": 3, "bandlimit": 6, "prior": "'zero'"}), tmp_path)


def test_scan_compares_truncations(tmp_path):
    document = build(make_problem(tmp_path, surrogate={"degree": 2, "bandlimit": 4, "scan": "'1, 2 x 0, 4'"}), tmp_path)
    assert [(row["degree"], row["bandlimit"], row["terms"]) for row in document["scan"]] == [(1, 0, 3), (1, 4, 6), (2, 0, 6), (2, 4, 12)]
    assert document["scan"][3]["log_evidence"] == pytest.approx(document["log_evidence"], rel=1e-9)
    assert document["scan"][3]["loocv_gpa"] == pytest.approx(document["loocv_gpa"], rel=1e-6)
    for row in document["scan"]:
        counts = row["curve"]["simulations"]
        assert (counts[0], counts[-1]) == (document["history"][0]["simulations"], 16)
        assert row["curve"]["loocv_gpa"][-1] == row["loocv_gpa"]


def test_ask_and_tell(tmp_path):
    problem = make_problem(tmp_path, simulation={"simulator": "'import'"}, design={"n_candidates": 200, "budget": 12})
    points = ask(problem, tmp_path, 12)["points"]
    text = as_csv(list(points[0]), [list(point.values()) for point in points])
    rows = np.array([[float(v) for v in line.split(",")] for line in text.splitlines()[1:]])
    assert text.splitlines()[0] == "C11,C12,C44,phi1_deg,Phi_deg,phi2_deg"
    assert len(np.unique(rows, axis=0)) == 12
    modulus = bi.halfspace_modulus(stiffness_rows("cubic", rows[:, :3]), rows[:, 3:])
    table = tmp_path / "results.csv"
    table.write_text(
        "\n".join(
            [
                text.splitlines()[0] + ",modulus_gpa",
                *(f"{line},{m!r}" for line, m in zip(text.splitlines()[1:], modulus.tolist(), strict=True)),
            ]
        )
        + "\n"
    )
    points = read_crystals(table, "cubic")
    assert tell(problem, tmp_path, points)["imported"] == 12
    assert tell(problem, tmp_path, points)["imported"] == 0
    document = build(problem, tmp_path)
    assert (document["simulations"], document["new_simulations"]) == (12, 0)
    with pytest.raises(bi.InputError, match="&simulation: simulator 'import' cannot simulate"):
        build(make_problem(tmp_path, simulation={"simulator": "'import'"}, design={"n_candidates": 200, "budget": 13}), tmp_path)
    (tmp_path / "bare.csv").write_text(text)
    with pytest.raises(bi.InputError, match="modulus_gpa"):
        tell(problem, tmp_path, read_crystals(tmp_path / "bare.csv", "cubic"))


def test_candidates_of_a_table(tmp_path):
    rows = DOMAINS["cubic"].crystals(30, 3)
    outside = "100,99,120,0,0,0"
    lines = ["C11,C12,C44,phi1_deg,Phi_deg,phi2_deg", *(",".join(map(repr, row)) for row in np.hstack(rows).tolist()), outside]
    (tmp_path / "mine.csv").write_text("\n".join(lines) + "\n")
    document = build(make_problem(tmp_path, design={"candidates": "'mine.csv'", "budget": 12}), tmp_path)
    assert document["warnings"] == ["1 of 31 candidates are outside the domain and are left out"]
    known = {tuple(row) for row in np.hstack(rows).tolist()}
    data = Surrogate.load(tmp_path / "surrogate.txt").data
    assert {tuple(row) for row in np.hstack([data["constants"], data["euler_deg"]]).tolist()} <= known
    document = build(make_problem(tmp_path, design={"candidates": "'mine.csv'", "budget": 31}), tmp_path)
    assert document["simulations"] == 30
    assert "no candidate is left" in document["warnings"][-1]


def test_stopping_without_improvement(tmp_path):
    # The theory learns nothing from itself: the error settles at what truncation leaves out.
    document = build(make_problem(tmp_path, design={"n_candidates": 200, "budget": 150, "patience": 20}), tmp_path)
    assert document["simulations"] < 150
    assert "did not improve over the last 20" in document["stopped"]
