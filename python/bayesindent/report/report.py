"""The report: one HTML page that needs nothing beside it, made from whatever a folder of results holds."""

import base64
import hashlib
import html
import io
import json
import platform
from collections.abc import Iterable, Sequence
from importlib import metadata
from pathlib import Path

import f90nml
import numpy as np
import xarray

from ..core import BayesindentError
from ..crystal.elasticity import constant_names
from ..pipeline.simulator import new_indentation
from ..report import figures
from ..surrogate.surrogate import Surrogate
from ..version import __version__

__all__ = ["write_report"]

#: Samples of the posterior that are carried through the surrogate for a figure.
POSTERIOR_DRAWS = 200

STYLE = """
:root { color-scheme: light; }
body { font: 16px/1.55 system-ui, sans-serif; color: #1c2024; background: #fff; margin: 0 auto; max-width: 52rem; padding: 2rem 1.2rem 4rem; }
h1 { font-size: 1.7rem; line-height: 1.2; margin: 0 0 .3rem; }
h2 { font-size: 1.25rem; margin: 2.6rem 0 .6rem; border-bottom: 1px solid #d7dbe0; padding-bottom: .25rem; }
.lead { color: #50575f; margin-top: 0; }
.synthetic { background: #fbeee6; border-left: 4px solid #D55E00; padding: .5rem .9rem; }
.warnings { background: #fff8e1; border-left: 4px solid #E69F00; padding: .5rem .9rem .5rem 2rem; margin: 1rem 0; }
table { border-collapse: collapse; margin: .8rem 0 1.2rem; font-variant-numeric: tabular-nums; font-size: .92rem; }
caption { text-align: left; color: #50575f; padding-bottom: .3rem; caption-side: top; }
th, td { padding: .22rem .8rem .22rem 0; text-align: right; border-bottom: 1px solid #eceef1; }
th:first-child, td:first-child { text-align: left; }
thead th { border-bottom: 1px solid #8b949e; font-weight: 600; }
figure { margin: 1.2rem 0; }
figure img { max-width: 100%; height: auto; }
figcaption { color: #50575f; font-size: .92rem; }
pre { background: #f5f6f8; padding: .8rem; overflow-x: auto; font-size: .85rem; }
.wide { overflow-x: auto; }
"""


def write_report(folder: Path, output: Path | None = None, kind_of_files: str = "") -> Path:
    """Write report.html into `output` (default: the folder itself) from the results in `folder`; return its path.

    With `kind_of_files` ('png', 'pdf' or 'svg') every figure is also a file in `folder`/figures.
    """
    results = Results(Path(folder), kind_of_files)
    with figures.house_style():
        sections = [
            summary_section(results),
            simulation_section(results),
            surrogate_section(results),
            posterior_section(results),
            identifiability_section(results),
            next_section(results),
            provenance_section(results),
        ]
    page = "\n".join(
        [
            '<!doctype html>\n<html lang="en">\n<head>\n<meta charset="utf-8">',
            '<meta name="viewport" content="width=device-width, initial-scale=1">',
            f"<title>{text(results.title)}</title>\n<style>{STYLE}</style>\n</head>\n<body>",
            *filter(None, sections),
            "</body>\n</html>\n",
        ]
    )
    file = Path(output or folder) / "report.html"
    file.parent.mkdir(parents=True, exist_ok=True)
    file.write_text(page, encoding="utf-8")
    return file


class Results:
    """What the stages left in a folder; a stage that did not run is an empty document."""

    def __init__(self, folder: Path, kind_of_files: str = ""):
        self.folder, self.kind_of_files = folder, kind_of_files
        resolved = folder / "resolved.nml"
        self.namelist = f90nml.read(resolved) if resolved.exists() else f90nml.Namelist()
        problem = self.namelist.get("problem", {})
        self.symmetry = problem.get("symmetry", "cubic")
        self.constants = constant_names(self.symmetry)
        self.synthetic = bool(problem.get("synthetic", False))
        self.title = problem.get("title") or f"Indentation of a {self.symmetry} metal"
        self.simulate, self.theory, self.build, self.extract, self.next = (
            self.document(name) for name in ("simulate", "theory", "build", "summary", "next")
        )

    def document(self, name: str) -> dict:
        file = self.folder / f"{name}.json"
        return json.loads(file.read_text()) if file.exists() else {}

    def figure(self, name: str, drawing, alt: str, caption: str) -> str:
        """A figure as HTML, with its words for those who cannot see it; kept as a file too if that is wanted."""
        if self.synthetic:
            figures.stamp_synthetic(drawing)
        if self.kind_of_files:
            (self.folder / "figures").mkdir(exist_ok=True)
            drawing.savefig(self.folder / "figures" / f"{name}.{self.kind_of_files}")
        buffer = io.BytesIO()
        drawing.savefig(buffer, format="png")
        data = base64.b64encode(buffer.getvalue()).decode()
        return f'<figure><img src="data:image/png;base64,{data}" alt="{text(alt)}"><figcaption>{text(caption)}</figcaption></figure>'

    def surrogate(self) -> Surrogate | None:
        """The surrogate of the folder, or the shipped one that its problem names."""
        name = self.namelist.get("surrogate", {}).get("file") or "surrogate.nc"
        for candidate in (self.folder / name, name):
            try:
                return Surrogate.load(candidate)
            except BayesindentError:
                continue
        return None

    def samples(self) -> dict[str, np.ndarray]:
        """Chains (chain, draw) of each constant."""
        with xarray.open_dataset(self.folder / "posterior.nc", group="posterior") as posterior:
            return {name: posterior[name].values for name in self.constants}


class Markup(str):
    """A text that is HTML already."""

    __slots__ = ()


def text(value) -> str:
    """Escape for HTML."""
    return value if isinstance(value, Markup) else html.escape(str(value), quote=True)


def table(caption: str, header: Sequence[str], rows: Iterable[Sequence]) -> str:
    """A table as HTML."""
    head = "".join(f"<th scope=col>{text(cell)}</th>" for cell in header)
    body = "".join("<tr>" + "".join(f"<td>{text(cell)}</td>" for cell in row) + "</tr>" for row in rows)
    return f'<div class="wide"><table><caption>{text(caption)}</caption><thead><tr>{head}</tr></thead><tbody>{body}</tbody></table></div>'


def number(value, digits: int = 1) -> str:
    """A number as text; a dash where there is none."""
    return "–" if value is None or not np.isfinite(value) else f"{value:.{digits}f}"


def summary_section(results: Results) -> str:
    """Title, what was estimated, and every warning."""
    parts = [f"<h1>{text(results.title)}</h1>"]
    parts.append(
        '<p class="lead">Elastic constants of single crystals from spherical indentation. Uncertainties are standard deviations (sd).</p>'
    )
    if results.synthetic:
        parts.append(
            '<p class="synthetic"><strong>Synthetic data.</strong> The measurements are made up, to show or to test the method.</p>'
        )
    if results.extract:
        rows = [
            [
                name,
                number(item["mean"]),
                number(item["sd"]),
                number(item["map"]),
                f"{number(item['hdi_95'][0])} to {number(item['hdi_95'][1])}",
            ]
            for name, item in results.extract["parameters"].items()
        ]
        parts.append(table("Elastic constants in GPa", ["constant", "mean", "sd", "most probable", "95 % interval"], rows))
    documents = results.simulate, results.theory, results.build, results.extract, results.next
    warnings = dict.fromkeys(warning for document in documents for warning in document.get("warnings", []))
    if warnings:
        items = "".join(f"<li>{text(warning)}</li>" for warning in warnings)
        parts.append(f'<ul class="warnings" aria-label="warnings">{items}</ul>')
    return "\n".join(parts)


def simulation_section(results: Results) -> str:
    """Simulated indentations and the theory."""
    rows = [row for row in results.simulate.get("results", []) if row["indentation_modulus_gpa"] and row["depth_um"]]
    theory = [row["indentation_modulus_gpa"] for row in results.theory.get("results", [])]
    if not rows:
        return ""
    settings = results.namelist.get("simulation", {})
    other = results.simulate.get("other_mesh")
    radius = settings.get("radius_um", 16.0)
    parts = [
        "<h2>Simulated indentations</h2>",
        results.figure(
            "load_depth",
            figures.load_depth(rows, radius),
            f"Force against depth to the power 1.5 for {len(rows)} simulated indentations; the points lie on straight lines.",
            f"Force against depth to the power 1.5 under a rigid sphere of radius {radius:g} µm. The slope of the fit through the origin is "
            "4/3 M √R, with M the indentation modulus.",
        ),
    ]
    if "simulation" in results.namelist:
        parts[1:1] = [mesh_figure(results, rows, mesh) for mesh in (["", other["mesh"]] if other else [""])]
    if len(theory) == len(rows):
        simulated = [row["indentation_modulus_gpa"] for row in rows]
        angles = np.array([row["euler_deg"] for row in rows])
        one_crystal = all(row["constants"] == rows[0]["constants"] for row in rows) and len(rows) > 1
        largest = np.max(np.abs(np.divide(simulated, theory) - 1))
        if one_crystal and np.ptp(angles[:, 1]) > 0 and not np.ptp(angles[:, [0, 2]], axis=0).any():
            series = {settings.get("mesh", "halfspace"): simulated}
            if other and len(other["indentation_modulus_gpa"]) == len(rows) and None not in other["indentation_modulus_gpa"]:
                series[other["mesh"]] = other["indentation_modulus_gpa"]
            drawing = figures.modulus_over_declination(angles[:, 1], series, theory)
        else:
            drawing = figures.modulus_against_theory(simulated, theory)
        words = f"Finite elements beside the exact theory of the half-space: they differ by at most {100 * largest:.2f} %."
        if other:
            bias = 100 * (np.divide([value or np.nan for value in other["indentation_modulus_gpa"]], theory) - 1)
            words += (
                f" On the {other['mesh']} mesh: by {np.nanmin(bias):.1f} to {np.nanmax(bias):.1f} %; the finite block of the paper is "
                "stiffer than a half-space, by an amount that depends on crystal and orientation."
            )
        parts.append(results.figure("theory", drawing, words, words + " The simulations use nothing of the theory."))
    header = [
        "φ₁, Φ, φ₂ (degrees)",
        "M (GPa)",
        *(["theory (GPa)", "difference (%)"] if len(theory) == len(rows) else []),
        "elements",
        "seconds",
    ]
    body = []
    for index, row in enumerate(rows):
        modulus = row["indentation_modulus_gpa"]
        compared = [number(theory[index], 2), number(100 * (modulus / theory[index] - 1), 2)] if len(theory) == len(rows) else []
        body.append([figures.orientation(row["euler_deg"]), number(modulus, 2), *compared, row["elements"], number(row["seconds"], 2)])
    parts.append(table("Indentation moduli" + (", the first 40" if len(body) > 40 else ""), header, body[:40]))
    return "\n".join(parts)


def mesh_figure(results: Results, rows: list[dict], other: str = "") -> str:
    """A picture of the mesh that the simulations used, or of the `other` one."""
    indentation = new_indentation(results.namelist, other)
    mesh = indentation.mesh_arrays()
    contact_radius = float(np.sqrt(indentation.radius_um * rows[0]["depth_um"][-1]))
    outside = (
        f"; {indentation.infinite_elements} infinite elements outside stand for the rest of the half-space"
        if indentation.infinite_elements
        else ""
    )
    words = f"The {indentation.mesh} mesh of {indentation.bricks} bricks{outside}"
    return results.figure(
        f"mesh_{other}" if other else "mesh",
        figures.mesh_picture(mesh.x, mesh.brick, mesh.contact, contact_radius),
        f"{words}, with a quarter cut away, and its surface under the indenter.",
        f"{words}. On the right its surface under the indenter, with the circle of contact of an isotropic solid at the last depth.",
    )


def surrogate_section(results: Results) -> str:
    """How the surrogate was taught, and how well it knows the simulations."""
    build = results.build
    if not build:
        return ""
    facts = [
        ["simulations in all", build["simulations"]],
        ["of them failed", build["failed"]],
        ["terms of the basis", build["terms"]],
        ["mean error of a simulation left out (GPa)", number(build["loocv_gpa"], 3)],
        ["mean error of a crystal left out (GPa)", number(build.get("leave_crystal_out_gpa"), 3)],
        ["precision of the coefficients, α", f"{build['alpha']:.4g}"],
        ["precision of the simulations, β", f"{build['beta']:.4g}"],
        ["factor on every sd, learnt from crystals left out", number(build.get("sd_inflation"), 2)],
        ["stopped because", build.get("stopped", "–")],
    ]
    parts = ["<h2>Step 1: the surrogate</h2>", table("The surrogate of the indentation modulus", ["", "value"], facts)]
    history = build["history"]
    if len(history) > 1:
        baseline = build.get("baselines", {})
        labels = {"leave_crystal_out_gpa": "a crystal left out", "next_gpa": "the next points, before they are added"}
        count = [entry["simulations"] for entry in history]
        series = {label: (count, [np.nan if entry[name] is None else entry[name] for entry in history]) for name, label in labels.items()}
        lines = {
            "theory alone": baseline.get("theory_gpa"),
            "theory times one ratio": baseline.get("theory_times_ratio_gpa"),
        }
        last = number(history[-1]["leave_crystal_out_gpa"], 2)
        parts += [
            results.figure(
                "learning_curve",
                figures.learning_curve(series, {label: value for label, value in lines.items() if value}),
                f"Error against the number of simulations; the error of a crystal left out ends at {last} GPa.",
                "Mean absolute error against the number of simulations: of crystals left out of the fit, and of the next points, which the "
                "variance chooses as the hardest. Beside them, what the half-space theory does without a surrogate.",
            ),
            results.figure(
                "coefficients",
                figures.coefficients(count, [entry["norm"] for entry in history], [entry["angle_deg"] for entry in history]),
                "Norm of the coefficient vector, and the angle between updates, against the number of simulations.",
                "The vector of coefficients settles: its norm, and the angle through which each update turns it.",
            ),
        ]
    surrogate = results.surrogate()
    if surrogate is not None and surrogate.data:
        simulated = surrogate.data["modulus_gpa"]
        predicted, sd = surrogate.predict(surrogate.data["constants"], surrogate.data["euler_deg"])
        parts.append(
            results.figure(
                "parity",
                figures.parity(simulated, predicted, sd),
                "Predicted against simulated moduli: the points lie on the diagonal.",
                "The surrogate on the simulations that taught it, with one sd. The bands on the right are 1 and 2 sd.",
            )
        )
    if validation := build.get("validation"):
        error = number(validation["mean_absolute_gpa"], 2)
        parts.append(
            results.figure(
                "validation",
                figures.parity(validation["simulated"], validation["predicted"], validation["sd"]),
                f"Predicted against simulated moduli of {validation['points']} points that the surrogate has not seen; mean error {error} GPa.",
                f"The surrogate on {validation['points']} simulations that it has not seen, the next by variance: mean absolute error "
                f"{error} GPa, {100 * validation['within_1_sd']:.0f} % within 1 sd and {100 * validation['within_2_sd']:.0f} % within 2.",
            )
        )
    if scan := build.get("scan"):
        best = max(scan, key=lambda entry: entry["log_evidence"])
        parts.append(
            results.figure(
                "truncations",
                figures.truncations(scan),
                "Leave-one-out error of several truncations against the number of simulations.",
                "Other truncations on the same simulations. The evidence is largest with degree "
                f"{best['degree']} and bandlimit {best['bandlimit']}.",
            )
        )
    return "\n".join(parts)


def posterior_section(results: Results) -> str:
    """The posterior of the constants."""
    document = results.extract
    if not document:
        return ""
    samples = results.samples()
    prior = results.namelist.get("prior", {})
    bounds = dict(zip(results.constants, zip(prior.get("c_min", []), prior.get("c_max", []), strict=False), strict=False))
    parameters = document["parameters"]
    kind = results.namelist.get("measurements", {}).get("modulus_kind", "indentation_modulus").replace("_", " ")
    words = ", ".join(f"{name} {item['mean']:.0f} with sd {item['sd']:.0f}" for name, item in parameters.items())
    parts = [
        "<h2>Step 2: the elastic constants</h2>",
        results.figure(
            "marginals",
            figures.marginals(samples, {name: item["map"] for name, item in parameters.items()}, bounds),
            f"Histograms of the posterior of each constant, in GPa: {words}.",
            "What the measurements say of each constant by itself; above each, mean ± sd. A thick line is a bound of the prior: where the "
            "histogram ends at one, the bound decided.",
        ),
        results.figure(
            "pairs",
            figures.pairs(samples),
            "Points of the posterior for each pair of constants, with their correlations.",
            "Pairs of constants. Long thin clouds are ridges: combinations along which the measurements cannot tell crystals apart. The "
            "numbers are correlations.",
        ),
        results.figure(
            "grain_comparison",
            figures.grain_comparison(document["predicted"], kind),
            "Measured modulus of each grain beside the prediction of the posterior.",
            f"The {kind} of each grain, measured and as the posterior predicts it, in order of the prediction.",
        ),
    ]
    parts.append(orientation_figure(results, samples, document, kind))
    parts.append(
        results.figure(
            "traces",
            figures.traces(samples),
            "The sampled values of each chain in order.",
            "The chains. Healthy ones overlap and show no trend.",
        )
    )
    rows = [[name, number(item["r_hat"], 3), number(item["ess_bulk"], 0), number(item["ess_tail"], 0)] for name, item in parameters.items()]
    caption = f"Convergence of {document['chains']} chains of {document['samples']} samples; R-hat should be below 1.01"
    parts.append(table(caption, ["constant", "R-hat", "effective samples, bulk", "tail"], rows))
    return "\n".join(parts)


def orientation_figure(results: Results, samples: dict, document: dict, kind: str) -> str:
    """Predicted modulus over all orientations; nothing where the surrogate or the angles of the grains are not at hand."""
    surrogate = results.surrogate()
    grains = document["predicted"]
    if surrogate is None or kind != "indentation modulus" or any("euler_deg" not in item for item in grains):
        return ""
    draws = np.stack([samples[name].ravel() for name in results.constants], axis=1)
    draws = draws[np.linspace(0, len(draws) - 1, min(len(draws), POSTERIOR_DRAWS)).astype(int)]

    def predict(euler_deg) -> tuple[np.ndarray, np.ndarray]:
        constants = np.repeat(draws, len(euler_deg), axis=0)
        modulus, _ = surrogate.predict(constants, np.tile(euler_deg, (len(draws), 1)))
        modulus = modulus.reshape(len(draws), len(euler_deg))
        return modulus.mean(axis=0), modulus.std(axis=0)

    angles = np.array([item["euler_deg"] for item in grains])
    measured = [item["measured"] for item in grains]
    if results.symmetry == "cubic":
        drawing = figures.modulus_over_triangle(predict, angles, measured, kind)
        words = "Posterior mean and sd of the modulus over the standard triangle of crystal directions; discs are the measured grains"
        caption = f"{words}, on the left in the colour of what was measured."
    else:
        errors = [item.get("measured_sd") or 0.0 for item in grains]
        drawing = figures.curve_over_declination(predict, angles, measured, errors, kind)
        words = "Posterior of the modulus over the declination of the c axis, with the measured grains"
        caption = f"{words}."
    return results.figure("orientations", drawing, f"{words}.", caption)


def identifiability_section(results: Results) -> str:
    """What the data decided and what the prior did."""
    rows = results.extract.get("identifiability", [])
    if not rows:
        return ""
    combinations = [row for row in rows if row["kind"] == "combination"]
    quantities = [row for row in rows if row["kind"] == "quantity"]
    labels = [figures.product_of_powers(row["exponents"]) for row in combinations]
    labels += [figures.subscript(quantity_in_words(row["name"])) for row in quantities]
    shares = [row["contraction"] for row in rows]
    header = ["", "mean", "sd", "sd of the prior", "contraction"]
    body = []
    for row in quantities:
        unit = "" if row["unit"] == "1" else f" ({row['unit']})"
        digits = 1 if unit else 3
        values = [number(row[name], digits) for name in ("mean", "sd", "prior_sd")]
        body.append([quantity_in_words(row["name"]) + unit, *values, number(row["contraction"], 3)])
    hidden = combinations[-1]
    return "\n".join(
        [
            "<h2>What the data decided, and what the prior did</h2>",
            "<p>Indentation sees some combinations of the constants sharply and others hardly at all. The contraction is the share of the "
            "prior's variance that the data removed: where it is near 1 the data decided, where it is near 0 the result repeats the prior, "
            "however narrow its sd may look.</p>",
            results.figure(
                "contraction",
                figures.contraction(labels, shares, len(combinations)),
                f"Contraction of {len(combinations)} combinations of the constants, from {combinations[0]['contraction']:.3f} to "
                f"{hidden['contraction']:.3f}, and of {len(quantities)} quantities of the crystal.",
                "Above, products of powers of the constants, from the best to the worst identified; below, the constants and quantities that "
                "follow from them.",
            ),
            table(
                "Combinations of the constants; sd is relative",
                ["combination", "sd (%)", "sd of the prior (%)", "contraction"],
                [
                    [
                        Markup(powers_as_html(row["exponents"])),
                        *(number(100 * row[name], 2) for name in ("sd", "prior_sd")),
                        number(row["contraction"], 3),
                    ]
                    for row in combinations
                ],
            ),
            table("Quantities of the crystal", header, body),
        ]
    )


def quantity_in_words(name: str) -> str:
    """The name of a quantity of the crystal as people write it."""
    first, *rest = name.split("_")
    if first == "ratio":
        return "/".join(rest)
    if first == "youngs" and rest != ["modulus"]:
        return f"Young's modulus along {'45° to c' if rest == ['45'] else ' '.join(rest)}"
    owner = {"youngs": "Young's", "poisson": "Poisson's", "zener": "Zener"}
    return " ".join([owner.get(first, first), *rest])


def powers_as_html(exponents: dict[str, float]) -> str:
    """A product of powers of constants, such as C11^1 C44^0.77; powers that hardly count are left out."""
    return " ".join(
        f"<i>C</i><sub>{text(name[1:])}</sub>" + ("" if abs(power - 1) < 0.005 else f"<sup>{power:.2f}</sup>")
        for name, power in exponents.items()
        if abs(power) >= 0.05
    )


def next_section(results: Results) -> str:
    """Grains worth measuring next."""
    suggestions = results.next.get("suggestions", [])
    if not suggestions:
        return ""
    cubic = results.symmetry == "cubic"
    measured = [item["euler_deg"] for item in results.extract.get("predicted", []) if "euler_deg" in item]
    rows = [[rank, *(number(angle) for angle in item["euler_deg"]), f"{item['gain']:.3f}"] for rank, item in enumerate(suggestions, 1)]
    unit = f" ({results.next['unit']})" if results.next.get("unit") else ""
    return "\n".join(
        [
            "<h2>Which grain to measure next</h2>",
            results.figure(
                "next_grains",
                figures.next_grains(suggestions, cubic, measured, results.next.get("candidates", [])),
                f"The {len(suggestions)} orientations that one more measurement would teach most at.",
                "Orientations that are expected to teach most, ranked"
                + (", in the standard triangle." if cubic else ", over the declination of the c axis."),
            ),
            table(
                "Suggested orientations, each chosen given those above it",
                ["rank", "φ₁", "Φ", "φ₂ (degrees)", f"expected gain{unit}"],
                rows,
            ),
        ]
    )


def provenance_section(results: Results) -> str:
    """Versions, input and commands that made the results."""
    resolved = results.folder / "resolved.nml"
    log = results.folder / "run.log"
    commands = [line for line in log.read_text().splitlines() if f"INFO bayesindent {__version__[:1]}" in line] if log.exists() else []
    rows = [
        ["bayesindent", __version__],
        ["Python, system", f"{platform.python_version()}, {platform.system()} {platform.machine()}"],
        ["NumPy, SciPy, ArviZ", ", ".join(metadata.version(name) for name in ("numpy", "scipy", "arviz"))],
        ["seed", results.namelist.get("problem", {}).get("seed", "–")],
        ["last command", commands[-1].split(": ", 1)[-1] if commands else "–"],
        ["SHA-256 of the resolved input", hashlib.sha256(resolved.read_bytes()).hexdigest() if resolved.exists() else "–"],
    ]
    parts = ["<h2>Provenance</h2>", table("What made these results", ["", ""], rows)]
    if resolved.exists():
        parts.append(f"<details><summary>The resolved input</summary><pre>{text(resolved.read_text())}</pre></details>")
    return "\n".join(parts)
