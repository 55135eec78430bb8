"""Conversions between the units of the public face and those of the kernels."""

from __future__ import annotations

import math

from isetcl.errors import InvalidInputError, check_finite, check_number

MM_PER_M = 1000.0
UM_PER_MM = 1000.0
NM_PER_MM = 1e6
NM_PER_M = 1e9
ARCMIN_PER_DEG = 60.0
ARCMIN_PER_RAD = 60.0 * 180.0 / math.pi

PLANCK_J_S = 6.62607015e-34
"""Planck constant, exact. Source: CODATA 2018 (SI Brochure, 9th edition, 2019)."""
SPEED_OF_LIGHT_M_S = 299792458.0
"""Speed of light in vacuum, exact. Source: CODATA 2018."""

LUMINOUS_EFFICACY_LM_PER_W = 683.0
"""Maximum photopic luminous efficacy, lm/W (SI definition of the candela, CGPM 1979)."""


def vergence_from_distance(distance_m: float) -> float:
    """Vergence in dioptres (1/m) of an object `distance_m` in front of the corneal vertex.

    Infinity is legal and has vergence 0.

    Raises
    ------
    InvalidInputError
        If the distance is not positive.
    """
    distance = check_number("distance_m", distance_m)
    if distance == math.inf:
        return 0.0
    if not distance > 0:
        raise InvalidInputError(
            f"distance_m must be > 0 m from the corneal vertex (inf is legal), got {distance_m}"
        )
    return 1.0 / distance


def distance_from_vergence(vergence_dpt: float) -> float:
    """Distance in metres from the corneal vertex of a vergence in dioptres; 0 is infinity."""
    vergence = check_finite("vergence_dpt", vergence_dpt, "dpt")
    if vergence < 0:
        raise InvalidInputError(
            f"vergence_dpt must be >= 0 dpt for a real object, got {vergence:g}"
        )
    return math.inf if vergence == 0 else 1.0 / vergence
