"""Synthetic curves of grains and a reference, independent of the package: a contact of its own, and
every error that `curves` has a prior for.
"""

from dataclasses import dataclass, field

import numpy as np
from scipy.optimize import brentq

#: Fused quartz: Young's modulus with its sd, Poisson's ratio; diamond.
QUARTZ, QUARTZ_NU, DIAMOND, DIAMOND_NU = (72.0, 0.5), 0.17, 1140.0, 0.07


def effective(indentation_modulus):
    """What an instrument with a diamond reports."""
    return 1 / (1 / np.asarray(indentation_modulus) + (1 - DIAMOND_NU**2) / DIAMOND)


def sneddon(load, modulus, radius, beta):
    """Depth (um) of a contact with the profile r^2/2R + beta r^4/8R^3, by bisection of Sneddon's
    integrals for the contact radius.
    """

    def force(a):
        # P = 2 E int_0^a (h - h_free(r)) .. in closed form for powers of r.
        return modulus * (4 * a**3 / (3 * radius) + 8 * beta * a**5 / (15 * radius**3))

    top = (0.75 * load.max() * radius / modulus) ** (1 / 3) * 1.5
    grid = np.linspace(0, top, 4000)
    radii = np.interp(load, force(grid), grid)
    return radii**2 / radius + beta * radii**4 / (3 * radius**3)


def contact_radius(load, modulus, radius, beta):
    """The contact radius (um) at one load."""
    return brentq(
        lambda a: modulus * (4 * a**3 / (3 * radius) + 8 * beta * a**5 / (15 * radius**3)) - load,
        0,
        3 * radius,
    )


@dataclass
class Truth:
    """What curves are made with; sds are those that `curves` is given as priors, unless a study
    changes them.
    """

    rng: np.random.Generator
    grains: int = 12
    repeats: int = 3
    references: int = 10
    points: int = 600
    radius_um: float = 5.0
    radius_sd: float = 0.1
    beta: tuple[float, float] = (1.0, 1.0)
    compliance_sd: float = 0.02
    drift_sd: float = 0.1
    load_sd: float = 0.02
    session_sd: float = 0.01
    #: nm, of a step of the noise; its correlation from point to point.
    noise: float = 0.2
    correlation: float = 0.7
    #: Wrong models: a dent in the tip, as a share of its depth; change of the drift over a test,
    #: nm/s.
    dent: float = 0.0
    drift_change: float = 0.0
    #: Indentation moduli of the grains (GPa); empty: between 100 and 160.
    moduli: np.ndarray = field(default_factory=lambda: np.empty(0))

    def draw(self):
        """Rows of the curves, rows of the tests, and the values behind them."""
        rng = self.rng
        moduli = self.moduli if len(self.moduli) else rng.uniform(100, 160, self.grains)
        repeat = np.clip(0.01 * np.exp(rng.normal()), 0.002, 0.1)
        repeats = {True: repeat, False: np.clip(repeat * np.exp(0.5 * rng.normal()), 0.002, 0.1)}
        quartz = rng.normal(*QUARTZ) / (1 - QUARTZ_NU**2)
        self.radius = self.radius_um * np.exp(self.radius_sd * rng.normal())
        self.shape = max(-1.0, rng.normal(*self.beta))
        self.compliance = self.compliance_sd * rng.normal()
        session = np.exp(self.session_sd * rng.normal(size=2))
        curves, tests = [], []
        for number, modulus in enumerate([quartz, *moduli]):
            reference = number == 0
            for repetition in range(self.references if reference else self.repeats):
                name = f"{'quartz' if reference else f'g{number}'}-{repetition + 1}"
                factor = session[int(not reference and number > len(moduli) // 2)] * np.exp(
                    repeats[reference] * rng.normal()
                )
                time, depth, load = self.curve(float(effective(modulus) * factor), reference)
                curves += zip(
                    [name] * len(time), time.round(4), depth.round(4), load.round(5), strict=True
                )
                place = int(not reference and number > len(moduli) // 2)
                tests.append(
                    (
                        name,
                        "quartz" if reference else "",
                        "" if reference else f"g{number}",
                        f"s{place + 1}",
                    )
                )
        self.effective_gpa = effective(moduli)
        return curves, tests

    def curve(self, modulus, reference):
        """Time (s), depth (nm) and load (mN) of a test: approach, loading with a pop-in,
        unloading.
        """
        rng, n = self.rng, self.points
        peak = rng.uniform(40, 80)
        load = np.concatenate(
            [np.zeros(n // 10), np.linspace(0, peak, n), np.linspace(peak, 0.02 * peak, n // 4)]
        )
        time = np.linspace(0, rng.uniform(15, 40), len(load))
        depth = 1e3 * sneddon(load, modulus, self.radius, self.shape)
        if self.dent:
            radii = np.sqrt(self.radius * depth / 1e3)
            depth = depth * (1 - self.dent * np.exp(-((radii / (0.1 * self.radius)) ** 2)))
        depth[: n // 10] -= np.linspace(80, 0, n // 10)
        share = rng.uniform(0.25, 1.3) if not reference else rng.uniform(0.5, 1.5)
        plastic = np.maximum(0, np.maximum.accumulate(load) / peak - share)
        depth = depth + np.where(
            plastic > 0,
            rng.uniform(2, 30) * (not reference) + 1e3 * rng.uniform(0.05, 0.4) * plastic**1.3,
            0,
        )
        steps = self.noise * rng.normal(size=len(load))
        for i in range(1, len(steps)):
            steps[i] += self.correlation * steps[i - 1]
        drift = self.drift_sd * rng.normal() + self.drift_change * (
            np.cumsum(np.ones(len(time))) / len(time)
        )
        depth = depth + drift * time + self.compliance * load + steps + rng.uniform(-50, 50)
        return time, depth, load + self.load_sd * rng.normal()


CURVES = "test,time_s,depth_nm,load_mn\n"
TESTS = "test,reference,grain,session\n"


def write(folder, curves, tests):
    """curves.csv and tests.csv."""
    for file, header, rows in (("curves.csv", CURVES, curves), ("tests.csv", TESTS, tests)):
        (folder / file).write_text(header + "".join(",".join(map(str, row)) + "\n" for row in rows))


NAMELIST = """&curves
  file = 'curves.csv'
  tests = 'tests.csv'
  radius_um = 5.0
  radius_sd_um = 0.5
/
&references
  name = 'quartz'
  young_gpa = 72.0
  young_sd_gpa = 0.5
  nu = 0.17
/
"""

#: Priors so narrow that only the modulus is inferred.
KNOWN = {"radius_sd_um": 1e-4, "tip_beta_sd": 1e-4, "compliance_sd_nm_mn": 1e-5, "session_sd": 1e-5}


def one_curve(name, modulus, rng=None, n=200, noise=0.0, peak=40.0, beta=1.0, drift=0.0):
    """Rows of an elastic curve of a sphere of 5 um with white noise."""
    load = np.linspace(0, peak, n + 1)[1:]
    time = np.linspace(0, 20, n)
    depth = 1e3 * sneddon(load, modulus, 5.0, beta) + drift * time + 17.0
    if noise:
        depth = depth + noise * rng.normal(size=n)
    return [(name, *row) for row in zip(time.tolist(), depth.tolist(), load.tolist(), strict=True)]


def table(rows):
    """The columns of rows of curves."""
    return dict(
        zip(
            ("test", "time_s", "depth_nm", "load_mn"),
            map(list, zip(*rows, strict=True)),
            strict=True,
        )
    )
