"""Finite element simulations of spherical indentation of one crystal."""

import os
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, field

import numpy as np

from ..core import BayesindentError, InputError, check, native
from ..crystal.elasticity import oriented_crystals

__all__ = ["NUMERICS_REVISION", "Indentation", "IndentationResult"]

#: Counts changes of the numerics that change results; part of the identity of stored simulations.
NUMERICS_REVISION = int(native.indentation_revision())


def one_crystal(stiffness, euler_deg) -> tuple[np.ndarray, np.ndarray]:
    """Stiffness (6, 6) in GPa and angles (3,) in radians of one crystal."""
    matrix, angles = oriented_crystals(stiffness, euler_deg)
    if matrix.ndim != 2 or angles.ndim != 1:
        raise InputError(f"one crystal at a time: (6, 6) and (3,), not {matrix.shape} and {angles.shape}; run_many takes more")
    return matrix, angles


@dataclass(frozen=True)
class IndentationResult:
    """One simulated indentation. Lengths in um, forces in mN, moduli in GPa."""

    #: M of P = 4/3 M sqrt(R) h^1.5: least squares through the origin over the depths whose contact is resolved.
    indentation_modulus_gpa: float
    depth_um: np.ndarray
    force_mn: np.ndarray
    #: All elements of all solves behind the number, infinite ones included.
    elements: int
    seconds: float
    #: Diagnostics: slope of a line with intercept, last point alone, estimate on each mesh (the finest first).
    modulus_slope_gpa: float
    modulus_last_gpa: float
    modulus_of_mesh_gpa: np.ndarray
    #: Radius of a circle as large as the area of the touching nodes.
    contact_radius_um: np.ndarray
    seconds_factor: float
    #: Largest violation of the contact conditions, and of equilibrium with the reactions, relative.
    contact_residual: float
    equilibrium_residual: float


@dataclass(frozen=True)
class MeshArrays:
    """A mesh; nodes are numbered from 0, lengths in um."""

    x: np.ndarray
    brick: np.ndarray
    #: Facets that carry infinite elements.
    facet: np.ndarray
    contact: np.ndarray
    #: Height of the indenter above each contact node at zero depth.
    gap: np.ndarray
    clamped: np.ndarray
    #: Hanging nodes, and the up to four nodes (else -1) whose mean they follow.
    hanging: np.ndarray
    master: np.ndarray


@dataclass
class Indentation:
    """A mesh with its solver, ready to indent any crystal; threads may share it.

    mesh: 'halfspace' (infinite elements outside) or 'paper' (block of 9.6 x 9.6 x 4.8 um, bottom clamped);
    radius_um: of the rigid sphere; element: 'c3d8', 'c3d8i' or '' for the default of the mesh; integration of c3d8:
    'selective' (Abaqus) or 'full' (CalculiX); refine: elements per contact radius relative to the default;
    extrapolate: in mesh size, from a second, coarser mesh; depths: points of the curve, equally spaced in contact radius;
    outer, growth: of the half-space, for studies: where the infinite elements begin, in contact radii, and growth of the layers.
    Raises `InputError` for what cannot be meant.
    """

    mesh: str = "halfspace"
    radius_um: float = 16.0
    element: str = ""
    integration: str = "selective"
    refine: float = 1.0
    extrapolate: bool = False
    depths: int = 10
    outer: float = 5.0
    growth: float = 1.13
    _handle: int = field(default=0, init=False, repr=False)

    def __post_init__(self):
        handle, counts, costs, status, message = native.indentation_new(
            self.mesh[:16].ljust(16), self.element[:16].ljust(16), self.integration[:16].ljust(16),
            self.refine, self.extrapolate, self.radius_um, self.depths, self.outer, self.growth,
        )  # fmt: skip
        check(status, message)
        self._handle = int(handle)
        (self.elements, _, self.meshes, self.nodes, self.bricks, self.infinite_elements, self.contact_nodes,
         self.unknowns, self._clamped_nodes, self._hanging_nodes) = (int(count) for count in counts)  # fmt: skip
        #: Entries of the factor, floating point operations of one factorisation, bytes of workspace of one simulation, last depth.
        self.factor_entries, self.factor_operations, self.workspace_bytes, self.depth_max_um = (float(cost) for cost in costs)

    def __del__(self):
        if getattr(self, "_handle", 0):
            native.indentation_free(self._handle)
            self._handle = 0

    def run(self, stiffness, euler_deg) -> IndentationResult:
        """Indent one crystal: stiffness (6, 6) in GPa, crystal frame; Bunge-Euler angles (3,) in degrees.

        Raises `InputError` for an unstable crystal, `BayesindentError` where the simulation fails.
        """
        depth, force, radius, moduli, diagnostics, elements, status, message = native.indentation_run(
            self._handle, self.depths, *one_crystal(stiffness, euler_deg)
        )
        check(status, message)
        return IndentationResult(
            indentation_modulus_gpa=float(moduli[0]),
            depth_um=depth,
            force_mn=force,
            elements=elements,
            seconds=float(diagnostics[0]),
            modulus_slope_gpa=float(moduli[1]),
            modulus_last_gpa=float(moduli[2]),
            modulus_of_mesh_gpa=moduli[3 : 3 + self.meshes],
            contact_radius_um=radius,
            seconds_factor=float(diagnostics[1]),
            contact_residual=float(diagnostics[2]),
            equilibrium_residual=float(diagnostics[3]),
        )

    def run_many(
        self, stiffness, euler_deg, workers: int = 0, *, errors: str = "raise", done: Callable[[int], None] | None = None
    ) -> list[IndentationResult | BayesindentError]:
        """Indent n crystals, stiffness (n, 6, 6) and angles (n, 3), on `workers` threads (0: all cores).

        The numbers do not depend on `workers`. errors: 'raise' the first, or 'return' each in the place of its result.
        done(1) is called, from any thread, after each simulation.
        """

        def one(item):
            try:
                result = self.run(*item)
            except BayesindentError as error:
                if errors == "raise":
                    raise
                result = error
            if done is not None:
                done(1)
            return result

        matrices, angles = np.asarray(stiffness, dtype=float), np.asarray(euler_deg, dtype=float)
        if len(matrices) != len(angles):
            raise InputError(f"there are {len(matrices)} crystals but {len(angles)} orientations")
        with ThreadPoolExecutor(workers or len(os.sched_getaffinity(0))) as pool:
            return list(pool.map(one, zip(matrices, angles, strict=True)))

    def mesh_arrays(self) -> MeshArrays:
        """The finest mesh."""
        x, brick, facet, contact, gap, clamped, hanging, master = native.indentation_mesh(
            self._handle, self.nodes, self.bricks, self.infinite_elements, self.contact_nodes, self._clamped_nodes, self._hanging_nodes
        )
        return MeshArrays(x.T, brick.T, facet.T, contact, gap, clamped, hanging, master.T)

    def fields(self, stiffness, euler_deg, step: int = -1) -> tuple[np.ndarray, np.ndarray]:
        """Displacement (nodes, 3) in um and mean stress (bricks, 6) in GPa, order 11,22,33,23,13,12, on the finest mesh.

        `step` counts the depths as an index of `depth_um` does. Raises as `run` does.
        """
        number = step + 1 if step >= 0 else self.depths + 1 + step
        u, stress, status, message = native.indentation_field(
            self._handle, number, self.nodes, self.bricks, *one_crystal(stiffness, euler_deg)
        )
        check(status, message)
        return u.T, stress.T

    def write_vtu(self, path, stiffness, euler_deg, step: int = -1) -> None:
        """Write the fields at one depth for ParaView: displacement of points, stress (xx, yy, zz, xy, yz, xz) and mises of cells."""
        import meshio

        u, stress = self.fields(stiffness, euler_deg, step)
        mesh = self.mesh_arrays()
        normal, shear = stress[:, :3], stress[:, 3:]
        mises = np.sqrt(0.5 * ((normal - np.roll(normal, 1, axis=1)) ** 2).sum(axis=1) + 3.0 * (shear**2).sum(axis=1))
        meshio.Mesh(
            mesh.x,
            [("hexahedron", mesh.brick)],
            point_data={"displacement_um": u},
            cell_data={"stress_gpa": [stress[:, [0, 1, 2, 5, 3, 4]]], "mises_gpa": [mises]},
        ).write(path, file_format="vtu")

    def deck(self, stiffness, euler_deg, title: str = "spherical indentation") -> str:
        """The same problem on the finest mesh as an input deck for Abaqus and CalculiX (see `deck.py`)."""
        from ..fe.deck import write_deck

        rotated, infinite = native.indentation_stiffness(self._handle, self.infinite_elements, *one_crystal(stiffness, euler_deg))
        element = self.element or ("c3d8" if self.mesh == "paper" else "c3d8i")
        # The simulation finds the depths that fit this crystal.
        depths = self.run(stiffness, euler_deg).depth_um
        return write_deck(self.mesh_arrays(), rotated, np.moveaxis(infinite, -1, 0), depths, element.upper(), title)
