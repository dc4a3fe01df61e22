"""Step 2 of the paper's two case studies on synthetic moduli: its method, and beside it other
samplers, surrogates and bounds.
"""

import json
from pathlib import Path

import f90nml
import numpy as np

from bayesindent.crystal.elasticity import (
    constant_names,
    halfspace_modulus,
    stiffness,
    stiffness_rows,
)
from bayesindent.settings.problem import Problem
from bayesindent.stages.results_folder import read_posterior
from bayesindent.stages.stage import run_stage
from bayesindent.step_2 import extract, summary
from bayesindent.surrogate.surrogate import Surrogate
from reproduction.published import STUDIES
from reproduction.studies import build, kept, namelist_of, problem_of
from support.csv_tables import column
from support.tree import REFERENCE

__all__ = ["BLOCK", "DECLINATIONS", "EXACT", "METHOD", "SAME", "Study"]

METALS = {"cubic": "iron", "hexagonal": "titanium"}
REFERENCES = {"cubic": "cubic_fe3si", "hexagonal": "hex_titanium"}

#: A bound that decides, moved away to see what it did.
MOVED = {"cubic": ("C44", 15.0, 250.0), "hexagonal": ("C13", 0.0, 150.0)}

#: Sds of measurements, GPa, for which the posterior is asked beside their own, and lengths of
#: stretches of a chain.
PRECISIONS, STRETCHES = (1.0, 0.2), (500, 5000, 50000)

#: Declinations at which the distribution of the modulus is drawn, degrees, and draws that are
#: carried through a model.
DECLINATIONS, DRAWS = (0, 15, 30, 45, 60, 75, 90), 4000

#: The posteriors.
METHOD, SAME, EXACT = "the paper's method", "its surrogate, default sampler", "exact posterior"
BLOCK = "the paper's method trained on the paper's block"


class Study:
    """The constants of a class in a folder: the case study's file, and all posteriors that are
    compared with it.

    `documents` and `draws` (chains, samples, k) are by the names of the posteriors.
    """

    def __init__(self, symmetry: str, folder: Path, workers: int):
        self.symmetry, self.folder, self.workers = symmetry, folder, workers
        self.names, self.metal = constant_names(symmetry), METALS[symmetry]
        self.paper = STUDIES[symmetry]
        self.published = self.paper["mean"], self.paper["sd"]
        reference = json.loads((REFERENCE / f"{REFERENCES[symmetry]}.json").read_text())
        self.reference, self.truth = reference, np.array(reference["truth"])
        self.bounds = dict(zip(self.names, zip(*reference["bounds"], strict=True), strict=True))
        self.namelist = namelist_of(self.metal, workers)
        self.documents: dict[str, dict] = {}
        self.draws: dict[str, np.ndarray] = {}

    def run(self, block: Path | None) -> None:
        """Both steps as the file says, then the other posteriors; `block`: the surrogate that is
        trained on the paper's block.
        """
        self.build = build(self.namelist, self.folder)
        problem = Problem(self.folder / "problem.nml", "run")
        self.measured = problem.measurements
        surrogate = self.folder / "surrogate.txt"
        method = {"sampler": dict(self.namelist["sampler"])}
        self.sample(METHOD, self.changed(surrogate, **method), "method")
        self.surrogate = Surrogate.load(surrogate)
        self.sample(SAME, self.changed(surrogate), "same")
        exact = self.changed("halfspace")
        self.sample(EXACT, exact, "exact")
        name, low, high = MOVED[self.symmetry]
        moved = self.changed("halfspace")
        for variable, value in (("c_min", low), ("c_max", high)):
            moved["prior"][variable][self.names.index(name)] = value
        self.sample(f"exact, {name} from {low:g} to {high:g}", moved, "moved")
        if block is not None:
            self.sample(BLOCK, self.changed(block.absolute(), **method), "block")

    def changed(self, surrogate: str | Path, **groups: dict) -> f90nml.Namelist:
        """Step 2 alone, with another surrogate and the default sampler, or these groups."""
        sampler = {"samples": 50000, "surrogate_variance": "none"}
        groups = {"surrogate": {"file": str(surrogate)}, "sampler": sampler} | groups
        namelist = namelist_of(self.metal, self.workers)
        for group in ("simulation", "domain", "design", "surrogate", "sampler"):
            del namelist[group]
        for group, variables in groups.items():
            namelist[group] = variables
        if surrogate == "halfspace":
            namelist["specimen"] = {"geometry": "halfspace"}
        return namelist

    def sample(self, label: str, namelist: f90nml.Namelist, name: str) -> None:
        """A posterior, which is kept: its document, and its draws."""
        folder = self.folder / name
        file = Path(namelist["surrogate"]["file"])
        trained = Surrogate.load(file).coefficients.tolist() if file.suffix else []
        stated = namelist.todict() | {"surrogate": file.name, "execution": ""}
        self.documents[label] = kept(
            folder / "kept.json",
            [stated, trained],
            lambda: run_stage(problem_of(namelist, folder, "extract"), "extract", folder),
        )
        self.draws[label] = read_posterior(folder)["draws"][..., : len(self.names)]

    def parameters(self, label: str, name: str) -> list[float]:
        """A number of each constant in a posterior's document."""
        return column(self.documents[label]["parameters"].values(), name)

    def stretches(self) -> dict[int, np.ndarray]:
        """Median of the sds of each constant within stretches of a chain of the paper's method, by
        their length.
        """
        draws = self.draws[METHOD]
        lengths = [length for length in STRETCHES if length <= draws.shape[1]]
        found = {}
        for length in lengths:
            whole = draws[:, : draws.shape[1] // length * length]
            parts = whole.reshape(-1, length, len(self.names))
            found[length] = np.median(parts.std(axis=1), axis=0)
        return found

    def precisions(self) -> list[dict]:
        """Sds that moduli without noise would leave, by the sd that is stated of them and by the
        model, kept.
        """
        crystal = stiffness(self.symmetry, **dict(zip(self.names, self.truth, strict=True)))
        angles, cap = self.measured.euler_deg, self.namelist["prior"]["anisotropy_cap"]
        moduli = halfspace_modulus(crystal, angles)
        models = {"exact": "halfspace", "the paper's surrogate": self.surrogate}

        def compute() -> list[dict]:
            found = []
            for sd in (float(self.measured.sd_gpa[0]), *PRECISIONS):
                table = {
                    "euler_deg": angles,
                    "modulus_gpa": moduli,
                    "sd_gpa": np.full(len(moduli), sd),
                }
                for label, model in models.items():
                    result = extract(
                        table,
                        surrogate=model,
                        symmetry=self.symmetry,
                        bounds=self.bounds,
                        anisotropy_cap=cap,
                        modulus_kind="indentation_modulus",
                        technique="exact",
                        surrogate_variance="none",
                        seed=1,
                        workers=self.workers,
                    )
                    sds = column(summary(result)["parameters"].values(), "sd")
                    found.append({"stated": sd, "model": label, "sds": sds})
            return found

        return kept(self.folder / "precisions.json", self.surrogate.coefficients.tolist(), compute)

    def moduli(self, label: str, declinations) -> np.ndarray:
        """Moduli (draws, angles) of draws of a posterior by the model that it has, over
        declinations in degrees.
        """
        flat = self.draws[label].reshape(-1, len(self.names))
        chosen = np.linspace(0, len(flat) - 1, DRAWS).astype(int)
        crystals = stiffness_rows(self.symmetry, flat[chosen])
        angles = np.array([(0.0, angle, 0.0) for angle in declinations])
        if label == METHOD:
            return np.asarray(self.surrogate.predict(crystals[:, None], angles)[0])
        return halfspace_modulus(crystals[:, None], angles)
