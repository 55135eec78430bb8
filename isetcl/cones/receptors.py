"""Size and length of a cone by its eccentricity and by its distance to its neighbours."""

from __future__ import annotations

from enum import IntEnum
from typing import Literal

import numpy as np

ApertureModel = Literal["pillbox", "chen1993", "gaussian"]
APERTURE_MODELS: tuple[ApertureModel, ...] = ("pillbox", "chen1993", "gaussian")

APERTURE_TO_SPACING = 0.79
"""Diameter of a cone's entrance over its spacing, as ISETBio's cone mosaics have it."""

GAUSSIAN_SIGMA = 0.204
"""Standard deviation of the aperture over the cone's diameter. Chen, Makous & Williams 1993."""

CHEN_APERTURE_TO_SPACING = 2.0 * np.sqrt(2.0) * GAUSSIAN_SIGMA
"""Twice the characteristic radius sqrt(2) sigma of that Gaussian: 0.577."""

# Banks, Sekuler & Anderson 1991, Fig. 1: eccentricity, deg, and outer-segment length, um.
_SEGMENT_DEG = (0.0, 1.82, 4.86, 9.86, 19.78, 39.90)
_SEGMENT_UM = (47.81, 26.16, 21.2, 21.2, 21.2, 13.22)

# Banks, Sekuler & Anderson 1991: spacing and inner-segment diameter, arcmin, by eccentricity, deg.
_INTRUSION_DEG = (0.0, 2.04, 5.08, 9.92, 19.95, 40.17)
_BANKS_SPACING_ARCMIN = (0.57, 1.18, 1.81, 2.25, 3.02, 3.59)
_BANKS_DIAMETER_ARCMIN = (0.57, 1.10, 1.33, 1.58, 1.63, 1.71)


class ReceptorType(IntEnum):
    """Types of receptors, as `ConeMosaic.types` numbers them."""

    L = 0
    M = 1
    S = 2
    ROD = 3


def outer_segment_um(eccentricity_deg: np.ndarray) -> np.ndarray:
    """Length of the outer segments, um, at eccentricities in degrees.

    Monotone cubic through six measured points; beyond the last, at 39.9 degrees, its value.
    Source: Banks, Sekuler & Anderson 1991, Fig. 1.
    """
    return _monotone(_SEGMENT_DEG, _SEGMENT_UM, eccentricity_deg)


def rod_intrusion(eccentricity_deg: np.ndarray) -> np.ndarray:
    """Inner-segment diameter over the cones' spacing: 1 in the fovea, less where rods lie between.

    Monotone cubic; beyond 40.2 degrees the last value. Source: Banks, Sekuler & Anderson 1991.
    """
    ratio = np.array(_BANKS_DIAMETER_ARCMIN) / np.array(_BANKS_SPACING_ARCMIN)
    return _monotone(_INTRUSION_DEG, tuple(ratio), eccentricity_deg)


def aperture_um(
    spacing_um: np.ndarray,
    eccentricity_deg: np.ndarray,
    model: ApertureModel = "pillbox",
    *,
    has_rod_intrusion: bool = False,
) -> np.ndarray:
    """Diameter of the light-collecting aperture, um.

    ``"pillbox"`` is 0.79 of the spacing; ``"chen1993"`` and ``"gaussian"`` are 0.577 of it, the
    latter as twice the characteristic radius of a Gaussian. With rods between the cones the inner
    segments, and with them the apertures, fill less of the spacing.
    """
    ratio = APERTURE_TO_SPACING if model == "pillbox" else CHEN_APERTURE_TO_SPACING
    diameter = ratio * spacing_um
    if has_rod_intrusion:
        diameter = diameter * rod_intrusion(eccentricity_deg)
    return np.asarray(diameter)


def neighbour_spacing(positions: np.ndarray, neighbours: int = 6) -> np.ndarray:
    """Median distance to the six nearest, smoothed by the median over a cone and these six, (n,).

    In the unit of the positions, (n, 2). A mosaic of fewer cones uses as many as there are; a
    single cone has none and gets NaN.
    """
    from scipy.spatial import cKDTree

    k = min(neighbours, len(positions) - 1)
    if k < 1:
        return np.full(len(positions), np.nan)
    distance, index = cKDTree(positions).query(positions, k=k + 1)
    spacing = np.median(distance[:, 1:], axis=1)
    return np.asarray(np.median(spacing[index], axis=1))


def _monotone(at: tuple[float, ...], values: tuple[float, ...], where: np.ndarray) -> np.ndarray:
    from scipy.interpolate import PchipInterpolator

    return np.asarray(PchipInterpolator(at, values)(np.clip(where, at[0], at[-1])))
