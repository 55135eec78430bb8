"""What PSF methods need of eyes that are not figures of revolution."""

from __future__ import annotations

import math

import numpy as np

from isetcl.eye.field_plane import FieldPlane
from isetcl.eye.plane_polynomial import sampled
from isetcl.eye.throughput import plane_irradiance_per_radiance
from isetcl.retina.grid import RetinalGrid

_TOLERANCE_DEG = 1e-6
_NODE_DEG = 2.0


def fields_seen_deg(labels: FieldPlane, own: FieldPlane, at_deg: np.ndarray) -> np.ndarray:
    """Directions that retinal points see at the wavelength of `own`, (n, 2), degrees.

    `at_deg` (n, 2) are the field angles that label the points.
    """

    def seen(at: np.ndarray) -> np.ndarray:
        return own.field_of_point_deg(labels.retinal_point_mm(*at.T))

    return sampled(seen, at_deg, _TOLERANCE_DEG)


def plane_throughput(grid: RetinalGrid, wavelength_nm: float) -> np.ndarray:
    """Irradiance per unit radiance at every pixel, sr, (rows, columns)."""
    from scipy.interpolate import RectBivariateSpline

    labels = grid.field_map
    assert isinstance(labels, FieldPlane)
    # A node every two degrees: far out the pupil closes quickly.
    x, y = (
        np.linspace(middle - half, middle + half, max(5, math.ceil(2.0 * half / _NODE_DEG) + 1))
        for middle, half in zip(grid.rectangle.middle, grid.rectangle.half, strict=True)
    )
    at = np.stack(np.meshgrid(x, y, indexing="ij"), axis=-1).reshape(-1, 2)
    values = plane_irradiance_per_radiance(grid.eye, wavelength_nm, labels, at)
    spline = RectBivariateSpline(x, y, values.reshape(len(x), len(y)))
    return np.asarray(spline(grid.x_deg, grid.y_deg[::-1]).T[::-1])
