"""How irregular lattices of cones are: what was measured, and the disorder that makes them so.

Disorder is the relative spread of the cones' sizes in `isetcl.cones.lattice.relaxed`. The nodes
below were found by making lattices of 5000 cones/mm^2 and looking at them, 43 000 cones each.
"""

from __future__ import annotations

from typing import Literal

import numpy as np

from isetcl.errors import InvalidInputError, check_between

Disorder = float | Literal["measured"]

MOST_DISORDER = 0.4
"""Beyond it cones come to lie nearly on top of each other, and some are lost (0.4 % at 0.46)."""

SIX_SIDED_UNTIL_DEG = 6.0
"""Where measurements of the share of six-sided cells end."""

LEAST_DISTANCE_UM = (6.0, 8.0)
"""Least distance of neighbours all over the peripheral retina. Curcio & Sloan 1992, abstract."""

LEAST_DISTANCE_FROM_DEG = 10.0
"""Where cones with six neighbours half of the time are as near as that, and the periphery begins.

Curcio and Sloan's abstract does not say where theirs does.
"""

LEAST_DISTANCE_PERCENTILE = 1.0
"""The least distance among the hundred or so cones of a micrograph, in a mosaic of any size."""

# 30 % of the about 300 cones in the middle of the fovea are not six-sided, fewer around them (Pum,
# Ahnelt & Grasl 1990); disorder is least at the edge of the rod-free zone, at 0.175 mm or 0.65 deg
# (Curcio & Sloan 1992). About half are six-sided at 0.1 to 4.3 deg (Li & Roorda 2007; 35 to 70 % in
# places), at 2 to 6 deg (Legras, Gaudric & Woog 2018); 40 to 50 % at 0.7 to 3.9 deg (Lombardo,
# Serrao, Ducoli & Lombardo 2013). The line from 0.65 to 2 deg is drawn, not measured.
_SIX_SIDED_DEG = (0.65, 2.0)
_SIX_SIDED = (0.7, 0.5)

_TOUCHING_UM = 6.5
_LEAST_IN_SPACINGS = 0.6  # 1 % of the cones of a lattice of disorder 0.18 are nearer

# Disorder against the share of six-sided cells and against the least distance over the spacing.
_DISORDER_OF_SHARE = ((0.5, 0.544, 0.603, 0.643, 0.7), (0.18, 0.14, 0.1, 0.08, 0.06))
_DISORDER_OF_DISTANCE = (
    (0.32, 0.355, 0.424, 0.479, 0.533, 0.584, 0.636),
    (0.4, 0.38, 0.34, 0.3, 0.26, 0.22, 0.18),
)


def measured_six_sided(eccentricity_deg: np.ndarray) -> np.ndarray:
    """Share of cones with six neighbours that was measured; NaN beyond 6 degrees."""
    ecc = np.asarray(eccentricity_deg, dtype=np.float64)
    return np.where(ecc <= SIX_SIDED_UNTIL_DEG, np.interp(ecc, _SIX_SIDED_DEG, _SIX_SIDED), np.nan)


def measured_disorder(eccentricity_deg: np.ndarray, spacing_mm: np.ndarray) -> np.ndarray:
    """Disorder that makes a lattice as irregular as measured, at eccentricities and spacings.

    As many cones are six-sided as were found out to 6 degrees; where cones are far apart, some come
    as near to each other as 7 um all the same.
    """
    six_sided = np.interp(eccentricity_deg, _SIX_SIDED_DEG, _SIX_SIDED)
    least_mm = 0.5e-3 * sum(LEAST_DISTANCE_UM)
    near = np.interp(least_mm / spacing_mm, *_DISORDER_OF_DISTANCE, right=0.0)
    return np.maximum(np.interp(six_sided, *_DISORDER_OF_SHARE), near)


def least_distance_mm(spacing_mm: np.ndarray) -> np.ndarray:
    """How near cones come at most, mm, at spacings: as inner segments do that touch."""
    return np.minimum(_LEAST_IN_SPACINGS * spacing_mm, 1e-3 * _TOUCHING_UM)


def check_disorder(disorder: Disorder) -> Disorder:
    """Raise InvalidInputError unless it is ``"measured"`` or a number between 0 and 0.4."""
    if isinstance(disorder, str):
        if disorder != "measured":
            raise InvalidInputError(
                f"disorder must be 'measured' or a number from 0 to {MOST_DISORDER:g}, got "
                f"{disorder!r}"
            )
        return "measured"
    return check_between("disorder", disorder, 0.0, MOST_DISORDER)
