"""The surrogate of Step 1: a basis, the posterior of its coefficients, and what it predicts.

Angles are Bunge-Euler (phi1, Phi, phi2) in degrees, constants in GPa in the order of `crystal.constant_names`, moduli in GPa.
"""

from importlib import resources
from pathlib import Path

import numpy as np

from ..core import InputError, check, native
from ..crystal.elasticity import class_name, constant_names
from ..surrogate.domain import COORDINATES, Domain

__all__ = ["Basis", "Design", "Surrogate"]

#: The number the core gives a truncation.
TRUNCATIONS = {"tensor": 1, "total": 2}

#: Surrogates that come with the package.
SHIPPED = ("cubic", "hexagonal")

#: Version of the layout of surrogate.nc.
FORMAT = 1


def _number(names: dict, value: str, what: str) -> int:
    if value not in names:
        raise InputError(f"{what}: '{value}' is unknown; allowed: {', '.join(names)}")
    return names[value]


def _columns(constants, euler_deg, symmetry: str) -> tuple[np.ndarray, np.ndarray]:
    """Constants (k, n) and angles in radians (3, n) as the core takes them."""
    k = len(constant_names(symmetry))
    values = np.atleast_2d(np.asarray(constants, dtype=float))
    angles = np.atleast_2d(np.asarray(euler_deg, dtype=float))
    if values.shape[-1] != k or angles.shape[-1] != 3 or values.ndim != 2 or angles.ndim != 2:
        raise InputError(
            f"a {symmetry} crystal takes arrays (n, {k}) of constants and (n, 3) of angles, not {values.shape} and {angles.shape}"
        )
    if len(values) != len(angles) and 1 not in (len(values), len(angles)):
        raise InputError(f"there are {len(values)} crystals but {len(angles)} orientations")
    n = np.broadcast_shapes(values.shape[:1], angles.shape[:1])[0]
    values, angles = np.broadcast_to(values, (n, k)), np.broadcast_to(angles, (n, 3))
    if not (np.isfinite(values).all() and np.isfinite(angles).all()):
        raise InputError("a constant or an angle is not finite")
    return np.asfortranarray(values.T), np.asfortranarray(np.radians(angles).T)


class Basis:
    """Harmonics times Legendre products in box or dimensionless coordinates (see docs/surrogate.md)."""

    def __init__(self, symmetry: str, coordinates: str, truncation: str, degree: int, bandlimit: int, lower, upper):
        self.symmetry, self.coordinates, self.truncation = class_name(symmetry), coordinates, truncation
        self.degree, self.bandlimit = int(degree), int(bandlimit)
        self.lower, self.upper = np.array(lower, dtype=float), np.array(upper, dtype=float)
        self._key = (
            self.symmetry,
            _number(COORDINATES, coordinates, "coordinates"),
            _number(TRUNCATIONS, truncation, "truncation"),
            self.degree,
            self.bandlimit,
        )
        harmonics, polynomials, self.n_coordinates, status, message = native.basis_counts(*self._key)
        check(status, message)
        self.n_harmonics, self.n_polynomials = int(harmonics), int(polynomials)
        self.n_terms = self.n_harmonics * self.n_polynomials
        harmonic, polynomial, status, message = native.basis_degrees(*self._key, self.n_terms)
        check(status, message)
        #: Degree of each term's harmonic, and of its polynomial in all coordinates together.
        self.harmonic_degrees, self.polynomial_degrees = harmonic, polynomial

    def terms(self, constants, euler_deg) -> tuple[np.ndarray, np.ndarray]:
        """Terms (n_terms, n) and stiffness scales (n,) in GPa of stable crystals."""
        values, angles = _columns(constants, euler_deg, self.symmetry)
        terms, scale, status, message = native.basis_terms(*self._key, self.lower, self.upper, self.n_terms, values, angles)
        check(status, message)
        return terms, scale

    def to_y(self, modulus_gpa, scale) -> np.ndarray:
        """The quantity that is linear in the coefficients: M for a box, log(M/s) else."""
        modulus = np.asarray(modulus_gpa, dtype=float)
        return np.log(modulus / scale) if self.coordinates == "dimensionless" else modulus

    def to_modulus(self, y, scale) -> np.ndarray:
        """The modulus (GPa) of a y."""
        return scale * np.exp(y) if self.coordinates == "dimensionless" else np.asarray(y)


def raw_coordinates(symmetry: str, coordinates: str, constants) -> np.ndarray:
    """Coordinates (n, m) before they are mapped to [-1, 1], of stable crystals (n, k) in GPa."""
    values = np.asarray(constants, dtype=float)
    number = _number(COORDINATES, coordinates, "coordinates")
    m = values.shape[1] - (coordinates == "dimensionless")
    return native.basis_coordinates(symmetry, number, m, values.T)[0].T


class Design:
    """Evidence regression over terms, and the choice of the next candidates by variance; all in units of y.

    The prior of the coefficients is N(prior_mean, 1/(alpha weights)); `least_noise` bounds the sd of the noise from below.
    """

    def __init__(self, weights, prior_mean, least_noise: float):
        self._handle = 0
        self.prior_mean = np.asarray(prior_mean, dtype=float)
        self.n_terms, self.n_data, self.n_candidates = len(weights), 0, 0
        self.beta = least_noise**-2
        self._handle, status, message = native.design_new(weights, prior_mean, least_noise)
        check(status, message)

    def __del__(self):
        if self._handle:
            native.design_free(self._handle)

    def set_candidates(self, terms) -> None:
        """Terms (n_terms, n) of the candidates, all of them available."""
        self.n_candidates = np.shape(terms)[1]
        native.design_candidates(self._handle, terms)

    def exclude(self, numbers) -> None:
        """These candidates may not be chosen any more."""
        numbers = np.asarray(numbers, dtype=np.intc)
        if numbers.size and not (numbers.min() >= 0 and numbers.max() < self.n_candidates):
            raise InputError(f"a candidate's number is outside 0 .. {self.n_candidates - 1}")
        native.design_exclude(self._handle, numbers)

    def add(self, terms, y) -> None:
        """Append observations: terms (n_terms, m), y (m,). The posterior follows with `fit` or `settle`."""
        self.n_data += len(y)
        native.design_add(self._handle, terms, y)

    def fit(self, alpha: float = 0.0, beta: float = 0.0) -> tuple[float, float, float]:
        """Posterior from all data at alpha and beta (default: those of largest evidence). Gives alpha, beta, log evidence."""
        alpha, beta, evidence, status, message = native.design_fit(self._handle, alpha, beta)
        check(status, message)
        self.beta = beta
        return alpha, beta, evidence

    def evidence(self, alpha, beta) -> np.ndarray:
        """Log evidence of the data at pairs of alpha and beta."""
        values, status, message = native.design_evidence(self._handle, alpha, beta)
        check(status, message)
        return values

    def update(self, term, y: float) -> None:
        """One observation more at frozen alpha, beta."""
        self.n_data += 1
        check(*native.design_update(self._handle, term, y))

    def choose(self, count: int, importance=None, threads: int = 1) -> tuple[np.ndarray, np.ndarray]:
        """The next candidates, and the variance of y at each when it was chosen.

        `importance` is |dM/dy| of each candidate for the largest variance of M; without it that of y counts.
        """
        weights = np.ones(self.n_candidates) if importance is None else importance
        chosen, variance, status, message = native.design_choose(self._handle, weights, count, threads)
        check(status, message)
        return chosen, variance

    def settle(self, exactly: bool = False) -> None:
        """The posterior mean once the values of all choices were added; `exactly` if one of them failed."""
        check(*native.design_settle(self._handle, int(exactly)))

    def mean(self) -> np.ndarray:
        """Posterior mean of the coefficients."""
        return native.design_mean(self._handle, self.n_terms)

    def covariance(self) -> np.ndarray:
        """Posterior covariance of the coefficients."""
        return native.design_covariance(self._handle, self.n_terms)

    def variances(self) -> np.ndarray:
        """Variance of y at each candidate, noise not included."""
        return native.design_variances(self._handle, self.n_candidates)

    def leave_out(self, groups) -> tuple[np.ndarray, np.ndarray]:
        """Residual and sd of each y with its whole group left out."""
        residual, sd, status, message = native.design_leave_out(self._handle, np.asarray(groups, dtype=np.intc))
        check(status, message)
        return residual, sd


#: The number the core gives a prior.
PRIORS = {"zero": 1, "theory": 2}


class Surrogate:
    """Indentation modulus of every crystal of a class, with its uncertainty."""

    def __init__(
        self,
        basis: Basis,
        coefficients,
        covariance,
        *,
        anisotropy_cap: float,
        alpha: float,
        beta: float,
        sd_inflation: float = 1.0,
        provenance: dict | None = None,
        data: dict | None = None,
    ):
        self._handle = 0
        self.basis = basis
        self.symmetry = basis.symmetry
        self.coefficients = np.asarray(coefficients, dtype=float)
        self.covariance = np.asarray(covariance, dtype=float)
        self.anisotropy_cap, self.alpha, self.beta, self.sd_inflation = anisotropy_cap, alpha, beta, sd_inflation
        #: What it was made from: text attributes of the file, and the simulations behind it.
        self.provenance, self.data = dict(provenance or {}), dict(data or {})
        self._handle, status, message = native.surrogate_new(
            *basis._key, basis.lower, basis.upper, self.coefficients, self.covariance, anisotropy_cap, alpha, beta, sd_inflation
        )
        check(status, message)

    def __del__(self):
        if self._handle:
            native.surrogate_free(self._handle)

    @property
    def handle(self) -> int:
        """The core's surrogate; it lives as long as this object."""
        return self._handle

    @classmethod
    def fit(
        cls,
        symmetry: str,
        constants,
        euler_deg,
        modulus_gpa,
        *,
        coordinates: str = "dimensionless",
        truncation: str = "total",
        degree: int = 4,
        bandlimit: int = 8,
        prior: str = "theory",
        domain: Domain | None = None,
    ) -> "Surrogate":
        """A surrogate from simulated moduli (n,) in GPa of crystals (n, k) at angles (n, 3), by evidence maximisation."""
        domain = domain or Domain.default(symmetry)
        basis = Basis(symmetry, coordinates, truncation, degree, bandlimit, *domain.ranges(coordinates))
        design = new_design(basis, domain, prior)
        terms, scale = basis.terms(constants, euler_deg)
        design.add(terms, basis.to_y(modulus_gpa, scale))
        alpha, beta, _ = design.fit()
        crystals = np.unique(np.asarray(constants, dtype=float), axis=0, return_inverse=True)[1].ravel()
        residual, sd = design.leave_out(crystals)
        return cls(
            basis,
            design.mean(),
            design.covariance(),
            anisotropy_cap=domain.anisotropy_cap,
            alpha=alpha,
            beta=beta,
            sd_inflation=sd_factor(basis, domain, prior, design, residual / sd),
        )

    @classmethod
    def load(cls, name) -> "Surrogate":
        """A surrogate that comes with the package ('cubic', 'hexagonal'), or the file `name` that `save` wrote."""
        import xarray as xr

        path = Path(name)
        if str(name) in SHIPPED and not path.exists():
            path = Path(str(resources.files("bayesindent") / "data" / f"{name}.nc"))
        if not path.exists():
            raise InputError(f"{name}: there is no such surrogate; allowed: a file, {', '.join(SHIPPED)}")
        try:
            with xr.open_dataset(path, engine="h5netcdf") as file:
                dataset = file.load()
        except (OSError, ValueError) as error:
            raise InputError(f"{path}: is not a surrogate, or is damaged: {error}") from error
        attributes = dict(dataset.attrs)
        if attributes.get("content") != "bayesindent surrogate":
            raise InputError(f"{path}: is not a surrogate of bayesindent")
        if int(attributes["format"]) > FORMAT:
            raise InputError(f"{path}: was written by a newer version (format {attributes['format']}, known: {FORMAT})")
        basis = Basis(
            *(str(attributes[name]) for name in ("symmetry", "coordinate_kind", "truncation")),
            int(attributes["degree"]),
            int(attributes["bandlimit"]),
            dataset["lower"].values,
            dataset["upper"].values,
        )
        covariance = np.zeros((basis.n_terms, basis.n_terms))
        covariance[np.tril_indices(basis.n_terms)] = dataset["covariance"].values
        covariance += np.tril(covariance, -1).T
        numbers = {name: float(attributes[name]) for name in ("anisotropy_cap", "alpha", "beta", "sd_inflation")}
        known = {"content", "format", "symmetry", "coordinate_kind", "truncation", "degree", "bandlimit", *numbers}
        return cls(
            basis,
            dataset["coefficients"].values,
            covariance,
            **numbers,
            provenance={name: value for name, value in attributes.items() if name not in known},
            data={name: dataset[name].values for name in ("constants", "euler_deg", "modulus_gpa") if name in dataset},
        )

    def save(self, path) -> None:
        """Write surrogate.nc: coefficients, covariance (lower triangle, row by row), ranges, provenance, simulations."""
        import xarray as xr

        b = self.basis
        variables = {
            "coefficients": ("term", self.coefficients, {"long_name": "posterior mean of A, harmonics fastest"}),
            "covariance": ("pair", self.covariance[np.tril_indices(b.n_terms)], {"long_name": "posterior covariance of A"}),
            "lower": ("coordinate", b.lower),
            "upper": ("coordinate", b.upper),
        }
        if self.data:
            variables |= {
                "constants": (("simulation", "constant"), self.data["constants"], {"units": "GPa"}),
                "euler_deg": (("simulation", "angle"), self.data["euler_deg"], {"units": "degree"}),
                "modulus_gpa": ("simulation", self.data["modulus_gpa"], {"units": "GPa"}),
            }
        attributes = {
            "content": "bayesindent surrogate",
            "format": FORMAT,
            "symmetry": b.symmetry,
            "coordinate_kind": b.coordinates,
            "truncation": b.truncation,
            "degree": b.degree,
            "bandlimit": b.bandlimit,
            "anisotropy_cap": self.anisotropy_cap,
            "alpha": self.alpha,
            "beta": self.beta,
            "sd_inflation": self.sd_inflation,
            **self.provenance,
        }
        compressed = {name: {"zlib": True, "complevel": 9, "shuffle": True} for name in variables}
        xr.Dataset(variables, attrs=attributes).to_netcdf(path, engine="h5netcdf", encoding=compressed)

    def write_text(self, path) -> None:
        """Write the text form that the batch program reads."""
        check(*native.surrogate_write(self._handle, str(path)))

    @classmethod
    def read_text(cls, path) -> "Surrogate":
        """Read the text form that the batch program writes."""
        handle, status, message = native.surrogate_read(str(path))
        check(status, message)
        try:
            symmetry, coordinates, truncation, degree, bandlimit, m, n, lower, upper, *numbers = native.surrogate_header(handle)
            coefficients, covariance = native.surrogate_posterior(handle, n)
        finally:
            native.surrogate_free(handle)
        names = ({v: k for k, v in table.items()}[n] for table, n in ((COORDINATES, coordinates), (TRUNCATIONS, truncation)))
        basis = Basis(symmetry.decode(), *names, degree, bandlimit, lower[:m], upper[:m])
        keys = ("anisotropy_cap", "alpha", "beta", "sd_inflation")
        return cls(basis, coefficients, covariance, **dict(zip(keys, map(float, numbers), strict=True)))

    def predict(self, constants, euler_deg, *, threads: int = 1) -> tuple[np.ndarray, np.ndarray]:
        """Mean and sd (GPa) of the simulated indentation modulus of crystals (n, k) in GPa at angles (n, 3) in degrees.

        The sd is that of one simulation (noise included); with dimensionless coordinates it is the relative one times the mean.
        Raises `InputError` for an unstable crystal; `outside` says where the surrogate does not know.
        """
        values, angles = _columns(constants, euler_deg, self.symmetry)
        modulus, sd = native.surrogate_predict(self._handle, values, angles, threads)
        if not np.isfinite(modulus).all():
            row = int(np.flatnonzero(~np.isfinite(modulus))[0])
            raise InputError(f"crystal {row + 1} ({', '.join(f'{v:g}' for v in values[:, row])} GPa) is elastically unstable")
        return modulus, sd

    def outside(self, constants) -> np.ndarray:
        """Whether each crystal is outside the domain: unstable, a coordinate beyond its range, or the index beyond the cap."""
        values, _ = _columns(constants, [0.0, 0.0, 0.0], self.symmetry)
        return native.surrogate_outside(self._handle, values).astype(bool)


def new_design(basis: Basis, domain: Domain, prior: str) -> Design:
    """A regression with the stated prior over a basis, without data."""
    return Design(*coefficient_prior(basis, domain, prior))


def coefficient_prior(basis: Basis, domain: Domain, prior: str) -> tuple[np.ndarray, np.ndarray, float]:
    """Weights W and mean m of the prior N(m, 1/(alpha W)), centred on zero (Eq. 6) or on the half-space theory; least sd of the noise."""
    weights, mean, least_noise, status, message = native.coefficient_prior(
        *basis._key,
        basis.lower,
        basis.upper,
        domain.c_min,
        domain.c_max,
        domain.anisotropy_cap,
        _number(PRIORS, prior, "prior"),
        basis.n_terms,
    )
    check(status, message)
    return weights, mean, least_noise


def sd_factor(basis: Basis, domain: Domain, prior: str, design: Design, z) -> float:
    """The factor on every sd, from the z-scores of crystals left out, and what truncation leaves out (see docs/surrogate.md)."""
    factor, status, message = native.surrogate_inflation(
        *basis._key,
        basis.lower,
        basis.upper,
        domain.c_min,
        domain.c_max,
        domain.anisotropy_cap,
        _number(PRIORS, prior, "prior"),
        design.prior_mean,
        design.covariance(),
        design.beta,
        z,
    )
    check(status, message)
    return factor
