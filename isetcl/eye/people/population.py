"""Populations of eyes as a normal distribution of Zernike coefficients, from a file.

The statistics themselves (such as those of Thibos, Bradley & Hong 2002, Ophthalmic Physiol Opt
22:427, whose licence forbids shipping them) are the user's own. A file holds

* ``mean_um``: mean coefficients, piston first, full radial orders, um;
* ``covariance_um2``: their covariance, um^2;
* ``pupil_diameter_mm``: diameter of the circle;
* if they differ from these: ``wavelength_nm`` (550), ``order`` (``osa`` or ``noll``),
  ``normalisation`` (``orthonormal`` or ``peak``).

In .npz and .mat files these are variables (``sample_mean`` and ``S`` are understood too). In .csv
files the single values are comment lines such as ``# pupil_diameter_mm: 6``; the first row of
numbers is the mean, the others are the covariance.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from isetcl.errors import (
    FileError,
    InvalidInputError,
    check_array,
    check_choice,
    check_count,
    check_positive,
    check_type,
)
from isetcl.eye.fitting.measurement import in_osa_order
from isetcl.eye.waves.zernike import ZernikeFit

_ALIASES = {"sample_mean": "mean_um", "S": "covariance_um2"}
_SINGLE = ("pupil_diameter_mm", "wavelength_nm", "order", "normalisation")
_WAVELENGTH_NM = 550.0
_ASYMMETRY = 1e-6
_NEGATIVE = 1e-6  # of the largest eigenvalue: rounding of printed numbers


@dataclass(frozen=True, eq=False)
class Population:
    """A normal distribution of Zernike coefficients.

    Parameters
    ----------
    mean : ZernikeFit
        The mean eye: orthonormal coefficients in OSA order, um, with circle and wavelength.
    covariance_um2 : ndarray, (terms, terms)
        Covariance of the coefficients, um^2.

    Raises
    ------
    InvalidInputError
        If the covariance has another size than the mean, is not symmetric, or has a direction of
        negative variance.
    """

    mean: ZernikeFit
    covariance_um2: np.ndarray

    def __post_init__(self) -> None:
        check_type("mean", self.mean, ZernikeFit)
        covariance = check_array("covariance_um2", self.covariance_um2)
        terms = len(self.mean.coefficients_um)
        if covariance.shape != (terms, terms) or not np.all(np.isfinite(covariance)):
            raise InvalidInputError(
                f"covariance_um2 must be {terms} x {terms} finite numbers, as the mean has {terms} "
                f"coefficients, got shape {covariance.shape}"
            )
        largest = float(np.max(np.abs(covariance)))
        asymmetry = float(np.max(np.abs(covariance - covariance.T)))
        if asymmetry > _ASYMMETRY * largest:
            raise InvalidInputError(
                f"covariance_um2 must be symmetric, but C and its transpose differ by {asymmetry:g}"
                " um^2; check that the file holds a covariance, not a table of samples"
            )
        covariance = (covariance + covariance.T) / 2.0
        values = np.linalg.eigvalsh(covariance)
        if values[0] < -_NEGATIVE * max(values[-1], 0.0) or values[-1] < 0.0:
            raise InvalidInputError(
                "covariance_um2 must have no direction of negative variance, but its smallest "
                f"eigenvalue is {values[0]:g} um^2; a table of correlations or of standard "
                "deviations is no covariance"
            )
        object.__setattr__(self, "covariance_um2", covariance)

    @property
    def pupil_diameter_mm(self) -> float:
        """Diameter of the circle on which the coefficients hold, mm."""
        return 2.0 * self.mean.radius_mm

    def draw(self, count: int, seed: int = 0) -> tuple[ZernikeFit, ...]:
        """Random eyes; the same seed draws the same ones, and more of them add to the first.

        Parameters
        ----------
        count
            How many.
        seed
            A whole number >= 0.
        """
        n = check_count("count", count, 1)
        rng = np.random.default_rng(check_count("seed", seed, 0))
        values, vectors = np.linalg.eigh(self.covariance_um2)
        spread = vectors * np.sqrt(np.maximum(values, 0.0))
        deviations = rng.standard_normal((n, len(values))) @ spread.T
        mean = self.mean.coefficients_um
        return tuple(
            dataclasses.replace(self.mean, coefficients_um=mean + d, residual_um=0.0)
            for d in deviations
        )


def load_population(path: str | Path, *, pupil_diameter_mm: float | None = None) -> Population:
    """A population from a .npz, .mat or .csv file; see this module for the format.

    Parameters
    ----------
    pupil_diameter_mm
        For files that do not tell.

    Raises
    ------
    FileError
        If the file cannot be read.
    InvalidInputError
        If something is missing, of the wrong order or normalisation, or no covariance.
    """
    check_type("path", path, (str, Path))
    file = Path(path)
    if not file.is_file():
        raise FileError(f"file {str(file)!r} does not exist")
    reader = {".npz": _read_npz, ".mat": _read_mat, ".csv": _read_csv}
    kind = check_choice("kind of population file", file.suffix.lower(), reader)
    try:
        found = reader[kind](file)
    except InvalidInputError:
        raise
    except Exception as error:
        raise FileError(f"cannot read {str(file)!r} as a {kind} file: {error}") from error
    entries: dict[str, Any] = {_ALIASES.get(name, name): value for name, value in found.items()}
    if pupil_diameter_mm is not None:
        entries["pupil_diameter_mm"] = pupil_diameter_mm
    return _population(file, entries)


def _population(file: Path, entries: Mapping[str, Any]) -> Population:
    for name in ("mean_um", "covariance_um2", "pupil_diameter_mm"):
        if name not in entries:
            listed = ", ".join(sorted(entries)) or "nothing"
            raise InvalidInputError(
                f"file {str(file)!r} must hold {name!r}, got {listed}; see "
                "help(isetcl.eye.people.population)"
            )
    order = check_choice(
        f"order in file {str(file)!r}", _text(entries.get("order", "osa")), ("osa", "noll")
    )
    normalisation = check_choice(
        f"normalisation in file {str(file)!r}",
        _text(entries.get("normalisation", "orthonormal")),
        ("orthonormal", "peak"),
    )
    radius = check_positive("pupil_diameter_mm", _number(entries["pupil_diameter_mm"]), "mm") / 2.0
    nm = _number(entries.get("wavelength_nm", _WAVELENGTH_NM))
    # The count is checked before anything is moved.
    raw = ZernikeFit(np.ravel(check_array("mean_um", entries["mean_um"])), radius, nm)
    covariance = check_array("covariance_um2", entries["covariance_um2"])

    def moved(values: np.ndarray) -> np.ndarray:
        return in_osa_order(values, order, normalisation)  # type: ignore[arg-type]

    mean = dataclasses.replace(raw, coefficients_um=moved(raw.coefficients_um))
    if covariance.shape == (len(raw.coefficients_um),) * 2:
        covariance = np.array([moved(row) for row in covariance])
        covariance = np.array([moved(column) for column in covariance.T]).T
    return Population(mean, covariance)


def _text(value: Any) -> str:
    """A string, also out of an array that holds one."""
    return str(np.asarray(value).ravel()[0]) if np.size(value) else ""


def _number(value: Any) -> float:
    """A number, also out of an array that holds one or out of text."""
    item = np.asarray(value).ravel()
    if item.size != 1:
        raise InvalidInputError(f"a single number is wanted, got {item.size} of them")
    try:
        return float(item[0])
    except ValueError:
        raise InvalidInputError(f"a single number is wanted, got {item[0]!r}") from None


def _read_npz(file: Path) -> dict[str, Any]:
    with np.load(file, allow_pickle=False) as data:
        return {name: data[name] for name in data.files}


def _read_mat(file: Path) -> dict[str, Any]:
    from scipy.io import loadmat

    try:
        data = loadmat(str(file))
    except NotImplementedError:
        raise InvalidInputError(
            f"file {str(file)!r} is a MATLAB 7.3 file, which must be saved anew with -v7"
        ) from None
    return {name: value for name, value in data.items() if not name.startswith("__")}


def _read_csv(file: Path) -> dict[str, Any]:
    entries: dict[str, Any] = {}
    for line in file.read_text(encoding="utf-8").splitlines():
        name, _, value = line.lstrip("# ").partition(":")
        if line.startswith("#") and name.strip() in _SINGLE:
            entries[name.strip()] = value.strip()
    rows = np.loadtxt(file, delimiter=",", comments="#", ndmin=2, encoding="utf-8")
    return entries | {"mean_um": rows[0], "covariance_um2": rows[1:]}
