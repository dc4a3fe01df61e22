"""Quartz and glaucophane of the case study against themselves: parts of the tests, of the load and
of the points.

Quartz: tests that are left out are grains of unknown modulus, the others the reference.
Glaucophane: tests of a grain against each other.

    ./bayesindent dev bench splits
"""

import argparse
import csv
import warnings
from collections.abc import Mapping
from pathlib import Path

import numpy as np

import bayesindent as bi
from support.csv_tables import numbers

STUDY = Path(__file__).resolve().parents[2] / "inputs" / "case_studies"
#: Effective modulus of fused quartz with diamond, GPa.
TRUTH = 69.64
COLUMNS = ("time_s", "depth_nm", "load_mn")
Curves = Mapping[str, np.ndarray]


def read() -> dict[str, np.ndarray]:
    """The points of each test, (point, column)."""
    points: dict[str, list] = {}
    with (STUDY / "glaucophane_curves.csv").open() as file:
        for row in csv.DictReader(line for line in file if not line.startswith("#")):
            points.setdefault(row["test"], []).append([float(row[name]) for name in COLUMNS])
    return {name: np.array(rows) for name, rows in points.items()}


def infer(curves: Curves, tests: Mapping[str, list], **settings) -> dict:
    """The document of Step 0."""
    columns = {"test": np.repeat(list(curves), [len(rows) for rows in curves.values()])}
    columns |= dict(zip(COLUMNS, np.concatenate(list(curves.values())).T, strict=True))
    return bi.curves(
        columns, tests, {"quartz": (72.0, 0.5, 0.17)}, **{"radius_um": 6.0} | settings
    ).document


def left_out(
    curves: Curves,
    parts: list[set[str]],
    label: str,
    together: bool = False,
    end: float = np.inf,
    **settings,
) -> None:
    """Each part in turn is left out; `together`: as one grain; `end`: the load, mN, at which its
    curves end.
    """
    found = []
    for part in parts:
        tests = {
            "test": list(curves),
            "grain": [("part" if together else name) if name in part else "" for name in curves],
            "reference": ["" if name in part else "quartz" for name in curves],
        }
        document = infer(
            {
                name: below({name: rows}, end)[name] if name in part else rows
                for name, rows in curves.items()
            },
            tests,
            **settings,
        )
        found += [(row["effective_modulus_gpa"], row["sd_gpa"]) for row in document["grains"]]
    modulus, sd = np.array(found).T
    z, radius = np.log(modulus / TRUTH) * modulus / sd, document["tip"]["radius_um"]
    print(
        f"| {label} | {len(z)} | {100 * (modulus.mean() / TRUTH - 1):.1f} % | "
        f"{100 * np.std(np.log(modulus)):.1f} % | "
        f"{100 * np.median(sd / modulus):.1f} % | {100 * np.mean(np.abs(z) < 2):.0f} % | "
        f"{radius['mean']:.2f} ± {radius['sd']:.2f} |"
    )


def grains(quartz: Curves, curves: Curves, label: str, section: str = "section") -> None:
    """The grains of glaucophane with quartz as their reference."""
    tests = {
        "test": [*quartz, *curves],
        "grain": [""] * len(quartz) + [name.split("-")[0] for name in curves],
        "reference": ["quartz"] * len(quartz) + [""] * len(curves),
        "session": ["quartz"] * len(quartz) + [section] * len(curves),
    }
    document = infer({**quartz, **curves}, tests)
    modulus, own, sd = numbers(
        document["grains"], ["effective_modulus_gpa", "own_sd_gpa", "sd_gpa"]
    ).T
    agreement = document["agreement"]
    print(
        f"| {label} | {modulus.min():.0f} to {modulus.max():.0f} GPa | "
        f"{100 * np.median(own / modulus):.1f}, {100 * np.median(sd / modulus):.1f} % | "
        f"{agreement['chi_square']:.1f} for {agreement['degrees_of_freedom']} | "
        f"{agreement['probability']:.2f} |"
    )


def below(curves: Curves, load: float) -> dict[str, np.ndarray]:
    """Curves up to a load, mN."""
    return {
        name: rows[: np.argmax(rows[:, 2] > load) if (rows[:, 2] > load).any() else len(rows)]
        for name, rows in curves.items()
    }


def thinned(curves: Curves, step: int) -> dict[str, np.ndarray]:
    """Every so manieth point."""
    return {name: rows[::step] for name, rows in curves.items()}


def hysteresis(curves: Curves) -> None:
    """How much deeper the unloading is than the loading, at a fifth and at half of the peak load,
    and after which time.
    """
    print("\n| quartz, peak load | at a fifth of it | at half of it |\n|---|---|---|")
    for rows in curves.values():
        peak = int(np.argmax(rows[:, 2]))
        load = rows[peak, 2]
        parts = (
            rows[peak - np.argmax(rows[peak::-1, 2] < 0.1 * load) : peak],
            rows[peak : peak + np.argmax(rows[peak:, 2] < 0.1 * load)][::-1],
        )
        cells = []
        for share in (0.2, 0.5):
            at = share * load
            (start, up), (end, down) = (
                (np.interp(at, *part.T[[2, 0]]), np.interp(at, *part.T[[2, 1]])) for part in parts
            )
            cells.append(f"{down - up:.1f} nm in {end - start:.1f} s")
        print(f"| {load:.0f} mN | {' | '.join(cells)} |")


def folds(names: list[str], n: int) -> list[set[str]]:
    """Parts of the tests, one in n."""
    return [set(names[k::n]) for k in range(n)]


def main(argv=None) -> None:
    """Print both tables."""
    argparse.ArgumentParser(
        prog="bayesindent dev bench splits", description=__doc__.splitlines()[0]
    ).parse_args(argv)
    warnings.simplefilter("ignore", bi.BayesindentWarning)
    curves = read()
    quartz = {name: rows for name, rows in curves.items() if name.startswith("q")}
    section = {name: rows for name, rows in curves.items() if name.startswith("g")}
    names = list(quartz)
    by_load = sorted(names, key=lambda name: quartz[name][:, 2].max())
    print(
        "| quartz | values | mean | scatter | stated sd, median | within two sds | radius of "
        "the last part, um |\n|---|---|---|---|---|---|---|"
    )
    left_out(quartz, folds(names, 10), "ten-fold, each test a grain")
    left_out(quartz, folds(names, 10), "ten-fold, each fold a grain", together=True)
    left_out(
        quartz, [set(names[k : k + 4]) for k in range(0, len(names), 4)], "blocks of four tests"
    )
    for radius in (4.2, 5.0, 5.323):
        left_out(quartz, folds(names, 10), f"stated radius {radius} um", radius_um=radius)
    rng = np.random.default_rng(1)
    for number in (3, 5):
        left_out(
            quartz,
            [set(names) - set(rng.choice(names, number, replace=False)) for _ in range(4)],
            f"{number} references, random, four times",
        )
    left_out(
        quartz,
        [set(by_load[:17]), set(by_load[17:])],
        "low peak loads from high ones, and the reverse",
    )
    left_out(
        {name: quartz[name] for name in by_load[17:]},
        folds(by_load[17:], 6),
        "the 17 highest peak loads alone",
    )
    for load in (150, 80, 40, 20):
        left_out(below(quartz, load), folds(names, 5), f"curves that end at {load} mN")
    for load in (100, 60, 40, 30, 20):
        left_out(
            quartz, folds(names, 2), f"curves that end at {load} mN, references whole", end=load
        )
    # The time of the transient was chosen on the tests of even number.
    for load in (60, 40, 30, 20):
        left_out(
            quartz,
            [set(names[1::2])],
            f"the same at {load} mN, tests of odd number alone",
            end=load,
        )
    for step in (2, 3):
        left_out(
            thinned(quartz, step),
            folds(names, 5),
            f"every {'second' if step == 2 else 'third'} point",
        )
    hysteresis({name: quartz[name] for name in by_load[:17:4]})
    print(
        "\n| glaucophane | moduli | sd, median: own, in all | chi-square | p |\n"
        "|---|---|---|---|---|"
    )
    grains(quartz, section, "all tests")
    grains(quartz, section, "one session for quartz and section", section="quartz")
    grains(quartz, below(section, 60), "curves that end at 60 mN")
    grains(quartz, below(section, 25), "curves that end at 25 mN")
    grains(quartz, thinned(section, 5), "every fifth point")
    grains(
        quartz,
        {name: rows for name, rows in section.items() if not name.endswith("-3")},
        "without the tests number 3",
    )
    grains({name: quartz[name] for name in names[::7]}, section, "five tests of quartz")
    grains(
        {name: quartz[name] for name in by_load[:10]},
        section,
        "the ten lowest peak loads of quartz",
    )
    grains(
        {name: quartz[name] for name in by_load[-10:]},
        section,
        "the ten highest peak loads of quartz",
    )


if __name__ == "__main__":
    main()
