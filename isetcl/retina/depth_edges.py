"""Where light is hidden or revealed: strips along the edges of a depth map."""

from __future__ import annotations

import itertools
import math

import numpy as np

from isetcl.units import MM_PER_M

_WIDTH_CLASSES = 24


def occlusion_strip(
    vergence_dpt: np.ndarray,
    pitch_deg: float | tuple[float, float],
    entrance_pupil_diameter_mm: float,
) -> np.ndarray:
    """Pixels within a |D1 - D2| radians of a depth edge, bool, (rows, columns).

    An edge is where the vergence of neighbours jumps by enough to make a strip of half a pixel.

    Parameters
    ----------
    vergence_dpt
        Depth map, 1/m, (rows, columns).
    pitch_deg
        Width of a pixel, degrees, or width and height.
    entrance_pupil_diameter_mm
        Diameter of the entrance pupil, mm.
    """
    from scipy.ndimage import distance_transform_edt

    width, height = (pitch_deg, pitch_deg) if isinstance(pitch_deg, (int, float)) else pitch_deg
    deg_per_dpt = math.degrees(entrance_pupil_diameter_mm / 2.0 / MM_PER_M)
    reach = np.zeros(vergence_dpt.shape)
    edge = np.zeros(vergence_dpt.shape, dtype=bool)
    for axis, pitch in ((0, height), (1, width)):
        jump = np.abs(np.diff(vergence_dpt.astype(np.float64), axis=axis)) * deg_per_dpt
        low = [slice(None), slice(None)]
        high = [slice(None), slice(None)]
        low[axis], high[axis] = slice(None, -1), slice(1, None)
        for side in (tuple(low), tuple(high)):
            reach[side] = np.maximum(reach[side], jump)
            edge[side] |= jump > 0.5 * pitch
    if not edge.any():
        return edge
    strip = edge.copy()
    # Edges of like width share one distance transform, taken at the largest width.
    limits = np.linspace(0.0, reach.max(), _WIDTH_CLASSES + 1)
    for low_limit, high_limit in itertools.pairwise(limits):
        members = edge & (reach > low_limit) & (reach <= high_limit)
        if members.any():
            distance = distance_transform_edt(~members, sampling=(height, width))
            strip |= distance <= reach[members].max() + 0.5 * min(width, height)
    return strip
