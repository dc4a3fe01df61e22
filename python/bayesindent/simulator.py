"""What &simulation asks for: a function that simulates one crystal, and the identity of its physics."""

from collections.abc import Callable

from .core import InputError
from .crystal import halfspace_modulus

__all__ = ["new_indentation", "physics_identity", "simulator_of"]


def physics_identity(problem, mesh: str = "") -> dict:
    """What makes two simulations the same physics; `mesh` takes the place of the problem's."""
    simulator = problem["simulation"]["simulator"]
    if simulator != "fe":
        return {"simulator": simulator}
    from . import indentation

    names = ("mesh", "element", "integration", "refine", "extrapolate", "radius_um", "depths")
    identity = {"simulator": simulator, **{name: problem["simulation"][name] for name in names}}
    identity["mesh"] = mesh or identity["mesh"]
    return identity | {"estimator": "least squares through the origin", "numerics": indentation.NUMERICS_REVISION}


def new_indentation(problem, mesh: str = ""):
    """The `Indentation` that &simulation asks for; `mesh` takes the place of its own."""
    from .indentation import Indentation

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
                "a campaign of imported results cannot simulate: print the next points with 'build --ask', import their "
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
