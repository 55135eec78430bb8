"""Photopigments and macular pigment: what part of the light at a receptor it absorbs.

Wavelengths are in nm; densities and absorbances are decadic.
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

# Published peaks of the cones, nm, which a nomogram's shift counts from: Stockman & Rider 2023.
CONE_PEAK_NM = {"L": 551.9, "M": 529.8, "S": 416.9}


@functools.cache
def _table() -> np.ndarray:
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


def absorbance(
    cone: str,
    wavelengths_nm: np.ndarray,
    model: PigmentModel = "cie_170",
    shift_nm: float = 0.0,
) -> np.ndarray:
    """Low-density absorbance of a cone's pigment, peak 1, (wavelengths,).

    Parameters
    ----------
    cone
        ``"L"``, ``"M"`` or ``"S"``.
    wavelengths_nm
        Ascending wavelengths, nm.
    model
        ``"cie_170"``: the tables of CIE 170-1:2006, 390 to 830 nm, every nm; between them linear in
        the logarithm. ``"stockman_rider_2023"``: Fourier templates, 360 to 850 nm.
    shift_nm
        How far the peak is moved, nm. On a scale of log wavelength the spectrum keeps its shape.

    Raises
    ------
    InvalidInputError
        If a name is unknown or a wavelength lies outside the model.
    """
    check_choice("cone", cone, ("L", "M", "S"))
    check_choice("pigment model", model, PIGMENT_MODELS)
    grid = check_pigment_range(model, wavelengths_nm)
    if model == "stockman_rider_2023":
        from isetcl.cones.templates import template_absorbance

        return template_absorbance(cone, grid, shift_nm)
    table, peak = _table(), CONE_PEAK_NM[cone]
    log = table[:, 1 + "LMS".index(cone)]
    return np.asarray(10.0 ** _extended(grid * peak / (peak + shift_nm), table[:, 0], log))


def _extended(at: np.ndarray, nodes: np.ndarray, values: np.ndarray) -> np.ndarray:
    """Linear interpolation that goes on beyond the ends with the slope of the last 30 nodes."""
    found = np.interp(at, nodes, values)
    rise = (values[-1] - values[-31]) / (nodes[-1] - nodes[-31])
    fall = (values[30] - values[0]) / (nodes[30] - nodes[0])
    found += np.maximum(at - nodes[-1], 0.0) * rise
    return np.asarray(found + np.minimum(at - nodes[0], 0.0) * fall)


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
        from isetcl.cones.templates import template_macular_density

        density = template_macular_density(grid)
    else:
        density = np.interp(grid, _table()[:, 0], _table()[:, 5])
    return np.asarray(density * (peak_density / (0.35 * MACULAR_PEAK_OVER_460_NM)))


def standard_lens_density(wavelengths_nm: np.ndarray) -> np.ndarray:
    """Density of the lens of CIE 170-1:2006 at 32 years, every nm from 390, (wavelengths,)."""
    return np.interp(wavelengths_nm, _table()[:, 0], _table()[:, 4])


def macular_fraction(eccentricity_deg: np.ndarray | float) -> np.ndarray:
    """Density of the macular pigment over that of the fovea, at eccentricities in degrees.

    h / (r^2 + h), h = 3.6028 deg^2: a Lorentzian through Putnam & Bland 2014, Fig. 2B.
    """
    squared = np.square(np.asarray(eccentricity_deg, dtype=np.float64))
    return np.asarray(_MACULAR_HALF_DEG2 / (squared + _MACULAR_HALF_DEG2))


def field_size_densities(field_deg: float) -> tuple[tuple[float, float, float], float]:
    """Optical densities of L, M and S, and the macular pigment's peak density, of a field's size.

    CIE 170-1:2006, for fields of 1 to 10 degrees: 0.38 + 0.54 exp(-d/1.333) for L and M, 0.30 +
    0.45 exp(-d/1.333) for S, 0.485 exp(-d/6.132) for the macular pigment at 460 nm.
    """
    if not 1.0 <= field_deg <= 10.0:
        raise InvalidInputError(
            f"field_deg must be 1 to 10 deg, which CIE 170-1 covers, got {field_deg:g}"
        )
    fall = float(np.exp(-field_deg / 1.333))
    long = 0.38 + 0.54 * fall
    return (long, long, 0.30 + 0.45 * fall), 0.485 * MACULAR_PEAK_OVER_460_NM * float(
        np.exp(-field_deg / 6.132)
    )
