"""What the stages left in a folder, as far as it belongs to the present inputs."""

import json
from functools import cached_property
from pathlib import Path

import f90nml
import numpy as np
import xarray

from ..common.result_files import read_groups, read_json
from ..core import InputError
from ..crystal.elasticity import constant_names
from ..pipeline.inputs_identity import DOCUMENTS, belongs, read_manifest, read_resolved, surrogate_input
from ..pipeline.moduli import as_measured
from ..settings.problem import Problem
from ..surrogate.surrogate import Surrogate

__all__ = ["Results"]


class Results:
    """A folder of results; a stage that did not run, or on other inputs, is an empty document."""

    def __init__(self, folder: Path):
        self.folder = folder
        self.manifest = read_manifest(folder)
        self.resolved = read_resolved(folder, self.manifest)
        self.namelist = f90nml.reads(self.resolved) if self.resolved else {}
        if name := self.group("surrogate").get("file"):
            # A build that was killed may have left a new surrogate beside the documents of the last one.
            self.manifest["inputs"] = self.manifest.get("inputs", {}) | surrogate_input(name, folder, self.namelist_folder)
        found = {stage: read_json(folder / file) for stage, file in DOCUMENTS.items()}
        #: Stages whose documents are of other inputs.
        self.outdated = [stage for stage, document in found.items() if document and not belongs(document, self.manifest)]
        self.documents = {stage: {} if stage in self.outdated else document for stage, document in found.items()}
        problem = self.group("problem")
        self.symmetry = problem.get("symmetry", "")
        self.constants = constant_names(self.symmetry) if self.symmetry else ()
        self.synthetic = bool(problem.get("synthetic", False))
        self.title = problem.get("title") or f"Indentation of {self.symmetry or 'single'} crystals"
        self.kind = self.group("measurements").get("modulus_kind", "indentation_modulus").replace("_", " ")

    @property
    def namelist_folder(self) -> Path:
        """The folder of the namelist that was last used here."""
        return Path(self.manifest.get("namelist", ".")).parent

    def group(self, name: str) -> dict:
        """The variables of a group of the resolved namelist."""
        return self.namelist.get(name, {})

    @property
    def warnings(self) -> list[str]:
        """Those of all documents."""
        return list(dict.fromkeys(line for document in self.documents.values() for line in document.get("warnings", [])))

    @property
    def simulations(self) -> list[dict]:
        """Simulated crystals that did not fail."""
        return [row for row in self.documents["simulate"].get("results", []) if row["indentation_modulus_gpa"] and row["depth_um"]]

    @property
    def theory_moduli(self) -> np.ndarray | None:
        """Theory of `simulations` in GPa, if it is there."""
        simulated, theory = (self.documents[stage].get("results", []) for stage in ("simulate", "theory"))
        if not self.simulations or len(simulated) != len(theory):
            return None
        done = [row["indentation_modulus_gpa"] is not None and bool(row["depth_um"]) for row in simulated]
        return np.array([row["indentation_modulus_gpa"] for row in theory])[done]

    @property
    def bounds(self) -> dict[str, tuple[float, float]]:
        """Bounds of the prior in GPa, by constant."""
        return json.loads(self.posterior.attrs["bounds"]) if self.posterior is not None else {}

    @cached_property
    def posterior(self) -> xarray.Dataset | None:
        """The draws that the document of `extract` is about."""
        if not self.documents["extract"]:
            return None
        if not (self.folder / "posterior.nc").exists():
            return None
        with xarray.open_dataset(read_groups(self.folder / "posterior.nc"), group="posterior", engine="h5netcdf") as file:
            return file.load() if json.loads(file.attrs["inputs"]) == self.documents["extract"]["inputs"] else None

    @cached_property
    def samples(self) -> dict[str, np.ndarray]:
        """Chains (chain, draw) of each constant; nothing where there is no posterior."""
        return {} if self.posterior is None else {name: self.posterior[name].values for name in self.constants}

    def as_measured(self, modulus) -> np.ndarray:
        """Indentation moduli in GPa as the kind that was measured."""
        stated = {name: value for name, value in self.group("measurements").items() if name != "file"}
        return as_measured(
            Problem.from_keywords("report", problem={"symmetry": self.symmetry}, measurements=stated).settings.measurements, modulus
        )

    @cached_property
    def surrogate(self) -> Surrogate | None:
        """The surrogate of the results: in the folder, beside the namelist, or one that comes with the package."""
        name = self.group("surrogate").get("file")
        if not name:
            return None
        try:
            return Surrogate.load(name, symmetry=self.symmetry, output=self.folder, folder=self.namelist_folder)
        except InputError:
            return None
