"""Finite element simulations of the indentation of one crystal."""

from __future__ import annotations

from dataclasses import dataclass
from functools import partial
from os import PathLike
from types import SimpleNamespace
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from ..core import BayesindentError, InputError, NativeObject
from ..crystal.elasticity import crystal_rows, oriented_crystals
from ..settings.keywords import takes
from ..settings.problem import Problem, grouped
from .deck import write_deck

#: Groups whose variables define a simulation.
GROUPS = ("specimen", "indenter", "simulation")
NOT_OURS = ("simulator", "vtu", "inp")


def one_crystal(stiffness: ArrayLike, euler_deg: ArrayLike) -> dict[str, np.ndarray]:
    """Stiffness (6, 6) in GPa and angles (3,) in degrees of one crystal, as the core takes them."""
    matrix, angles = oriented_crystals(stiffness, euler_deg)
    if matrix.ndim != 2 or angles.ndim != 1:
        raise InputError(
            f"one crystal at a time: (6, 6) and (3,), not {matrix.shape} and {angles.shape}; "
            "run_many takes more"
        )
    return {"stiffness": matrix, "euler_deg": angles}


@dataclass(frozen=True)
class IndentationResult:
    """One simulated indentation. Lengths in um, forces in mN, moduli in GPa.

    `indentation_modulus_gpa` is the modulus of the isotropic half-space with the same curve, P =
    4/3 M sqrt(R) h^1.5 under a paraboloid, by least squares through the origin over the depths
    whose contact is resolved. `modulus_by_depth_gpa` has the modulus of each depth alone,
    `modulus_slope_gpa` that of a line with intercept, and `modulus_of_mesh_gpa` that of each mesh,
    the finest first. `modulus_by_stiffness` (6, 6) has the derivatives of the indentation modulus:
    a small change of the stiffness in crystal axes changes it by the sum of their products, and a
    small turn of the crystal about the axes of the sample by `modulus_by_rotation_gpa` (3,) a
    radian. Both are 0 if the estimator is not 'curve'. Residuals are relative. `warning` names the
    error of the mesh if it is large.

    Examples
    --------
    >>> result = bi.Indentation(geometry="halfspace", refine=0.6).run(
    ...     bi.stiffness("cubic", 168.4, 121.4, 75.4), [0, 0, 0]
    ... )
    >>> len(result.depth_um) == len(result.force_mn) == 10
    True
    """

    indentation_modulus_gpa: float
    depth_um: np.ndarray
    force_mn: np.ndarray
    modulus_by_depth_gpa: np.ndarray
    elements: int
    seconds: float
    modulus_slope_gpa: float
    modulus_last_gpa: float
    modulus_of_mesh_gpa: np.ndarray
    contact_radius_um: np.ndarray
    seconds_factor: float
    contact_residual: float
    equilibrium_residual: float
    modulus_by_stiffness: np.ndarray
    modulus_by_rotation_gpa: np.ndarray
    warning: str


@takes(*GROUPS, without=(*NOT_OURS, "geometry"))
def film_modulus(
    stiffness: ArrayLike, euler_deg: ArrayLike, *, threads: int = 1, **settings: Any
) -> np.ndarray:
    """Exact indentation modulus in GPa of crystals as films, by the theory of layers.

    Parameters
    ----------
    stiffness : array_like
        Shape (..., 6, 6), GPa, crystal axes.
    euler_deg : array_like
        Bunge-Euler angles, shape (..., 3), degrees; the two broadcast.
    threads : int, default 1
        Threads that share the crystals.

    Examples
    --------
    >>> copper = bi.stiffness("cubic", 168.4, 121.4, 75.4)
    >>> film = {"thickness_um": 1, "substrate_young_gpa": 70, "substrate_nu": 0.25}
    >>> round(float(bi.film_modulus(copper, [0, 0, 0], **film)), 1)
    112.5
    """
    rows, shape = crystal_rows(stiffness, euler_deg)
    film = grouped({"geometry": "film", **settings}, GROUPS)
    problem = Problem.from_keywords("bi.film_modulus", **film)
    return problem._call("film", **rows, threads=threads)["values"][0].reshape(shape)


class Indentation(NativeObject):
    """A mesh with its solver, ready to indent any crystal; threads may share it.

    Its keywords are the variables of the specimen, the indenter and the simulation;
    help(bi.Indentation.__init__) explains all `settings`. Raises `InputError` for wrong settings
    and `MachineError` if memory does not suffice.

    Examples
    --------
    >>> indentation = bi.Indentation(geometry="halfspace", refine=0.6)
    >>> copper = bi.stiffness("cubic", 168.4, 121.4, 75.4)
    >>> modulus = indentation.run(copper, [0, 0, 0]).indentation_modulus_gpa
    >>> abs(modulus / 134.0 - 1) < 0.1
    True
    """

    kind = "indentation"
    #: Name of the brick element; then the numbers of elements in all solves, of points of the
    #: curve, of meshes, and of parts of the finest mesh.
    element: str
    #: Names of the parts of the specimen, separated by ', '.
    parts: str
    elements: int
    depths: int
    meshes: int
    nodes: int
    bricks: int
    infinite_elements: int
    unknowns: int
    #: Entries of the factor, floating point operations of one factorisation, bytes of workspace of
    #: one simulation.
    factor_entries: float
    factor_operations: float
    workspace_bytes: float
    #: The last point: depth, and contact radius on an isotropic half-space.
    depth_max_um: float
    contact_radius_max_um: float

    @takes(*GROUPS, without=NOT_OURS)
    def __init__(self, **settings: Any):
        """Mesh and solver of a specimen under an indenter.

        Parameters
        ----------
        """
        self._made_of: tuple = (partial(type(self), **settings), ())  # type: ignore[misc]
        self._set_up(Problem.from_keywords("bi.Indentation", **grouped(settings, GROUPS)))

    @classmethod
    def of_problem(cls, problem: Problem) -> Indentation:
        """The simulation that &specimen, &indenter and &simulation of a problem define."""
        self = cls.__new__(cls)
        self._made_of = (cls.of_problem, (problem,))
        self._set_up(problem)
        return self

    def _set_up(self, problem: Problem) -> None:
        self._hold(problem._call("indentation")["handle"], frozen=False)
        #: The variables of all groups: `settings.indenter.shape`.
        self._problem, self.settings = problem, problem.settings
        self.__dict__.update(self._call("describe"))
        self._frozen = True

    def __repr__(self) -> str:
        specimen, indenter = self.settings.specimen.geometry, self.settings.indenter.shape
        last = (
            f"depth {self.depth_max_um:.3g} um, contact radius {self.contact_radius_max_um:.3g} um"
        )
        return (
            f"<Indentation of a {specimen} by a {indenter} to {last}: {self.bricks} bricks, "
            f"{self.unknowns} unknowns>"
        )

    def __reduce__(self) -> tuple:
        return self._made_of

    def run(self, stiffness: ArrayLike, euler_deg: ArrayLike) -> IndentationResult:
        """Indent one crystal: stiffness (6, 6) in GPa, crystal frame; Bunge-Euler angles (3,) in
        degrees.

        Raises `InputError` for an unstable crystal, `BayesindentError` where the simulation fails.
        """
        crystal = one_crystal(stiffness, euler_deg)
        found = self._call("run", **crystal)
        return IndentationResult(
            **found,
            warning=self._problem._call("mesh_error", stiffness=crystal["stiffness"])["text"],
        )

    @takes()
    def run_many(
        self,
        stiffness: ArrayLike,
        euler_deg: ArrayLike,
        workers: int = 0,
        *,
        engine: str = "local",
        scheduler: str = "local",
        errors: str = "raise",
    ) -> list[IndentationResult | BayesindentError]:
        """Indent n crystals, stiffness (n, 6, 6) and angles (n, 3), on `workers` threads (0: all
        cores), or by the `engine` 'dask' and its `scheduler`: 'local', 'slurm' or an address.

        The numbers do not depend on these. `errors` is 'raise', which raises the first one, or
        'return', which returns each in the place of its result.
        """
        # Importing the engines takes time.
        from ..engines import ENGINES

        execution = Problem.from_keywords(
            "bi.Indentation.run_many",
            execution={"workers": workers, "engine": engine},
        ).settings.execution
        if errors not in ("raise", "return"):
            raise InputError(
                f"bi.Indentation.run_many: errors: '{errors}' is "
                "unknown; allowed: 'raise', 'return'"
            )
        crystals, _ = crystal_rows(stiffness, euler_deg)
        results: dict[int, Any] = {}

        def attempt(item: tuple) -> Any:
            try:
                return self.run(*item)
            except BayesindentError as error:
                if errors == "raise":
                    raise
                return error

        with ENGINES[execution.engine](execution.workers, scheduler) as queue:
            queue.map(attempt, list(zip(*crystals.values())), results.__setitem__)
        return [results[number] for number in sorted(results)]

    def largest_error(self, stiffness: ArrayLike) -> np.ndarray:
        """The largest relative error of the mesh (n,) for crystals of stiffness (n, 6, 6) in GPa,
        see docs/simulation.md.
        """
        return self._problem._call("mesh_error", stiffness=stiffness)["values"][0]

    def mesh_arrays(
        self, stiffness: ArrayLike, euler_deg: ArrayLike = (0, 0, 0)
    ) -> SimpleNamespace:
        """The finest mesh for a crystal, a larger one if its contact exceeds the refined zone.

        It has the nodes `x` in um, the nodes of each `brick`, its `material` (the crystal is 0),
        and the `facet`s that carry infinite elements; the `contact` nodes and the `gap` above each
        at zero depth; the `clamped` nodes; and the `hanging` nodes, which follow the mean of up to
        four `master` nodes (-1 for none). Nodes are numbered from 0.
        """
        return SimpleNamespace(**self._fields(stiffness, euler_deg))

    def _fields(
        self, stiffness: ArrayLike, euler_deg: ArrayLike, step: int = -1
    ) -> dict[str, np.ndarray]:
        return self._call(
            "fields",
            step=step + 1 if step >= 0 else self.depths + 1 + step,
            **one_crystal(stiffness, euler_deg),
        )

    def fields(
        self, stiffness: ArrayLike, euler_deg: ArrayLike, step: int = -1
    ) -> tuple[np.ndarray, np.ndarray]:
        """Displacement (nodes, 3) in um and mean stress (bricks, 6) in GPa, order
        11,22,33,23,13,12, on the mesh of `mesh_arrays`.

        `step` counts the depths as an index of `depth_um` does. Raises as `run` does.
        """
        found = self._fields(stiffness, euler_deg, step)
        return found["displacement_um"], found["values"]

    def write_vtu(
        self, path: str | PathLike, stiffness: ArrayLike, euler_deg: ArrayLike, step: int = -1
    ) -> None:
        """Write the fields at one depth for ParaView: displacement of points, stress (xx, yy, zz,
        xy, yz, xz) and mises of cells.
        """
        import meshio

        found = self._fields(stiffness, euler_deg, step)
        u, stress = found["displacement_um"], found["values"]
        normal, shear = stress[:, :3], stress[:, 3:]
        mises = np.sqrt(
            0.5 * ((normal - np.roll(normal, 1, axis=1)) ** 2).sum(axis=1)
            + 3.0 * (shear**2).sum(axis=1)
        )
        cells = {"stress_gpa": [stress[:, [0, 1, 2, 5, 3, 4]]], "mises_gpa": [mises]}
        mesh = meshio.Mesh(
            found["x"],
            [("hexahedron", found["brick"])],
            point_data={"displacement_um": u},
            cell_data=cells,
        )
        mesh.write(path, file_format="vtu")

    def deck(
        self,
        stiffness: ArrayLike,
        euler_deg: ArrayLike,
        title: str = "indentation",
        depth_um: ArrayLike | None = None,
    ) -> str:
        """The same problem on the finest mesh as an input deck for Abaqus and CalculiX (see
        `deck.py`).

        `depth_um`: depths (n,) in place of those of the simulation.
        """
        found = self._fields(stiffness, euler_deg)
        depths = found["depth_um"] if depth_um is None else np.asarray(depth_um, dtype=float)
        return write_deck(
            SimpleNamespace(**found), depths, self.element.upper(), title, self.parts.split(", ")
        )
