"""Published functions of the light that is scattered inside the eye.

Each gives the veiling radiance of a small source at an angle from the line of sight, divided by the
illuminance it makes at the eye on a plane at right angles to its light: 1/sr, the tails of the
eye's point spread function. The age is in years. Pigmentation p is 0 for very dark (non-Caucasian)
eyes, 0.5 for brown, 1 for green and mixed, 1.2 for light blue ones: `PIGMENTATION`.
"""

from __future__ import annotations

import math

import numpy as np

from isetcl.errors import InvalidInputError, check_array, check_between, check_positive

PIGMENTATION = {"dark": 0.0, "brown": 0.5, "green": 1.0, "light blue": 1.2}
"""Pigmentation p of the CIE functions (CIE 135/1:1999)."""

MAX_PIGMENTATION = 1.2
MAX_AGE_YEARS = 100.0


def cie_general(
    angle_deg: np.ndarray | float, age_years: float = 35.0, pigmentation: float = 0.5
) -> np.ndarray:
    """The CIE general disability glare function, 1/sr, 0.1 to 100 deg; same shape as the angles.

    10/t^3 + (5/t^2 + 0.1 p/t) (1 + (A/62.5)^4) + 0.0025 p, t in degrees.

    Raises
    ------
    InvalidInputError
        If an angle, the age or the pigmentation lies outside the function's range.

    Source: CIE 146:2002; Vos 2003, Clin Exp Optom 86:363.
    """
    t = _angles(angle_deg, 0.1, 100.0)
    aged = 1.0 + (check_age(age_years) / 62.5) ** 4
    p = check_pigmentation(pigmentation)
    return np.asarray(10.0 / t**3 + (5.0 / t**2 + 0.1 * p / t) * aged + 0.0025 * p)


def cie_small_angle(angle_deg: np.ndarray | float, age_years: float = 35.0) -> np.ndarray:
    """The CIE small-angle disability glare function, 1/sr, 0.1 to 30 deg.

    10/t^3 + 5/t^2 (1 + (A/62.5)^4). Raises and source as in `cie_general`.
    """
    t = _angles(angle_deg, 0.1, 30.0)
    aged = 1.0 + (check_age(age_years) / 62.5) ** 4
    return np.asarray(10.0 / t**3 + 5.0 / t**2 * aged)


def stiles_holladay(angle_deg: np.ndarray | float, age_years: float = 35.0) -> np.ndarray:
    """The age-adapted Stiles-Holladay function, 1/sr, 1 to 30 deg: 10 (1 + (A/70)^4) / t^2.

    Raises and source as in `cie_general`.
    """
    t = _angles(angle_deg, 1.0, 30.0)
    return np.asarray(10.0 * (1.0 + (check_age(age_years) / 70.0) ** 4) / t**2)


def vos_van_den_berg(
    angle_deg: np.ndarray | float, age_years: float = 35.0, pigmentation: float = 0.5
) -> np.ndarray:
    """The CIE total glare function of Vos and van den Berg, 1/sr, 0 to 100 deg: core and tails.

    Divided by 1 + p (0.0417 + 0.055 (A/70)^4), so that it integrates to 1.00 to 1.02 over the half
    space. Its core is an eye's own blur and diffraction: do not apply it on top of them.

    Raises
    ------
    InvalidInputError
        If an angle, the age or the pigmentation lies outside the function's range.

    Source: Vos & van den Berg, CIE 135/1:1999; the divisor as the program HDR-VDP applies it.
    """
    t = _angles(angle_deg, 0.0, 100.0)
    aged = (check_age(age_years) / 70.0) ** 4
    p = check_pigmentation(pigmentation)
    core = 9.2e6 / (1 + (t / 0.0046) ** 2) ** 1.5 + 1.5e5 / (1 + (t / 0.045) ** 2) ** 1.5
    wide = 1.0 + (t / 0.1) ** 2
    lens = 400.0 / wide + 3e-8 * t**2
    wall = p * (1300.0 / wide**1.5 + 0.8 / wide**0.5)
    total = (1.0 - 0.08 * aged) * core + (1.0 + 1.6 * aged) * (lens + wall) + 2.5e-3 * p
    return np.asarray(total / (1.0 + p * (0.0417 + 0.055 * aged)))


def spencer_photopic(angle_deg: np.ndarray | float) -> np.ndarray:
    """The photopic point spread function of Spencer et al., 1/sr, core and tails, any age.

    0.384 f0 + 0.478 f1 + 0.138 f2 with f0 = 2.61e6 exp(-(t/0.02)^2), f1 = 20.91/(t + 0.02)^3 and
    f2 = 72.37/(t + 0.02)^2.

    Source: Spencer, Shirley, Zimmerman & Greenberg 1995, SIGGRAPH 95, 325.
    """
    t = _angles(angle_deg, 0.0, 100.0)
    f0 = 2.61e6 * np.exp(-((t / 0.02) ** 2))
    return np.asarray(
        0.384 * f0 + 0.478 * 20.91 / (t + 0.02) ** 3 + 0.138 * 72.37 / (t + 0.02) ** 2
    )


IJSPEERT_PIGMENTATION = {"mean": 0.142, "blue": 0.16, "brown": 0.106, "dark": 0.056}
"""Pigmentation m of `ijspeert_psf` (IJspeert et al. 1993)."""


def ijspeert_psf(
    angle_deg: np.ndarray | float,
    age_years: float = 35.0,
    pigmentation: float = 0.142,
    pupil_diameter_mm: float = 3.0,
) -> np.ndarray:
    """The point spread function of IJspeert et al. by age, pigmentation m and pupil, 1/sr.

    The sum of c b / (2 pi (sin^2 t + b^2 cos^2 t)^1.5) over four terms; it integrates to 1 over the
    half space. m: `IJSPEERT_PIGMENTATION`.

    Source: IJspeert, van den Berg & Spekreijse 1993, Vision Res 33:15.
    """
    t = np.radians(_angles(angle_deg, 0.0, 90.0))[..., None]
    share, width = ijspeert_terms(age_years, pigmentation, pupil_diameter_mm)
    spread = (np.sin(t) ** 2 + (width * np.cos(t)) ** 2) ** 1.5
    return np.asarray(np.sum(share * width / (2.0 * math.pi * spread), axis=-1))


def ijspeert_mtf(
    frequency_cpd: np.ndarray | float,
    age_years: float = 35.0,
    pigmentation: float = 0.142,
    pupil_diameter_mm: float = 3.0,
) -> np.ndarray:
    """The modulation transfer of `ijspeert_psf`: the sum of c exp(-360 b f), f in cycles/degree."""
    f = check_array("frequency_cpd", frequency_cpd)[..., None]
    share, width = ijspeert_terms(age_years, pigmentation, pupil_diameter_mm)
    return np.asarray(np.sum(share * np.exp(-360.0 * width * f), axis=-1))


def ijspeert_terms(
    age_years: float, pigmentation: float, pupil_diameter_mm: float
) -> tuple[np.ndarray, np.ndarray]:
    """Shares c and widths b (radians) of the four terms of `ijspeert_psf`, (4,) each."""
    m = check_between("pigmentation m", pigmentation, 0.01, 0.5)
    pupil = check_positive("pupil_diameter_mm", pupil_diameter_mm, "mm")
    aged = 1.0 + (check_age(age_years) / 70.0) ** 4
    small = 1.0 / (1.0 + aged / (1.0 / m - 1.0))
    large = 1.0 / (1.0 + (1.0 / m - 1.0) / aged)
    slope, d, e = 9000.0 - 936.0 * math.sqrt(aged), 3.2, math.sqrt(aged) / 2000.0
    narrow, wide = 1.0 + (pupil / d) ** 2, 1.0 + (d / pupil) ** 2
    third = large / ((1.0 + 25.0 * m) * (1.0 + 1.0 / aged))
    share = np.array([small / narrow, small / wide, third, large - third])
    first = 1.0 / (slope * pupil)
    width = np.array(
        [narrow * first, wide * (e - first), 1.0 / (10.0 + 60.0 * m - 5.0 / aged), 1.0]
    )
    return share, width


def check_age(age_years: float) -> float:
    """The age; raises InvalidInputError unless it lies between 0 and 100 years."""
    return check_between("age_years", age_years, 0.0, MAX_AGE_YEARS, "years")


def check_pigmentation(pigmentation: float) -> float:
    """The pigmentation p; raises InvalidInputError unless it lies between 0 and 1.2."""
    return check_between("pigmentation", pigmentation, 0.0, MAX_PIGMENTATION)


def _angles(angle_deg: np.ndarray | float, low: float, high: float) -> np.ndarray:
    angle = check_array("angle_deg", angle_deg)
    if not np.all((angle >= low) & (angle <= high)):
        outside = angle[~((angle >= low) & (angle <= high))]
        raise InvalidInputError(
            f"angle_deg must lie between {low:g} and {high:g} deg, where this glare function is "
            f"defined, got {outside.flat[0]:g} deg"
        )
    return angle
