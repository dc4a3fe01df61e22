"""The loop of Step 1: choose the next simulation, perform it, store it, learn from it; see docs/surrogate.md.

All results go through campaign.sqlite, so that an interrupted build goes on where it was, and a larger budget continues it.
"""

import csv
import io
import json
from contextlib import contextmanager
from pathlib import Path

import numpy as np

from ..core import BayesindentError, InputError
from ..crystal.elasticity import CONSTANTS, anisotropy_index, halfspace_modulus, stiffness_rows
from ..pipeline.campaign import Campaign
from ..pipeline.simulator import physics_identity, simulate_into, simulator_of, worker_count
from ..surrogate.domain import DEFAULT_BOUNDS, Domain, directions
from ..surrogate.surrogate import FEW, SHIPPED, Basis, Surrogate, new_design, raw_coordinates, sd_factor

__all__ = ["ask", "build", "tell"]

#: alpha and beta until then, by prior and coordinates: sd of a coefficient of weight 1 and of the noise, in units of y.
FIRST_SD = {
    ("zero", "box"): (100.0, 1.0),
    ("zero", "dimensionless"): (1.0, 0.01),
    ("theory", "box"): (30.0, 0.5),
    ("theory", "dimensionless"): (0.1, 0.003),
}

#: The error improved if it fell below this share of the best before.
IMPROVEMENT = 0.98

#: Points over which the error of the next points is averaged.
WINDOW = 20

#: Numbers of simulations at which a scan of truncations is made.
SCAN_COUNTS = 6


def build(problem, output, progress=None) -> dict:
    """Step 1 of a problem: the surrogate in the output folder, and the document of `build`."""
    with Loop(problem, Path(output), progress) as loop:
        return loop.run()


def ask(problem, output, count: int) -> str:
    """The next `count` crystals as CSV, for a simulation elsewhere."""
    with Loop(problem, Path(output), None) as loop:
        numbers = loop.next_numbers(count)
        return loop.table(numbers)


def tell(problem, output, points, name: str = "the table") -> dict:
    """Import results that were computed elsewhere: a table (`Points`) with modulus_gpa, which errors call `name`."""
    if points.modulus_gpa is None or not np.isfinite(points.modulus_gpa).all():
        raise InputError(f"{name}: there must be a column modulus_gpa (GPa) with a value in every row")
    symmetry = problem["problem"]["symmetry"]
    if any(name != symmetry for name in points.symmetry):
        raise InputError(f"{name}: there are crystals that are not {symmetry}, which is the symmetry of {problem.path}")
    Path(output).mkdir(parents=True, exist_ok=True)
    with Campaign(Path(output) / "campaign.sqlite", physics_identity(problem)) as campaign:
        try:
            new = campaign.tell(symmetry, points.constants_array(), points.euler_deg, points.modulus_gpa)
        except InputError as error:
            raise InputError(f"{name}: {error}") from None
        simulations = sum(row.status == "done" for row in campaign.rows(symmetry))
    return {"told": new, "simulations": simulations, "warnings": []}


class Loop:
    """The state of one build: candidates, data so far, regression, campaign."""

    def __init__(self, problem, output: Path, progress):
        self.problem, self.output, self.progress = problem, output, progress
        self.warnings = []
        self.symmetry = problem["problem"]["symmetry"]
        low, high, cap = DEFAULT_BOUNDS[self.symmetry]
        bounds = [problem["domain"].get(name) if "domain" in problem else None for name in ("c_min", "c_max", "anisotropy_cap")]
        c_min, c_max, cap = (default if value is None else value for value, default in zip(bounds, (low, high, cap), strict=True))
        self.domain = Domain(self.symmetry, tuple(map(float, c_min)), tuple(map(float, c_max)), float(cap))
        coordinates = self.of_surrogate("coordinates")
        self.basis = Basis(
            self.symmetry,
            coordinates,
            self.of_surrogate("truncation"),
            self.of_surrogate("degree"),
            self.of_surrogate("bandlimit"),
            *self.domain.ranges(coordinates),
        )
        self.prior = self.of_surrogate("prior")
        self.budget = self.of_design("budget")
        self.check()
        self.workers = worker_count(problem["execution"]["workers"])
        self.constants, self.euler_deg = self.candidates()
        self.terms, self.scale = self.basis.terms(self.constants, self.euler_deg)
        self.initial = self.initial_numbers()
        self.design = new_design(self.basis, self.domain, self.prior)
        self.design.set_candidates(self.terms)
        sd_prior, sd_noise = FIRST_SD[self.prior, coordinates]
        self.evidence = None
        self.last_mean = self.design.mean()
        self.alpha, self.beta, _ = self.design.fit(sd_prior**-2, sd_noise**-2)
        self.numbers = {
            (tuple(c), tuple(e)): i
            for i, (c, e) in reversed(list(enumerate(zip(self.constants.tolist(), self.euler_deg.tolist(), strict=True))))
        }
        self.data = {"constants": [], "euler_deg": [], "modulus_gpa": []}
        self.next_errors, self.history = [], []
        self.n_failed = self.n_new = self.n_told = 0
        self.simulate = None
        self.output.mkdir(parents=True, exist_ok=True)
        self.campaign = Campaign(self.output / "campaign.sqlite", physics_identity(problem))
        others = self.campaign.other_physics()
        if others and not self.campaign.rows(self.symmetry):
            self.warnings.append(f"{self.campaign.path} holds only simulations of another physics ({others[0]}); they are not used here")

    def __enter__(self) -> "Loop":
        return self

    def __exit__(self, *_) -> None:
        self.campaign.close()

    def of_design(self, name: str):
        return self.problem["design"][name]

    def of_surrogate(self, name: str):
        return self.problem["surrogate"][name]

    @property
    def n(self) -> int:
        return len(self.data["modulus_gpa"])

    def refuse(self, group: str, name: str, message: str):
        raise InputError(f"{self.problem.path}: &{group} {name}: {message}")

    def check(self) -> None:
        """Refuse what cannot be meant."""
        if self.prior == "zero" and self.budget < self.basis.n_terms:
            self.refuse(
                "design",
                "budget",
                f"{self.budget} simulations are fewer than the {self.basis.n_terms} terms of the surrogate, which "
                f"a flat prior cannot make up for; allowed: {self.basis.n_terms} or more, or a lower degree or bandlimit, or "
                "prior = 'theory'",
            )
        if self.of_surrogate("file") in SHIPPED:
            self.refuse(
                "surrogate",
                "file",
                f"'{self.of_surrogate('file')}' is a surrogate that comes with the package; build writes its "
                "own file, for example surrogate.nc",
            )

    # Candidates.

    def candidates(self) -> tuple[np.ndarray, np.ndarray]:
        """The crystals and angles to choose from."""
        kind, n, seed = self.of_design("candidates"), self.of_design("n_candidates"), self.problem["problem"]["seed"]
        table = self.problem.candidates
        if table is not None:
            constants, euler_deg = table.constants_array(), np.array(table.euler_deg)
            keep = ~self.outside(constants)
            if not keep.all():
                self.warnings.append(f"{(~keep).sum()} of {len(keep)} candidates are outside the domain and are left out")
            return constants[keep], euler_deg[keep]
        if kind == "factorial":
            per_crystal = self.of_design("n_directions")
            crystals = self.domain.latin(max(1, n // per_crystal), seed)
            angles = directions(self.symmetry, per_crystal)
            return np.repeat(crystals, per_crystal, axis=0), np.tile(angles, (len(crystals), 1))
        n_first = self.of_design("initial") if self.of_design("initial_set") == "latin" else 0
        blocks = [self.spread(size, seed + 1_000_003 * block) for block, size in enumerate((n_first, max(0, n - n_first))) if size > 0]
        return tuple(np.vstack(part) for part in zip(*blocks, strict=True))

    def spread(self, n: int, seed: int) -> tuple[np.ndarray, np.ndarray]:
        """A Latin hypercube of crystals and directions."""
        if self.of_design("orientations") == "sphere":
            return self.domain.crystals(n, seed)
        points = self.domain.latin(n, seed, n_angles=1)
        return points[:, :-1], np.column_stack([np.zeros(n), 90 * points[:, -1], np.zeros(n)])

    def outside(self, constants) -> np.ndarray:
        """Whether crystals are outside what the surrogate covers."""
        constants = np.asarray(constants, dtype=float)
        index, stable = anisotropy_index(self.symmetry, constants)
        bad = ~stable
        bad[stable] |= index[stable] > self.domain.anisotropy_cap
        raw = raw_coordinates(self.symmetry, self.basis.coordinates, constants[~bad])
        bad[~bad] = np.any((raw < self.basis.lower) | (raw > self.basis.upper), axis=1)
        return bad

    def initial_numbers(self) -> list[int]:
        """Candidates that are simulated before the variance chooses."""
        count, kind = self.of_design("initial"), self.of_design("initial_set")
        if kind == "latin":
            return list(range(min(count, len(self.constants))))
        if kind == "boundary":
            raw = raw_coordinates(self.symmetry, self.basis.coordinates, self.constants)
            x = np.max(np.abs((2 * raw - self.basis.lower - self.basis.upper) / (self.basis.upper - self.basis.lower)), axis=1)
            return self.distinct_crystals(np.argsort(-x, kind="stable"), count)
        return []

    def distinct_crystals(self, order, count: int) -> list[int]:
        """The first `count` crystals of an order, each once, in directions that take turns; then their other directions."""
        groups = {}
        for number in order:
            groups.setdefault(tuple(self.constants[number]), []).append(int(number))
        members = list(groups.values())
        rounds = max(map(len, members))
        turns = [m[(i + r) % len(m)] for r in range(rounds) for i, m in enumerate(members) if r < len(m)]
        return turns[:count]

    @property
    def n_first(self) -> int:
        """Points before alpha and beta are learnt: as stated, or as few as the basis needs."""
        few = self.basis.n_terms if self.prior == "zero" else FEW
        return min(max(self.of_design("initial") or few, 2), self.budget)

    def boundary(self) -> int:
        """The number of points at which the batch that is under way ends."""
        first, batch = self.n_first, self.of_design("batch")
        if self.n < first:
            return min(first, self.budget)
        return min(first + batch * ((self.n - first) // batch + 1), self.budget)

    # Learning.

    def learn(self, constants, euler_deg, modulus, *, chosen: bool) -> None:
        """Take observations in; if they were chosen by the design, the covariance has them already."""
        if not len(modulus):
            return
        terms, scale = self.basis.terms(constants, euler_deg)
        y = self.basis.to_y(modulus, scale)
        predicted = self.basis.to_modulus(self.design.mean() @ terms, scale)
        if self.n:
            self.next_errors += np.abs(predicted - modulus).tolist()
        if chosen:
            self.design.add(terms, y)
        else:
            for column, value in zip(terms.T, y, strict=True):
                self.design.update(column, value)
        for name, values in (("constants", constants), ("euler_deg", euler_deg), ("modulus_gpa", modulus)):
            self.data[name].extend(np.asarray(values).tolist())

    def close_batch(self, exactly: bool = False) -> None:
        """At the end of a batch: the posterior, with new alpha and beta when it is time."""
        before = self.history[-1]["simulations"] if self.history else 0
        first, every = self.n_first, self.of_design("refit")
        due = self.n >= first and (before < first or self.n - before >= every or self.n >= self.budget)
        if due and self.n > before:
            self.refit()
        else:
            self.design.settle(exactly)
        self.last_mean = self.design.mean()

    def refit(self) -> None:
        self.alpha, self.beta, self.evidence = self.design.fit()
        self.record()

    def errors(self) -> dict:
        """Leave-one-out and leave-one-crystal-out errors in GPa, and z-scores of the latter."""
        constants, modulus = np.array(self.data["constants"]), np.array(self.data["modulus_gpa"])
        _, scale = self.basis.terms(constants, self.data["euler_deg"])
        y = self.basis.to_y(modulus, scale)
        crystals = np.unique(constants, axis=0, return_inverse=True)[1].ravel()
        residual, _ = self.design.leave_out(np.arange(self.n))
        loocv = np.mean(np.abs(self.basis.to_modulus(y - residual, scale) - modulus))
        residual, sd = self.design.leave_out(crystals)
        loco = np.mean(np.abs(self.basis.to_modulus(y - residual, scale) - modulus))
        return {"loocv_gpa": float(loocv), "leave_crystal_out_gpa": float(loco), "z": residual / sd}

    def record(self) -> None:
        """An entry of the history; the angle is that between the coefficients now and at the end of the batch before."""
        errors, mean, previous = self.errors(), self.design.mean(), self.last_mean
        norm = float(np.linalg.norm(mean))
        cosine = mean @ previous / max(norm * np.linalg.norm(previous), 1e-300)
        self.history.append(
            {
                "simulations": self.n,
                "loocv_gpa": errors["loocv_gpa"],
                "leave_crystal_out_gpa": errors["leave_crystal_out_gpa"],
                "next_gpa": float(np.mean(self.next_errors[-WINDOW:])) if self.next_errors else None,
                "alpha": self.alpha,
                "beta": self.beta,
                "log_evidence": self.evidence,
                "norm": norm,
                "angle_deg": float(np.degrees(np.arccos(np.clip(cosine, -1, 1)))),
            }
        )

    def finished(self) -> str:
        """Why to stop before the budget, or nothing."""
        if not self.history or self.n < max(self.n_first, self.basis.n_terms if self.prior == "zero" else FEW):
            return ""
        target, patience = self.of_design("target_gpa"), self.of_design("patience")
        last = self.history[-1]
        if target > 0 and last["leave_crystal_out_gpa"] <= target and last["next_gpa"] is not None and last["next_gpa"] <= target:
            return (
                f"the errors of unseen crystals ({last['leave_crystal_out_gpa']:.3g} and {last['next_gpa']:.3g} GPa) reached {target:g} GPa"
            )
        if patience > 0:
            early = [h["leave_crystal_out_gpa"] for h in self.history if h["simulations"] <= self.n - patience]
            late = [h["leave_crystal_out_gpa"] for h in self.history if h["simulations"] > self.n - patience]
            if early and min(late) > IMPROVEMENT * min(early):
                return f"the error did not improve over the last {patience} simulations"
        return ""

    # Simulating.

    def stored_rows(self) -> list:
        """Rows of the campaign that are data from the start, in order of choice."""
        rows = self.campaign.rows(self.symmetry)
        if self.of_design("reuse") == "chosen":
            rows = [row for row in rows if row.origin == "told"]
        done = [row for row in rows if row.status == "done"]
        for row in rows:
            number = self.numbers.get((row.constants, row.euler_deg))
            if number is not None:
                self.design.exclude([number])
        self.n_failed = sum(row.status == "failed" for row in rows)
        if done:
            outside = self.outside(np.array([row.constants for row in done]))
            if outside.any():
                self.warnings.append(f"{outside.sum()} simulations of the campaign are outside the surrogate's domain and are not used")
            done = [row for row, out in zip(done, outside, strict=True) if not out]
        return done

    def replay(self, rows) -> list:
        """Learn from stored rows as they were learnt from when they were made; gives those that are too many."""
        start = 0
        while start < len(rows) and self.n < self.budget and not self.finished():
            end = self.boundary()
            part = rows[start : start + end - self.n]
            start += len(part)
            self.learn([r.constants for r in part], [r.euler_deg for r in part], [r.modulus_gpa for r in part], chosen=False)
            if self.n == end:
                self.close_batch()
        self.design.settle(exactly=True)
        return rows[start:]

    def choose(self, count: int) -> tuple[np.ndarray, bool]:
        """Numbers of the next candidates, and whether the variance chose them: the rest of the initial set comes first."""
        left = [i for i in self.initial if i in self.pending]
        if left:
            numbers = np.array(left[:count])
            self.design.exclude(numbers)
            return numbers, False
        importance = None
        if self.of_design("variance_of") == "modulus" and self.basis.coordinates == "dimensionless":
            importance = self.basis.to_modulus(self.design.mean() @ self.terms, self.scale)
        return self.design.choose(count, importance, self.workers)[0], True

    def next_numbers(self, count: int) -> np.ndarray:
        """The candidates that would be simulated next."""
        rows = self.stored_rows()
        self.pending = set(range(len(self.constants))) - self.excluded()
        self.replay(rows)
        if count < 1 or count > len(self.pending):
            raise InputError(f"--ask {count}: allowed are 1 .. {len(self.pending)}, the candidates that are left")
        numbers, _ = self.choose(count)
        if len(numbers) < count:
            # The initial set is at its end: the variance, given that set, chooses the rest.
            for number in numbers:
                self.design.update(self.terms[:, number], self.design.mean() @ self.terms[:, number])
            self.design.settle(exactly=True)
            self.pending -= set(numbers.tolist())
            numbers = np.concatenate([numbers, self.choose(count - len(numbers))[0]])
        return numbers

    def excluded(self) -> set[int]:
        """Candidates that the campaign has as rows already."""
        if self.of_design("reuse") == "chosen":
            rows = [row for row in self.campaign.rows(self.symmetry) if row.origin == "told"]
        else:
            rows = self.campaign.rows(self.symmetry)
        found = (self.numbers.get((row.constants, row.euler_deg)) for row in rows)
        return {number for number in found if number is not None}

    def perform(self, numbers, advance) -> tuple[np.ndarray, np.ndarray]:
        """Moduli of candidates (NaN where the simulation failed): from the campaign, or simulated and stored one by one."""
        points = [(self.symmetry, tuple(self.constants[i].tolist()), tuple(self.euler_deg[i].tolist())) for i in numbers]
        rows = [self.campaign.find(*point) for point in points]
        todo = [point for point, row in zip(points, rows, strict=True) if row is None]
        advance(sum(row is not None and row.status == "done" for row in rows))
        if todo:
            self.simulate = self.simulate or simulator_of(self.problem)
            simulate_into(self.campaign, self.simulate, todo, self.workers, lambda success: advance(int(success)))
            self.n_new += len(todo)
            rows = [self.campaign.find(*point) for point in points]
        modulus = np.array([row.modulus_gpa if row.status == "done" else np.nan for row in rows], dtype=float)
        failed = ~np.isfinite(modulus)
        self.n_failed += int(failed.sum())
        return modulus, failed

    def run(self) -> dict:
        """Until the target, the budget, or no candidate is left; then the surrogate, its errors, and the validation set."""
        rows = self.stored_rows()
        self.pending = set(range(len(self.constants))) - self.excluded()
        self.unused = self.replay(rows)
        stopped = self.finished()
        with self.bar("simulations", max(0, self.budget - self.n)) as advance:
            while not stopped and self.n < self.budget and self.pending:
                if self.step(advance) and self.n_failed > max(10, self.budget):
                    raise BayesindentError(f"{self.n_failed} simulations failed, more than the budget; the last: {self.last_message()}")
                stopped = self.finished()
        if self.n < self.budget and not stopped:
            self.warnings.append(f"no candidate is left after {self.n} simulations; raise &design n_candidates to go on")
        if self.n < 2:
            raise BayesindentError("there are fewer than two simulations to learn from")
        if not self.history or self.history[-1]["simulations"] < self.n:
            self.refit()
        return self.conclude(stopped)

    def step(self, advance) -> bool:
        """One batch, or the rest of it; says whether a simulation failed."""
        end = self.boundary()
        numbers, by_variance = self.choose(min(end - self.n, len(self.pending)))
        self.pending -= set(numbers.tolist())
        modulus, failed = self.perform(numbers, advance)
        kept = numbers[~failed]
        self.learn(self.constants[kept], self.euler_deg[kept], modulus[~failed], chosen=by_variance)
        exactly = bool(failed.any()) or not by_variance
        if self.n == end:
            self.close_batch(exactly)
        else:
            self.design.settle(exactly)
        return bool(failed.any())

    def last_message(self) -> str:
        return next((row.message for row in reversed(self.campaign.rows(self.symmetry)) if row.status == "failed"), "")

    @contextmanager
    def bar(self, text: str, total: int):
        if self.progress is None or total <= 0:
            yield lambda steps=1: None
        else:
            with self.progress.bar(text, total) as advance:
                yield advance

    # Concluding.

    def conclude(self, stopped: str) -> dict:
        """Write the surrogate and say how good it is."""
        errors = self.errors()
        inflation = sd_factor(self.basis, self.domain, self.prior, self.design, errors["z"])
        data = {name: np.array(values) for name, values in self.data.items()}
        document = {
            "simulations": self.n,
            "new_simulations": self.n_new,
            "failed": self.n_failed,
            "terms": self.basis.n_terms,
            "loocv_gpa": errors["loocv_gpa"],
            "alpha": self.alpha,
            "beta": self.beta,
            "log_evidence": self.evidence,
            "leave_crystal_out_gpa": errors["leave_crystal_out_gpa"],
            "next_gpa": self.history[-1]["next_gpa"],
            "sd_inflation": inflation,
            "stopped": stopped or "the budget is used",
            "baselines": self.baselines(data),
            "history": self.history,
        }
        surrogate = Surrogate(
            self.basis,
            self.design.mean(),
            self.design.covariance(),
            anisotropy_cap=self.domain.anisotropy_cap,
            alpha=self.alpha,
            beta=self.beta,
            sd_inflation=inflation,
            data=data,
            provenance=self.provenance(document),
        )
        path = self.output / self.of_surrogate("file")
        surrogate.save(path)
        document["file"] = str(path)
        self.export(data)
        if self.of_surrogate("scan"):
            document["scan"] = self.scan(data)
        if self.of_design("validation"):
            document["validation"] = self.validate(surrogate)
            document["new_simulations"], document["failed"] = self.n_new, self.n_failed
        document["warnings"] = self.warnings
        return document

    def export(self, data) -> None:
        """Write simulations.csv, to the last bit: what the surrogate has learnt from, for the batch program and for people."""
        with open(self.output / "simulations.csv", "w", newline="") as stream:
            stream.write(f"# physics: {json.dumps(physics_identity(self.problem), sort_keys=True)}\n")
            writer = csv.writer(stream, lineterminator="\n")
            writer.writerow([*CONSTANTS[self.symmetry], "phi1_deg", "Phi_deg", "phi2_deg", "indentation_modulus_gpa"])
            for row in zip(data["constants"], data["euler_deg"], data["modulus_gpa"], strict=True):
                writer.writerow([repr(float(value)) for value in np.hstack(row)])

    def baselines(self, data) -> dict:
        """Mean absolute errors in GPa, on the same simulations, of the theory alone and of the theory times one ratio."""
        theory = halfspace_modulus(stiffness_rows(self.symmetry, data["constants"]), data["euler_deg"])
        modulus = data["modulus_gpa"]
        ratio = np.exp(np.mean(np.log(modulus / theory)))
        return {
            "theory_gpa": float(np.mean(np.abs(theory - modulus))),
            "ratio": float(ratio),
            "theory_times_ratio_gpa": float(np.mean(np.abs(ratio * theory - modulus))),
        }

    def provenance(self, document) -> dict:
        return {
            "title": f"surrogate of the indentation modulus of {self.symmetry} crystals",
            "physics": json.dumps(physics_identity(self.problem), sort_keys=True),
            "prior": self.prior,
            "c_min": list(self.domain.c_min),
            "c_max": list(self.domain.c_max),
            "simulations": self.n,
            "seed": self.problem["problem"]["seed"],
            "loocv_gpa": document["loocv_gpa"],
            "leave_crystal_out_gpa": document["leave_crystal_out_gpa"],
            "namelist": without_folders(self.problem),
        }

    def validate(self, surrogate: Surrogate) -> dict:
        """The next points by variance, which the surrogate has not seen."""
        count = self.of_design("validation")
        stored = self.unused[:count]
        constants, euler_deg = [row.constants for row in stored], [row.euler_deg for row in stored]
        modulus = [row.modulus_gpa for row in stored]
        left = min(count - len(stored), len(self.pending))
        if left:
            if stored:
                # The variance is that with the stored points known; their values do not matter.
                for term in self.basis.terms(constants, euler_deg)[0].T:
                    self.design.update(term, 0.0)
                self.design.settle(exactly=True)
            with self.bar("validation", left) as advance:
                numbers, _ = self.choose(left)
                new, failed = self.perform(numbers, advance)
            constants += self.constants[numbers[~failed]].tolist()
            euler_deg += self.euler_deg[numbers[~failed]].tolist()
            modulus += new[~failed].tolist()
        modulus = np.array(modulus)
        mean, sd = surrogate.predict(constants, euler_deg)
        z = np.abs(mean - modulus) / sd
        return {
            "points": len(modulus),
            "constants": np.asarray(constants).tolist(),
            "euler_deg": np.asarray(euler_deg).tolist(),
            "mean_absolute_gpa": float(np.mean(np.abs(mean - modulus))),
            "within_1_sd": float(np.mean(z <= 1)),
            "within_2_sd": float(np.mean(z <= 2)),
            "simulated": modulus.tolist(),
            "predicted": mean.tolist(),
            "sd": sd.tolist(),
        }

    def scan(self, data) -> list[dict]:
        """Evidence and leave-one-out errors of other truncations on the same simulations, as their number grows (Figs. 1 and 6)."""
        counts = np.unique(np.linspace(self.n_first, self.n, SCAN_COUNTS).astype(int))
        pairs = scan_pairs(self.of_surrogate("scan"))
        result = []
        with self.bar("truncations", len(pairs)) as advance:
            for degree, bandlimit in pairs:
                other = Basis(
                    self.symmetry, self.basis.coordinates, self.basis.truncation, degree, bandlimit, self.basis.lower, self.basis.upper
                )
                terms, scale = other.terms(data["constants"], data["euler_deg"])
                y = other.to_y(data["modulus_gpa"], scale)
                design, before, errors = new_design(other, self.domain, self.prior), 0, []
                for count in counts:
                    design.add(terms[:, before:count], y[before:count])
                    alpha, beta, evidence = design.fit()
                    residual, _ = design.leave_out(np.arange(count))
                    left_out = other.to_modulus(y[:count] - residual, scale[:count])
                    errors.append(float(np.mean(np.abs(left_out - data["modulus_gpa"][:count]))))
                    before = count
                result.append(
                    {
                        "degree": degree,
                        "bandlimit": bandlimit,
                        "terms": other.n_terms,
                        "log_evidence": evidence,
                        "loocv_gpa": errors[-1],
                        "alpha": alpha,
                        "beta": beta,
                        "curve": {"simulations": counts.tolist(), "loocv_gpa": errors},
                    }
                )
                advance(1)
        return result

    def table(self, numbers) -> str:
        """Candidates as CSV, to the last bit."""
        text = io.StringIO()
        writer = csv.writer(text, lineterminator="\n")
        writer.writerow([*CONSTANTS[self.symmetry], "phi1_deg", "Phi_deg", "phi2_deg"])
        for number in numbers:
            writer.writerow([repr(float(v)) for v in (*self.constants[number], *self.euler_deg[number])])
        return text.getvalue()


def without_folders(problem) -> str:
    """The resolved namelist; the file that it came from by its name alone, since a surrogate travels between machines."""
    resolved, path = problem.resolved, problem.path
    return resolved.replace(str(path), path.name) if path else resolved


def scan_pairs(text: str) -> list[tuple[int, int]]:
    """The pairs of '1, 2, 3 x 8, 10, 12': degrees, then bandlimits."""
    try:
        degrees, bandlimits = ([int(word) for word in part.replace(",", " ").split()] for part in text.lower().split("x"))
    except ValueError:
        raise InputError(f"&surrogate scan: '{text}' is not of the form '1, 2, 3 x 8, 10, 12' (degrees x bandlimits)") from None
    return [(degree, bandlimit) for degree in degrees for bandlimit in bandlimits]
