"""Which candidates are simulated next: first the initial set, then those of largest variance."""

import numpy as np

from ..crystal.elasticity import stiffness_rows
from ..surrogate.basis import Basis
from ..surrogate.candidates import Candidates
from ..surrogate.learner import Learner

__all__ = ["Choice", "initial_set"]


class Choice:
    """The candidates that are left, and the order in which they are taken."""

    def __init__(self, candidates: Candidates, learner: Learner, initial: list[int], variance_of: str, threads: int):
        self.candidates, self.learner, self.initial, self.threads = candidates, learner, initial, threads
        self.left = set(range(len(candidates)))
        learner.set_candidates(candidates.constants, candidates.euler_deg, variance_of)

    def exclude(self, numbers) -> None:
        """These candidates may not be chosen any more."""
        self.left -= set(map(int, numbers))
        self.learner.exclude(numbers)

    def next(self, count: int) -> tuple[np.ndarray, bool]:
        """At most `count` candidates, and whether the variance chose them: the rest of the initial set comes first."""
        initial = [number for number in self.initial if number in self.left]
        if initial:
            numbers = np.array(initial[:count])
            self.exclude(numbers)
            return numbers, False
        numbers = self.learner.choose(count, self.threads)[0]
        self.left -= set(numbers.tolist())
        return numbers, True

    def look_ahead(self, count: int) -> np.ndarray:
        """The next `count` candidates, before the moduli of the first of them are known."""
        numbers, _ = self.next(count)
        if len(numbers) < count:
            # The initial set is at its end: the variance, given that set, chooses the rest.
            self.assume(self.candidates.constants[numbers], self.candidates.euler_deg[numbers])
            numbers = np.concatenate([numbers, self.next(count - len(numbers))[0]])
        return numbers

    def assume(self, constants, euler_deg) -> None:
        """Let the variance be that with these crystals simulated; their moduli do not matter."""
        self.learner.add(constants, euler_deg, self.learner.predict(constants, euler_deg))
        self.learner.update(exactly=True)


def initial_set(candidates: Candidates, basis: Basis, kind: str, count: int) -> list[int]:
    """Candidates that are simulated before the variance chooses: 'latin', the first; 'boundary', those at the ends of the ranges."""
    if kind == "latin":
        return list(range(min(count, len(candidates))))
    if kind == "boundary":
        reach, _ = basis.coverage(stiffness_rows(basis.domain.symmetry, candidates.constants))
        return distinct_crystals(candidates, np.argsort(-reach, kind="stable"), count)
    return []


def distinct_crystals(candidates: Candidates, order, count: int) -> list[int]:
    """The first `count` crystals of an order, each once, in directions that take turns; then their other directions."""
    groups = {}
    for number in order:
        groups.setdefault(tuple(candidates.constants[number]), []).append(int(number))
    members = list(groups.values())
    rounds = max(map(len, members))
    turns = [m[(i + r) % len(m)] for r in range(rounds) for i, m in enumerate(members) if r < len(m)]
    return turns[:count]
