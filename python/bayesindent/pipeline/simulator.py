"""What &specimen, &indenter and &simulation ask for: a simulator of one crystal, and many crystals into a campaign."""

from collections.abc import Callable, Sequence

import numpy as np

from ..core import MachineError, NativeObject, call, check, native
from ..crystal.elasticity import stiffness_rows
from ..fe.indentation import resolution
from ..pipeline.campaign import Campaign
from ..pipeline.engines import ENGINES
from ..settings.problem import Problem

__all__ = ["Simulator", "engine_of", "resolution_warnings", "simulate_all", "simulate_into"]


class Simulator(NativeObject):
    """What a problem asks for. Threads may share it."""

    kind = "simulator"

    def __init__(self, problem):
        self._made_of, self.depths = (problem,), problem.settings.simulation.depths
        self._hold(call("simulation_new", problem.handle, self.kind))

    def __reduce__(self):
        # For workers elsewhere, which may not see the files: what the physics depends on.
        settings = self._made_of[0].settings
        return _simulator_of, tuple(_stated(getattr(settings, group)) for group in ("specimen", "indenter", "simulation"))

    def __call__(self, stiffness, euler_deg) -> dict:
        """What `Campaign.add` stores of one crystal: stiffness (6, 6) in GPa, angles (3,) in degrees.

        One that cannot be simulated has a message and no modulus. Raises `InputError` and `MachineError`: they are no results.
        """
        curve, numbers, status, message = native.simulator_run(self.handle, self.depths, stiffness, np.radians(euler_deg))
        check(status, message)
        modulus, seconds, elements, points, failed = numbers
        if failed:
            return {"seconds": float(seconds), "message": message}
        result = {"modulus_gpa": float(modulus), "seconds": float(seconds)}
        if not elements:
            return result
        return result | {"elements": int(elements), "depth_um": curve[: int(points), 0], "force_mn": curve[: int(points), 1]}


def _stated(group) -> dict:
    return {name: value for name, value in vars(group).items() if name != "given" and value is not None}


def _simulator_of(specimen: dict, indenter: dict, simulation: dict) -> Simulator:
    return Simulator(Problem.from_keywords("Simulator", specimen=specimen, indenter=indenter, simulation=simulation))


def resolution_warnings(problem, stiffness) -> list[str]:
    """What is to be said of simulated crystals (n, 6, 6) in GPa that the mesh resolves badly, if there are any."""
    _, warning = resolution(problem, np.asarray(stiffness))
    return [f"{problem.path}: &simulation: {warning}"] * bool(warning)


def engine_of(problem):
    """The engine that &execution asks for, for a `with` statement."""
    execution = problem.settings.execution
    return ENGINES[execution.engine](execution.workers, execution.scheduler)


def simulate_into(campaign: Campaign, simulate: Callable, crystals: Sequence, engine, done: Callable[[bool], None]) -> None:
    """Simulate crystals (symmetry, constants, angles in degrees) by an engine; each is a row as soon as it is done, in this order.

    One that fails is stored as failed. done(success) is called after each.
    """
    first = campaign.next_position()

    def store(k: int, result: dict) -> None:
        campaign.add(*crystals[k], position=first + k, **result)
        done("modulus_gpa" in result)

    points = [(stiffness_rows(symmetry, [constants])[0], euler_deg) for symmetry, constants, euler_deg in crystals]
    simulate_all(simulate, points, engine, store)


def simulate_all(simulate: Callable, points: Sequence, engine, store: Callable[[int, dict], None]) -> None:
    """Simulate points (stiffness (6, 6) in GPa, angles (3,) in degrees) by an engine, and store(number, result) each as soon as it is done.

    What the machine could not do is no result: it is tried once more, alone, and is raised if that fails too. An exception, or an
    interrupt, starts no more; what is under way is still stored.
    """
    again = []

    def attempt(point) -> dict | MachineError:
        try:
            return simulate(*point)
        except MachineError as error:
            return error

    def collect(k: int, result: dict | MachineError) -> None:
        if isinstance(result, MachineError):
            again.append(k)
        else:
            store(k, result)

    engine.map(attempt, points, collect)
    for k in sorted(again):
        store(k, simulate(*points[k]))
