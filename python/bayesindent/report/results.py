"""Results of all stages in a folder, as far as they belong to the present inputs."""

import json
import re
from collections import defaultdict
from collections.abc import Callable, Sized
from functools import cached_property
from itertools import chain
from pathlib import Path
from typing import Any, TypeVar

import numpy as np
from numpy.typing import ArrayLike

from ..common.diagnostics import diagnostic, distinct
from ..core import InputError, call
from ..crystal.elasticity import class_name, constant_names, stiffness_rows
from ..crystal.metals import metals
from ..settings.problem import Problem, typed
from ..stages.results_folder import (
    DOCUMENTS,
    MANIFEST,
    belongs,
    changed_inputs,
    read_document,
    read_posterior,
    read_resolved,
    surrogate_digest,
    using_documents,
)
from ..surrogate.surrogate import Surrogate

T = TypeVar("T", bound=Sized)


class NothingToShow(Exception):
    """The results lack the data of a figure or section."""


def present(part: T | None) -> T:
    """Return a part of the results. Raises `NothingToShow` if it is None or empty."""
    if part is None or not len(part):
        raise NothingToShow
    return part


class Results:
    """A folder of results, or a result of `bi.extract`.

    The document of a stage is empty if the stage did not run, or ran with other inputs.
    """

    def __init__(self, source: Any):
        #: The result of `bi.extract`, or None for a folder.
        self.result = source if hasattr(source, "posterior") else None
        self.folder = Path() if self.result is not None else Path(source)
        self.manifest: dict = {}
        self.documents: dict[str, dict] = {stage: {} for stage in DOCUMENTS}
        #: Stages whose documents belong to other inputs.
        self.outdated: list[str] = []
        #: Diagnostics of inputs that were edited, and files that were removed, after the results.
        self.edited: list[dict] = []
        if self.result is None:
            with using_documents(self.folder):
                self._read_folder()
                self._arrange()
        else:
            self.resolved = self.result.posterior.attrs["settings"]
            self.documents["extract"] = json.loads(self.result.posterior.attrs["summary"])
            self._arrange()

    def _arrange(self) -> None:
        """Set what several parts of the report use."""
        problem = self.settings["problem"]
        symmetry = problem.get("symmetry")
        self.symmetry = class_name(symmetry) if symmetry else ""
        self.constants = constant_names(symmetry) if symmetry else ()
        self.synthetic = problem.get("synthetic", False)
        self.title = problem.get("title") or f"Indentation of {self.symmetry or 'single'} crystals"
        measured = self.settings["measurements"]
        self.kind = measured.get("modulus_kind", "indentation_modulus").replace("_", " ")
        #: Whether the measured grains have unknown orientations.
        self.without_orientations = measured.get("orientations") == "unknown"
        found = self.extracted.get("predicted", [])
        #: Moduli of the grains, and speeds of waves, measured and predicted.
        self.predicted = [item for item in found if "propagation_deg" not in item]
        self.velocities = [item for item in found if "propagation_deg" in item]
        wave = "wave" if any("wave" in item for item in self.velocities) else "Rayleigh"
        #: The name of the measured speeds.
        self.speed = f"{wave} velocity"
        #: Simulated crystals that did not fail.
        self.simulations = list(filter(succeeded, self.documents["simulate"].get("results", [])))

    def _read_folder(self) -> None:
        folder = self.folder
        if not folder.is_dir():
            raise InputError(f"{folder}: there is no such folder of results")
        self.manifest = read_document(folder, MANIFEST)
        self.resolved = read_resolved(folder)
        if name := self.settings["surrogate"].get("file"):
            # A killed build may have left a new surrogate beside documents of the last one.
            self.manifest["inputs"] = self.manifest.get("inputs", {}) | surrogate_digest(
                name, folder, self.namelist_folder
            )
        for stage in DOCUMENTS:
            document = read_document(folder, stage)
            if belongs(document, self.manifest):
                self.documents[stage] = document
            elif document:
                self.outdated.append(stage)
        self.edited = changed_inputs(folder, self.manifest, self.problem)
        if self.extracted and not (folder / "posterior.bin").exists():
            self.edited.append(diagnostic("posterior_missing", f"{folder / 'posterior.bin'}"))

    #: The documents of `extract` and of `build`.
    extracted = property(lambda self: self.documents["extract"])
    built = property(lambda self: self.documents["build"])

    @property
    def namelist_folder(self) -> Path:
        """The folder of the last namelist."""
        return Path(self.manifest.get("namelist", ".")).parent

    @cached_property
    def problem(self) -> Problem | None:
        """The problem of the last namelist as it is now; None if it cannot be read."""
        try:
            return Problem(self.manifest["namelist"])
        except (KeyError, InputError):
            return None

    @cached_property
    def settings(self) -> dict[str, dict]:
        """The variables of each group of the resolved namelist; {} for other groups."""
        groups: dict[str, dict] = defaultdict(dict)
        if self.resolved:
            path = self.folder / "resolved.nml"
            found = typed(call("settings.values", path=path, content=self.resolved))
            for name, value in found.items():
                group, _, variable = name.partition(".")
                if found[f"{group}.given"] and variable != "given":
                    groups[group][variable] = value
        return groups

    @cached_property
    def reference(self) -> tuple[str, dict[str, float]]:
        """The label and values (GPa) of reference constants; '' and {} if there are none.

        The problem states them, or its title names a pure metal.
        """
        if (stated := self.settings["problem"].get("reference_gpa")) is not None and len(stated):
            values = dict(zip(self.constants, map(float, stated)))
            return "truth" if self.synthetic else "reference", values
        for metal in metals().values():
            named = re.search(rf"\b{metal.name}\b", self.title, re.IGNORECASE)
            if named and metal.symmetry == self.symmetry:
                return f"literature, pure {metal.name}", metal.constants
        return "", {}

    @property
    def warnings(self) -> list[dict]:
        """Diagnostics of edited inputs, then those of all documents."""
        found = [document.get("warnings", []) for document in self.documents.values()]
        return distinct(chain(self.edited, *found))

    def identifiability(self, kind: str) -> list[dict]:
        """Rows of the document of `extract` on each 'combination', 'quantity' or 'knowledge'."""
        return [row for row in self.extracted.get("identifiability", []) if row["kind"] == kind]

    @property
    def theory_moduli(self) -> np.ndarray | None:
        """Moduli of `simulations` by theory in GPa, or None."""
        simulated, theory = (
            self.documents[stage].get("results", []) for stage in ("simulate", "theory")
        )
        if not self.simulations or len(simulated) != len(theory):
            return None
        return np.array(
            [
                exact["indentation_modulus_gpa"]
                for row, exact in zip(simulated, theory)
                if succeeded(row)
            ]
        )

    @cached_property
    def posterior(self) -> dict:
        """The numbers of the posterior, see `read_posterior`; {} if there is none."""
        if self.result is not None:
            return self._from_result(self.result)
        found = read_posterior(self.folder) if self.extracted else {}
        if found and found["inputs"] != json.dumps(self.extracted["inputs"])[1:-1]:
            return {}
        return found

    def _from_result(self, result: Any) -> dict:
        """The same from the groups of ArviZ, as far as figures and comparisons need it."""

        def joined(join: Callable, group: Any) -> np.ndarray:
            return join([item.values for item in group.data_vars.values()], axis=-1)

        return {
            "draws": joined(np.stack, result.posterior),
            "prior_draws": joined(np.stack, result.prior),
            "stride": int(np.diff(result.log_likelihood["draw"][:2]).sum()) or 1,
            "log_likelihood": joined(np.concatenate, result.log_likelihood),
            "modulus_gpa": joined(np.concatenate, result.observed_data),
        }

    @cached_property
    def samples(self) -> dict[str, np.ndarray]:
        """Draws (chain, draw) of each constant in GPa; {} without a posterior."""
        if not self.posterior:
            return {}
        return {name: self.posterior["draws"][..., j] for j, name in enumerate(self.constants)}

    def draws(self, count: int) -> np.ndarray:
        """Stiffness (n, 6, 6) in GPa of at most `count` draws, evenly over the posterior."""
        table = np.stack([chains.ravel() for chains in self.samples.values()], axis=1)
        return stiffness_rows(
            self.symmetry, table[np.linspace(0, len(table) - 1, min(len(table), count)).astype(int)]
        )

    def as_measured(self, modulus: ArrayLike) -> np.ndarray:
        """Convert indentation moduli (GPa) to the measured kind of modulus."""
        group = self.settings["measurements"]
        constants = ("indenter_modulus_gpa", "indenter_nu", "sample_nu")
        found = call(
            "crystal.moduli_of_kind",
            kind=self.kind.replace(" ", "_"),
            moduli=modulus,
            **{name: group.get(name, 0.0) for name in constants},
        )
        return found["values"].reshape(np.shape(modulus))

    @cached_property
    def shared_factor(self) -> float:
        """The factor that the measured moduli share, by least squares; 1 where it is known."""
        factors = (self.extracted.get("laboratory") or {}).get("log_factor", [])
        grains = [item for item in self.predicted if item.get("measured_sd")]
        if len(factors) != 1 or not factors[0]["prior_sd"] or not grains:
            return 1.0
        measured = np.array([item["measured"] for item in grains])
        mean = np.array([item["mean"] for item in grains])
        sd = np.array([item["measured_sd"] for item in grains])
        return float(np.sum(measured * mean / sd**2) / np.sum((mean / sd) ** 2))

    @property
    def scatter(self) -> float:
        """The inferred relative sd of the scatter between grains; 0 where it is not inferred."""
        return self.extracted.get("parameters", {}).get("scatter", {}).get("mean", 0.0)

    def residual(self, item: dict) -> float:
        """Measured minus predicted modulus, with the shared factor, in units of the sd, to which
        the scatter between grains contributes.
        """
        mean = self.shared_factor * item["mean"]
        return (item["measured"] - mean) / float(np.hypot(item["measured_sd"], self.scatter * mean))

    @cached_property
    def surrogate(self) -> Surrogate | None:
        """The surrogate: in the folder, beside the namelist, or one that comes with the package."""
        held: Any = None
        if self.result is not None:
            facts = self.result.posterior.attrs | self.result.posterior.encoding
            held = facts.get("surrogate")
        if isinstance(held, Surrogate):
            return held
        # Namelists of the library need not state the name of the surrogate.
        name = (
            held or self.settings["surrogate"].get("file") or Path(self.built.get("file", "")).name
        )
        try:
            return Surrogate.load(
                name, symmetry=self.symmetry, output=self.folder, folder=self.namelist_folder
            )
        except InputError:
            return None


def succeeded(simulation: dict) -> bool:
    """Whether a simulation has a modulus and a curve."""
    return bool(simulation["indentation_modulus_gpa"] and simulation["depth_um"])
