"""How many simulations a correction needs: error on unseen crystals of several kinds against the
number of simulations, and whether its sd is honest.

The unseen crystals are simulated once and kept in campaign.sqlite (run again to go on): on the
paper's block those of the literature in random directions, of the paper's two domains, random
orthorhombic ones, and triclinic ones that are spread over the domain; in a grain cubic, hexagonal
and orthorhombic ones that are spread over the domain, where there is a scale up to three times as
stiff as the surroundings or as compliant, and errors are in per cent. For each seed a correction is
built with its defaults, step by step; beside it theory alone, and theory times the one ratio of the
correction's simulations. One and the same correction for all kinds of crystals. On the block there
is also the paper's own model, which learns a class at a time, as in inputs/case_studies.
"""

import argparse
import csv
import time
from pathlib import Path

import f90nml
import numpy as np
from scipy.linalg import expm

from bayesindent.common.progress import show_progress
from bayesindent.common.result_files import write_csv
from bayesindent.crystal.elasticity import (
    anisotropy_index,
    constant_names,
    halfspace_modulus,
    log_anisotropy,
    stiffness_rows,
)
from bayesindent.settings.problem import Problem
from bayesindent.stages.stage import run_stage
from bayesindent.surrogate.basis import Basis
from bayesindent.surrogate.surrogate import Surrogate
from support.csv_tables import named_numbers, read_rows
from support.learner import build, spread_crystals
from support.paper_domains import DOMAINS

CRYSTALS = Path(__file__).parents[1] / "reference" / "crystals.csv"
CASE_STUDIES = Path(__file__).parents[2] / "inputs" / "case_studies"
#: Simulations that the paper's model of a class learns from: it needs as many as it has terms, 135
#: and 729.
PAPER_SIZES = {"cubic": (150, 300), "hexagonal": (760,)}
#: Random crystals of one class: greatest log-anisotropy, and the range of log(3K/2G).
ORTHORHOMBIC = (1.3, 0.2, 1.6)
#: &specimen of each that can be asked for: radii 5 contact radii.
SPECIMENS: dict[str, dict] = {
    "block": {"geometry": "block"},
    "grain": {"geometry": "grain", "grain_radius_um": 2.5},
    "matrix": {
        "geometry": "grain",
        "grain_radius_um": 2.5,
        "matrix": "isotropic",
        "matrix_young_gpa": 200.0,
    },
}


#: Whether the corrections of each name are trained on derivatives.
TRAINED = {"derivatives": True, "moduli": False}


def main(argv=None) -> int:
    """Simulate, build, tabulate, draw."""
    parser = argparse.ArgumentParser(
        prog="bench learning",
        description=__doc__,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    parser.add_argument(
        "--specimen",
        choices=SPECIMENS,
        default="block",
        help="the paper's block; a grain in its own polycrystal or a given matrix",
    )
    parser.add_argument(
        "--unseen", type=int, default=320, help="unseen crystals of each kind (320)"
    )
    parser.add_argument(
        "--unseen-seed", type=int, default=12345, help="other unseen crystals (12345)"
    )
    parser.add_argument(
        "--seeds",
        type=int,
        default=5,
        help="corrections, each from other candidates (5; 0: the shipped one alone)",
    )
    parser.add_argument(
        "--sizes", default="8,12,20,30,40,60,100,150", help="numbers of simulations"
    )
    parser.add_argument(
        "--without-paper", action="store_true", help="leave out the paper's model on the block"
    )
    parser.add_argument(
        "--trained",
        choices=[*TRAINED, "both"],
        default="derivatives",
        help="on derivatives and moduli, on moduli alone, or one after the other (derivatives)",
    )
    parser.add_argument("--variance-of", default="imse", help="what chooses, see &design (imse)")
    parser.add_argument(
        "--workers", type=int, default=0, help="simulations at a time (0: all cores)"
    )
    parser.add_argument("--output", type=Path, help="folder (runs/learning_SPECIMEN)")
    arguments = parser.parse_args(argv)
    show_progress(True)
    arguments.output = arguments.output or Path("runs") / f"learning_{arguments.specimen}"
    arguments.output.mkdir(parents=True, exist_ok=True)
    unseen = {
        name: simulated(arguments, name, points)
        for name, points in unseen_crystals(arguments).items()
    }
    for name, (matrices, angles, modulus) in unseen.items():
        ratio = modulus / halfspace_modulus(matrices, angles)
        print(
            f"{name}: {len(modulus)} unseen, simulation over theory {ratio.mean():.4f}, sd "
            f"{ratio.std():.4f}, {ratio.min():.4f} .. {ratio.max():.4f}"
        )
    if arguments.specimen == "block":
        print_shipped(unseen)
    if arguments.seeds == 0:
        return 0
    chosen = TRAINED if arguments.trained == "both" else [arguments.trained]
    seeds = range(1, arguments.seeds + 1)
    rows = [
        row for name in chosen for seed in seeds for row in curve(arguments, name, seed, unseen)
    ]
    with open(arguments.output / "learning.csv", "w", newline="") as stream:
        writer = csv.DictWriter(stream, list(rows[0]))
        writer.writeheader()
        writer.writerows(rows)
    unit = "GPa" if arguments.specimen == "block" else "%"
    for name in chosen:
        print_tables([row for row in rows if row["trained"] == name], unit)
    print_times(rows)
    if arguments.specimen == "block" and not arguments.without_paper:
        print_paper_model(arguments, unseen)
    draw([row for row in rows if row["trained"] == next(iter(chosen))], unit, arguments)
    print(f"{arguments.output / 'learning.csv'}, {arguments.output / 'learning.svg'}")
    return 0


def print_shipped(unseen: dict) -> None:
    """How large the errors of the shipped correction are beside its sds, by kind and by
    log-anisotropy.
    """
    block = Surrogate.load("block")
    print(
        "| shipped block | crystals | error, % | sd, % | within 1 sd | within 2 sd | rms of z "
        "|\n|---|---|---|---|---|---|---|"
    )
    kinds = {}
    for name, (matrices, angles, modulus) in unseen.items():
        mean, sd = block.predict(matrices, angles)
        kinds[name] = np.column_stack(
            [(modulus - mean) / sd, sd / mean, [log_anisotropy(matrix) for matrix in matrices]]
        )
    everything = np.concatenate(list(kinds.values()))
    for low, high in ((0, 0.4), (0.4, 0.8), (0.8, 1.2), (1.2, 1.5), (1.5, 9)):
        kinds[f"log-anisotropy {low} to {high}"] = everything[
            (everything[:, 2] >= low) & (everything[:, 2] < high)
        ]
    for name, rows in kinds.items():
        z, sd = np.abs(rows[:, 0]), rows[:, 1]
        print(
            f"| {name} | {len(z)} | {100 * np.sqrt(np.mean((z * sd) ** 2)):.3f} | "
            f"{100 * np.median(sd):.3f} "
            f"| {np.mean(z < 1):.2f} | {np.mean(z < 2):.2f} | {np.sqrt(np.mean(z**2)):.2f} |"
        )


def unseen_crystals(arguments) -> dict[str, list[tuple]]:
    """Crystals of each kind, those of the literature in n // 16 directions, as (class, constants in
    GPa, angles in degrees).
    """
    n, seed = arguments.unseen, arguments.unseen_seed
    if arguments.specimen != "block":
        return {
            name: spread_over_domain(arguments.specimen, name, n, seed)
            for name in ("cubic", "hexagonal", "orthorhombic")
        }
    rng = np.random.default_rng(seed)
    known = []
    for row in read_rows(CRYSTALS):
        constants = named_numbers(row, constant_names(row["symmetry"]))
        known.append((row["symmetry"], tuple(constants.values())))
    found = {"literature": in_directions([point for point in known for _ in range(n // 16)], rng)}
    for symmetry, domain in DOMAINS.items():
        points: list[tuple] = []
        while len(points) < n:
            constants = rng.uniform(domain["c_min"], domain["c_max"])
            matrix = stiffness_rows(symmetry, [constants])[0]
            if (
                np.linalg.eigvalsh(matrix)[0] > 0
                and anisotropy_index(matrix) <= domain["anisotropy_cap"]
            ):
                points.append((symmetry, tuple(constants.tolist())))
        found[symmetry] = in_directions(points, rng)
    found["orthorhombic"] = in_directions([random_orthorhombic(rng) for _ in range(n)], rng)
    found["triclinic"] = spread_over_domain("block", "triclinic", n, seed)
    return found


def spread_over_domain(specimen: str, symmetry: str, n: int, seed: int) -> list[tuple]:
    """Crystals of a class of the domain that a correction of this specimen has by default."""
    basis = Basis(
        Problem.from_keywords(
            "learning", specimen=SPECIMENS[specimen], domain={"classes": [symmetry]}
        )
    )
    constants, angles = spread_crystals(basis, n, seed)
    return [
        (basis.symmetry, tuple(row), tuple(euler))
        for row, euler in zip(constants.tolist(), angles.tolist(), strict=True)
    ]


def in_directions(points: list[tuple], rng) -> list[tuple]:
    """The crystals with random orientations."""
    n = len(points)
    angles = np.column_stack(
        [
            rng.uniform(0, 360, n),
            np.degrees(np.arccos(rng.uniform(-1, 1, n))),
            rng.uniform(0, 360, n),
        ]
    )
    return [(*point, tuple(row)) for point, row in zip(points, angles.tolist(), strict=True)]


def random_orthorhombic(rng) -> tuple:
    """A crystal whose log K has a random direction in the space of its class."""
    names, roots = constant_names("orthorhombic"), np.sqrt([1, 1, 1, 2, 2, 2])
    dilatation = np.zeros((6, 6))
    dilatation[:3, :3] = 1 / 3
    space = [dilatation, (np.eye(6) - dilatation) / np.sqrt(5)]
    for name in names:
        matrix = np.zeros((6, 6))
        row, column = (int(digit) - 1 for digit in name[1:])
        matrix[row, column] = matrix[column, row] = roots[row] * roots[column]
        for _ in range(2):
            matrix = matrix - sum(np.sum(matrix * other) * other for other in space)
        if np.linalg.norm(matrix) > 1e-8:
            space.append(matrix / np.linalg.norm(matrix))
    greatest, low, high = ORTHORHOMBIC
    contrast, direction = rng.uniform(low, high), rng.normal(size=len(space) - 2)
    direction *= greatest * rng.uniform() / np.linalg.norm(direction)
    logarithm = (
        np.log(100) * np.eye(6) + contrast * dilatation + np.tensordot(direction, space[2:], axes=1)
    )
    matrix = expm(logarithm) / np.outer(roots, roots)
    return "orthorhombic", tuple(
        float(matrix[int(name[1]) - 1, int(name[2]) - 1]) for name in names
    )


def namelist_of(variables: dict) -> str:
    """Variables as a group of a namelist has them."""
    return ", ".join(f"{name} = {value!r}" for name, value in variables.items())


def simulated(
    arguments, name: str, points: list[tuple]
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Stiffnesses, angles and moduli of the unseen crystals of a kind, from the campaign or
    simulated now.
    """
    folder, specimen = (
        arguments.output / f"unseen_{name}",
        namelist_of(SPECIMENS[arguments.specimen]),
    )
    names, angles = constant_names("triclinic"), ("phi1_deg", "Phi_deg", "phi2_deg")
    crystals = [
        {"symmetry": symmetry}
        | dict(zip(constant_names(symmetry), constants))
        | dict(zip(angles, e))
        for symmetry, constants, e in points
    ]
    header = ["symmetry", *names, *angles]
    empty = dict.fromkeys(header, "")
    write_csv(
        folder / "points.csv", header, [list((empty | crystal).values()) for crystal in crystals]
    )
    (folder / "unseen.nml").write_text(
        "&problem symmetry = 'triclinic' /\n"
        "&crystals points = 'points.csv' /\n"
        f"&specimen {specimen} /\n"
        f"&execution workers = {arguments.workers} /\n"
    )
    results = run_stage(Problem(folder / "unseen.nml", "simulate"), "simulate", folder)["results"]
    moduli = [row["indentation_modulus_gpa"] for row in results]
    matrices = np.array(
        [stiffness_rows(symmetry, [constants])[0] for symmetry, constants, _ in points]
    )
    done = np.array([modulus is not None for modulus in moduli])
    return (
        matrices[done],
        np.array([point[2] for point in points])[done],
        np.array([m for m in moduli if m is not None]),
    )


def curve(arguments, trained: str, seed: int, unseen: dict) -> list[dict]:
    """Errors and shares on the unseen crystals, and CPU seconds from nothing, by the number of
    simulations. Simulations of an earlier run take no time.
    """
    rows, folder, cpu_s = [], arguments.output / f"{trained}_seed_{seed}", 0.0
    folder.mkdir(parents=True, exist_ok=True)
    specimen = namelist_of(SPECIMENS[arguments.specimen])
    for size in map(int, arguments.sizes.split(",")):
        path = folder / f"build_{size}.nml"
        path.write_text(
            f"&problem title = 'Learning: {arguments.specimen}', seed = {seed} /\n"
            f"&specimen {specimen} /\n"
            f"&surrogate derivatives = .{TRAINED[trained]}. /\n".lower()
            + f"&design budget = {size}, variance_of = '{arguments.variance_of}' /\n"
            f"&execution workers = {arguments.workers} /\n"
        )
        began = time.process_time()
        document = build(Problem(path, "build"), folder)
        cpu_s += time.process_time() - began
        surrogate = Surrogate.load(document["file"])
        for name, (matrices, angles, modulus) in unseen.items():
            mean, sd = surrogate.predict(matrices, angles)
            theory, z = halfspace_modulus(matrices, angles), np.abs(mean - modulus) / sd
            unit = 1.0 if arguments.specimen == "block" else 0.01 * modulus
            errors = [
                np.mean(np.abs(value - modulus) / unit)
                for value in (theory, document["baselines"]["ratio"] * theory, mean)
            ]
            errors.append(100 * np.sqrt(np.mean((mean / modulus - 1) ** 2)))
            shares = (np.mean(z <= 1), np.mean(z <= 2), np.quantile(z, 0.99))
            columns = ("theory", "ratio", "correction", "rms", "within_1_sd", "within_2_sd", "z_99")
            rows.append(
                {"trained": trained, "seed": seed, "set": name, "simulations": size, "cpu_s": cpu_s}
                | dict(zip(columns, (*errors, *shares), strict=True))
            )
    return rows


def print_paper_model(arguments, unseen: dict) -> None:
    """Errors of the paper's model of each class on the same unseen crystals, GPa, by the number of
    simulations of that class alone.
    """
    print("\n| the paper's model | simulations | error, GPa |\n|---|---|---|")
    for symmetry, sizes in PAPER_SIZES.items():
        folder = arguments.output / f"paper_{symmetry}"
        folder.mkdir(exist_ok=True)
        for size in sizes:
            namelist = f90nml.read(CASE_STUDIES / f"{symmetry}_paper.nml")
            namelist["design"].update(budget=size, validation=0)
            namelist["surrogate"].pop("scan")
            namelist["execution"] = {"workers": arguments.workers}
            path = folder / f"build_{size}.nml"
            namelist.write(path, force=True)
            surrogate = Surrogate.load(build(Problem(path, "build"), folder)["file"])
            matrices, angles, modulus = unseen[symmetry]
            print(
                f"| {symmetry} | {size} | "
                f"{np.mean(np.abs(surrogate.predict(matrices, angles)[0] - modulus)):.2f} |",
                flush=True,
            )


def kinds(rows: list[dict]) -> list[str]:
    """The kinds of unseen crystals."""
    return list(dict.fromkeys(row["set"] for row in rows))


def means(rows: list[dict], name: str, size: int, column: str) -> float:
    """The mean over the seeds."""
    return float(
        np.mean([row[column] for row in rows if row["set"] == name and row["simulations"] == size])
    )


def print_tables(rows: list[dict], unit: str) -> None:
    """A table for each kind of crystal."""
    sizes = sorted({row["simulations"] for row in rows})
    labels = {
        "theory": f"theory alone, {unit}",
        "ratio": f"theory x one ratio, {unit}",
        "correction": f"correction, {unit}",
        "rms": "correction, root mean square, %",
        "within_1_sd": "within 1 sd",
        "within_2_sd": "within 2 sd",
        "z_99": "99 % of |z|",
    }
    for name in kinds(rows):
        print(f"\n| {name} | " + " | ".join(map(str, sizes)) + " |\n|" + "---|" * (len(sizes) + 1))
        for column, label in labels.items():
            print(
                f"| {label} | "
                + " | ".join(f"{means(rows, name, size, column):.3f}" for size in sizes)
                + " |"
            )


def print_times(rows: list[dict]) -> None:
    """CPU seconds of Step 1 from nothing, and the error that they buy, means over the seeds."""
    names = kinds(rows)
    print(f"\n| trained on | simulations | CPU s | {' | '.join(names)} |")
    print("|" + "---|" * (3 + len(names)))
    for trained, size in dict.fromkeys((row["trained"], row["simulations"]) for row in rows):
        these = [row for row in rows if row["trained"] == trained]
        cells = [f"{means(these, name, size, 'rms'):.3f}" for name in names]
        cpu_s = means(these, names[0], size, "cpu_s")
        print(f"| {trained} | {size} | {cpu_s:.1f} | {' | '.join(cells)} |")


def draw(rows: list[dict], unit: str, arguments) -> None:
    """The error of each kind against the number of simulations."""
    import matplotlib

    matplotlib.use("Agg")
    from matplotlib import pyplot

    sizes = sorted({row["simulations"] for row in rows})
    figure, axes = pyplot.subplots(figsize=(5.5, 3.6), layout="constrained")
    for name, marker in zip(kinds(rows), "os^D", strict=False):
        line = axes.plot(
            sizes,
            [means(rows, name, size, "correction") for size in sizes],
            marker=marker,
            ms=4,
            label=name,
        )[0]
        axes.axhline(means(rows, name, sizes[-1], "ratio"), color=line.get_color(), lw=0.8, ls="--")
    axes.set(
        xlabel="simulations", ylabel=f"mean absolute error ({unit})", xscale="log", yscale="log"
    )
    axes.set_xticks(sizes, [str(size) for size in sizes])
    axes.minorticks_off()
    axes.legend(title="unseen crystals; dashed: one ratio")
    figure.savefig(arguments.output / "learning.svg")
