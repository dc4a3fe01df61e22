"""The surrogate of Step 1: the posterior of the coefficients of a basis, and its predictions. The
core holds it under a handle.

Stiffnesses and moduli in GPa, angles Bunge-Euler (phi1, Phi, phi2) in degrees.
"""

from __future__ import annotations

import json
import os
from os import PathLike
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from ..core import InputError, NativeObject, call
from ..crystal.elasticity import crystal_rows
from ..settings.keywords import takes
from ..settings.problem import Points
from ..surrogate.basis import Basis

#: The folder of the surrogates that come with the package, and their names.
DATA = Path(os.environ.get("BAYESINDENT_DATA") or Path(__file__).parents[1] / "data")
SHIPPED = tuple(sorted(path.stem for path in DATA.glob("*.txt")))


def places(output: str | os.PathLike, folder: str | os.PathLike) -> dict[str, str]:
    """Values for the core: the folders of the results, of the namelist and of the package's data,
    and the names of the surrogates that come with the package. A folder ends in a slash; the
    current one is ''.
    """
    folders = {"output": output, "folder": folder, "data_folder": DATA}
    return {
        name: "" if str(place) in ("", ".") else f"{place}/" for name, place in folders.items()
    } | {"shipped": ", ".join(SHIPPED)}


class Surrogate(NativeObject):
    """Indentation modulus of the crystals of a domain, with its uncertainty.

    `fit` and `load` make it; `handle` is that of the core. `coefficients` (n_terms,) is the
    posterior mean, in units of y. `alpha` and `beta` are the precisions of the prior and of the
    noise, in the same units. `fall` is the decay rate of the prior's sd from degree to degree.
    `provenance` has the title, the physics, the namelist and so on.

    Examples
    --------
    >>> import numpy as np
    >>> rng = np.random.default_rng(1)
    >>> constants = np.array([168.4, 121.4, 75.4]) * rng.uniform(0.95, 1.05, (30, 3))
    >>> angles = rng.uniform(0, 90, (30, 3))
    >>> moduli = bi.halfspace_modulus(bi.stiffness("cubic", *constants.T), angles)
    >>> domain = {"c_min": [150, 110, 65], "c_max": [185, 135, 85]}
    >>> surrogate = bi.Surrogate.fit(
    ...     constants, angles, moduli, symmetry="cubic", domain=domain, degree=1
    ... )
    >>> mean, sd = surrogate.predict(bi.stiffness("cubic", 168.4, 121.4, 75.4), [0, 0, 0])
    """

    kind = "surrogate"
    basis: Basis
    symmetry: str
    provenance: dict
    alpha: float
    beta: float
    fall: float
    coefficients: np.ndarray
    _facts: dict

    def __init__(self, handle: int):
        self._hold(handle)
        facts, basis = self._call("describe"), Basis(self)
        for values in facts.values():
            if isinstance(values, np.ndarray):
                values.flags.writeable = False
        self.__dict__.update(
            {name: facts[name] for name in ("alpha", "beta", "fall", "coefficients")},
            basis=basis,
            symmetry=basis.symmetry,
            # Anything but a JSON object raises a TypeError, see `load`.
            provenance={**json.loads(facts["provenance"])},
            _facts=facts,
        )

    @classmethod
    @takes("surrogate", without=("file", "scan"))
    def fit(
        cls,
        constants: ArrayLike,
        euler_deg: ArrayLike,
        modulus_gpa: ArrayLike,
        by_stiffness: ArrayLike | None = None,
        *,
        symmetry: str | None = None,
        domain: dict | None = None,
        **settings: Any,
    ) -> Surrogate:
        """Train a surrogate by evidence maximisation. The training data are simulated moduli (n,)
        of crystals (n, k) in GPa at angles (n, 3) in degrees. If the derivatives (n, 21) of the
        moduli by C11, C12, .. C66 are given, they are used as well.

        `symmetry` is the crystal class, and `domain` has the variables of &domain. If these have no
        bounds `c_min`, `c_max`, the `constants` are the 21 of a triclinic crystal.

        Parameters
        ----------
        """
        basis = Basis.from_keywords(symmetry, domain, **settings)
        rows = basis.rows(constants, euler_deg)
        rows["modulus_gpa"] = np.asarray(modulus_gpa, dtype=float)
        if by_stiffness is not None:
            rows["by_stiffness"] = np.asarray(by_stiffness, dtype=float)
        n = len(rows["constants"])
        for name, shape in (("modulus_gpa", (n,)), ("by_stiffness", (n, 21))):
            values = rows.get(name, np.zeros(shape))
            if values.shape != shape or not np.isfinite(values).all():
                raise InputError(f"{name}: finite numbers of the shape {shape} are needed")
        return cls(basis._call("fit", **rows)["handle"])

    def leave_out(self, groups: ArrayLike) -> tuple[np.ndarray, np.ndarray]:
        """For each simulation of `data` the modulus (n,) in GPa that the simulations outside its
        group predict, and the error in units of its sd. `groups` (n,) has the same number for the
        simulations of a group.
        """
        numbers = np.asarray(groups, dtype=float).ravel()
        if len(numbers) != len(self._facts["simulated_modulus_gpa"]):
            raise InputError("groups: a number for each simulation is needed")
        modulus, z = self.basis._call("leave_out", groups=numbers, **self.data)["values"]
        return modulus, z

    @classmethod
    def load(
        cls,
        name: str | PathLike,
        *,
        symmetry: str = "",
        output: str | PathLike = "",
        folder: str | PathLike = "",
    ) -> Surrogate:
        """The exact theory ('halfspace'), a surrogate that comes with the package ('block'), or the
        file `name` that `save` wrote.

        It must be valid for the crystal class `symmetry`. A relative name is searched in `output`,
        then in `folder`.
        """
        found = call("file.surrogate", name=name, symmetry=symmetry, **places(output, folder))
        try:
            return cls(found["handle"])
        except (TypeError, ValueError) as error:
            raise InputError(
                f"{name}: the surrogate is damaged: its provenance is no JSON object ({error})"
            ) from None

    def save(self, path: str | PathLike) -> None:
        """Write the surrogate, its provenance and its simulations as text. Only a file of a
        surrogate is replaced.
        """
        self._call("save", path=path)

    def __reduce__(self) -> tuple:
        # Imported here, because the import takes time.
        from tempfile import TemporaryDirectory

        with TemporaryDirectory() as folder:
            self.save(f"{folder}/surrogate.txt")
            return _from_text, (Path(folder, "surrogate.txt").read_text(encoding="utf-8"),)

    def __repr__(self) -> str:
        simulations, terms = len(self._facts["simulated_modulus_gpa"]), self.basis.n_terms
        known = f"{simulations} simulations, {terms} terms" if terms else "the exact theory"
        title = self.provenance.get("title")
        name = f"Surrogate {title!r}" if title else "Surrogate"
        crystals = self.symmetry if len(self.basis.c_min) else "crystals of every class"
        return f"<{name} of {crystals}: {known}>"

    @property
    def covariance(self) -> np.ndarray:
        """Posterior covariance (n_terms, n_terms) of the coefficients, in units of y."""
        n = self.basis.n_terms
        full = np.zeros((n, n))
        # The core stores the lower triangle column by column.
        full.T[np.triu_indices(n)] = self._facts["covariance"]
        return full + np.tril(full, -1).T

    @property
    def data(self) -> dict[str, np.ndarray]:
        """The simulations on which it is trained: constants (n, k) and modulus_gpa (n,) in GPa,
        euler_deg (n, 3), and by_stiffness (n, 21), the derivatives of the modulus by C11, C12, ..
        C66, 0 where they are unknown or not used; empty if there are none.
        """
        n = len(self._facts["simulated_modulus_gpa"])
        if not n:
            return {}
        shapes = {
            "constants": (n, -1),
            "euler_deg": (n, 3),
            "modulus_gpa": (n,),
            "by_stiffness": (n, -1),
        }
        return {
            name: self._facts[f"simulated_{name}"].reshape(shape) for name, shape in shapes.items()
        }

    def predict(
        self, stiffness: ArrayLike, euler_deg: ArrayLike, *, threads: int = 1
    ) -> tuple[np.ndarray, np.ndarray]:
        """Mean and sd (n,) in GPa of the simulated indentation modulus of crystals (n, 6, 6) in GPa
        at angles (n, 3) in degrees.

        The sd is that of one simulation (noise included). Raises `InputError` for an unstable
        crystal; `outside` tests which crystals are outside the domain.
        """
        rows, shape = crystal_rows(stiffness, euler_deg)
        modulus, sd = self._call("predict", **rows, threads=threads)["values"]
        return modulus.reshape(shape), sd.reshape(shape)

    def predict_table(self, points: Points, threads: int) -> tuple[np.ndarray, np.ndarray, str]:
        """Mean and sd (n,) as in `predict` for the crystals of a table, and a warning on those
        outside the domain; '' if there are none.
        """
        crystals = {"problem": points.problem.handle, "threads": threads}
        _, covered, scale = self.basis._call("validity", **crystals)["values"]
        modulus, sd = self._call("predict", **crystals)["values"]
        return modulus, sd, self.outside_words(covered > 0, scale)

    def outside(self, stiffness: ArrayLike) -> np.ndarray:
        """Whether each crystal (n, 6, 6) in GPa is outside the domain: it is unstable or of another
        class, a coordinate is out of range, or its anisotropy is above the cap.
        """
        return ~self.basis.coverage(stiffness)[1]

    def outside_words(self, covered: np.ndarray, scale: np.ndarray) -> str:
        """A warning on the crystals that are not `covered` (n,): their number, the first ten rows,
        and the number of those that are outside by their `scale` (n,) in GPa. It is empty if all
        are covered.
        """
        outside = np.flatnonzero(~covered)
        if not len(outside):
            return ""
        words = f"{len(outside)} of {len(covered)} rows are outside the surrogate's domain: "
        words += ", ".join(map(str, outside[:10] + 1)) + (", .." if len(outside) > 10 else "")
        low, high = self.basis.stiffness
        beyond = np.count_nonzero((scale < low) | (scale > high))
        if beyond and high < np.finfo(float).max and not len(self.basis.c_min):
            words += (
                f"; {beyond} by the scale (geometric mean of the stiffness' eigenvalues), for "
                f"which it is valid from {low:.3g} to {high:.3g} GPa"
            )
        return words


def _from_text(text: str) -> Surrogate:
    """The surrogate of the content of a file; for copies and pickles."""
    from tempfile import TemporaryDirectory

    with TemporaryDirectory() as folder:
        Path(folder, "surrogate.txt").write_text(text, encoding="utf-8")
        return Surrogate.load(f"{folder}/surrogate.txt")
