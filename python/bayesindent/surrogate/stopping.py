"""When a design has learnt enough."""

__all__ = ["why_to_stop"]

#: The error improved if it fell below this share of the best before.
IMPROVEMENT = 0.98


def why_to_stop(history: list[dict], n: int, target_gpa: float, patience: int) -> str:
    """Why to stop before the budget, or nothing, after n simulations and a history with leave_crystal_out_gpa and next_gpa.

    target_gpa: of both errors in GPa (0: none); patience: simulations without improvement (0: no end).
    """
    last = history[-1]
    error, following = last["leave_crystal_out_gpa"], last["next_gpa"]
    if target_gpa > 0 and following is not None and max(error, following) <= target_gpa:
        return f"the errors of unseen crystals ({error:.3g} and {following:.3g} GPa) reached {target_gpa:g} GPa"
    if patience > 0:
        early, late = [], []
        for entry in history:
            (early if entry["simulations"] <= n - patience else late).append(entry["leave_crystal_out_gpa"])
        if early and min(late) > IMPROVEMENT * min(early):
            return f"the error did not improve over the last {patience} simulations"
    return ""
