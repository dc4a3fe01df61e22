"""The loop of Step 1 with the half-space theory in place of simulations: resuming, stopping,
importing, refusing.
"""

import itertools
import json
import sqlite3
import time
from contextlib import closing

import numpy as np
import pytest

import bayesindent as bi
from bayesindent.common.result_files import as_csv
from bayesindent.crystal.elasticity import stiffness_rows
from bayesindent.program.cli import main
from bayesindent.settings.problem import read_crystals
from bayesindent.stages.build import ask, tell
from bayesindent.stages.stage import Simulations
from bayesindent.surrogate.basis import Basis
from bayesindent.surrogate.surrogate import Surrogate
from support.build_problems import CORRECTION, PAPER, make_problem, numbers_of, posterior_of, stored
from support.diagnostics import of_code
from support.learner import Learner, build, spread_crystals
from support.paper_domains import DOMAINS
from support.specimen_factor import specimen


@pytest.fixture
def specimens(monkeypatch):
    """Simulations of a specimen that is no half-space: the theory, and a factor that a specimen
    might add.
    """
    theory = Simulations.__call__

    def simulate(self, job):
        result = theory(self, job)
        return result | {
            "modulus_gpa": result["modulus_gpa"]
            * float(specimen(job.stiffness[None], job.euler_deg[None])[0])
        }

    monkeypatch.setattr(Simulations, "__call__", simulate)


@pytest.fixture(params=["paper", "correction"])
def model(request):
    return {"paper": PAPER, "correction": CORRECTION}[request.param]


def before_each_simulation(monkeypatch, act) -> None:
    """Call act() before each simulation; what it returns, if anything, stands for the simulation's
    result.
    """
    simulate = Simulations.__call__
    monkeypatch.setattr(Simulations, "__call__", lambda self, job: act() or simulate(self, job))


def test_build_writes_what_it_promises(tmp_path, specimens, model):
    document = build(make_problem(tmp_path, model=model), tmp_path / "out")
    assert {
        "simulations",
        "new_simulations",
        "failed",
        "terms",
        "loocv_gpa",
        "alpha",
        "beta",
        "history",
    } <= set(document)
    terms = 16 if model is PAPER else 29
    assert (
        document["simulations"],
        document["new_simulations"],
        document["failed"],
        document["terms"],
    ) == (16, 16, 0, terms)
    assert document["history"][-1]["simulations"] == 16
    assert document["stopped"] == "the budget is used"
    surrogate = Surrogate.load(tmp_path / "out" / "surrogate.txt")
    assert (surrogate.alpha, surrogate.beta, surrogate.fall) == tuple(
        document[name] for name in ("alpha", "beta", "fall")
    )
    data = surrogate.data
    stiffness, angles, modulus = (
        stiffness_rows(surrogate.symmetry, data["constants"]),
        data["euler_deg"],
        data["modulus_gpa"],
    )
    theory = bi.halfspace_modulus(stiffness, angles)
    assert len(modulus) == 16
    assert modulus == pytest.approx(theory * specimen(stiffness, angles), rel=1e-9)
    assert surrogate.provenance["physics"] == '{"simulator": "theory"}'
    assert surrogate.provenance["simulations"] == 16
    # What theory alone, and times one ratio, leaves of the same simulations.
    ratio = np.exp(np.log(modulus / theory).mean())
    expected = {
        "theory_gpa": np.abs(theory - modulus).mean(),
        "ratio": ratio,
        "theory_times_ratio_gpa": np.abs(ratio * theory - modulus).mean(),
    }
    assert document["baselines"] == pytest.approx(expected, rel=1e-6)
    assert document["domain"]["largest_relative_sd"] >= document["domain"]["mean_relative_sd"] > 0
    # The errors of the last state, from a refit without each simulation at the same alpha, beta and
    # fall.
    learner = Learner(surrogate.basis)
    learner.add(data["constants"], angles, modulus, chosen=True)
    learner.fit()
    assert learner.precisions()["fall"] == pytest.approx(document["fall"], rel=1e-12)
    assert learner.leave_out(np.arange(16))[2] == pytest.approx(document["loocv_gpa"], rel=1e-6)
    assert document["norm"] == pytest.approx(np.linalg.norm(surrogate.coefficients), rel=1e-9)
    if model is CORRECTION:
        assert document["loocv_gpa"] < document["baselines"]["theory_times_ratio_gpa"]


@pytest.mark.parametrize("workers, batch", [(1, 1), (2, 4)])
def test_an_interrupted_build_goes_on_where_it_was(tmp_path, monkeypatch, model, workers, batch):
    def problem(folder, budget):
        design = {"n_candidates": 200, "budget": budget, "batch": batch}
        return make_problem(folder, model=model, design=design, execution={"workers": workers})

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
    # To the last bit, but for where it was and how much was new.
    assert numbers_of(resumed) == numbers_of(whole)
    assert posterior_of(tmp_path / "b") == posterior_of(tmp_path / "a")
    assert stored(tmp_path / "b") == stored(tmp_path / "a")
    assert resumed["new_simulations"] + len(made) in (24, 25)
    # Once more: nothing new; then more points for a finished campaign, the same as with the larger
    # budget at once.
    assert build(problem(tmp_path / "b", 24), tmp_path / "b")["new_simulations"] == 0
    assert build(problem(tmp_path / "b", 32), tmp_path / "b")["new_simulations"] == 8
    build(problem(tmp_path / "c", 32), tmp_path / "c")
    assert {row[1:] for row in stored(tmp_path / "b")} == {
        row[1:] for row in stored(tmp_path / "c")
    }


def test_an_interrupt_starts_no_more_and_keeps_what_is_done(tmp_path, monkeypatch):
    calls, numbers = [], itertools.count(1)

    def interrupted():
        number = next(numbers)
        calls.append(number)
        time.sleep(0.1)  # longer than it takes to store a row
        if number == 20:
            raise KeyboardInterrupt

    before_each_simulation(monkeypatch, interrupted)
    problem = make_problem(
        tmp_path,
        design={"n_candidates": 200, "budget": 150, "batch": 150},
        execution={"workers": 2},
    )
    with pytest.raises(KeyboardInterrupt):
        build(problem, tmp_path)
    assert 20 <= len(calls) <= 24
    assert len(stored(tmp_path)) == len(calls) - 1


def test_workers_do_not_change_the_numbers(tmp_path, specimens, model):
    results = []
    for workers in (1, 3):
        folder = tmp_path / str(workers)
        design = {"n_candidates": 1000, "budget": 20, "batch": 4, "validation": 3}
        document = build(
            make_problem(folder, model=model, design=design, execution={"workers": workers}), folder
        )
        results.append((stored(folder), numbers_of(document), posterior_of(folder)))
    assert results[0] == results[1]


def test_a_failed_point_stays_failed(tmp_path, monkeypatch):
    calls = itertools.count(1)
    before_each_simulation(
        monkeypatch,
        lambda: {"message": "the contact did not converge"} if next(calls) in (3, 10) else None,
    )
    document = build(make_problem(tmp_path), tmp_path)
    assert (document["simulations"], document["new_simulations"], document["failed"]) == (16, 18, 2)
    (found,) = of_code(document["warnings"], "simulations_failed")
    assert found["numbers"] == {"failed": 2, "simulations": 18}
    assert build(make_problem(tmp_path), tmp_path)["new_simulations"] == 0


@pytest.mark.parametrize("times", [1, 100])
def test_what_the_machine_could_not_do_is_no_result(tmp_path, monkeypatch, times):
    """Too little memory: tried once more; if that fails too nothing is stored of this crystal, and
    the next run goes on.
    """
    calls = itertools.count(1)

    def failing():
        if 3 <= next(calls) < 3 + times:
            raise bi.MachineError("there is not enough memory")

    before_each_simulation(monkeypatch, failing)
    if times == 1:
        document = build(make_problem(tmp_path), tmp_path)
        assert (document["simulations"], document["new_simulations"], document["failed"]) == (
            16,
            16,
            0,
        )
        return
    with pytest.raises(bi.MachineError, match="not enough memory"):
        build(make_problem(tmp_path), tmp_path)
    assert len(stored(tmp_path)) == 2
    monkeypatch.undo()
    document = build(make_problem(tmp_path), tmp_path)
    assert (document["simulations"], document["new_simulations"], document["failed"]) == (16, 14, 0)


@pytest.mark.parametrize(
    "machine, words", [(False, "every simulation failed"), (True, "no memory")]
)
@pytest.mark.parametrize("command", ["build", "simulate"])
def test_a_run_in_which_every_simulation_failed_says_so(
    tmp_path, monkeypatch, capsys, command, machine, words
):
    def failing():
        if machine:
            raise bi.MachineError("no memory")
        return {"message": "no contact"}

    before_each_simulation(monkeypatch, failing)
    (tmp_path / "points.csv").write_text(
        "C11,C12,C44,phi1_deg,Phi_deg,phi2_deg\n168.4,121.4,75.4,0,0,0\n168.4,121.4,75.4,0,45,0\n"
    )
    problem = make_problem(tmp_path, crystals={"points": "'points.csv'"})
    for _ in range(2):
        assert main([command, str(problem.path), "--output", str(tmp_path / "out")]) == 1
        captured = capsys.readouterr()
        assert captured.out == ""
        assert words in captured.err.splitlines()[-1]
    assert (len(stored(tmp_path / "out")) == 0) == machine


def test_surrogates_share_a_campaign(tmp_path):
    build(make_problem(tmp_path), tmp_path)
    document = build(
        make_problem(
            tmp_path,
            surrogate={"model": "'paper'", "degree": 1, "bandlimit": 2, "file": "'other.txt'"},
        ),
        tmp_path,
    )
    assert document["new_simulations"] == 0
    assert (tmp_path / "other.txt").exists()
    chosen = build(
        make_problem(
            tmp_path,
            surrogate={"model": "'paper'", "degree": 1, "bandlimit": 0},
            design={"n_candidates": 200, "budget": 8, "reuse": "'chosen'"},
        ),
        tmp_path,
    )
    assert chosen["simulations"] == 8


def test_what_other_classes_taught_is_used(tmp_path, specimens):
    """A correction of all crystals learns from the cubic ones of the same campaign; one of cubic
    crystals not from the others.
    """
    cubic = build(make_problem(tmp_path), tmp_path)
    document = build(
        make_problem(tmp_path, model=CORRECTION, design={"n_candidates": 100, "budget": 30}),
        tmp_path,
    )
    inside = ~Surrogate.load(tmp_path / "surrogate.txt").outside(
        stiffness_rows("cubic", [json.loads(row[1]) for row in stored(tmp_path)[:16]])
    )
    assert 5 <= inside.sum() < cubic["simulations"]
    assert (document["simulations"], document["new_simulations"]) == (30, 30 - inside.sum())
    left = 16 - inside.sum()
    (found,) = of_code(document["warnings"], "simulations_outside")
    assert found["numbers"] == {"outside": left}
    data = Surrogate.load(tmp_path / "surrogate.txt").data
    assert data["constants"].shape == (30, 21)
    # The same crystals with a surrogate of their own.
    again = build(
        make_problem(tmp_path, surrogate=PAPER["surrogate"] | {"file": "'cubic.txt'"}), tmp_path
    )
    assert again["new_simulations"] == 0
    assert numbers_of(again)["history"] == cubic["history"][-1:] or again["simulations"] == 16


@pytest.mark.parametrize("initial_set", ["latin", "boundary", "variance"])
@pytest.mark.parametrize("candidates", ["latin", "factorial"])
def test_designs(tmp_path, specimens, model, initial_set, candidates):
    problem = make_problem(
        tmp_path,
        model=model,
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
    assert document["history"][0]["simulations"] == 20
    validation = document["validation"]
    assert validation["points"] == 5
    surrogate = Surrogate.load(tmp_path / "surrogate.txt")
    stiffness, angles = (
        stiffness_rows(surrogate.symmetry, validation["constants"]),
        np.array(validation["euler_deg"]),
    )
    simulated = bi.halfspace_modulus(stiffness, angles) * specimen(stiffness, angles)
    assert validation["simulated"] == pytest.approx(simulated.tolist())
    mean, sd = surrogate.predict(stiffness, angles)
    assert validation["predicted"] == pytest.approx(mean.tolist(), rel=1e-12)
    assert validation["sd"] == pytest.approx(sd.tolist(), rel=1e-12)
    assert validation["mean_absolute_gpa"] == pytest.approx(
        np.abs(mean - simulated).mean(), rel=1e-9
    )
    assert validation["within_1_sd"] == np.mean(np.abs(mean - simulated) <= sd)
    # They were not learnt from.
    learnt = {
        tuple(row)
        for row in np.hstack([surrogate.data["constants"], surrogate.data["euler_deg"]]).tolist()
    }
    assert not learnt & {
        tuple(row) for row in np.hstack([validation["constants"], angles]).tolist()
    }
    again = build(problem, tmp_path)
    assert again["new_simulations"] == 0
    assert again["validation"]["simulated"] == document["validation"]["simulated"]


def test_more_terms_than_points_under_equal_priors_is_refused(tmp_path):
    with pytest.raises(
        bi.InputError, match="&design budget: 16 simulations are fewer than the 54 terms"
    ):
        build(
            make_problem(tmp_path, surrogate=PAPER["surrogate"] | {"degree": 2}),
            tmp_path,
        )
    assert (
        build(make_problem(tmp_path, model=CORRECTION, surrogate={"degree": 3}), tmp_path)["terms"]
        == 141
    )


def test_scan_compares_truncations(tmp_path):
    problem = make_problem(
        tmp_path,
        surrogate={
            "model": "'paper'",
            "degree": 2,
            "bandlimit": 4,
            "truncation": "'total'",
            "scan": "'1, 2 x 0, 4'",
        },
        design={"n_candidates": 200, "budget": 30},
    )
    document = build(problem, tmp_path)
    assert [(row["degree"], row["bandlimit"], row["terms"]) for row in document["scan"]] == [
        (1, 0, 4),
        (1, 4, 8),
        (2, 0, 10),
        (2, 4, 20),
    ]
    assert document["scan"][3]["log_evidence"] == pytest.approx(document["log_evidence"], rel=1e-9)
    assert document["scan"][3]["loocv_gpa"] == pytest.approx(document["loocv_gpa"], rel=1e-6)
    for row in document["scan"]:
        counts = row["curve"]["simulations"]
        assert (counts[0], counts[-1]) == (document["history"][0]["simulations"], 30)
        assert row["curve"]["loocv_gpa"][-1] == row["loocv_gpa"]


def test_ask_and_tell(tmp_path):
    problem = make_problem(
        tmp_path,
        simulation={"simulator": "'import'"},
        surrogate={"model": "'paper'", "degree": 1, "bandlimit": 0},
        design={"n_candidates": 200, "budget": 12},
    )
    points = ask(problem, tmp_path, 12)["points"]
    text = as_csv(list(points[0]), [list(point.values()) for point in points])
    rows = np.loadtxt(text.splitlines()[1:], delimiter=",")
    assert text.splitlines()[0] == "C11,C12,C44,phi1_deg,Phi_deg,phi2_deg"
    assert len(np.unique(rows, axis=0)) == 12
    modulus = bi.halfspace_modulus(stiffness_rows("cubic", rows[:, :3]), rows[:, 3:])
    table = tmp_path / "results.csv"
    table.write_text(
        "\n".join(
            [
                text.splitlines()[0] + ",modulus_gpa",
                *(
                    f"{line},{m!r}"
                    for line, m in zip(text.splitlines()[1:], modulus.tolist(), strict=True)
                ),
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
        build(
            make_problem(
                tmp_path,
                simulation={"simulator": "'import'"},
                design={"n_candidates": 200, "budget": 16},
            ),
            tmp_path,
        )
    (tmp_path / "bare.csv").write_text(text)
    with pytest.raises(bi.InputError, match="modulus_gpa"):
        tell(problem, tmp_path, read_crystals(tmp_path / "bare.csv", "cubic"))


def test_failures_are_told(tmp_path):
    """A simulation that failed is a row with its reason, and its point is not asked for again. An
    empty cell is a simulation that is not yet done.
    """
    problem = make_problem(
        tmp_path,
        simulation={"simulator": "'import'"},
        surrogate={"model": "'paper'", "degree": 1, "bandlimit": 0},
        design={"n_candidates": 200, "budget": 12},
    )

    def tell_moduli(cells):
        rows = [[*point.values(), *cell] for point, cell in zip(points, cells, strict=True)]
        table = tmp_path / "results.csv"
        table.write_text(as_csv([*points[0], "modulus_gpa", "reason"], rows))
        return tell(problem, tmp_path, read_crystals(table, "cubic"))

    points = ask(problem, tmp_path, 4)["points"]
    first = [[150.0, ""], ["", "no convergence"], ["", "contact, lost"], ["", ""]]
    counts = ("imported", "simulations", "failed")
    for imported in (3, 0):
        document = tell_moduli(first)
        assert [document[name] for name in counts] == [imported, 1, 2]
    with closing(sqlite3.connect(tmp_path / "campaign.sqlite")) as file:
        found = file.execute("SELECT status, message FROM simulation ORDER BY position").fetchall()
    assert found == [("done", ""), ("failed", "no convergence"), ("failed", "contact, lost")]
    # All candidates that are left.
    again = ask(problem, tmp_path, 197)["points"]
    assert points[3] in again
    assert not any(point in again for point in points[:3])
    with pytest.raises(bi.InputError, match=r"row 2 .* as failed \(no convergence\)"):
        tell_moduli([[150.0, ""]] * 4)
    with pytest.raises(bi.InputError, match="row 1 .* but the same point has 150.0 GPa"):
        tell_moduli([["", "late"]] * 4)


def test_candidates_of_a_table(tmp_path):
    rows = spread_crystals(Basis.from_keywords("cubic", DOMAINS["cubic"]), 30, 3)
    outside = "100,99,120,0,0,0"
    lines = [
        "C11,C12,C44,phi1_deg,Phi_deg,phi2_deg",
        *(",".join(map(repr, row)) for row in np.hstack(rows).tolist()),
        outside,
    ]
    (tmp_path / "mine.csv").write_text("\n".join(lines) + "\n")
    document = build(
        make_problem(tmp_path, design={"candidates": "'mine.csv'", "budget": 16}), tmp_path
    )
    (found,) = document["warnings"]
    assert (found["code"], found["subject"], found["numbers"]) == (
        "candidates_left_out",
        "the table mine.csv",
        {"outside": 1, "rows": 31},
    )
    known = {tuple(row) for row in np.hstack(rows).tolist()}
    data = Surrogate.load(tmp_path / "surrogate.txt").data
    assert {
        tuple(row) for row in np.hstack([data["constants"], data["euler_deg"]]).tolist()
    } <= known
    document = build(
        make_problem(tmp_path, design={"candidates": "'mine.csv'", "budget": 31}), tmp_path
    )
    assert document["simulations"] == 30
    assert document["warnings"][-1]["code"] == "no_candidate_left"
    assert document["warnings"][-1]["numbers"] == {"simulations": 30}


def test_told_moduli_of_a_specimen_teach_a_correction(tmp_path):
    """Simulations made elsewhere, in rounds: what is asked for next takes account of what was
    told.
    """
    problem = make_problem(
        tmp_path,
        model=CORRECTION,
        simulation={"simulator": "'import'"},
        design={"n_candidates": 300, "budget": 24},
    )
    asked = []
    for _ in range(3):
        points = ask(problem, tmp_path, 8)["points"]
        rows = np.array([list(point.values()) for point in points])
        assert not {tuple(row) for row in rows} & set(asked)
        asked += [tuple(row) for row in rows]
        stiffness, angles = stiffness_rows("triclinic", rows[:, :21]), rows[:, 21:]
        modulus = bi.halfspace_modulus(stiffness, angles) * specimen(stiffness, angles)
        lines = [
            ",".join([*points[0], "modulus_gpa"]),
            *(
                ",".join(map(repr, [*row, m]))
                for row, m in zip(rows.tolist(), modulus.tolist(), strict=True)
            ),
        ]
        (tmp_path / "told.csv").write_text("\n".join(lines) + "\n")
        tell(problem, tmp_path, read_crystals(tmp_path / "told.csv", "triclinic"))
    document = build(problem, tmp_path)
    assert (document["simulations"], document["new_simulations"]) == (24, 0)
    assert document["loocv_gpa"] < 0.5 * document["baselines"]["theory_times_ratio_gpa"]


def test_a_build_over_the_scale(tmp_path, specimens):
    """Crystals of every scale are candidates; an interrupted build goes on."""
    model = CORRECTION | {
        "domain": {
            "log_anisotropy_max": "1.2",
            "stiffness_min_gpa": "50",
            "stiffness_max_gpa": "450",
        }
    }
    first = build(
        make_problem(tmp_path, model=model, design={"n_candidates": 300, "budget": 12}), tmp_path
    )
    again = build(
        make_problem(tmp_path, model=model, design={"n_candidates": 300, "budget": 24}), tmp_path
    )
    assert (first["terms"], again["simulations"], again["new_simulations"]) == (35, 24, 12)
    surrogate = Surrogate.load(tmp_path / "surrogate.txt")
    scale = surrogate.basis.coverage(stiffness_rows("triclinic", surrogate.data["constants"]))[2]
    assert scale.min() < 60
    assert scale.max() > 375
    whole = build(
        make_problem(tmp_path / "b", model=model, design={"n_candidates": 300, "budget": 24}),
        tmp_path / "b",
    )
    assert [again[key] for key in ("alpha", "beta", "fall", "loocv_gpa")] == [
        whole[key] for key in ("alpha", "beta", "fall", "loocv_gpa")
    ]
