"""Pupil diameter in mm against luminance: published formulas.

Luminance in cd/m^2. Diameters are those of the entrance pupil, as they are measured from outside.
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

Eyes = Literal["one", "both"]

_REFERENCE_AGE_YEARS = 28.58


def watson_yellott(
    luminance_cd_m2: np.ndarray | float,
    *,
    area_deg2: float,
    age_years: float = _REFERENCE_AGE_YEARS,
    eyes: Eyes = "both",
) -> np.ndarray:
    """The unified formula by luminance, area of the field, age and eyes that see it, mm.

    D_SD + (y - 28.58)(0.02132 - 0.009562 D_SD), with D_SD of Stanley & Davies at the luminance
    times 1 (both eyes) or 0.1 (one eye). Fitted to ages of 20 to 83 years.

    Raises
    ------
    InvalidInputError
        If a value breaks its rule.

    Source: Watson & Yellott 2012, J Vis 12(10):12.
    """
    age = check_between("age_years", age_years, 20.0, 83.0, "years")
    share = {"one": 0.1, "both": 1.0}[check_choice("eyes", eyes, ("one", "both"))]
    base = stanley_davies(share * _luminance(luminance_cd_m2), area_deg2=area_deg2)
    return np.asarray(base + (age - _REFERENCE_AGE_YEARS) * (0.02132 - 0.009562 * base))


def stanley_davies(luminance_cd_m2: np.ndarray | float, *, area_deg2: float) -> np.ndarray:
    """7.75 - 5.75 g/(g + 2) with g = (luminance area/846)^0.41, mm.

    Source: Stanley & Davies 1995, Ophthalmic Physiol Opt 15:601.
    """
    area = check_positive("area_deg2", area_deg2, "deg^2")
    g = (_luminance(luminance_cd_m2) * area / 846.0) ** 0.41
    return np.asarray(7.75 - 5.75 * g / (g + 2.0))


def moon_spencer(luminance_cd_m2: np.ndarray | float) -> np.ndarray:
    """4.9 - 3 tanh(0.4 (log10 B + 0.5)) with B in millilamberts, mm.

    In cd/m^2 the bracket is log10 L to 0.003. Handbooks and programs that print log10 L + 1 have
    converted the unit the other way round.

    Source: Moon & Spencer 1944, J Opt Soc Am 34:319.
    """
    level = _log_millilamberts(luminance_cd_m2)
    return np.asarray(4.9 - 3.0 * np.tanh(0.4 * (level + 0.5)))


def de_groot_gebhard(luminance_cd_m2: np.ndarray | float) -> np.ndarray:
    """10^(0.8558 - 0.000401 (log10 B + 8.1)^3) with B in millilamberts, mm.

    In cd/m^2 the bracket is log10 L + 7.597; log10 L + 8.6 is the unit converted the other way
    round.

    Source: de Groot & Gebhard 1952, J Opt Soc Am 42:492.
    """
    level = _log_millilamberts(luminance_cd_m2)
    return np.asarray(10.0 ** (0.8558 - 4.01e-4 * (level + 8.1) ** 3))


def pokorny_smith(luminance_cd_m2: np.ndarray | float) -> np.ndarray:
    """5 - 3 tanh(0.4 log10 L), mm.

    Source: Pokorny & Smith 1997, in Cavonius, Colour vision deficiencies XIII, 491.
    """
    return np.asarray(5.0 - 3.0 * np.tanh(0.4 * np.log10(_luminance(luminance_cd_m2))))


def _log_millilamberts(luminance_cd_m2: np.ndarray | float) -> np.ndarray:
    """log10 of the luminance in millilamberts: 1 mL = 10/pi cd/m^2."""
    return np.log10(_luminance(luminance_cd_m2) * math.pi / 10.0)


def _luminance(value: np.ndarray | float) -> np.ndarray:
    luminance = check_array("luminance_cd_m2", value)
    if not np.all(np.isfinite(luminance) & (luminance > 0.0)):
        raise InvalidInputError("luminance_cd_m2 must be finite and > 0 cd/m^2")
    return luminance
