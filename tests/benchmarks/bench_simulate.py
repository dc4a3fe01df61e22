"""Accuracy and cost of indentation simulations, against the exact theory, CalculiX and the
machine's matrix product.

- accuracy: zinc, copper and Fe-3%Si at the reference orientations, default and extrapolated,
against the half-space theory
- indenters: sphere and cone against Sneddon's closed forms on an isotropic half-space, and M of
anisotropic crystals under them
- alike: grains among what is like them against the half-space; large grains of anisotropic
crystals likewise
- specimens: elements, work, memory and CPU time of grains
- random: crystals drawn uniformly from the paper's two domains, against the theory
- soft: crystals with soft modes of shear, towards elastic instability, against the theory and the
error that a warning states, and the
  constants of that
- convergence: the error over mesh size, element, distance of the infinite elements and growth of
the layers, with a figure
- cost: one curve of ten depths on the paper's block against its bare numeric factorisation, and the
rate against SGEMM
- ccx: CPU time of CalculiX on the exported deck of the paper's block, four depths, against our
curve of four depths with the set-up of
  the model (mesh, ordering, symbolic factorisation) that CalculiX does too, and against the further
  crystals of a model; the forces of a grain
- memory: peak of a process with one and with two simulations at a time
- workers: two threads against one
- size: factorisation time and factor size over mesh size, with a figure
"""

import argparse
import ctypes
import os
import resource
import shutil
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import numpy as np

import bayesindent as bi
from bayesindent.crystal.elasticity import constant_names, log_anisotropy
from benchmarks import simulate_specimens as specimens
from support.csv_tables import ANGLES, named_numbers, numbers, read_rows

SECTIONS = (
    "accuracy",
    "indenters",
    "alike",
    "specimens",
    "random",
    "soft",
    "convergence",
    "cost",
    "ccx",
    "memory",
    "workers",
    "size",
)
REFERENCE = Path(__file__).parents[1] / "reference" / "halfspace_moduli.csv"
#: Boxes and caps of the paper's domains: constants in the order of `constant_names`, GPa.
DOMAINS = {
    "cubic": ((50, 40, 15), (250, 150, 120), 7.2),
    "hexagonal": ((80, 40, 30, 70, 40), (240, 120, 90, 210, 90), 66.2),
}
ZINC = bi.stiffness("hexagonal", C11=161.1, C12=34.2, C44=38.3, C33=61.1, C13=50.3)
COPPER = bi.stiffness("cubic", C11=168.4, C12=121.4, C44=75.4)
ISOTROPIC = bi.stiffness("cubic", C11=200, C12=80, C44=60)
#: Hexagonal, anisotropy index 15: close to elastic instability.
SOFT = bi.stiffness("hexagonal", C11=120, C12=113, C44=60, C33=120, C13=80)


def main(argv=None) -> int:
    """Run the sections asked for and print their tables."""
    parser = argparse.ArgumentParser(
        prog="bench simulate",
        description=__doc__,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    parser.add_argument(
        "sections", nargs="*", choices=[*SECTIONS, []], help="sections to run (all)"
    )
    parser.add_argument(
        "--random", type=int, default=100, help="random crystals of each domain (100)"
    )
    parser.add_argument(
        "--seed",
        type=int,
        default=7,
        help="of the crystals of `soft` (7: those its constants were taken from)",
    )
    parser.add_argument(
        "--workers", type=int, default=0, help="threads of the accuracy sections (0: all cores)"
    )
    parser.add_argument(
        "--largest", type=int, default=60000, help="elements of the largest mesh of `size` (60000)"
    )
    parser.add_argument(
        "--figures", type=Path, default=None, help="folder for figures (none are drawn)"
    )
    arguments = parser.parse_args(argv)
    for section in arguments.sections or SECTIONS:
        print(f"\n## {section}\n", flush=True)
        globals()[f"run_{section}"](arguments)
    return 0


def table(header, rows) -> None:
    """Print a Markdown table."""
    print("| " + " | ".join(header) + " |\n|" + "---|" * len(header))
    for row in rows:
        print("| " + " | ".join(str(cell) for cell in row) + " |", flush=True)


def reference_crystals():
    """Names, stiffness, angles and exact moduli of the reference table."""
    rows = [row for row in read_rows(REFERENCE) if row["material"] in ("Zn", "Cu", "Fe-3%Si")]
    names = [f"{row['material']} {row['orientation']}" for row in rows]
    matrices = []
    for row in rows:
        constants = named_numbers(row, constant_names(row["symmetry"]))
        matrices.append(bi.stiffness(row["symmetry"], **constants))
    return names, np.array(matrices), numbers(rows, ANGLES), numbers(rows, ["M_elliptic"])[:, 0]


def run_accuracy(arguments) -> None:
    """Errors at the reference crystals."""
    names, matrices, angles, exact = reference_crystals()
    models = {
        "default": bi.Indentation(extrapolate=False),
        "extrapolate": bi.Indentation(extrapolate=True),
    }
    errors = {}
    for label, model in models.items():
        results = model.run_many(matrices, angles, workers=arguments.workers)
        errors[label] = 100 * (
            np.array([result.indentation_modulus_gpa for result in results]) / exact - 1
        )
        kkt, balance = (
            max(r.contact_residual for r in results),
            max(r.equilibrium_residual for r in results),
        )
        print(
            f"{label}: {model.elements} elements, contact residual {kkt:.1e}, equilibrium "
            f"residual {balance:.1e}"
        )
    print()
    rows = []
    for name, modulus, *of_models in zip(names, exact, *errors.values(), strict=True):
        rows.append((name, f"{modulus:.3f}", *(f"{error:+.3f}" for error in of_models)))
    rows.append(("largest error", "", *(f"{np.abs(errors[label]).max():.3f}" for label in models)))
    table(("crystal", "exact M, GPa", *(f"{label}, %" for label in models)), rows)


#: Indenters by what is printed of them; contact radius 0.5 um at the last depth.
INDENTERS: dict[str, dict] = {
    "paraboloid": {},
    **{
        f"sphere, a/R = {t}": {"shape": "sphere", "radius_um": 0.5 / t}
        for t in (0.1, 0.2, 0.3, 0.6)
    },
    "cone": {"shape": "cone"},
}


def run_indenters(arguments) -> None:
    """Errors of force and contact radius on an isotropic half-space over the resolved depths, and
    of the moduli of anisotropic crystals.
    """
    rows, angles = [], (200, 50, 25)
    for extrapolate in (False, True):
        for name, settings in INDENTERS.items():
            model = bi.Indentation(extrapolate=extrapolate, **settings)
            result = model.run(ISOTROPIC, angles)
            # a of the closed form: dP/dh = 2 a M, and equal steps to the last.
            radius = np.linspace(0, 0.5, model.depths + 1)[1:]
            used = radius >= 5 * 0.5 / 9.5
            force = 100 * (result.modulus_by_depth_gpa[used] / 168.0 - 1)
            edge = np.abs(result.contact_radius_um - radius)[used].max() / (0.5 / 9.5)
            crystals = [
                model.run(stiffness, angles).indentation_modulus_gpa
                / bi.halfspace_modulus(stiffness, angles)
                for stiffness in (ZINC, COPPER)
            ]
            errors = [
                100 * (ratio - 1) for ratio in (result.indentation_modulus_gpa / 168.0, *crystals)
            ]
            rows.append(
                (
                    name,
                    "extrapolate" if extrapolate else "default",
                    f"{force.min():+.2f} to {force.max():+.2f}",
                    f"{edge:.2f}",
                    *(f"{error:+.3f}" for error in errors),
                )
            )
    header = (
        "indenter",
        "mesh",
        "isotropic: force by depth, %",
        "contact radius, elements",
        "M, %",
        "M of Zn, %",
        "M of Cu, %",
    )
    table(header, rows)


def run_alike(arguments) -> None:
    """Grains that are half-spaces, nearly or quite."""
    ratios = [
        f"nu = {nu}, {mesh}, %" for mesh in ("default", "extrapolate") for nu in (0.1, 0.3, 0.45)
    ]
    table(("specimen, alike, against the half-space", *ratios), specimens.alike())
    print()
    errors = [
        f"{mesh}, against {other}, %"
        for other in ("the half-space", "exact theory")
        for mesh in ("default", "extrapolate")
    ]
    table(("crystal", "class", "specimen", *errors), specimens.large())


def run_specimens(arguments) -> None:
    """What grains cost."""
    header = (
        "specimen",
        "elements",
        "unknowns",
        "Gflop",
        "workspace, MB",
        "set-up, CPU s",
        "curve of 10 depths, CPU s",
    )
    table(header, specimens.costs(ZINC))


def random_crystals(symmetry: str, count: int, seed: int = 1):
    """Stiffness, angles and anisotropy index of crystals drawn uniformly from a domain of the
    paper.
    """
    lower, upper, cap = DOMAINS[symmetry]
    random = np.random.default_rng(seed)
    drawn = []
    while len(drawn) < count:
        constants = random.uniform(lower, upper)
        angles = (
            random.uniform(0, 360),
            np.degrees(np.arccos(random.uniform(-1, 1))),
            random.uniform(0, 360),
        )
        stiffness = bi.stiffness(
            symmetry, **dict(zip(constant_names(symmetry), constants, strict=True))
        )
        index = float(bi.anisotropy_index(stiffness))
        if index <= cap:
            drawn.append((stiffness, angles, index))
    return tuple(np.array(column) for column in zip(*drawn, strict=True))


def run_random(arguments) -> None:
    """Errors at random crystals."""
    rows = []
    for label, model in (
        ("default", bi.Indentation(extrapolate=False)),
        ("extrapolate", bi.Indentation(extrapolate=True)),
    ):
        for symmetry in DOMAINS:
            matrices, angles, index = random_crystals(symmetry, arguments.random)
            results = model.run_many(matrices, angles, workers=arguments.workers, errors="return")
            failed = np.array([isinstance(result, Exception) for result in results])
            moduli = np.array(
                [np.nan if isinstance(r, Exception) else r.indentation_modulus_gpa for r in results]
            )
            errors = 100 * np.abs(moduli / bi.halfspace_modulus(matrices, angles) - 1)
            for name, part in (("<= 10", index <= 10), ("> 10", index > 10)):
                if (part & ~failed).any():
                    worst = int(np.nanargmax(np.where(part, errors, np.nan)))
                    rows.append(
                        (
                            label,
                            symmetry,
                            name,
                            part.sum(),
                            (part & failed).sum(),
                            f"{np.nanmean(errors[part]):.3f}",
                            f"{errors[worst]:.3f}",
                            f"{index[worst]:.1f}",
                        )
                    )
    table(
        (
            "settings",
            "domain",
            "index",
            "crystals",
            "failed",
            "mean error, %",
            "worst, %",
            "its index",
        ),
        rows,
    )


def soft_crystals(count: int, seed: int):
    """Stiffness and angles of crystals with one soft mode, of four kinds in turn, softened by up to
    150 times.
    """
    random = np.random.default_rng(seed)
    drawn = []
    for k in range(count):
        soft, bulk = 50 * np.exp(-random.uniform(0.5, 5.0)), 50 * np.exp(random.uniform(-0.3, 2.0))
        hexagonal = {
            "C11": random.uniform(100, 240),
            "C33": random.uniform(80, 210),
            "C13": random.uniform(20, 80),
            "C44": random.uniform(30, 90),
            "C12": random.uniform(20, 60),
        }
        crystals = (
            ("cubic", {"C11": bulk + 4 / 3 * soft, "C12": bulk - 2 / 3 * soft, "C44": 50.0}),
            ("cubic", {"C11": bulk + 4 / 3 * 50, "C12": bulk - 2 / 3 * 50, "C44": soft}),
            ("hexagonal", hexagonal | {"C12": hexagonal["C11"] - 2 * soft}),
            ("hexagonal", hexagonal | {"C44": soft}),
        )
        symmetry, constants = crystals[k % 4]
        angles = (
            random.uniform(0, 360),
            np.degrees(np.arccos(random.uniform(-1, 1))),
            random.uniform(0, 360),
        )
        drawn.append((bi.stiffness(symmetry, **constants), angles))
    return tuple(np.array(column) for column in zip(*drawn, strict=True))


def run_soft(arguments) -> None:
    """Errors towards instability, by log-anisotropy, beside the largest that the program states."""
    matrices, angles = soft_crystals(arguments.random, arguments.seed)
    exact, size = bi.halfspace_modulus(matrices, angles), log_anisotropy(matrices)
    rows, worst = [], {}
    variants = {
        "default": {},
        "extrapolate": {"extrapolate": True},
        "c3d8": {"element": "c3d8"},
        "refine = 0.6": {"refine": 0.6},
        "c3d8, refine = 0.6": {"refine": 0.6, "element": "c3d8"},
    }
    for label, options in variants.items():
        model = bi.Indentation(**({"extrapolate": False} | options))
        results = model.run_many(matrices, angles, workers=arguments.workers, errors="return")
        moduli = np.array(
            [np.nan if isinstance(r, Exception) else r.indentation_modulus_gpa for r in results]
        )
        errors, stated = 100 * np.abs(moduli / exact - 1), 100 * model.largest_error(matrices)
        worst[label] = np.nanmax((errors / size**3.5)[size > 1.5])
        for low, high in (
            (0, 1),
            (1, 2),
            (2, 2.5),
            (2.5, 3),
            (3, 3.5),
            (3.5, 4),
            (4, 4.5),
            (4.5, 5),
            (5, 9),
        ):
            part = (size >= low) & (size < high)
            done = part & np.isfinite(errors)
            if done.any():
                rows.append(
                    (
                        label,
                        f"{low:g} to {high:g}",
                        part.sum(),
                        (part & ~done).sum(),
                        f"{errors[done].mean():.2f}",
                        f"{errors[done].max():.2f}",
                        f"{stated[part].min():.2f} to {stated[part].max():.2f}",
                        (errors > stated)[done].sum(),
                    )
                )
    header = (
        "settings",
        "log-anisotropy",
        "crystals",
        "failed",
        "mean error, %",
        "worst, %",
        "stated, %",
        "beyond what is stated",
    )
    table(header, rows)
    print(
        "\nlargest error over L^3.5, L > 1.5, %: "
        + ", ".join(f"{label} {value:.3f}" for label, value in worst.items())
    )


def run_convergence(arguments) -> None:
    """Errors over the parameters of the half-space mesh."""
    crystals = {
        "isotropic": (ISOTROPIC, (0, 0, 0)),
        "Zn, 90 degrees": (ZINC, (0, 90, 0)),
        "Cu, general": (COPPER, (200, 50, 25)),
        "hexagonal, index 15": (SOFT, (30, 60, 0)),
    }
    matrices = np.array([crystal[0] for crystal in crystals.values()])
    angles = np.array([crystal[1] for crystal in crystals.values()], dtype=float)
    exact = bi.halfspace_modulus(matrices, angles)

    def errors(**options):
        model = bi.Indentation(**({"extrapolate": False} | options))
        results = model.run_many(matrices, angles, workers=arguments.workers)
        return model.elements, 100 * (
            np.array([result.indentation_modulus_gpa for result in results]) / exact - 1
        )

    studies = {
        "elements per contact radius, C3D8I": [
            (f"{9.5 * r:.3g}", {"refine": r}) for r in (0.6, 0.8, 1.0, 1.25, 1.5)
        ],
        "elements per contact radius, C3D8": [
            (f"{9.5 * r:.3g}", {"refine": r, "element": "c3d8"}) for r in (0.6, 0.8, 1.0, 1.25)
        ],
        "elements per contact radius, extrapolated": [
            (f"{9.5 * r:.3g}", {"extrapolate": True, "refine": r}) for r in (0.8, 1.0, 1.25)
        ],
        "infinite elements begin at, contact radii": [
            (f"{r:g}", {"outer": r}) for r in (2, 3, 5, 8)
        ],
        "growth of the layers, C3D8I": [
            (f"{g:g}", {"growth": g}) for g in (1.13, 1.2, 1.4, 1.5, 1.7)
        ],
        "growth of the layers, C3D8": [
            (f"{g:g}", {"growth": g, "element": "c3d8"}) for g in (1.05, 1.13, 1.2, 1.4)
        ],
        "growth of the layers, extrapolated": [
            (f"{g:g}", {"growth": g, "extrapolate": True}) for g in (1.2, 1.35, 1.4, 1.5)
        ],
    }
    rows, curves = [], {}
    for study, variants in studies.items():
        for value, options in variants:
            elements, error = errors(**options)
            rows.append((study, value, elements, *(f"{e:+.3f}" for e in error)))
            curves.setdefault(study, []).append((float(value), error))
    table(("parameter", "value", "elements", *(f"{name}, %" for name in crystals)), rows)
    if arguments.figures:
        draw_convergence(arguments.figures / "simulation_convergence.png", curves, list(crystals))


def draw_convergence(path: Path, curves: dict, names: list[str]) -> None:
    """Error over each parameter, a line for each crystal."""
    plt = pyplot()
    figure, axes = plt.subplots(1, 3, figsize=(11, 3.6), sharey=True, layout="constrained")
    styles = {"C3D8I": "o-", "C3D8": "s:", "extrapolated": "^--"}
    for study, points in curves.items():
        x, y = np.array([p[0] for p in points]), np.array([p[1] for p in points])
        axis = (
            axes[0]
            if study.startswith("elements")
            else axes[1]
            if study.startswith("infinite")
            else axes[2]
        )
        kind = "C3D8I" if study.startswith("infinite") else study.split(", ")[-1]
        axis.set_prop_cycle(None)
        axis.plot(
            x,
            y,
            styles[kind],
            ms=4,
            lw=1,
            label=[f"{name}, {kind}" for name in names] if axis is axes[0] else names,
        )
        axis.set_xlabel(
            study.split(", C3D8I")[0].replace(", extrapolated", "").replace(", C3D8", "")
        )
    for axis in axes:
        axis.axhline(0, color="0.6", lw=0.8)
        axis.grid(alpha=0.3)
    axes[0].set_ylabel("error of M against exact theory, %")
    axes[0].set_ylim(-1, 3)
    axes[1].legend(fontsize=7)
    axes[0].text(
        0.98,
        0.97,
        "● C3D8I  ■ C3D8  ▲ C3D8I extrapolated",
        transform=axes[0].transAxes,
        ha="right",
        va="top",
        fontsize=7,
    )
    figure.savefig(path, dpi=110)


def run_cost(arguments) -> None:
    """One curve against its factorisation, and the factorisation against SGEMM."""
    peak = sgemm_rate()
    rows = []
    for geometry in ("block", "halfspace"):
        model = bi.Indentation(geometry=geometry)
        results = [timed(lambda model=model: model.run(ZINC, (0, 30, 0))) for _ in range(7)]
        cpu = min(seconds for seconds, _ in results)
        bare, total = min((result.seconds_factor, result.seconds) for _, result in results)
        # On a busy machine wall time means little: the rate is that of the factorisation's share of
        # the CPU time.
        rate = 1e-9 * model.factor_operations / (cpu * bare / total)
        rows.append(
            (
                geometry,
                model.elements,
                model.unknowns,
                f"{1e-9 * model.factor_operations:.1f}",
                f"{bare:.3f}",
                f"{total:.3f}",
                f"{total / bare:.2f}",
                f"{cpu:.3f}",
                f"{rate:.1f}",
                f"{100 * rate / peak:.0f}",
            )
        )
    print(f"SGEMM on one core: {peak:.1f} Gflop/s\n")
    table(
        (
            "specimen",
            "elements",
            "unknowns",
            "Gflop",
            "factorisation, s",
            "curve of 10 depths, s",
            "ratio",
            "CPU, s",
            "Gflop/s",
            "% of SGEMM",
        ),
        rows,
    )


def timed(work):
    """CPU seconds of a call, and its value."""
    start = time.process_time()
    value = work()
    return time.process_time() - start, value


def sgemm_rate(n: int = 2000) -> float:
    """Gflop/s of the matrix product in single precision of the BLAS that the simulations use, best
    of five, one thread.
    """
    blas = ctypes.CDLL("libopenblas.so.0")
    blas.openblas_set_num_threads(1)
    a, b, c = (np.full((n, n), value, dtype=np.float32) for value in (1, 1, 0))
    pointers = [ctypes.c_void_p(matrix.ctypes.data) for matrix in (a, b, c)]
    one, zero = ctypes.c_float(1.0), ctypes.c_float(0.0)

    def product():
        blas.cblas_sgemm(
            102, 111, 111, n, n, n, one, pointers[0], n, pointers[1], n, zero, pointers[2], n
        )

    return 2e-9 * n**3 / min(timed(product)[0] for _ in range(5))


def run_ccx(arguments) -> None:
    """CalculiX on the same problems."""
    if shutil.which("ccx") is None:
        print("CalculiX is not installed (Debian package calculix-ccx)")
        return
    set_up, model = min(
        (
            timed(lambda: bi.Indentation(geometry="block", integration="full", depths=4))
            for _ in range(5)
        ),
        key=lambda pair: pair[0],
    )
    ours = min(
        (timed(lambda: model.run(ZINC, (0, 30, 0))) for _ in range(5)), key=lambda pair: pair[0]
    )
    first = set_up + ours[0]
    seconds, memory, force = calculix(model, (0, 30, 0))
    table(
        ("program", "elements", "CPU, s", "ratio", "peak memory, MB", "largest difference of P"),
        [
            (
                "bayesindent, set-up and curve",
                model.elements,
                f"{first:.2f}",
                "1",
                "see memory",
                "",
            ),
            (
                "bayesindent, a further crystal",
                model.elements,
                f"{ours[0]:.2f}",
                f"{ours[0] / first:.2f}",
                "see memory",
                "",
            ),
            (
                "ccx",
                model.elements,
                f"{seconds:.1f}",
                f"{seconds / first:.0f}",
                f"{memory:.0f}",
                f"{np.abs(force / ours[1].force_mn - 1).max():.1e}",
            ),
        ],
    )
    print()
    rows = []
    for name in ("hemisphere, 2.5 um",):
        settings = specimens.around(specimens.SPECIMENS[name], 160.0, 0.25)
        model = bi.Indentation(**settings, element="c3d8", integration="full", depths=2)
        seconds, _, force = calculix(model, (20, 35, 10))
        cpu, result = timed(lambda model=model: model.run(ZINC, (20, 35, 10)))
        rows.append(
            (
                name,
                model.elements,
                f"{cpu:.2f}",
                f"{seconds:.1f}",
                f"{np.abs(force / result.force_mn - 1).max():.1e}",
            )
        )
    table(
        ("specimen", "elements", "bayesindent, CPU s", "ccx, CPU s", "largest difference of P"),
        rows,
    )


def calculix(model, angles) -> tuple[float, float, np.ndarray]:
    """CPU seconds, peak memory (MB) and the forces (mN) of CalculiX on the deck of a simulation of
    zinc.
    """
    with tempfile.TemporaryDirectory() as folder:
        (Path(folder) / "deck.inp").write_text(model.deck(ZINC, angles))
        before = resource.getrusage(resource.RUSAGE_CHILDREN)
        one_thread = os.environ | {"OMP_NUM_THREADS": "1"}
        subprocess.run(["ccx", "deck"], cwd=folder, check=True, capture_output=True, env=one_thread)
        after = resource.getrusage(resource.RUSAGE_CHILDREN)
        steps = (Path(folder) / "deck.dat").read_text().split("forces (fx,fy,fz)")[1:]
    force = np.array([-float(step.splitlines()[2].split()[3]) for step in steps])
    return (
        after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime,
        after.ru_maxrss / 1024,
        force,
    )


MEMORY = """
import sys
import numpy as np
import bayesindent as bi
C = bi.stiffness("hexagonal", C11=161.1, C12=34.2, C44=38.3, C33=61.1, C13=50.3)
def peak():
    # Not ru_maxrss: a process begins with its parent's.
    lines = open("/proc/self/status")
    return int(next(line for line in lines if line.startswith("VmHWM")).split()[1])
base = peak()
workers = int(sys.argv[1])
model = bi.Indentation(geometry="block")
model.run_many([C] * 2 * workers, [(0, 10 * k, 0) for k in range(2 * workers)], workers=workers)
print(base / 1024, peak() / 1024, model.workspace_bytes / 1e6)
"""


def run_memory(arguments) -> None:
    """Peak resident memory on the paper's block."""
    rows = []
    for workers in (1, 2):
        output = subprocess.run(
            [sys.executable, "-c", MEMORY, str(workers)], check=True, capture_output=True, text=True
        ).stdout
        base, peak, workspace = map(float, output.split())
        rows.append(
            (
                workers,
                f"{peak:.0f}",
                f"{base:.0f}",
                f"{(peak - base) / workers:.0f}",
                f"{workspace:.0f}",
            )
        )
    table(
        (
            "workers",
            "peak, MB",
            "Python and libraries, MB",
            "rest per worker, MB",
            "factor and stacks, MB",
        ),
        rows,
    )


def run_workers(arguments) -> None:
    """Curves a second with one and two threads."""
    model = bi.Indentation(geometry="block")
    count = 8
    crystals = (
        np.array([ZINC] * count),
        np.array([(0, 10 * k, 0) for k in range(count)], dtype=float),
    )
    model.run_many(crystals[0][:2], crystals[1][:2], workers=2)
    seconds, cpu = {}, {}
    for workers in (1, 2):
        start = time.perf_counter()
        cpu[workers], _ = timed(lambda workers=workers: model.run_many(*crystals, workers=workers))
        seconds[workers] = time.perf_counter() - start
    table(
        ("workers", f"seconds for {count} curves", "curves an hour", "speed-up", "CPU seconds"),
        [
            (w, f"{s:.2f}", f"{3600 * count / s:.0f}", f"{seconds[1] / s:.2f}", f"{cpu[w]:.2f}")
            for w, s in seconds.items()
        ],
    )
    print(
        f"\nload average {os.getloadavg()[0]:.1f} on {os.cpu_count()} cores (where it is "
        "higher, others were at work)"
    )


def run_size(arguments) -> None:
    """Cost over mesh size on the paper's block."""
    rows, points = [], []
    for refine in (0.7, 0.85, 1.0, 1.2, 1.4, 1.55, 1.7):
        model = bi.Indentation(geometry="block", refine=refine)
        if model.elements > 1.05 * arguments.largest:
            break
        # CPU times: on a busy machine wall time means little.
        total, result = min(
            (timed(lambda model=model: model.run(ZINC, (0, 30, 0))) for _ in range(2)),
            key=lambda pair: pair[0],
        )
        seconds = total * result.seconds_factor / result.seconds
        points.append((model.unknowns, seconds, model.factor_entries, total))
        rate = 1e-9 * model.factor_operations / seconds
        rows.append(
            (
                model.elements,
                model.unknowns,
                f"{seconds:.2f}",
                f"{total:.2f}",
                f"{1e-6 * model.factor_entries:.1f}",
                f"{1e-9 * model.factor_operations:.0f}",
                f"{rate:.1f}",
                f"{1e-6 * model.workspace_bytes:.0f}",
            )
        )
        del model
    table(
        (
            "elements",
            "unknowns",
            "factorisation, CPU s",
            "curve, CPU s",
            "entries of the factor, millions",
            "Gflop",
            "Gflop/s",
            "workspace, MB",
        ),
        rows,
    )
    n, seconds, entries, _ = np.array(points).T
    if len(n) > 1:
        slopes = [np.polyfit(np.log(n), np.log(y), 1)[0] for y in (seconds, entries)]
        print(
            f"\nfitted exponents of n: time {slopes[0]:.2f} (theory 2), storage {slopes[1]:.2f} "
            "(theory 4/3)"
        )
    if arguments.figures:
        draw_size(arguments.figures / "simulation_cost.png", n, seconds, entries)


def draw_size(path: Path, n, seconds, entries) -> None:
    """Time and storage over the number of unknowns beside their theoretical growth."""
    plt = pyplot()
    figure, axes = plt.subplots(1, 2, figsize=(8, 3.4), layout="constrained")
    for axis, y, power, label in (
        (axes[0], seconds, 2, "factorisation, CPU s"),
        (axes[1], 4e-6 * entries, 4 / 3, "factor, MB"),
    ):
        axis.loglog(n, y, "o", label="measured")
        axis.loglog(
            n,
            y[0] * (n / n[0]) ** power,
            "--",
            color="0.4",
            label="$n^2$" if power == 2 else "$n^{4/3}$",
        )
        axis.set_xlabel("unknowns n")
        axis.xaxis.set_minor_formatter("")
        axis.set_ylabel(label)
        axis.legend()
        axis.grid(alpha=0.3, which="both")
    figure.savefig(path, dpi=110)


def pyplot():
    """Matplotlib without a display."""
    import matplotlib

    matplotlib.use("Agg")
    import matplotlib.pyplot as plt

    return plt


if __name__ == "__main__":
    sys.exit(main())
