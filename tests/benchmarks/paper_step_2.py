"""Step 2 of the paper's two case studies on synthetic moduli: its method beside the exact
posterior, in tables and figures.
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
from bayesindent.inference.extract import extract, summary
from bayesindent.report.figures.style import (
    BLACK,
    BLUE,
    GREEN,
    ORANGE,
    RED,
    SKY,
    house_style,
    new_figure,
    stamp_synthetic,
)
from bayesindent.report.formatting import subscript
from bayesindent.settings.problem import Problem
from bayesindent.stages.results_folder import read_posterior
from bayesindent.stages.stage import run_stage
from bayesindent.surrogate.surrogate import Surrogate
from support.csv_tables import column
from support.tree import REFERENCE, SOURCE

__all__ = ["Study"]

INPUTS = SOURCE / "inputs" / "case_studies"
FIGURES = SOURCE / "docs" / "verification" / "figures"

#: What was published, GPa: the paper's means and, where its text has them, sds; and what it
#: compares them with.
PAPER = {
    "cubic": ((222.88, 130.88, 114.13), (4.15, 4.55, 4.11)),
    "hexagonal": ((155, 89, 49, 174, 55), None),
}
OTHERS = {
    "cubic": {"literature": (225, 135, 124), "earlier study": (216, 132, 122)},
    "hexagonal": {"literature": (162, 92, 47, 180, 69)},
}

METALS = {"cubic": "iron", "hexagonal": "titanium"}
REFERENCES = {"cubic": "cubic_fe3si", "hexagonal": "hex_titanium"}

#: A bound that decides, moved away to see what it did.
MOVED = {"cubic": ("C44", 15.0, 250.0), "hexagonal": ("C13", 0.0, 150.0)}

#: Pairs of constants whose ridges are drawn.
PAIRS = {"cubic": (("C11", "C12"), ("C44", "C12")), "hexagonal": (("C11", "C12"), ("C33", "C13"))}

#: Sds of measurements, GPa, for which the posterior is asked beside their own, and lengths of
#: stretches of a chain.
PRECISIONS, STRETCHES = (1.0, 0.2), (500, 5000, 50000)

#: Declinations at which the distribution of the modulus is drawn, degrees, and draws that are
#: carried through a model.
DECLINATIONS, DRAWS = (0, 15, 30, 45, 60, 75, 90), 4000

#: The three posteriors.
METHOD, SAME, EXACT = "the paper's method", "its surrogate, default sampler", "exact posterior"


class Study:
    """The case study of a class: its file in a folder of results, and all posteriors that are
    compared.
    """

    def __init__(self, symmetry: str, folder: Path, simulator: str | None, workers: int):
        self.symmetry, self.folder, self.names = symmetry, folder, constant_names(symmetry)
        self.workers, self.metal = workers, METALS[symmetry]
        reference = json.loads((REFERENCE / f"{REFERENCES[symmetry]}.json").read_text())
        self.truth, self.bounds = (
            np.array(reference["truth"]),
            dict(zip(self.names, zip(*reference["bounds"], strict=True), strict=True)),
        )
        self.namelist = f90nml.read(INPUTS / f"{self.metal}_paper.nml")
        self.namelist["measurements"]["file"] = str(
            (INPUTS / self.namelist["measurements"]["file"]).resolve()
        )
        self.namelist["execution"] = {"workers": workers}
        if simulator:
            self.namelist["simulation"] = {"simulator": simulator}
            self.namelist["specimen"] = {"geometry": "block" if simulator == "fe" else "halfspace"}
        self.documents: dict[str, dict] = {}
        self.draws: dict[str, np.ndarray] = {}

    def run(self) -> None:
        """Both steps as the file says, then the other posteriors."""
        problem = self.problem(self.namelist, self.folder, "run")
        self.build = run_stage(problem, "build", self.folder)
        self.measured = problem.measurements
        self.sample(METHOD, self.namelist, self.folder)
        self.surrogate = Surrogate.load(self.folder / "surrogate.txt")
        self.sample(SAME, self.changed(self.folder / "surrogate.txt"), self.folder / "same")
        self.sample(EXACT, self.changed("halfspace"), self.folder / "exact")
        name, low, high = MOVED[self.symmetry]
        moved = self.changed("halfspace")
        for variable, value in (("c_min", low), ("c_max", high)):
            moved["prior"][variable][self.names.index(name)] = value
        self.sample(f"exact, {name} from {low:g} to {high:g}", moved, self.folder / "moved")

    def changed(self, surrogate) -> f90nml.Namelist:
        """Step 2 alone, with another surrogate and the default sampler."""
        namelist = self.namelist.copy()
        for group in ("simulation", "domain", "design"):
            del namelist[group]
        namelist["surrogate"] = {"file": str(surrogate)}
        if surrogate == "halfspace":
            namelist["specimen"] = {"geometry": "halfspace"}
        namelist["sampler"] = {"samples": 50000, "surrogate_variance": "none"}
        return namelist

    def problem(self, namelist: f90nml.Namelist, folder: Path, command: str) -> Problem:
        """The problem of a namelist, which is kept in its folder."""
        folder.mkdir(parents=True, exist_ok=True)
        namelist.write(folder / f"{self.metal}_paper.nml", force=True)
        return Problem(folder / f"{self.metal}_paper.nml", command)

    def sample(self, label: str, namelist: f90nml.Namelist, folder: Path) -> None:
        """A posterior: its document, and its draws (chains, samples, k)."""
        self.documents[label] = run_stage(
            self.problem(namelist, folder, "extract"), "extract", folder
        )
        self.draws[label] = read_posterior(folder)["draws"][..., : len(self.names)]

    def tables(self) -> None:
        """Print what was published beside what is found here."""
        print(
            f"\n{self.metal}: step 1 of {self.build['simulations']} points, leave-one-out "
            f"{self.build['loocv_gpa']:.2f} GPa"
        )
        print(f"{'GPa':32}" + "".join(f"{name:>18}" for name in self.names))
        mean, sd = PAPER[self.symmetry]
        self.row("paper, measured moduli", mean, sd)
        for label, values in OTHERS[self.symmetry].items():
            self.row(label, values)
        self.row("truth of the synthetic moduli", self.truth)
        for label, document in self.documents.items():
            found = list(document["parameters"].values())
            self.row(label, column(found, "mean"), column(found, "sd"))
            of_chains = self.draws[label].mean(axis=1)
            if label == METHOD:
                print(
                    f"{'  means of its chains':32}"
                    + "".join(
                        f"{low:8.1f} to {high:6.1f}"
                        for low, high in zip(
                            of_chains.min(axis=0), of_chains.max(axis=0), strict=True
                        )
                    )
                )
            print(
                f"{'  effective samples, R-hat':32}"
                + "".join(f"{item['ess_bulk']:11.0f}, {item['r_hat']:.2f}" for item in found)
            )
        print(
            f"\nsd within stretches of one of its chains, GPa (median)\n{'samples':32}"
            + "".join(f"{name:>18}" for name in self.names)
        )
        for length in STRETCHES:
            parts = self.draws[METHOD].reshape(-1, length, len(self.names))
            self.row(str(length), np.median(parts.std(axis=1), axis=0))
        if self.symmetry == "hexagonal":
            print(
                "\nsd of the modulus by declination, GPa\n"
                + f"{'degrees':32}"
                + "".join(f"{angle:10d}" for angle in DECLINATIONS)
            )
            for label in (METHOD, EXACT):
                print(
                    f"{label:32}"
                    + "".join(
                        f"{value:10.2f}" for value in self.moduli(label, DECLINATIONS).std(axis=0)
                    )
                )

    def row(self, label: str, mean, sd=None) -> None:
        """Print one line of the constants."""
        cells = [
            f"{m:.1f}" if sd is None else f"{m:.1f} ± {s:.1f}"
            for m, s in zip(mean, mean if sd is None else sd, strict=True)
        ]
        print(f"{label:32}" + "".join(f"{cell:>18}" for cell in cells), flush=True)

    def precision_table(self) -> None:
        """Print the sds that moduli without noise would leave, by the sd that is stated of them."""
        crystal = stiffness(self.symmetry, **dict(zip(self.names, self.truth, strict=True)))
        angles, cap = self.measured.euler_deg, self.namelist["prior"]["anisotropy_cap"]
        moduli = halfspace_modulus(crystal, angles)
        print(
            f"\nsds from moduli without noise, GPa\n{'stated sd, model':32}"
            + "".join(f"{name:>18}" for name in self.names)
        )
        for sd in (self.measured.sd_gpa[0], *PRECISIONS):
            table = {"euler_deg": angles, "modulus_gpa": moduli, "sd_gpa": np.full(len(moduli), sd)}
            for label, model in (("exact", "halfspace"), ("the paper's surrogate", self.surrogate)):
                found = extract(
                    table,
                    surrogate=model,
                    symmetry=self.symmetry,
                    bounds=self.bounds,
                    anisotropy_cap=cap,
                    modulus_kind="indentation_modulus",
                    surrogate_variance="none",
                    seed=1,
                    workers=self.workers,
                )
                constants = summary(found)["parameters"].values()
                self.row(f"{sd:g}, {label}", column(constants, "mean"), column(constants, "sd"))

    def moduli(self, label: str, declinations) -> np.ndarray:
        """Moduli (draws, angles) of draws of a posterior by the model that it has, over
        declinations in degrees.
        """
        flat = self.draws[label].reshape(-1, len(self.names))
        crystals = stiffness_rows(
            self.symmetry, flat[np.linspace(0, len(flat) - 1, DRAWS).astype(int)]
        )
        angles = np.array([(0.0, angle, 0.0) for angle in declinations])
        model = (
            Surrogate.load("halfspace", symmetry=self.symmetry)
            if label != METHOD
            else self.surrogate
        )
        return np.asarray(model.predict(crystals[:, None], angles)[0])

    def figures(self) -> None:
        """Write the figures of the case study."""
        with house_style():
            self.save(self.marginals(), f"{self.metal}_paper_marginals.svg")
            self.save(self.ridges(), f"{self.metal}_paper_ridges.png")
            if self.symmetry == "hexagonal":
                self.save(self.predictions(), f"{self.metal}_paper_predictions.svg")

    @staticmethod
    def save(figure, name: str) -> None:
        """Write a figure into the documentation, marked as synthetic."""
        stamp_synthetic(figure)
        figure.savefig(
            FIGURES / name, metadata={"Date": None} if name.endswith("svg") else None, dpi=130
        )

    def marginals(self):
        """Figs. 4 and 9: the distribution of each constant."""
        rows = -(-len(self.names) // 3)
        figure = new_figure(2.3 * rows + 0.3)
        grid = figure.subplots(rows, 3, squeeze=False).ravel()
        for spare in grid[len(self.names) :]:
            spare.remove()
        mean, sd = PAPER[self.symmetry]
        for j, (axes, name) in enumerate(zip(grid, self.names, strict=False)):
            bounds = self.bounds[name]
            method, exact = (self.draws[label][:, :, j] for label in (METHOD, EXACT))
            low, high = min(method.min(), exact.min()), max(method.max(), exact.max())
            bins = np.linspace(low, high, 41)
            axes.hist(
                method.ravel(),
                bins,
                density=True,
                color=SKY,
                alpha=0.6,
                lw=0,
                label="the paper's method, 4 chains",
            )
            for chain in method:
                axes.hist(
                    chain,
                    bins,
                    density=True,
                    histtype="step",
                    color=BLUE,
                    lw=0.6,
                    label="each of them",
                )
            axes.hist(
                exact.ravel(),
                bins,
                density=True,
                histtype="step",
                color=BLACK,
                lw=1.4,
                label="exact posterior",
            )
            top = axes.get_ylim()[1]
            error = None if sd is None else sd[j]
            axes.errorbar(
                mean[j],
                1.06 * top,
                xerr=error,
                fmt="o",
                ms=4,
                color=RED,
                label="paper" + (", ± sd" if sd else ""),
            )
            axes.plot(
                OTHERS[self.symmetry]["literature"][j],
                1.14 * top,
                "v",
                ms=5,
                color=ORANGE,
                label="literature",
            )
            axes.axvline(self.truth[j], color=GREEN, lw=1.2, ls="--", label="truth of the data")
            for bound in bounds:
                if low - 0.05 * (high - low) <= bound <= high + 0.05 * (high - low):
                    axes.axvline(bound, color=BLACK, lw=2.5, label="bound")
            axes.set(xlabel=f"{subscript(name)} (GPa)", yticks=[], ylim=(0, 1.2 * top))
            axes.grid(False)
            axes.spines["left"].set_visible(False)
        narrow_legend(figure)
        return figure

    def ridges(self):
        """Pairs of constants, with the paper's estimate."""
        figure = new_figure(3.6)
        mean, sd = PAPER[self.symmetry]
        for axes, pair in zip(figure.subplots(1, 2), PAIRS[self.symmetry], strict=True):
            i, j = (self.names.index(name) for name in pair)
            for label, colour in ((EXACT, BLACK), (METHOD, SKY)):
                flat = self.draws[label].reshape(-1, len(self.names))
                flat = flat[np.linspace(0, len(flat) - 1, 2500).astype(int)]
                axes.plot(
                    flat[:, i],
                    flat[:, j],
                    ".",
                    ms=3,
                    mew=0,
                    alpha=0.5,
                    color=colour,
                    label=label,
                    rasterized=True,
                )
            limits = axes.get_xlim(), axes.get_ylim()
            if sd is None:
                axes.plot(mean[i], mean[j], "o", ms=5, color=RED, label="paper")
            else:
                axes.errorbar(
                    mean[i],
                    mean[j],
                    xerr=sd[i],
                    yerr=sd[j],
                    fmt="o",
                    ms=4,
                    color=RED,
                    label="paper, ± sd",
                )
            literature = OTHERS[self.symmetry]["literature"]
            axes.plot(literature[i], literature[j], "v", ms=7, color=ORANGE, label="literature")
            axes.plot(
                self.truth[i],
                self.truth[j],
                "*",
                ms=9,
                color=GREEN,
                mec="white",
                mew=0.5,
                label="truth of the data",
            )
            for name, line, (low, high) in zip(
                pair, (axes.axvline, axes.axhline), limits, strict=True
            ):
                for bound in self.bounds[name]:
                    if low <= bound <= high:
                        line(bound, color=BLACK, lw=0.8, ls=":", label="bound")
            axes.set(xlabel=f"{subscript(pair[0])} (GPa)", ylabel=f"{subscript(pair[1])} (GPa)")
        narrow_legend(figure)
        return figure

    def predictions(self):
        """Fig. 10: the modulus over the declination, and its distribution at some."""
        figure = new_figure(3.8)
        left, right = figure.subplots(1, 2)
        angle = np.linspace(0, 90, 46)
        for label, colour in ((METHOD, BLUE), (EXACT, BLACK)):
            moduli = self.moduli(label, angle)
            mean, sd = moduli.mean(axis=0), moduli.std(axis=0)
            if label == METHOD:
                left.fill_between(
                    angle,
                    mean - 2 * sd,
                    mean + 2 * sd,
                    color=SKY,
                    alpha=0.5,
                    lw=0,
                    label=f"{label}, ± 2 sd",
                )
            else:
                for side in (-2, 2):
                    left.plot(
                        angle,
                        mean + side * sd,
                        color=colour,
                        lw=0.9,
                        ls="--",
                        label=f"{label}, ± 2 sd",
                    )
            at_some = self.moduli(label, DECLINATIONS)
            for place, values in zip(DECLINATIONS, at_some.T, strict=True):
                density, edges = np.histogram(values, np.arange(115, 149, 0.5), density=True)
                middle = (edges[1:] + edges[:-1]) / 2
                shown = density > 0
                right.plot(
                    middle[shown],
                    place + 13 * density[shown],
                    color=colour,
                    lw=1.1,
                    ls="-" if label == METHOD else "--",
                )
        truth = stiffness(self.symmetry, **dict(zip(self.names, self.truth, strict=True)))
        curve = halfspace_modulus(truth, np.array([(0.0, value, 0.0) for value in angle]))
        left.plot(angle, curve, color=GREEN, lw=1.2, label="truth of the data")
        folded = 90 - np.abs(90 - self.measured.euler_deg[:, 1])
        left.errorbar(
            folded,
            self.measured.modulus_gpa,
            self.measured.sd_gpa,
            fmt="o",
            ms=2.5,
            lw=0.6,
            color=RED,
            label="measured, ± sd",
        )
        left.set(
            xlabel="declination of the c axis (degrees)",
            ylabel="indentation modulus (GPa)",
            xlim=(-2, 92),
        )
        right.set(
            xlabel="indentation modulus (GPa)",
            ylabel="declination of the c axis (degrees)",
            yticks=DECLINATIONS,
        )
        narrow_legend(figure)
        return figure


def narrow_legend(figure) -> None:
    """One legend above all axes, in columns that leave room for the mark of synthetic data."""
    entries = {
        label: handle
        for axes in figure.axes
        for handle, label in zip(*axes.get_legend_handles_labels(), strict=True)
    }
    figure.legend(
        entries.values(), entries.keys(), loc="outside upper left", ncols=3, markerscale=1.5
    )
