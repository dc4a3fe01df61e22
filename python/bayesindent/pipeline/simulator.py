"""What &simulation asks for: a function that simulates one crystal, the identity of its physics, and many crystals into a campaign."""

import os
import time
from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor, as_completed

from ..core import BayesindentError, InputError
from ..crystal.elasticity import halfspace_modulus, stiffness_rows
from ..pipeline.campaign import Campaign

__all__ = ["new_indentation", "physics_identity", "simulate_into", "simulator_of", "worker_count"]


def physics_identity(problem, mesh: str = "") -> dict:
    """What makes two simulations the same physics; `mesh` takes the place of the problem's."""
    simulator = problem["simulation"]["simulator"]
    if simulator != "fe":
        return {"simulator": simulator}
    from ..fe import indentation

    names = ("mesh", "element", "integration", "refine", "extrapolate", "radius_um", "depths")
    identity = {"simulator": simulator, **{name: problem["simulation"][name] for name in names}}
    identity["mesh"] = mesh or identity["mesh"]
    return identity | {"estimator": "least squares through the origin", "numerics": indentation.NUMERICS_REVISION}


def new_indentation(problem, mesh: str = ""):
    """The `Indentation` that &simulation asks for; `mesh` takes the place of its own."""
    from ..fe.indentation import Indentation

    names = ("mesh", "integration", "refine", "extrapolate", "radius_um", "depths")
    options = {name: problem["simulation"][name] for name in names}
    options["mesh"] = mesh or options["mesh"]
    element = problem["simulation"]["element"]
    try:
        return Indentation(**options, **({"element": element} if element else {}))
    except InputError as error:
        raise InputError(f"{problem.path}: &simulation: {error}") from None


def simulator_of(problem, mesh: str = "") -> Callable:
    """A function of (stiffness (6, 6), angles in degrees) that gives what `Campaign.add` stores."""
    kind = problem["simulation"]["simulator"]
    if kind == "theory":
        return lambda stiffness, euler_deg: {"modulus_gpa": float(halfspace_modulus(stiffness, euler_deg))}
    if kind == "import":

        def missing(stiffness, euler_deg):
            raise InputError(
                f"{problem.path}: &simulation simulator: 'import' cannot simulate: print the next points with 'build --ask', import their "
                "moduli with 'build --tell', or lower &design budget"
            )

        return missing
    indentation = new_indentation(problem, mesh)

    def simulate(stiffness, euler_deg):
        result = indentation.run(stiffness, euler_deg)
        return {
            "modulus_gpa": result.indentation_modulus_gpa,
            "elements": int(result.elements),
            "seconds": result.seconds,
            "depth_um": result.depth_um,
            "force_mn": result.force_mn,
        }

    return simulate


def worker_count(asked: int) -> int:
    """Simulations at a time: as asked, or the cores that this process may use."""
    return asked or len(os.sched_getaffinity(0))


def simulate_into(campaign: Campaign, simulate: Callable, crystals: Sequence, workers: int, done: Callable[[bool], None]) -> None:
    """Simulate crystals (symmetry, constants, angles in degrees) on threads; each is a row as soon as it is done, in this order.

    One that fails is stored as failed. done(success) is called after each. An exception, or an interrupt, starts no more; what is
    under way is still stored. Bad input is raised, not stored.
    """
    first = campaign.next_position()

    def attempt(crystal) -> dict:
        symmetry, constants, euler_deg = crystal
        start = time.perf_counter()
        try:
            result = simulate(stiffness_rows(symmetry, [constants])[0], euler_deg)
        except InputError:
            raise
        except BayesindentError as error:
            result = {"message": str(error)}
        return {"seconds": time.perf_counter() - start} | result

    def store(k: int, result: dict) -> None:
        campaign.add(*crystals[k], position=first + k, **result)
        done("modulus_gpa" in result)

    with ThreadPoolExecutor(worker_count(workers)) as pool:
        left = {pool.submit(attempt, crystal): k for k, crystal in enumerate(crystals)}
        try:
            for future in as_completed(list(left)):
                store(left.pop(future), future.result())
        except BaseException:
            pool.shutdown(cancel_futures=True)
            for future, k in left.items():
                if not future.cancelled() and future.exception() is None:
                    store(k, future.result())
            raise
