"""Which candidates are simulated next: first the initial set, then those of largest variance."""

import numpy as np

from ..surrogate.candidates import Candidates
from ..surrogate.surrogate import Design, raw_coordinates

__all__ = ["Choice", "initial_set"]


class Choice:
    """The candidates that are left, and the order in which they are taken."""

    def __init__(self, candidates: Candidates, design: Design, initial: list[int], variance_of: str, threads: int):
        self.candidates, self.design, self.initial, self.threads = candidates, design, initial, threads
        self.left = set(range(len(candidates)))
        self.relative = variance_of == "modulus" and candidates.basis.coordinates == "dimensionless"
        design.set_candidates(candidates.terms)

    def exclude(self, numbers) -> None:
        """These candidates may not be chosen any more."""
        self.left -= set(map(int, numbers))
        self.design.exclude(numbers)

    def next(self, count: int) -> tuple[np.ndarray, bool]:
        """At most `count` candidates, and whether the variance chose them: the rest of the initial set comes first."""
        initial = [number for number in self.initial if number in self.left]
        if initial:
            numbers = np.array(initial[:count])
            self.exclude(numbers)
            return numbers, False
        importance = None
        if self.relative:
            basis, mean = self.candidates.basis, self.design.mean()
            importance = basis.to_modulus(mean @ self.candidates.terms, self.candidates.scale)
        numbers = self.design.choose(count, importance, self.threads)[0]
        self.left -= set(numbers.tolist())
        return numbers, True

    def look_ahead(self, count: int) -> np.ndarray:
        """The next `count` candidates, before the moduli of the first of them are known."""
        numbers, _ = self.next(count)
        if len(numbers) < count:
            # The initial set is at its end: the variance, given that set, chooses the rest.
            terms = self.candidates.terms[:, numbers]
            self.assume(terms, self.design.mean() @ terms)
            numbers = np.concatenate([numbers, self.next(count - len(numbers))[0]])
        return numbers

    def assume(self, terms, y) -> None:
        """Let the variance be that with these observations, whose values do not matter."""
        for column, value in zip(terms.T, y, strict=True):
            self.design.update(column, value)
        self.design.settle(exactly=True)


def initial_set(candidates: Candidates, kind: str, count: int) -> list[int]:
    """Candidates that are simulated before the variance chooses: 'latin', the first; 'boundary', those at the ends of the ranges."""
    if kind == "latin":
        return list(range(min(count, len(candidates))))
    if kind == "boundary":
        basis = candidates.basis
        raw = raw_coordinates(basis.symmetry, basis.coordinates, candidates.constants)
        x = np.max(np.abs((2 * raw - basis.lower - basis.upper) / (basis.upper - basis.lower)), axis=1)
        return distinct_crystals(candidates, np.argsort(-x, kind="stable"), count)
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
