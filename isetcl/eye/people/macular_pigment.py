"""Macular pigment by wavelength and eccentricity, and the tables it shares with the receptors.

Wavelengths are in nm; densities are decadic.
"""

from __future__ import annotations

import functools
from importlib import resources
from typing import Literal

import numpy as np

from isetcl.errors import InvalidInputError, check_choice
from isetcl.spectrum import check_wavelengths

PigmentModel = Literal["cie_170", "stockman_rider_2023"]
PIGMENT_MODELS: tuple[PigmentModel, ...] = ("cie_170", "stockman_rider_2023")

PIGMENT_RANGE_NM = {"cie_170": (390.0, 830.0), "stockman_rider_2023": (360.0, 850.0)}
"""Wavelengths each model was published for."""

MACULAR_PEAK_DENSITY = 0.35
"""Density of the macular pigment in the fovea, at its peak. ISETBio's default."""

MACULAR_PEAK_OVER_460_NM = 0.352114450093 / 0.35
"""The peak, at 458 nm, over the value at 460 nm that CIE 170-1 names. Its own table."""

# Lorentzian in eccentricity, deg^2, as ISETBio fits Putnam & Bland 2014, Fig. 2B: half at 1.90 deg.
_MACULAR_HALF_DEG2 = 3.6028


@functools.cache
def cie_170_table() -> np.ndarray:
    """The tables of CIE 170-1 every nm, (441, 6); columns as data/cie_170_cones.csv says."""
    with resources.files("isetcl.data").joinpath("cie_170_cones.csv").open() as lines:
        return np.loadtxt(lines, delimiter=",", comments="#")


def check_pigment_range(model: str, wavelengths_nm: np.ndarray) -> np.ndarray:
    """The wavelengths as an array, if the model was published for them.

    Raises
    ------
    InvalidInputError
        If it was not.
    """
    grid = check_wavelengths(wavelengths_nm)
    low, high = PIGMENT_RANGE_NM[model]
    if grid[0] < low or grid[-1] > high:
        raise InvalidInputError(
            f"pigments {model!r} are known from {low:g} to {high:g} nm, got {grid[0]:g} to "
            f"{grid[-1]:g} nm; narrow the wavelength grid or use another model"
        )
    return grid


def macular_density(
    wavelengths_nm: np.ndarray,
    peak_density: float = MACULAR_PEAK_DENSITY,
    model: PigmentModel = "cie_170",
) -> np.ndarray:
    """Density of macular pigment whose peak, at 458 nm, is `peak_density`, (wavelengths,).

    Tables of CIE 170-1:2006 (Bone, Landrum & Cairns 1992), or the template of Stockman & Rider
    2023.

    Raises
    ------
    InvalidInputError
        If the model is unknown or a wavelength lies outside it.
    """
    check_choice("pigment model", model, PIGMENT_MODELS)
    grid = check_pigment_range(model, wavelengths_nm)
    if model == "stockman_rider_2023":
        from isetcl.eye.people.stockman_rider import template_macular_density

        density = template_macular_density(grid)
    else:
        density = np.interp(grid, cie_170_table()[:, 0], cie_170_table()[:, 5])
    return np.asarray(density * (peak_density / (0.35 * MACULAR_PEAK_OVER_460_NM)))


def standard_lens_density(wavelengths_nm: np.ndarray) -> np.ndarray:
    """Density of the lens of CIE 170-1:2006 at 32 years, every nm from 390, (wavelengths,)."""
    return np.interp(wavelengths_nm, cie_170_table()[:, 0], cie_170_table()[:, 4])


def macular_fraction(eccentricity_deg: np.ndarray | float) -> np.ndarray:
    """Density of the macular pigment over that of the fovea, at eccentricities in degrees.

    h / (r^2 + h), h = 3.6028 deg^2: a Lorentzian through Putnam & Bland 2014, Fig. 2B.
    """
    squared = np.square(np.asarray(eccentricity_deg, dtype=np.float64))
    return np.asarray(_MACULAR_HALF_DEG2 / (squared + _MACULAR_HALF_DEG2))
