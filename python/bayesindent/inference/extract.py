"""Step 2: the posterior of the elastic constants given indentation moduli of grains of known orientation.

Constants and moduli in GPa, angles in degrees. The densities and the chains are the core's; diagnostics are ArviZ's.
"""

import json
import os
import time
import warnings
from collections.abc import Mapping
from contextlib import nullcontext
from pathlib import Path

import numpy as np

from ..common.result_files import plain, whole_file
from ..core import InputError, check, native
from ..crystal.elasticity import constant_names
from ..inference.verdicts import orientation_verdicts, verdicts

__all__ = ["METHODS", "MODULUS_KINDS", "Posterior", "check_stage", "extract", "extract_stage", "quantities", "quantity_names", "summary"]

#: The numbers the core gives methods and kinds of modulus.
METHODS = ("ensemble", "scmh")
MODULUS_KINDS = ("indentation_modulus", "effective_modulus", "sample_modulus")

#: Samples of a chain before it is kept, where none are asked for.
BURN_IN = 20000

#: Degrees of freedom of Student's t where a number is not given.
STUDENT_DOF = 4.0

#: Arguments of `extract` that do not change the density.
SAMPLING = ("method", "samples", "burn_in", "chains", "seed", "threads")

#: Draws for derived quantities and predictions; more say nothing new.
MOST_DRAWS = 4000


def quantity_names(symmetry: str) -> dict[str, str]:
    """Quantities of a crystal and their units ('GPa', or '1' for ratios); the constants come first."""
    count, names, units = native.quantity_list(symmetry)
    names, units = names.decode(), units.decode()
    return {names[20 * i : 20 * i + 20].strip(): units[3 * i : 3 * i + 3].strip() for i in range(count)}


def quantities(symmetry: str, constants) -> dict[str, np.ndarray]:
    """All quantities of stable crystals, constants (..., k) in GPa: bulk, shear and Young's modulus and Poisson's ratio of the
    polycrystal (Voigt-Reuss-Hill), anisotropy index (Eq. 14), ratios, and Young's moduli along directions of the crystal."""
    values = np.asarray(constants, dtype=float)
    names = quantity_names(symmetry)
    flat = native.quantity_values(symmetry, len(names), np.asfortranarray(values.reshape(-1, values.shape[-1]).T))
    return {name: row.reshape(values.shape[:-1]) for name, row in zip(names, flat, strict=True)}


class Posterior:
    """The density of the constants, and of the logarithm of a factor on the sds where that is inferred.

    `euler_deg` (n, 3), `modulus_gpa` (n,), `sd_gpa` (n,) or None if `infer_scale`. `bounds` maps constants to (low, high);
    what it leaves out, or is None, is the surrogate's box, or wide enough for any metal. `priors` maps a quantity ('C44', 'bulk_modulus', ..; see
    `quantity_names`) or a ratio of two ('C33/C11') to the (mean, sd) of a normal factor. `student_t` is a number of degrees of
    freedom, True for `STUDENT_DOF`, or 0 for normal errors. `prior_only` leaves the data out.
    """

    def __init__(
        self,
        surrogate,
        euler_deg,
        modulus_gpa,
        sd_gpa,
        *,
        bounds: Mapping | None = None,
        anisotropy_cap: float | None = None,
        priors: Mapping | None = None,
        modulus_kind: str = "indentation_modulus",
        indenter_modulus_gpa: float = 1140.0,
        indenter_nu: float = 0.07,
        sample_nu: float = 0.3,
        calibration_sd: float = 0.0,
        student_t: float | bool = 0.0,
        infer_scale: bool = False,
        surrogate_variance: str = "full",
        prior_only: bool = False,
    ):
        self._handle = 0
        self.surrogate, self.symmetry = surrogate, surrogate.symmetry
        self.names = constant_names(self.symmetry)
        self.euler_deg = np.atleast_2d(np.asarray(euler_deg, dtype=float))
        self.modulus_gpa = np.atleast_1d(np.asarray(modulus_gpa, dtype=float))
        if sd_gpa is None and not infer_scale:
            raise InputError("the measurements have no sd_gpa; it may be absent only if a common scale is inferred")
        sd = np.ones_like(self.modulus_gpa) if sd_gpa is None else np.atleast_1d(np.asarray(sd_gpa, dtype=float))
        self.sd_gpa = sd
        n = len(self.modulus_gpa)
        if n == 0:
            raise InputError("there are no measurements: at least one grain is needed")
        if self.euler_deg.shape != (n, 3) or sd.shape != (n,):
            raise InputError(f"{n} moduli need angles ({n}, 3) and sds ({n},), not {self.euler_deg.shape} and {sd.shape}")
        if modulus_kind not in MODULUS_KINDS:
            raise InputError(f"modulus_kind: '{modulus_kind}' is unknown; allowed: {', '.join(MODULUS_KINDS)}")
        if surrogate_variance not in ("full", "none"):
            raise InputError(f"surrogate_variance: '{surrogate_variance}' is unknown; allowed: full, none")
        self.modulus_kind, self.infer_scale, self.calibration_sd = modulus_kind, bool(infer_scale), float(calibration_sd)
        self.surrogate_variance = surrogate_variance
        self.student_t = STUDENT_DOF if student_t is True else float(student_t)
        lower, upper = self._bounds(bounds)
        cap = float(surrogate.anisotropy_cap if anisotropy_cap is None else anisotropy_cap)
        numbers, values = self._normals(priors or {})
        self.priors = dict(priors or {})
        self._handle, dimension, self.share_inside, self.lower, self.upper, self.anisotropy_cap, status, message = native.calibration_new(
            surrogate.handle, lower, upper, cap, numbers, values, modulus_kind, indenter_modulus_gpa, indenter_nu,
            sample_nu, calibration_sd, "student" if self.student_t else "normal", self.student_t, int(infer_scale), int(surrogate_variance == "full"), int(prior_only),
            np.asfortranarray(np.radians(self.euler_deg).T), self.modulus_gpa, sd,
        )  # fmt: skip
        check(status, message)
        self.dimension = int(dimension)

    def __del__(self):
        if getattr(self, "_handle", 0):
            native.calibration_free(self._handle)

    def _bounds(self, bounds: Mapping | None) -> tuple[np.ndarray, np.ndarray]:
        whole = dict(zip(self.names, zip(*native.prior_default_bounds(self.surrogate.handle, len(self.names)), strict=True), strict=True))
        unknown = set(bounds or {}) - set(self.names)
        if unknown:
            raise InputError(
                f"bounds: a {self.symmetry} crystal has no constant {', '.join(sorted(unknown))}; it has {', '.join(self.names)}"
            )
        for name, pair in (bounds or {}).items():
            whole[name] = tuple(usual if stated is None else stated for stated, usual in zip(pair, whole[name], strict=True))
        pairs = np.array([whole[name] for name in self.names], dtype=float)
        return pairs[:, 0].copy(), pairs[:, 1].copy()

    def _normals(self, priors: Mapping) -> tuple[np.ndarray, np.ndarray]:
        names = list(quantity_names(self.symmetry))
        numbers, values = [(0, 0)], [(0.0, 1.0)]
        for key, (mean, sd) in priors.items():
            parts = key.split("/")
            if len(parts) > 2 or any(part not in names for part in parts):
                raise InputError(f"priors: '{key}' is unknown; allowed: {', '.join(names)}, or the ratio of two of them with a /")
            numbers.append((names.index(parts[0]) + 1, names.index(parts[1]) + 1 if len(parts) == 2 else 0))
            values.append((float(mean), float(sd)))
        return np.asfortranarray(np.array(numbers, dtype=np.intc).T), np.asfortranarray(np.array(values).T)

    def sample(self, *, method: str, samples: int, burn_in: int, chains: int, threads: int, seed: int):
        """Chains: parameters (chains, samples, dimension), log densities (chains, samples), acceptance (chains,)."""
        if method not in METHODS:
            raise InputError(f"method: '{method}' is unknown; allowed: {', '.join(METHODS)}")
        draws, density, acceptance, status, message = native.calibration_sample(
            self._handle, self.dimension, method, samples, burn_in, chains, threads, seed
        )
        check(status, message)
        return np.ascontiguousarray(np.moveaxis(draws, 0, -1).swapaxes(0, 1)), np.ascontiguousarray(density.T), acceptance

    def evaluate(self, x) -> tuple[np.ndarray, np.ndarray]:
        """Log density and log likelihood at points (n, dimension); -inf outside the support."""
        density, likelihood, inside = native.calibration_evaluate(self._handle, np.asfortranarray(np.atleast_2d(x).T))
        outside = inside == 0
        density[outside] = likelihood[outside] = -np.inf
        return density, likelihood

    def moduli(self, x, euler_deg, seed: int = 0) -> tuple[np.ndarray, np.ndarray]:
        """Indentation moduli (m, n) of n grains at points x (m, dimension), the surrogate's error drawn given the data, and one
        plus the calibration error (m,), drawn likewise."""
        angles = np.asfortranarray(np.radians(np.atleast_2d(euler_deg)).T)
        moduli, factor = native.calibration_moduli(self._handle, np.asfortranarray(np.atleast_2d(x).T), angles, seed)
        return moduli.T, factor

    def as_measured(self, modulus) -> np.ndarray:
        """Indentation moduli as the kind of modulus that was measured."""
        values = np.asarray(modulus, dtype=float)
        return native.calibration_map(self._handle, values.ravel()).reshape(values.shape)


def measurements_of(table, sd_optional: bool = False) -> tuple[np.ndarray, np.ndarray, np.ndarray | None]:
    """Angles (n, 3) in degrees, moduli (n,) and sds (n,) or None, of a CSV file, a mapping, data frame or structured array of its
    columns, a list of such rows, an object with euler_deg, modulus_gpa and sd_gpa, or an array (n, 5) or (n, 4) of phi1, Phi, phi2,
    modulus and sd."""
    if isinstance(table, str | os.PathLike):
        from ..settings.problem import read_measurements

        table = read_measurements(table, sd_optional=sd_optional)
    if isinstance(table, list | tuple):
        named = len(table) > 0 and all(isinstance(row, Mapping) for row in table)
        table = {name: [row.get(name) for row in table] for name in table[0]} if named else _array(table)
    if isinstance(table, np.ndarray):
        if table.dtype.names:
            table = {name: table[name] for name in table.dtype.names}
        elif table.ndim == 2 and table.shape[1] in (4, 5):
            table = {"euler_deg": table[:, :3], "modulus_gpa": table[:, 3]} | ({"sd_gpa": table[:, 4]} if table.shape[1] == 5 else {})
        else:
            raise InputError(f"an array of measurements has columns phi1, Phi, phi2, modulus and sd: (n, 5), not {table.shape}")
    if hasattr(table, "euler_deg"):
        angles, modulus, sd = table.euler_deg, table.modulus_gpa, table.sd_gpa
    else:
        try:
            if "euler_deg" in table:
                angles = _array(table["euler_deg"])
            else:
                angles = np.column_stack([_array(table[name]) for name in ("phi1_deg", "Phi_deg", "phi2_deg")])
            sd = _array(table["sd_gpa"]) if "sd_gpa" in table else None
            modulus = _array(table["modulus_gpa"])
        except KeyError as error:
            raise InputError(f"the measurements have no column {error}") from None
    tilt = np.atleast_2d(angles)[:, 1:2]
    if not np.all((tilt >= 0) & (tilt <= 180)):
        raise InputError(f"Phi of a measurement is {tilt[~((tilt >= 0) & (tilt <= 180))][0]:g}; allowed: 0 to 180 degrees")
    return angles, modulus, sd


def _array(values) -> np.ndarray:
    """Numbers of a table."""
    try:
        return np.asarray(values, dtype=float)
    except (TypeError, ValueError):
        raise InputError(f"the measurements are no table of numbers: {str(values)[:60]}") from None


def extract(
    surrogate,
    measurements,
    *,
    bounds: Mapping | None = None,
    anisotropy_cap: float | None = None,
    priors: Mapping | None = None,
    method: str = "ensemble",
    samples: int = 10000,
    burn_in: int | None = None,
    chains: int = 4,
    seed: int = 1,
    threads: int = 0,
    **likelihood,
):
    """Sample the constants behind measured moduli; an ArviZ InferenceData whose `posterior` holds one variable a constant.

    `surrogate`: a `Surrogate`, or what `Surrogate.load` takes. `measurements`: see `measurements_of`. `bounds`, `anisotropy_cap`,
    `priors` and `likelihood` (modulus_kind, calibration_sd, student_t, infer_scale, surrogate_variance, ..): see `Posterior`.
    `method`: 'ensemble', or 'scmh', the paper's. `samples` are kept per chain after `burn_in`; `threads` 0 means all cores, and
    results do not depend on it. Further groups: `prior` (constants without the data), `derived` (quantities of the crystal, for
    some of the draws), `predictions` (the modulus of each grain, of the kind that was measured), `observed_data`.
    """
    if not hasattr(surrogate, "handle"):
        from ..surrogate.surrogate import Surrogate

        surrogate = Surrogate.load(surrogate)
    euler_deg, modulus, sd = measurements_of(measurements, bool(likelihood.get("infer_scale")))
    settings = {"bounds": bounds, "anisotropy_cap": anisotropy_cap, "priors": priors, **likelihood}
    posterior = Posterior(surrogate, euler_deg, modulus, sd, **settings)
    threads = threads or len(os.sched_getaffinity(0))
    burn_in = BURN_IN if burn_in is None else burn_in
    if samples < 1 or chains < 1 or burn_in < 0:
        raise InputError(f"samples = {samples} and chains = {chains} must be at least 1, burn_in = {burn_in} at least 0")
    start = time.perf_counter()
    draws, density, acceptance = posterior.sample(
        method=method, samples=samples, burn_in=burn_in, chains=chains, threads=threads, seed=seed
    )
    seconds = time.perf_counter() - start
    prior = Posterior(surrogate, euler_deg, modulus, sd, prior_only=True, **settings)
    k = len(posterior.names)
    before = prior.sample(method="ensemble", samples=2500, burn_in=5000, chains=4, threads=threads, seed=seed)[0][:, :, :k]
    return inference_data(posterior, draws, density, before, {
        "method": method, "seed": seed, "burn_in": burn_in, "acceptance": [float(a) for a in acceptance], "seconds": seconds,
    })  # fmt: skip


def inference_data(posterior: Posterior, draws, density, before, attributes: dict):
    """What `extract` gives: the draws with everything that is derived from them."""
    import arviz as az
    import xarray as xr

    names = posterior.names
    k = len(names)
    chains, samples, _ = draws.shape
    variables = {name: draws[:, :, j] for j, name in enumerate(names)}
    if posterior.infer_scale:
        variables["sd_factor"] = np.exp(draws[:, :, k])
    thin = max(1, chains * samples // MOST_DRAWS)
    few = draws[:, ::thin]
    moduli, factor = posterior.moduli(few.reshape(-1, draws.shape[2]), posterior.euler_deg)
    predicted = posterior.as_measured(moduli).reshape(*few.shape[:2], -1)
    coordinates = {"chain": np.arange(chains), "draw": np.arange(0, samples, thin)}
    some = ("chain", "draw")
    derived = {name: (some, values) for name, values in quantities(posterior.symmetry, few[:, :, :k]).items() if name not in names}
    predictions = {"modulus": ((*some, "grain"), predicted), "calibration_factor": (some, factor.reshape(few.shape[:2]))}
    data = {"modulus": ("grain", posterior.modulus_gpa), "sd": ("grain", posterior.sd_gpa)}
    data |= {"euler_deg": (("grain", "angle"), posterior.euler_deg)}
    result = az.from_dict(
        posterior=variables,
        prior={name: before[:, :, j] for j, name in enumerate(names)},
        sample_stats={"lp": density},
    )
    result.posterior.attrs |= attributes | {
        "symmetry": posterior.symmetry,
        "bounds": json.dumps(dict(zip(names, zip(posterior.lower.tolist(), posterior.upper.tolist(), strict=True), strict=True))),
        "anisotropy_cap": posterior.anisotropy_cap,
        "share_inside": posterior.share_inside,
        "priors": json.dumps({key: list(value) for key, value in posterior.priors.items()}),
        "modulus_kind": posterior.modulus_kind,
        "calibration_sd": posterior.calibration_sd,
        "student_t": posterior.student_t,
        "surrogate_variance": posterior.surrogate_variance,
    }
    best = most_probable(posterior, draws.reshape(-1, draws.shape[2]), density.ravel())
    if posterior.infer_scale:
        best[k] = np.exp(best[k])
    result.posterior.attrs["map"] = best
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        result.add_groups(
            {
                "derived": xr.Dataset(derived, coordinates),
                "predictions": xr.Dataset(predictions, coordinates),
                "observed_data": xr.Dataset(data),
            }
        )
    return result


def most_probable(posterior: Posterior, points, density) -> np.ndarray:
    """The point of largest density: the best draw, then a simplex from there."""
    from scipy.optimize import minimize

    best = points[np.argmax(density)]
    # A simplex of the posterior's own size; outside the support the density is as low as can be.
    simplex = np.vstack([best, best + 0.1 * np.diag(points.std(axis=0))])
    found = minimize(
        lambda x: min(1e300, -posterior.evaluate(x)[0][0]), best, method="Nelder-Mead",
        options={"initial_simplex": simplex, "maxfev": 1000, "xatol": 1e-3, "fatol": 1e-4},
    )  # fmt: skip
    return found.x if -found.fun >= density.max() else best.copy()


def summary(result) -> dict:
    """The document of `extract` from what the function of that name gives."""
    import arviz as az

    posterior, attributes = result.posterior, result.posterior.attrs
    chains = posterior.sizes["chain"]
    parameters = {}
    for j, name in enumerate(posterior.data_vars):
        values = posterior[name].values
        parameters[name] = {
            "mean": values.mean(),
            "sd": values.std(ddof=1),
            "map": float(np.atleast_1d(attributes["map"])[j]),
            "hdi_95": az.hdi(values.ravel(), hdi_prob=0.95),
            "ess_bulk": float(az.ess(values, method="bulk")),
            "ess_tail": float(az.ess(values, method="tail")),
            "r_hat": float(az.rhat(values)) if chains > 1 else None,
        }
    names = constant_names(attributes["symmetry"])
    draws = np.stack([posterior[name].values.ravel() for name in names])
    observed = result.observed_data
    modulus = result.predictions["modulus"].values.reshape(-1, observed.sizes["grain"])
    predicted = [
        {"mean": values.mean(), "sd": values.std(ddof=1), "measured": measured, "measured_sd": sd, "euler_deg": angles}
        for values, measured, sd, angles in zip(
            modulus.T, observed["modulus"].values, observed["sd"].values, observed["euler_deg"].values, strict=True
        )
    ]
    identified = identifiability(result)
    document = {
        "parameters": parameters,
        "correlation": np.corrcoef(draws),
        "predicted": predicted,
        "identifiability": identified,
        "acceptance": float(np.mean(attributes["acceptance"])),
        "samples": posterior.sizes["draw"],
        "chains": chains,
        "method": attributes["method"],
        "seconds": attributes["seconds"],
    }
    document["warnings"] = verdicts(result, document)
    return plain(document)


def identifiability(result) -> list[dict]:
    """What the data say: combinations of the constants from the best to the worst identified, then the quantities of the crystal.

    A combination is a product of powers of the constants (a sum of multiples of their logarithms) that makes the variance of the
    posterior relative to that of the prior extreme: the eigenvectors of the one covariance against the other. `sd` is of its logarithm,
    so a relative one. `contraction` is one minus that ratio of variances: 1 is decided by the data, 0 by the prior.
    """
    symmetry = result.posterior.attrs["symmetry"]
    names = constant_names(symmetry)
    after = np.stack([result.posterior[name].values.ravel() for name in names])
    before = np.stack([result.prior[name].values.ravel() for name in names])
    if min(after.min(), before.min()) <= 0:
        # A constant that may vanish has no logarithm: relative deviations from the mean stand in.
        scale = after.mean(axis=1, keepdims=True)
        log_after, log_before = after / scale, before / scale
    else:
        log_after, log_before = np.log(after), np.log(before)
    from scipy.linalg import eigh

    covariance = np.cov(log_after)
    values, vectors = eigh(covariance, np.cov(log_before))
    rows = []
    for value, vector in zip(values, vectors.T, strict=True):
        vector = vector / vector[np.argmax(np.abs(vector))]
        sd = np.sqrt(vector @ covariance @ vector)
        rows.append({
            "kind": "combination",
            "name": " ".join(f"{name}^{power:.2f}" for name, power in zip(names, vector, strict=True) if abs(power) >= 0.05),
            "exponents": dict(zip(names, vector, strict=True)),
            "correlations": dict(zip(names, (covariance @ vector) / (sd * np.sqrt(np.diag(covariance))), strict=True)),
            "mean": float(np.exp(np.mean(vector @ log_after))) if min(after.min(), before.min()) > 0 else None,
            "sd": sd,
            "prior_sd": sd / np.sqrt(value),
            "contraction": 1.0 - value,
        })  # fmt: skip
    units = quantity_names(symmetry)
    for name, prior_values in quantities(symmetry, before.T).items():
        values = result.posterior[name].values if name in names else result.derived[name].values
        mean, sd, prior_sd = values.mean(), values.std(ddof=1), prior_values.std(ddof=1)
        rows.append({
            "kind": "quantity", "name": name, "unit": units[name], "mean": mean, "sd": sd,
            "prior_mean": prior_values.mean(), "prior_sd": prior_sd, "contraction": 1.0 - (sd / prior_sd) ** 2,
        })  # fmt: skip
    return rows


def settings_of(problem) -> dict:
    """What a problem's groups say of Step 2, as arguments of `extract`."""
    groups = problem.settings
    measured, prior, knowledge, sampler = groups.measurements, groups.prior, groups.knowledge, groups.sampler
    names = constant_names(groups.problem.symmetry)
    priors = dict(zip(knowledge.quantity, zip(knowledge.mean, knowledge.sd, strict=True), strict=True)) if knowledge.quantity else {}
    low, high = ([None] * len(names) if bound is None else bound for bound in (prior.c_min, prior.c_max))
    bounds = dict(zip(names, zip(low, high, strict=True), strict=True))
    settings = {
        "bounds": bounds,
        "anisotropy_cap": prior.anisotropy_cap,
        "priors": priors,
        "method": sampler.method,
        "samples": sampler.samples,
        "burn_in": sampler.burn_in,
        "chains": sampler.chains,
        "surrogate_variance": sampler.surrogate_variance,
        "seed": groups.problem.seed,
        "threads": groups.execution.workers,
        "infer_scale": measured.scale == "inferred",
        "student_t": measured.student_dof if measured.likelihood == "student" else 0.0,
    }
    for name in ("modulus_kind", "indenter_modulus_gpa", "indenter_nu", "sample_nu", "calibration_sd"):
        settings[name] = getattr(measured, name)
    return settings


def surrogate_of(problem, output: Path):
    """The surrogate that a problem names: in the output folder, in the namelist's, or one that comes with the package."""
    from ..surrogate.lookup import find_surrogate
    from ..surrogate.surrogate import Surrogate

    name = problem.settings.surrogate.file
    symmetry = problem.settings.problem.symmetry
    try:
        surrogate = Surrogate.load(find_surrogate(name, output, problem.folder) or name)
    except InputError as error:
        raise InputError(f"{problem.path}: &surrogate file: {error}") from None
    if surrogate.symmetry != symmetry:
        raise InputError(f"{problem.path}: &surrogate file: {name} is for {surrogate.symmetry} crystals, not {symmetry} ones")
    return surrogate


def fingerprint(problem, settings: Mapping) -> str:
    """The settings and data that a posterior follows from, as text."""
    measured = problem.measurements
    data = [plain(measured.euler_deg), plain(measured.modulus_gpa), plain(measured.sd_gpa)]
    kept = {key: value for key, value in settings.items() if key != "threads"}
    return json.dumps([plain(kept), data], sort_keys=True)


def check_stage(problem, output: Path) -> None:
    """Refuse what `extract_stage` would refuse before it samples."""
    surrogate = surrogate_of(problem, output)
    density = {name: value for name, value in settings_of(problem).items() if name not in SAMPLING}
    measured = problem.measurements
    try:
        Posterior(surrogate, measured.euler_deg, measured.modulus_gpa, measured.sd_gpa, **density)
    except InputError as error:
        raise InputError(f"{problem.path}: &prior: {error}") from None


def extract_stage(problem, output: Path, progress=None) -> dict:
    """Step 2 of a problem: posterior.nc, summary.json, and the document of `extract`."""
    surrogate = surrogate_of(problem, output)
    settings = settings_of(problem)
    with progress.bar("sampling", settings["chains"]) if progress else nullcontext(lambda steps=1: None) as advance:
        try:
            result = extract(surrogate, problem.measurements, **settings)
        except InputError as error:
            raise InputError(f"{problem.path}: &prior: {error}") from None
        advance(settings["chains"])
    document = summary(result)
    # The reader has spoken of the measurements already.
    said = set(orientation_verdicts(surrogate.symmetry, problem.measurements.euler_deg)) if problem.warnings else set()
    document["warnings"] = [*problem.warnings, *(line for line in document["warnings"] if line not in said)]
    result.posterior.attrs["settings"] = fingerprint(problem, settings)
    result.posterior.attrs["title"] = problem.settings.problem.title
    with whole_file(Path(output) / "posterior.nc") as file:
        result.to_netcdf(str(file), engine="h5netcdf")
    return document
