"""Simulation-based calibration of Step 2 (Talts et al. 2018): classes, every kind of error and
knowledge, and a rough correction.

Truths are drawn from the prior within explicit bounds, or from the default prior (below),
measurements from the model that is assumed: with what a group shares, heavy tails, one unknown
scale, tilted directions, or a bulk modulus known beforehand; moduli are those of the exact theory,
or drawn with what a correction does not know, which all grains share. The rank of each truth among
the draws of its posterior must be uniform: of every constant, and of the logarithm of the density.
p-values are those of a chi-square test with ten bins, after Holm's correction over all that one run
has looked at.

The default prior has its scale about the mean measurement, and so depends on the data. Truths are
drawn with the scale about a number that is fixed before, CENTRE, and the draws of each posterior
are weighted by the ratio of the prior with this scale to that with the data's: the ranks are exact.
They are also tested without weights, as users get them. What extract would call unusable (R-hat,
effective samples) depends on data and chains alone, not on the truth, so that the ranks of the
other data sets must be uniform by themselves: p-values of all data sets, and of the usable ones.

    ./bayesindent dev bench calibration                       # all cases, 200 data sets each: hours
    ./bayesindent dev bench calibration --case cubic --repeats 50
    ./bayesindent dev bench calibration --keep ranks.csv      # goes on after an interruption
"""

import argparse
import csv
import time
from pathlib import Path

import numpy as np
from scipy import stats

from bayesindent.crystal.elasticity import (
    constant_names,
    halfspace_modulus,
    quantities,
    rayleigh_velocity,
    stiffness_rows,
)
from bayesindent.surrogate.surrogate import Surrogate
from benchmarks.bench_studies import BINS, DRAWS, effective_size, holm
from benchmarks.reference_density import LogPosterior
from benchmarks.reference_posteriors import SYNONYMS
from support.csv_tables import row_named
from support.densities import PRIOR, Posterior
from support.learner import terms_of
from support.tree import REFERENCE

#: Errors of speeds that they share.
SPEEDS = {"velocity_calibration_sd": 0.01, "density_kg_m3": 5000.0, "density_sd_kg_m3": 100.0}
#: Name of the case: crystal of crystals.csv, grains, and what is added to a normal likelihood.
CASES: dict[str, tuple[str, int, dict]] = {
    "cubic": ("copper", 12, {}),
    "hexagonal": ("Zn", 16, {}),
    "trigonal": ("quartz", 20, {}),
    "orthorhombic": ("forsterite", 30, {}),
    "calibration factor": ("copper", 12, {"calibration_sd": 0.03}),
    "groups": ("copper", 12, {"calibration_sd": 0.03, "group": 3}),
    "Student's t": ("copper", 12, {"likelihood": "student", "student_dof": 4.0}),
    "inferred scale": ("copper", 12, {"scale": "inferred"}),
    "orientation sd": ("copper", 12, {"orientation_sd_deg": 3.0}),
    "orientation sd, few": ("copper", 6, {"orientation_sd_deg": 5.0}),
    # Factor, contrast and scatter of plastic imprints, drawn from their priors.
    "laboratory, cubic": ("copper", 12, {"technique": "oliver_pharr", "scatter": "inferred"}),
    "laboratory, hexagonal": ("Zn", 16, {"technique": "oliver_pharr", "scatter": "inferred"}),
    "knowledge": ("copper", 12, {"knowledge": {"bulk_modulus": 0.1}}),
    "default prior, cubic": ("copper", 12, {"default": 2}),
    "default prior, hexagonal": ("Zn", 16, {"default": 3}),
    "default prior, tetragonal": ("rutile", 20, {"default": 4}),
    # Of the paper's block, taught by so many simulations, with measurements about as good as it is.
    "correction, cubic": ("copper", 12, {"simulations": 10, "noise": 0.001}),
    "correction, orthorhombic": ("forsterite", 16, {"simulations": 10, "noise": 0.002}),
    "misalignment": ("Zn", 12, {"misalignment_sd_deg": 3.0}),
    # As many speeds at 0.5 % as moduli, with errors that each kind shares, or each of two groups of
    # a kind.
    "speeds, cubic": ("copper", 8, {"calibration_sd": 0.03, **SPEEDS}),
    "speeds, hexagonal": ("Zn", 10, {"calibration_sd": 0.03, "group": 2, **SPEEDS}),
}
#: Relative sd of a measurement, and of the bounds about the literature's constants.
NOISE, HALF_WIDTH = 0.02, 0.3
#: GPa; and orientations whose moduli are ranked, as many as there are visible combinations
#: (`default` of a case).
CENTRE, VISIBLE = 140.0, np.array([[0, 0, 0], [0, 54.7356, 45], [0, 90, 0], [0, 45, 0]], float)
#: GPa; other measurements are refused. This, too, depends on the data alone.
PLAUSIBLE = 1.0, 2000.0
#: The prior of the factor on unknown sds: its logarithm is uniform.
FACTORS = 0.05, 50.0
#: Mean and sd of ln f, of ln(1+k) and of the logarithm of the scatter.
FACTOR, CONTRAST, SCATTER = (0.1, 0.15), (-0.15, 0.4), (np.log(0.01), np.log(3))
#: Orientations for the mean of the logarithm of a modulus.
EVERYWHERE = np.column_stack(
    [np.zeros(400), np.degrees(np.arccos((np.arange(400) + 0.5) / 400)), 137.508 * np.arange(400)]
)


class Study:
    """One case: truths, and the posteriors of data made with them."""

    def __init__(self, name: str, seed: int):
        crystal, self.grains, extra = CASES[name]
        row = row_named(REFERENCE / "crystals.csv", crystal)
        self.symmetry = row["symmetry"]
        self.names = constant_names(self.symmetry)
        self.typical = np.array([float(row[constant]) for constant in self.names])
        self.stream = [seed, list(CASES).index(name)]
        self.rng = np.random.default_rng(self.stream)
        width = HALF_WIDTH * np.maximum(np.abs(self.typical), 0.2 * self.typical.max())
        self.low, self.high = self.typical - width, self.typical + width
        self.extra = dict(extra)
        self.group = self.extra.pop("group", 0)
        self.noise = self.extra.pop("noise", NOISE)
        self.visible = self.extra.pop("default", 0)
        self.laboratory = "technique" in self.extra
        self.inferred = self.extra.get("scale") == "inferred"
        self.correction = (
            rough_correction(self.extra.pop("simulations")) if "simulations" in self.extra else None
        )
        self.settings = {
            "symmetry": self.symmetry,
            "surrogate": self.correction or Surrogate.load("halfspace"),
            "modulus_kind": "indentation_modulus",
            "bounds": dict(zip(self.names, zip(self.low, self.high, strict=True), strict=True)),
            **self.extra,
        }
        if self.visible:
            del self.settings["bounds"]
            self.prior = LogPosterior(
                SYNONYMS.get(self.symmetry, self.symmetry), None, np.array([CENTRE]), None
            )
        self.known = None
        if "knowledge" in self.extra:
            ((quantity, relative),) = self.extra["knowledge"].items()
            mean = float(quantities(self.symmetry, self.typical, [quantity])[quantity])
            self.known = quantity, mean, relative * mean
            self.settings["knowledge"] = {quantity: (mean, relative * mean)}

    def truth(self) -> np.ndarray:
        """A point of the prior, by rejection where there are bounds."""
        if self.visible:
            return self.prior.crystals(self.prior.draw_prior(self.rng))[0]
        settings = {
            key: value
            for key, value in self.settings.items()
            if key in ("symmetry", "surrogate", "modulus_kind", "bounds")
        }
        table = self.table(self.typical, np.zeros((1, 3)))
        prior = Posterior.of(table, what=PRIOR, **settings)
        while True:
            point = self.low + (self.high - self.low) * self.rng.random(len(self.low))
            if not np.isfinite(prior.evaluate(point[None])[0][0]):
                continue
            if self.known:
                quantity, mean, sd = self.known
                value = float(quantities(self.symmetry, point, [quantity])[quantity])
                if self.rng.random() > np.exp(-0.5 * ((value - mean) / sd) ** 2):
                    continue
            return point

    def table(self, constants: np.ndarray, euler_deg: np.ndarray) -> dict:
        """The columns of exact measurements."""
        modulus = halfspace_modulus(stiffness_rows(self.symmetry, [constants])[0], euler_deg)
        columns = dict(zip(("phi1_deg", "Phi_deg", "phi2_deg"), euler_deg.T, strict=True))
        return {**columns, "modulus_gpa": modulus, "sd_gpa": self.noise * modulus}

    def measure(self, truth: np.ndarray) -> tuple[dict, list[float]]:
        """Measurements of a truth with all the errors of the case, and what was drawn for the
        parameters beside the constants.
        """
        rng, n = self.rng, self.grains
        euler = np.column_stack(
            [
                rng.uniform(0, 360, n),
                np.degrees(np.arccos(rng.uniform(-1, 1, n))),
                rng.uniform(0, 360, n),
            ]
        )
        true = euler
        if "orientation_sd_deg" in self.extra:
            true = tilted(
                euler, np.radians(self.extra["orientation_sd_deg"]) * rng.normal(size=(2, n))
            )
        if "misalignment_sd_deg" in self.extra:
            true = tilted(
                euler,
                np.radians(self.extra["misalignment_sd_deg"])
                * rng.normal(size=(2, 1)).repeat(n, axis=1),
            )
        table = self.table(truth, euler)
        # By the theory as the posterior reads it, so that sds however small find no difference.
        plain = {
            key: value
            for key, value in self.settings.items()
            if key in ("symmetry", "surrogate", "modulus_kind", "bounds")
        }
        grains = table | {"modulus_gpa": np.clip(table["modulus_gpa"], *PLAUSIBLE)}
        exact = Posterior.of(grains, **plain)
        modulus = (
            self.simulated(truth, true) if self.correction else exact.moduli(truth, true)[0][0]
        )
        sd = table["sd_gpa"]
        noise, drawn = rng.normal(size=n), []
        if self.laboratory:
            mean = np.log(exact.moduli(truth, EVERYWHERE)[0][0]).mean()
            drawn = [rng.normal(*CONTRAST), rng.normal(*SCATTER)]
            modulus = np.exp(FACTOR[0] + mean + np.exp(drawn[0]) * (np.log(modulus) - mean))
            scatter = np.exp(drawn[1]) * modulus * rng.normal(size=n)
            modulus = modulus * (1 + FACTOR[1] * rng.normal()) + scatter
        if "student_dof" in self.extra:
            dof = self.extra["student_dof"]
            noise = rng.standard_t(dof, n) * np.sqrt((dof - 2) / dof)
        if self.inferred:
            factor = FACTORS[0] * (FACTORS[1] / FACTORS[0]) ** rng.random()
            sd = table["sd_gpa"] = 0.003 * modulus
            noise, drawn = factor * noise, [np.log(factor)]
        if "calibration_sd" in self.extra:
            of = np.arange(n) % max(1, self.group)
            modulus = modulus * (
                1 + self.extra["calibration_sd"] * rng.normal(size=max(1, self.group))[of]
            )
            if self.group:
                table["group"] = [f"tip {k}" for k in of]
        table["modulus_gpa"] = modulus + sd * noise
        if "density_kg_m3" in self.extra:
            self.settings["velocities"] = self.speeds(truth, euler)
        return table, drawn

    def speeds(self, truth: np.ndarray, euler_deg: np.ndarray) -> dict:
        """Speeds in random directions of the same grains: the density of a truth is another one, to
        first order.
        """
        rng, along, density = (
            self.rng,
            self.rng.uniform(0, 180, len(euler_deg)),
            self.extra["density_kg_m3"],
        )
        exact = rayleigh_velocity(
            stiffness_rows(self.symmetry, [truth])[0], euler_deg, along, density
        )
        of = np.arange(len(along)) % max(1, self.group)
        share = self.extra["velocity_calibration_sd"] * rng.normal(size=of.max() + 1)[of]
        share = share - 0.5 * self.extra["density_sd_kg_m3"] / density * rng.normal()
        measured = exact * (1 + share) + 0.005 * exact * rng.normal(size=len(along))
        columns = {
            "rayleigh_velocity_m_s": measured,
            "sd_m_s": 0.005 * exact,
            "group": [f"day {k}" for k in of],
        }
        return {"euler_deg": euler_deg, "propagation_deg": along, **columns}

    def simulated(self, constants: np.ndarray, euler_deg: np.ndarray) -> np.ndarray:
        """Moduli of grains by coefficients of the correction that are drawn from what is known of
        them.
        """
        # The constants of a triclinic crystal, row by row.
        triclinic = stiffness_rows(self.symmetry, [constants])[0][np.triu_indices(6)]
        terms, theory = terms_of(
            self.correction.basis, np.tile(triclinic, (len(euler_deg), 1)), euler_deg
        )
        coefficients = self.rng.multivariate_normal(
            self.correction.coefficients, self.correction.covariance, method="cholesky"
        )
        return theory * np.exp(
            coefficients @ terms + self.rng.normal(size=len(theory)) / np.sqrt(self.correction.beta)
        )

    @property
    def labels(self) -> list[str]:
        """What is ranked."""
        moduli = [f"modulus {k + 1}" for k in range(self.visible)]
        beside = ["contrast", "scatter"] * self.laboratory + ["scale"] * self.inferred
        return [*self.names, *beside, "log density", *moduli]

    @property
    def kept(self) -> list[str]:
        """What is kept of a data set: the ranks, and with the default prior those without weights
        and whether it is usable.
        """
        return (
            self.labels
            if not self.visible
            else [*self.labels, *(f"{label}, as given" for label in self.labels), "usable"]
        )

    def ranks(
        self, threads: int, seed: int, *, samples: int = 1000, burn_in: int = 4000, chains: int = 4
    ) -> np.ndarray:
        """Share of the draws below the truth, of which half a draw more: of each parameter, and of
        the logarithm of the density.

        What `kept` lists.
        """
        self.rng = np.random.default_rng([*self.stream, seed])
        while True:
            truth = self.truth()
            table, drawn = self.measure(truth)
            if (
                PLAUSIBLE[0] < table["modulus_gpa"].min()
                and table["modulus_gpa"].max() < PLAUSIBLE[1]
            ):
                break
        posterior = Posterior.of(table, seed=seed, workers=threads, **self.settings)
        draws, _, _ = posterior.sample(
            method="ensemble",
            samples=samples,
            burn_in=burn_in,
            chains=chains,
            threads=threads,
            seed=seed,
        )
        flat = draws.reshape(-1, draws.shape[2])
        size = min(DRAWS, int(effective_size(draws)))
        chosen = flat[np.linspace(0, len(flat) - 1, max(9, size)).astype(int)]
        true = np.concatenate([truth, drawn])
        values = np.column_stack([chosen, posterior.evaluate(chosen)[0]])
        true = np.append(true, posterior.evaluate(true[None])[0])
        if self.visible:
            values = np.column_stack([values, posterior.moduli(chosen, VISIBLE[: self.visible])[0]])
            true = np.append(true, posterior.moduli(truth, VISIBLE[: self.visible])[0][0])
        below = values < true
        plain = (below.sum(axis=0) + 0.5) / (len(values) + 1)
        if not self.visible:
            return plain
        weights = self.weights(chosen, table["modulus_gpa"])
        weighted = (weights @ below + 0.5) / (weights.sum() + 1)
        return np.concatenate([weighted, plain, [usable(draws)]])

    def weights(self, constants: np.ndarray, modulus: np.ndarray) -> np.ndarray:
        """Of draws, by the ratio of the prior with its scale about CENTRE to that about the mean
        measurement; their mean is one.
        """
        ours = LogPosterior(SYNONYMS.get(self.symmetry, self.symmetry), None, modulus, None)
        x = ours.coordinates(constants)
        change = self.prior.log_prior(x) - ours.log_prior(x)
        weights = np.exp(change - change.max())
        return weights / weights.mean()


def usable(draws: np.ndarray) -> bool:
    """Whether chains (chains, samples, k) are enough for `extract`: R-hat and effective samples of
    every constant.
    """
    import arviz as az

    columns = [draws[:, :, j] for j in range(draws.shape[2])]
    effective = min(
        float(az.ess(column, method=method)) for column in columns for method in ("bulk", "tail")
    )
    return effective >= 100 and max(float(az.rhat(column)) for column in columns) <= 1.05


def rough_correction(simulations: int) -> Surrogate:
    """The correction of the paper's block after its first simulations, those of the one that comes
    with the package.
    """
    data = {name: values[:simulations] for name, values in Surrogate.load("block").data.items()}
    return Surrogate.fit(**data)


class Kept:
    """Ranks in a CSV, a row each, of data sets as they come; without a path in memory alone."""

    def __init__(self, path: Path | None, seed: int, sampling: dict[str, int]):
        self.path, self.sampling, self.run = (
            path,
            sampling,
            tuple(map(str, (seed, *sampling.values()))),
        )
        self.ranks: dict[tuple[str, int], dict[str, float]] = {}
        if path and path.exists():
            with path.open(encoding="utf-8", newline="") as file:
                for *run, case, number, label, rank in csv.reader(file):
                    if tuple(run) == self.run:
                        self.ranks.setdefault((case, int(number)), {})[label] = float(rank)

    def of(self, study: Study, case: str, number: int, threads: int) -> list[float]:
        """The ranks of a data set, computed if they are not there."""
        kept = self.ranks.get((case, number), {})
        if set(kept) != set(study.kept):
            kept = dict(zip(study.kept, study.ranks(threads, number, **self.sampling), strict=True))
            if self.path:
                with self.path.open("a", encoding="utf-8", newline="") as file:
                    csv.writer(file).writerows(
                        (*self.run, case, number, label, rank) for label, rank in kept.items()
                    )
        return [kept[label] for label in study.kept]


def tilted(euler_deg: np.ndarray, tilt: np.ndarray) -> np.ndarray:
    """Orientations whose indented direction is tilted by small angles (2, n), radians, towards the
    sample's x and y.
    """
    phi1, phi, phi2 = np.radians(euler_deg).T
    # The indented direction in crystal axes, and the sample's x and y there.
    c1, s1, c, s, c2, s2 = (
        np.cos(phi1),
        np.sin(phi1),
        np.cos(phi),
        np.sin(phi),
        np.cos(phi2),
        np.sin(phi2),
    )
    z = np.array([s2 * s, c2 * s, c])
    x = np.array([c1 * c2 - s1 * s2 * c, -c1 * s2 - s1 * c2 * c, s1 * s])
    y = np.array([s1 * c2 + c1 * s2 * c, -s1 * s2 + c1 * c2 * c, -c1 * s])
    z = z + tilt[0] * x + tilt[1] * y
    z /= np.linalg.norm(z, axis=0)
    # A turn about the direction itself changes no modulus: phi1 is free.
    return np.column_stack(
        [np.zeros_like(phi), np.degrees(np.arccos(z[2])), np.degrees(np.arctan2(z[0], z[1]))]
    )


def uniformity(ranks: np.ndarray) -> float:
    """p-value of a chi-square test."""
    return float(stats.chisquare(np.histogram(ranks, BINS, (0, 1))[0]).pvalue)


def main(argv=None) -> int:
    """Rank, test, tabulate; 1 if anything is not uniform."""
    parser = argparse.ArgumentParser(
        prog="bench calibration",
        description=__doc__,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    parser.add_argument(
        "--case", choices=tuple(CASES), action="append", help="only this one; may be given again"
    )
    parser.add_argument("--repeats", type=int, default=200, help="data sets of a case (200)")
    parser.add_argument("--samples", type=int, default=1000, help="of each chain (1000)")
    parser.add_argument("--burn-in", type=int, default=4000, help="sweeps before them (4000)")
    parser.add_argument("--chains", type=int, default=4, help="chains (4)")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--threads", type=int, default=2)
    parser.add_argument(
        "--keep",
        type=Path,
        help="a CSV of the ranks as they come; those that are there are not computed again",
    )
    arguments = parser.parse_args(argv)
    sampling = {
        "samples": arguments.samples,
        "burn_in": arguments.burn_in,
        "chains": arguments.chains,
    }
    p_values, kept = {}, Kept(arguments.keep, arguments.seed, sampling)
    for name in arguments.case or CASES:
        start, study = time.perf_counter(), Study(name, arguments.seed)
        table = np.array(
            [kept.of(study, name, k + 1, arguments.threads) for k in range(arguments.repeats)]
        )
        for label, column in zip(study.kept, table.T, strict=True):
            if label == "usable":
                good = column > 0
                print(
                    f"{name}: {np.count_nonzero(~good)} of {len(good)} results are unusable; "
                    "among the others"
                )
                for ranked, values in zip(study.labels, table[good].T, strict=False):
                    print(f"  {ranked:22} p = {uniformity(values):.3f}")
            else:
                p_values[name, label] = uniformity(column)
                print(
                    f"  {label:22} 90 % intervals hold "
                    f"{100 * np.mean(np.abs(column - 0.5) < 0.45):.1f} % of the truths"
                )
        print(
            f"{name}: {arguments.repeats} data sets in {time.perf_counter() - start:.0f} s",
            flush=True,
        )
    corrected = holm(p_values)
    for (name, label), p in p_values.items():
        print(f"  {name:26} {label:22} p = {p:.3f}, corrected {corrected[name, label]:.3f}")
    least = min(corrected.values())
    print("uniform" if least > 0.01 else "NOT uniform", "at p > 0.01 after Holm's correction")
    return int(least <= 0.01)


if __name__ == "__main__":
    raise SystemExit(main())
