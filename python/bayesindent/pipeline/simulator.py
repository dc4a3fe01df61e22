"""What &simulation asks for: a function that simulates one crystal, the identity of its physics, and many crystals into a campaign."""

import time
from collections.abc import Callable, Sequence

from ..core import BayesindentError, InputError, MachineError
from ..crystal.elasticity import halfspace_modulus, stiffness_rows
from ..pipeline.campaign import Campaign
from ..pipeline.engines import ENGINES
from ..settings.problem import schema

__all__ = ["engine_of", "new_indentation", "physics_identity", "simulate_into", "simulator_of"]


def physics_identity(problem, mesh: str = "") -> dict:
    """What makes two simulations the same physics; `mesh` takes the place of the problem's."""
    simulator = problem.settings.simulation.simulator
    if simulator != "fe":
        return {"simulator": simulator}
    from ..fe import indentation

    names = ("mesh", "element", "integration", "refine", "extrapolate", "radius_um", "depths")
    identity = {"simulator": simulator, **{name: getattr(problem.settings.simulation, name) for name in names}}
    identity["mesh"] = mesh or identity["mesh"]
    # Variables of studies are named where they are not as usual: results that are older than they are stay valid.
    studied = {name: getattr(problem.settings.simulation, name) for name in ("outer", "growth")}
    identity |= {name: value for name, value in studied.items() if value != float(default_of("simulation", name))}
    return identity | {"estimator": "least squares through the origin", "numerics": indentation.NUMERICS_REVISION}


def default_of(group: str, name: str) -> str:
    """The default of a variable, as a namelist has it."""
    return next(variable.default for variable in schema() if (variable.group, variable.name) == (group, name))


def new_indentation(problem, mesh: str = ""):
    """The `Indentation` that &simulation asks for; `mesh` takes the place of its own."""
    from ..fe.indentation import Indentation

    names = ("mesh", "integration", "refine", "extrapolate", "radius_um", "depths", "outer", "growth")
    options = {name: getattr(problem.settings.simulation, name) for name in names}
    options["mesh"] = mesh or options["mesh"]
    element = problem.settings.simulation.element
    try:
        return Indentation(**options, **({"element": element} if element else {}))
    except InputError as error:
        raise InputError(f"{problem.path}: &simulation: {error}") from None


def simulator_of(problem, mesh: str = "") -> Callable:
    """A function of (stiffness (6, 6), angles in degrees) that gives what `Campaign.add` stores."""
    kind = problem.settings.simulation.simulator
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


def engine_of(problem):
    """The engine that &execution asks for."""
    execution = problem.settings.execution
    return ENGINES[execution.engine](execution.workers)


def simulate_into(campaign: Campaign, simulate: Callable, crystals: Sequence, engine, done: Callable[[bool], None]) -> None:
    """Simulate crystals (symmetry, constants, angles in degrees) by an engine; each is a row as soon as it is done, in this order.

    One that fails is stored as failed. What the machine could not do is no result: it is tried once more, alone, and is raised if that
    fails too. done(success) is called after each. An exception, or an interrupt, starts no more; what is under way is still stored.
    """
    first, again = campaign.next_position(), []

    def attempt(crystal) -> dict | MachineError:
        symmetry, constants, euler_deg = crystal
        start = time.perf_counter()
        try:
            result = simulate(stiffness_rows(symmetry, [constants])[0], euler_deg)
        except InputError:
            raise
        except MachineError as error:
            return error
        except BayesindentError as error:
            result = {"message": str(error)}
        return {"seconds": time.perf_counter() - start} | result

    def store(k: int, result: dict | MachineError) -> None:
        if isinstance(result, MachineError):
            again.append(k)
        else:
            campaign.add(*crystals[k], position=first + k, **result)
            done("modulus_gpa" in result)

    engine.map(attempt, crystals, store)
    for k in sorted(again):
        result = attempt(crystals[k])
        if isinstance(result, MachineError):
            raise result
        store(k, result)
