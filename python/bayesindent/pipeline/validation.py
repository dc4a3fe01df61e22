"""How good a surrogate is on simulations that it has not seen."""

import numpy as np

from ..crystal.elasticity import stiffness_rows

__all__ = ["validate"]


def validate(loop, surrogate, count: int) -> dict:
    """The next `count` points by variance: rows that the budget of a `Loop` left over, then new ones."""
    choice, stored = loop.choice, loop.unused[:count]
    candidates = choice.candidates
    constants, euler_deg = [row.constants for row in stored], [row.euler_deg for row in stored]
    modulus = [row.modulus_gpa for row in stored]
    left = min(count - len(stored), len(choice.left))
    if left:
        if stored:
            choice.assume(constants, euler_deg)
        with loop.progress.bar("validation", left) as advance:
            numbers, _ = choice.next(left)
            new = loop.perform(numbers, advance)
        done = np.isfinite(new)
        constants += candidates.constants[numbers[done]].tolist()
        euler_deg += candidates.euler_deg[numbers[done]].tolist()
        modulus += new[done].tolist()
    mean, sd = surrogate.predict(stiffness_rows(loop.symmetry, constants), euler_deg)
    error = np.abs(mean - modulus)
    return {
        "points": len(modulus),
        "constants": np.asarray(constants).tolist(),
        "euler_deg": np.asarray(euler_deg).tolist(),
        "mean_absolute_gpa": float(np.mean(error)),
        "within_1_sd": float(np.mean(error <= sd)),
        "within_2_sd": float(np.mean(error <= 2 * sd)),
        "simulated": modulus,
        "predicted": mean.tolist(),
        "sd": sd.tolist(),
    }
