"""Published formulas of the modulation transfer and line spread of human eyes.

Frequencies in cycles/degree, distances in arcmin; results have the shape of the input. Each formula
holds for what was measured: its pupil, light and place on the retina.
"""

from __future__ import annotations

import math
from typing import Literal

import numpy as np

from isetcl.errors import (
    InvalidInputError,
    check_array,
    check_between,
    check_choice,
    check_positive,
)
from isetcl.units import ARCMIN_PER_DEG

SpreadFormula = Literal["geisler_1984", "davila_geisler_1991"]

# Navarro, Artal & Williams 1993, J Opt Soc Am A 10:201: eccentricity deg, A, B, C. The rows of 5
# and 10 deg are the same in the source used here.
_NAVARRO_1993 = np.array(
    [
        [0.0, 0.172, 0.037, 0.22],
        [5.0, 0.245, 0.041, 0.20],
        [10.0, 0.245, 0.041, 0.20],
        [20.0, 0.328, 0.038, 0.14],
        [30.0, 0.606, 0.064, 0.12],
        [40.0, 0.82, 0.064, 0.09],
        [50.0, 0.93, 0.059, 0.067],
        [60.0, 1.89, 0.108, 0.05],
    ]
)

# Shares (before they are made to sum to 1) and standard deviations, arcmin.
_GAUSSIANS = {
    "geisler_1984": ((0.684, 0.587), (0.443, 2.035)),
    "davila_geisler_1991": ((0.409, 0.591), (0.417, 1.42)),
}


def diffraction_mtf(
    frequency_cpd: np.ndarray | float, pupil_diameter_mm: float, wavelength_nm: float
) -> np.ndarray:
    """Modulation transfer of a round pupil without aberrations, any orientation.

    (2/pi)(acos s - s sqrt(1 - s^2)) with s = f / (pi d 10^6 / (180 lambda)), d in mm.
    """
    d = check_positive("pupil_diameter_mm", pupil_diameter_mm, "mm")
    nm = check_positive("wavelength_nm", wavelength_nm, "nm")
    s = np.clip(_frequency(frequency_cpd) / (math.pi * d * 1e6 / (180.0 * nm)), 0.0, 1.0)
    return np.asarray(2.0 / math.pi * (np.arccos(s) - s * np.sqrt(1.0 - s * s)))


def watson_2013_mtf(frequency_cpd: np.ndarray | float, pupil_diameter_mm: float) -> np.ndarray:
    """Mean radial modulation transfer of 200 best-corrected healthy eyes in white light.

    sqrt(D(f, d, 555 nm)) (1 + (f/f1)^2)^-0.62 with f1 = 21.95 - 5.512 d + 0.3922 d^2; for pupils of
    2 to 6 mm.

    Raises
    ------
    InvalidInputError
        If the pupil lies outside that range or a frequency is negative.

    Source: Watson 2013, J Vis 13(6):18.
    """
    d = check_between("pupil_diameter_mm", pupil_diameter_mm, 2.0, 6.0, "mm")
    corner = 21.95 - 5.512 * d + 0.3922 * d * d
    ideal = diffraction_mtf(frequency_cpd, d, 555.0)
    return np.asarray(np.sqrt(ideal) * (1.0 + (_frequency(frequency_cpd) / corner) ** 2) ** -0.62)


def williams_1994_mtf(frequency_cpd: np.ndarray | float) -> np.ndarray:
    """Modulation transfer at a 3 mm pupil and 633 nm by interferometry, fovea.

    D(f, 3 mm, 633 nm) (0.3481 + 0.6519 exp(-0.1212 f)).

    Source: Williams, Brainard, McMahon & Navarro 1994, J Opt Soc Am A 11:3123.
    """
    fall = 0.3481 + 0.6519 * np.exp(-0.1212 * _frequency(frequency_cpd))
    return np.asarray(diffraction_mtf(frequency_cpd, 3.0, 633.0) * fall)


def navarro_1993_mtf(
    frequency_cpd: np.ndarray | float, eccentricity_deg: float = 0.0
) -> np.ndarray:
    """Modulation transfer at a 4 mm pupil against eccentricity, 0 to 60 deg, by double pass.

    (1 - C) exp(-A f) + C exp(-B f); A, B and C are linear between the measured eccentricities.

    Raises
    ------
    InvalidInputError
        If the eccentricity lies outside that range or a frequency is negative.

    Source: Navarro, Artal & Williams 1993, J Opt Soc Am A 10:201.
    """
    at = check_between("eccentricity_deg", eccentricity_deg, 0.0, 60.0, "deg")
    a, b, c = (np.interp(at, _NAVARRO_1993[:, 0], column) for column in _NAVARRO_1993[:, 1:].T)
    f = _frequency(frequency_cpd)
    return np.asarray((1.0 - c) * np.exp(-a * f) + c * np.exp(-b * f))


def rovamo_1998_mtf(frequency_cpd: np.ndarray | float, pupil_diameter_mm: float) -> np.ndarray:
    """exp(-(f/fc)^n) with fc = 16.6 - 1.49 d and n = exp(0.840/d - 0.318), d in mm.

    Raises
    ------
    InvalidInputError
        Unless the pupil is larger than 0.5 and smaller than 9 mm.

    Source: Rovamo, Kukkonen & Mustonen 1998, J Opt Soc Am A 15:2504.
    """
    d = check_between("pupil_diameter_mm", pupil_diameter_mm, 0.5, 9.0, "mm")
    corner, power = 16.6 - 1.49 * d, math.exp(0.840 / d - 0.318)
    return np.asarray(np.exp(-((_frequency(frequency_cpd) / corner) ** power)))


def gaussian_lsf(
    distance_arcmin: np.ndarray | float, formula: SpreadFormula = "geisler_1984"
) -> np.ndarray:
    """Line spread function as the sum of two Gaussians, per arcmin; it integrates to 1.

    ``"geisler_1984"``: 2 mm pupil, standard deviations 0.443 and 2.035 arcmin, areas as 0.684 to
    0.587 (Geisler 1984, J Opt Soc Am A 1:775). ``"davila_geisler_1991"``: 3 mm pupil, 0.417 and
    1.42 arcmin, 0.409 to 0.591 (Davila & Geisler 1991, Vision Res 31:1369).
    """
    x = check_array("distance_arcmin", distance_arcmin)
    return np.asarray(
        sum(
            share / (sigma * math.sqrt(2.0 * math.pi)) * np.exp(-((x / sigma) ** 2) / 2.0)
            for share, sigma in _gaussians(formula)
        )
    )


def gaussian_mtf(
    frequency_cpd: np.ndarray | float, formula: SpreadFormula = "geisler_1984"
) -> np.ndarray:
    """Modulation transfer of `gaussian_lsf`."""
    f = _frequency(frequency_cpd) / ARCMIN_PER_DEG
    return np.asarray(
        sum(s * np.exp(-2.0 * (math.pi * sigma * f) ** 2) for s, sigma in _gaussians(formula))
    )


def westheimer_lsf(distance_arcmin: np.ndarray | float) -> np.ndarray:
    """Westheimer's line spread function, 1 at 0: 0.47 exp(-3.3 x^2) + 0.53 exp(-0.93 |x|).

    Source: Westheimer 1986, in Boff, Kaufman & Thomas, Handbook of perception, chapter 4.
    """
    x = np.abs(check_array("distance_arcmin", distance_arcmin))
    return np.asarray(0.47 * np.exp(-3.3 * x * x) + 0.53 * np.exp(-0.93 * x))


def westheimer_mtf(frequency_cpd: np.ndarray | float) -> np.ndarray:
    """Modulation transfer of `westheimer_lsf`, 1 at 0."""
    f = _frequency(frequency_cpd) / ARCMIN_PER_DEG
    narrow = 0.47 * math.sqrt(math.pi / 3.3)
    wide = 0.53 * 2.0 / 0.93
    values = narrow * np.exp(-((math.pi * f) ** 2) / 3.3) + wide / (1 + (2 * np.pi * f / 0.93) ** 2)
    return np.asarray(values / (narrow + wide))


def westheimer_psf(distance_arcmin: np.ndarray | float) -> np.ndarray:
    """Westheimer's point spread function, 1 at 0, of the same chapter.

    0.952 exp(-2.59 r^1.36) + 0.048 exp(-2.43 r^1.74). It is not the point spread of
    `westheimer_lsf`: its line integral is half as high at 1 arcmin, and 1/1000 at 3 arcmin.
    """
    r = np.abs(check_array("distance_arcmin", distance_arcmin))
    return np.asarray(0.952 * np.exp(-2.59 * r**1.36) + 0.048 * np.exp(-2.43 * r**1.74))


def _gaussians(formula: SpreadFormula) -> tuple[tuple[float, float], ...]:
    shares, sigmas = _GAUSSIANS[check_choice("formula", formula, _GAUSSIANS)]
    return tuple((s / sum(shares), sigma) for s, sigma in zip(shares, sigmas, strict=True))


def _frequency(value: np.ndarray | float) -> np.ndarray:
    frequency = check_array("frequency_cpd", value)
    if not np.all(np.isfinite(frequency) & (frequency >= 0.0)):
        raise InvalidInputError("frequency_cpd must be finite and >= 0 cycles/degree")
    return frequency
