"""The loop of Step 1: choose the next simulations, perform them, store them, learn from them; see docs/surrogate.md.

All results go through campaign.sqlite, so that an interrupted build goes on where it was, and a larger budget continues it.
"""

import json
from pathlib import Path

import numpy as np

from ..common.progress import Progress
from ..core import BayesindentError
from ..crystal.elasticity import halfspace_modulus, stiffness_rows
from ..pipeline.campaign import Campaign
from ..pipeline.simulator import Simulator, engine_of, physics_identity, resolution_warnings, simulate_into
from ..pipeline.validation import validate
from ..surrogate.basis import Basis
from ..surrogate.candidates import candidates_of, outside
from ..surrogate.choice import Choice, initial_set
from ..surrogate.domain import Domain
from ..surrogate.learning import Learning
from ..surrogate.lookup import check_replaceable
from ..surrogate.scan import scan_truncations
from ..surrogate.stopping import why_to_stop

__all__ = ["Loop", "build"]


def build(problem, output, progress: Progress | None = None) -> dict:
    """Step 1 of a problem: the surrogate in the output folder, and the document of `build`."""
    with Loop(problem, Path(output), progress) as loop:
        return loop.run()


class Loop:
    """One build: what may be chosen, what was learnt, and the campaign; `unused` are rows that the budget leaves over."""

    def __init__(self, problem, output: Path, progress: Progress | None = None):
        self.problem, self.output, self.progress = problem, output, progress or Progress()
        self.symmetry, design = problem.settings.problem.symmetry, problem.settings.design
        check_replaceable(problem, output)
        basis = basis_of(problem)
        self.engine = engine_of(problem)
        candidates, self.warnings = candidates_of(problem, basis)
        schedule = {name: getattr(design, name) for name in ("initial", "budget", "batch", "refit")}
        self.learning = Learning(basis, problem.settings.surrogate.prior, **schedule)
        initial = initial_set(candidates, basis, design.initial_set, design.initial)
        self.choice = Choice(candidates, self.learning.learner, initial, design.variance_of, self.engine.workers)
        self.n_failed = self.n_new = 0
        self.unused, self.simulate = [], None
        self.campaign = Campaign(output / "campaign.sqlite", physics_identity(problem))
        others = self.campaign.other_physics()
        if others and not self.campaign.rows(self.symmetry):
            self.warnings.append(f"{self.campaign.path} holds only simulations of another physics ({others[0]}); they are not used here")

    def __enter__(self) -> "Loop":
        return self

    def __exit__(self, *_) -> None:
        self.campaign.close()

    def run(self) -> dict:
        """Until the target, the budget, or no candidate is left; then the surrogate, its errors, and the validation set."""
        learning, budget = self.learning, self.learning.budget
        self.replay()
        stopped = self.stopped()
        with self.progress.bar("simulations", max(0, budget - learning.n)) as advance:
            while not stopped and learning.n < budget and self.choice.left:
                if self.step(advance) and self.n_failed > max(10, budget):
                    raise BayesindentError(self.failures())
                stopped = self.stopped()
        if learning.n < budget and not stopped:
            self.warnings.append(f"no candidate is left after {learning.n} simulations; raise &design n_candidates to go on")
        if learning.n < 2:
            raise BayesindentError(self.failures() if self.n_failed else "there are fewer than two simulations to learn from")
        if not learning.history or learning.history[-1]["simulations"] < learning.n:
            learning.refit()
        return self.conclude(stopped or "the budget is used")

    def replay(self) -> None:
        """Learn from the rows of the campaign as they were learnt from when they were made."""
        rows, learning, start = self.stored_rows(), self.learning, 0
        while start < len(rows) and learning.n < learning.budget and not self.stopped():
            end = learning.batch_end()
            part = rows[start : start + end - learning.n]
            start += len(part)
            learning.learn([r.constants for r in part], [r.euler_deg for r in part], [r.modulus_gpa for r in part], chosen=False)
            if learning.n == end:
                learning.close_batch()
        learning.learner.update(exactly=True)
        self.unused = rows[start:]

    def stored_rows(self) -> list:
        """Rows of the campaign that are data from the start, in order of choice."""
        rows = self.campaign.rows(self.symmetry)
        if self.problem.settings.design.reuse == "chosen":
            rows = [row for row in rows if row.imported]
        self.choice.exclude(self.choice.candidates.find(rows))
        self.n_failed = sum(row.modulus_gpa is None for row in rows)
        done = [row for row in rows if row.modulus_gpa is not None]
        if not done:
            return []
        beyond = outside([row.constants for row in done], self.learning.basis)
        if beyond.any():
            self.warnings.append(f"{beyond.sum()} simulations of the campaign are outside the surrogate's domain and are not used")
        return [row for row, out in zip(done, beyond, strict=True) if not out]

    def step(self, advance) -> bool:
        """One batch, or the rest of it; says whether a simulation failed."""
        learning, candidates = self.learning, self.choice.candidates
        end = learning.batch_end()
        numbers, by_variance = self.choice.next(min(end - learning.n, len(self.choice.left)))
        modulus = self.perform(numbers, advance)
        done = np.isfinite(modulus)
        learning.learn(candidates.constants[numbers[done]], candidates.euler_deg[numbers[done]], modulus[done], chosen=by_variance)
        exactly = not done.all() or not by_variance
        if learning.n == end:
            learning.close_batch(exactly)
        else:
            learning.learner.update(exactly)
        return not done.all()

    def perform(self, numbers, advance) -> np.ndarray:
        """Moduli of candidates (NaN where the simulation failed): from the campaign, or simulated and stored one by one."""
        points = [(self.symmetry, *point) for point in self.choice.candidates.points(numbers)]
        rows = [self.campaign.find(*point) for point in points]
        todo = [point for point, row in zip(points, rows, strict=True) if row is None]
        advance(sum(row is not None and row.modulus_gpa is not None for row in rows))
        if todo:
            self.simulate = self.simulate or Simulator(self.problem)
            simulate_into(self.campaign, self.simulate, todo, self.engine, lambda success: advance(int(success)))
            self.n_new += len(todo)
            rows = [self.campaign.find(*point) for point in points]
        modulus = np.array([row.modulus_gpa for row in rows], dtype=float)
        self.n_failed += int(np.isnan(modulus).sum())
        return modulus

    def stopped(self) -> str:
        """Why to stop before the budget, or nothing."""
        learning, design = self.learning, self.problem.settings.design
        if not learning.history or learning.n < max(learning.first, learning.least):
            return ""
        return why_to_stop(learning.history, learning.n, design.target_gpa, design.patience)

    def failures(self) -> str:
        """How many simulations failed, and why the last did."""
        last = next(row.message for row in reversed(self.campaign.rows(self.symmetry)) if row.modulus_gpa is None)
        number = f"{self.n_failed} simulations failed, more than the budget" if self.learning.n else "every simulation failed"
        return f"{number}; the last: {last}"

    def conclude(self, stopped: str) -> dict:
        """Write the surrogate and say how good it is."""
        problem, learning = self.problem, self.learning
        last = learning.history[-1]
        physics = json.dumps(physics_identity(problem), sort_keys=True)
        errors = {name: last[name] for name in ("loocv_gpa", "leave_crystal_out_gpa")}
        surrogate = learning.learner.surrogate(
            title=f"surrogate of the indentation modulus of {self.symmetry} crystals",
            physics=physics,
            prior=learning.prior,
            simulations=learning.n,
            seed=problem.settings.problem.seed,
            **errors,
            namelist=without_folders(problem),
        )
        file = self.output / problem.settings.surrogate.file
        surrogate.save(file)
        self.warnings += resolution_warnings(problem, stiffness_rows(self.symmetry, [point[0] for point in learning.points]))
        document = {
            "simulations": learning.n,
            "terms": learning.basis.n_terms,
            **errors,
            **learning.learner.precisions(),
            "next_gpa": last["next_gpa"],
            "sd_inflation": surrogate.sd_inflation,
            "stopped": stopped,
            "baselines": baselines(self.symmetry, surrogate.data),
            "history": learning.history,
            "file": str(file),
        }
        if problem.scan:
            with self.progress.bar("truncations", len(problem.scan)) as advance:
                document["scan"] = scan_truncations(learning, problem.scan, advance)
        if problem.settings.design.validation:
            document["validation"] = validate(self, surrogate, problem.settings.design.validation)
        return document | {"new_simulations": self.n_new, "failed": self.n_failed, "warnings": self.warnings}


def basis_of(problem) -> Basis:
    """The basis of the surrogate of a problem, over the crystals that it is to cover."""
    stated, chosen = problem.settings.domain, problem.settings.surrogate
    domain = Domain(problem.settings.problem.symmetry, stated.c_min, stated.c_max, stated.anisotropy_cap)
    return Basis(domain, chosen.coordinates, chosen.truncation, chosen.degree, chosen.bandlimit)


def baselines(symmetry: str, data: dict) -> dict:
    """Mean absolute errors in GPa, on the same simulations, of the theory alone and of the theory times one ratio."""
    theory, modulus = halfspace_modulus(stiffness_rows(symmetry, data["constants"]), data["euler_deg"]), data["modulus_gpa"]
    ratio = np.exp(np.mean(np.log(modulus / theory)))
    return {
        "theory_gpa": float(np.mean(np.abs(theory - modulus))),
        "ratio": float(ratio),
        "theory_times_ratio_gpa": float(np.mean(np.abs(ratio * theory - modulus))),
    }


def without_folders(problem) -> str:
    """The resolved namelist; the file that it came from by its name alone, since a surrogate travels between machines."""
    return problem.resolved.replace(str(problem.path), problem.path.name) if problem.path else problem.resolved
