"""Spectra: wavelength grids, emission spectra and the photopic weighting.

Wavelengths are in nm, in vacuum. A spectrum of a light source is a spectral radiance in
W m^-2 sr^-1 nm^-1. colour-science supplies illuminants; it is imported only when one is asked for,
because importing it costs more time than rendering a small image.
"""

from __future__ import annotations

import functools
import hashlib
from collections.abc import Sequence
from dataclasses import dataclass
from importlib import resources
from typing import Literal

import numpy as np

from isetcl.errors import (
    InvalidInputError,
    check_array,
    check_choice,
    check_finite,
    check_positive,
    check_type,
)
from isetcl.units import LUMINOUS_EFFICACY_LM_PER_W

VISIBLE_RANGE_NM = (360.0, 830.0)
"""Range of the CIE 1924 photopic observer, nm."""

Uneven = Literal["refuse", "bins"]
"""What becomes of wavelengths in unequal steps where a spectrum is summed."""

_UNEVEN = 1e-6  # of the longest wavelength: what files in single precision keep


def default_wavelengths_nm() -> np.ndarray:
    """The default wavelength grid: 400 to 700 nm in steps of 10 nm, shape (31,)."""
    return np.arange(400.0, 701.0, 10.0)


def check_wavelengths(wavelengths_nm: Sequence[float] | np.ndarray | float) -> np.ndarray:
    """Return a wavelength grid as a float64 array, shape (n,).

    Raises
    ------
    InvalidInputError
        If the grid is empty, not finite, not positive or not strictly ascending.
    """
    grid = np.atleast_1d(check_array("wavelengths_nm", wavelengths_nm))
    if grid.ndim != 1 or grid.size == 0:
        raise InvalidInputError(
            f"wavelengths_nm must be a non-empty one-dimensional list, got shape {grid.shape}"
        )
    if not np.all(np.isfinite(grid)) or np.any(grid <= 0):
        raise InvalidInputError(f"wavelengths_nm must be finite and > 0 nm, got {grid.tolist()}")
    if np.any(np.diff(grid) <= 0):
        raise InvalidInputError(
            f"wavelengths_nm must be strictly ascending, got {grid.tolist()}; sort and de-duplicate"
        )
    return grid


def is_even(wavelengths_nm: np.ndarray) -> bool:
    """Whether an ascending grid has equal steps, as exactly as single precision keeps them."""
    steps = np.diff(wavelengths_nm)
    return len(steps) == 0 or bool(np.ptp(steps) <= _UNEVEN * wavelengths_nm[-1])


def check_even_or_bins(
    what: str, wavelengths_nm: np.ndarray, uneven_wavelengths: Uneven
) -> np.ndarray:
    """Return a grid over which a spectrum may be summed.

    Parameters
    ----------
    what
        Whose wavelengths they are, for the message.
    uneven_wavelengths
        ``"refuse"`` asks for equal steps; ``"bins"`` takes others too.

    Raises
    ------
    InvalidInputError
        If steps are unequal and refused, or the grid is no legal one.
    """
    check_choice("uneven_wavelengths", uneven_wavelengths, ("refuse", "bins"))
    grid = check_wavelengths(wavelengths_nm)
    if uneven_wavelengths == "refuse" and not is_even(grid):
        steps = np.diff(grid)
        raise InvalidInputError(
            f"wavelengths of {what} must lie in equal steps to be summed, got steps of "
            f"{steps.min():g} to {steps.max():g} nm; render or resample on an even grid, or pass "
            "uneven_wavelengths='bins', which lets each wavelength stand for the bin half-way to "
            "its neighbours"
        )
    return grid


@functools.cache
def _photopic_table() -> tuple[np.ndarray, np.ndarray]:
    with resources.files("isetcl.data").joinpath("photopic_cie_1924.csv").open() as lines:
        table = np.loadtxt(lines, delimiter=",", comments="#")
    return table[:, 0], table[:, 1]


def luminous_efficiency(wavelengths_nm: np.ndarray | float) -> np.ndarray:
    """Photopic luminous efficiency V(lambda), peak 1 at 555 nm, same shape as the input.

    Linear interpolation of the 1 nm table; zero outside 360 to 830 nm.

    Source: CIE 1924 standard photopic observer (CIE 018:2019, table 1).
    """
    nodes, values = _photopic_table()
    return np.interp(np.asarray(wavelengths_nm, dtype=np.float64), nodes, values, left=0, right=0)


def photopic_weights(wavelengths_nm: np.ndarray) -> np.ndarray:
    """Weights w that turn a spectrum into a photopic quantity: illuminance = sum(w * irradiance).

    w = 683 V(lambda) dlambda, where each wavelength stands for the bin that reaches half-way to its
    neighbours (a full step at the ends); on a uniform grid this is 683 dlambda sum(V E).

    Returns
    -------
    ndarray, shape (n,)
        lm/W nm. All zero if the grid has a single wavelength, where no width is defined.
    """
    grid = check_wavelengths(wavelengths_nm)
    return LUMINOUS_EFFICACY_LM_PER_W * luminous_efficiency(grid) * bin_widths(grid)


def bin_widths(wavelengths_nm: np.ndarray) -> np.ndarray:
    """Width in nm that each wavelength of an ascending grid stands for, (n,).

    Bins reach half-way to the neighbours, those at the ends a full step; zero for a single
    wavelength, where no width is defined.
    """
    grid = np.asarray(wavelengths_nm, dtype=np.float64)
    if grid.size == 1:
        return np.zeros(1)
    edges = np.concatenate(
        [
            [grid[0] - (grid[1] - grid[0]) / 2],
            (grid[1:] + grid[:-1]) / 2,
            [grid[-1] + (grid[-1] - grid[-2]) / 2],
        ]
    )
    return np.diff(edges)


@dataclass(frozen=True, eq=False)
class Spectrum:
    """A spectral quantity sampled at ascending wavelengths, interpolated linearly.

    Parameters
    ----------
    wavelengths_nm
        Ascending wavelengths, nm, shape (n,).
    values
        Values, shape (n,), finite and >= 0. For a source: W m^-2 sr^-1 nm^-1.
    name
        What the spectrum is, for messages and provenance.

    Raises
    ------
    InvalidInputError
        If shapes differ or a value is negative or not finite.
    """

    wavelengths_nm: np.ndarray
    values: np.ndarray
    name: str = "spectrum"

    def __post_init__(self) -> None:
        grid = check_wavelengths(self.wavelengths_nm)
        check_type("spectrum: name", self.name, str)
        values = np.atleast_1d(check_array(f"spectrum {self.name!r}: values", self.values))
        if values.shape != grid.shape:
            raise InvalidInputError(
                f"spectrum {self.name!r}: values must have one entry per wavelength "
                f"{grid.shape}, got {values.shape}"
            )
        if not np.all(np.isfinite(values)) or np.any(values < 0):
            raise InvalidInputError(
                f"spectrum {self.name!r}: values must be finite and >= 0, "
                f"got {values[~(np.isfinite(values) & (values >= 0))][0]}"
            )
        object.__setattr__(self, "wavelengths_nm", grid)
        object.__setattr__(self, "values", values)

    @classmethod
    def constant(cls, value: float, name: str = "constant") -> Spectrum:
        """The same value at every wavelength from 200 to 2000 nm."""
        return cls(np.array([200.0, 2000.0]), np.array([value, value]), name)

    @classmethod
    def equal_energy(cls, luminance_cd_m2: float = 100.0) -> Spectrum:
        """Equal-energy radiance (illuminant E) of the given luminance in cd/m^2."""
        return cls.constant(1.0, "equal energy").with_luminance(luminance_cd_m2)

    @classmethod
    def illuminant(cls, name: str, luminance_cd_m2: float = 100.0) -> Spectrum:
        """A named illuminant of colour-science ("D65", "A", "FL2", ...) of the given luminance.

        Raises
        ------
        InvalidInputError
            If the name is unknown; the message lists near matches.
        """
        import colour

        known = colour.SDS_ILLUMINANTS
        data = known[check_choice("illuminant", name, list(known.keys()))]
        raw = cls(np.asarray(data.domain), np.maximum(np.asarray(data.values), 0.0), name)
        return raw.with_luminance(luminance_cd_m2)

    def at(self, wavelengths_nm: np.ndarray | Sequence[float]) -> np.ndarray:
        """Values at other wavelengths, linearly interpolated, shape (m,).

        Raises
        ------
        InvalidInputError
            If a wavelength lies outside the range of the samples: nothing is extrapolated.
        """
        grid = check_wavelengths(wavelengths_nm)
        low, high = self.wavelengths_nm[0], self.wavelengths_nm[-1]
        if grid[0] < low or grid[-1] > high:
            raise InvalidInputError(
                f"spectrum {self.name!r} is known from {low:g} to {high:g} nm, "
                f"asked for {grid[0]:g} to {grid[-1]:g} nm; narrow the wavelength grid"
            )
        return np.interp(grid, self.wavelengths_nm, self.values)

    def luminance_cd_m2(self) -> float:
        """Luminance in cd/m^2: 683 times the integral of V(lambda) L(lambda) in 1 nm steps."""
        nodes, efficiency = _photopic_table()
        radiance = np.interp(nodes, self.wavelengths_nm, self.values, left=0, right=0)
        return float(LUMINOUS_EFFICACY_LM_PER_W * np.sum(efficiency * radiance))

    def with_luminance(self, luminance_cd_m2: float) -> Spectrum:
        """The same spectrum, scaled to a luminance in cd/m^2."""
        wanted = check_positive("luminance_cd_m2", luminance_cd_m2, "cd/m^2")
        present = self.luminance_cd_m2()
        if present <= 0:
            raise InvalidInputError(
                f"spectrum {self.name!r} must have visible energy to be scaled to a luminance"
            )
        return self.scaled(wanted / present)

    def scaled(self, factor: float) -> Spectrum:
        """The spectrum times a number >= 0."""
        return Spectrum(
            self.wavelengths_nm, self.values * check_finite("factor", factor), self.name
        )

    def digest(self) -> str:
        """A hash of the samples, for provenance and caches."""
        data = self.wavelengths_nm.tobytes() + self.values.tobytes()
        return hashlib.sha256(data).hexdigest()[:16]
