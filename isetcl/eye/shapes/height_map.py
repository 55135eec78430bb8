"""Height maps: a conic and measured heights, as corneal topography or a relief of the retina."""

from __future__ import annotations

import functools
from dataclasses import dataclass

import numpy as np

from isetcl.errors import InvalidInputError, check_array, check_positive
from isetcl.eye.shapes.shape import Departure

MAX_SIDE = 1024
"""Most samples along a side."""


@dataclass(frozen=True, eq=False)
class HeightMap(Departure):
    """The conic plus heights on an even grid, joined by cubic B-splines (twice differentiable).

    The map is centred on the vertex. Beyond its borders it goes on with the values there.

    Parameters
    ----------
    heights_mm : ndarray, (rows, columns)
        Heights along +z, mm. Row 0 lies at +y, column 0 at -x. At least 4 x 4.
    width_mm, height_mm
        Distance from the first to the last column and row, mm.
    """

    heights_mm: np.ndarray
    width_mm: float
    height_mm: float

    def __post_init__(self) -> None:
        heights = check_array("height map: heights_mm", self.heights_mm)
        if heights.ndim != 2 or not all(4 <= n <= MAX_SIDE for n in heights.shape):
            raise InvalidInputError(
                f"height map: heights_mm must be an array of 4 to {MAX_SIDE} rows and columns, got "
                f"shape {heights.shape}"
            )
        if not np.all(np.isfinite(heights)):
            count = int(np.sum(~np.isfinite(heights)))
            raise InvalidInputError(
                f"height map: heights_mm must be finite, got {count} missing values; fill or crop "
                "the map first"
            )
        heights = heights.copy()
        heights.setflags(write=False)
        object.__setattr__(self, "heights_mm", heights)
        for name in ("width_mm", "height_mm"):
            value = check_positive(f"height map: {name}", getattr(self, name), "mm")
            object.__setattr__(self, name, value)

    @property
    def is_rotational(self) -> bool:
        """False."""
        return False

    @functools.cached_property
    def spline(self) -> np.ndarray:
        """Coefficients of the B-splines, mm, (rows + 2, columns + 2), row 0 at -y.

        One more than the samples on every side; the slope across the borders is 0.
        """
        from scipy.ndimage import spline_filter

        inner = spline_filter(self.heights_mm[::-1], order=3, mode="mirror")
        return np.pad(inner, 1, mode="reflect")

    def departure(self, x: np.ndarray, y: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Height and slopes; beyond the border the slope across it is 0."""
        rows, columns = self.heights_mm.shape
        per_x, per_y = (columns - 1) / self.width_mm, (rows - 1) / self.height_mm
        i, weight_x, slope_x = _weights(x * per_x + (columns - 1) / 2.0, columns)
        j, weight_y, slope_y = _weights(y * per_y + (rows - 1) / 2.0, rows)
        patch = self.spline[
            j[..., None, None] + np.arange(4)[:, None], i[..., None, None] + np.arange(4)
        ]
        return (
            np.einsum("...ji,...j,...i->...", patch, weight_y, weight_x),
            np.einsum("...ji,...j,...i->...", patch, weight_y, slope_x) * per_x,
            np.einsum("...ji,...j,...i->...", patch, slope_y, weight_x) * per_y,
        )

    def vertex_curvatures(self, curvature: float) -> tuple[float, float, float]:
        """Those of the conic plus those of the spline at its middle."""
        step = 1e-3 * min(
            self.width_mm / (self.heights_mm.shape[1] - 1),
            self.height_mm / (self.heights_mm.shape[0] - 1),
        )
        at = np.array([step, -step, 0.0, 0.0])
        _, slope_x, slope_y = self.departure(at, at[::-1])
        return (
            curvature + float(slope_x[0] - slope_x[1]) / (2.0 * step),
            float(slope_y[0] - slope_y[1]) / (2.0 * step),
            curvature + float(slope_y[3] - slope_y[2]) / (2.0 * step),
        )


def _weights(at: np.ndarray, count: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """First of four coefficients, their weights and the derivatives, for a place in samples."""
    inside = np.clip(at, 0.0, count - 1.0)
    first = np.minimum(np.floor(inside).astype(int), count - 2)
    t = inside - first
    u = 1.0 - t
    weights = np.stack(
        [u**3, 4.0 - 6.0 * t * t + 3.0 * t**3, 4.0 - 6.0 * u * u + 3.0 * u**3, t**3], axis=-1
    )
    slopes = np.stack([-u * u, t * (3.0 * t - 4.0), u * (4.0 - 3.0 * u), t * t], axis=-1)
    slopes = np.where((at == inside)[..., None], slopes, 0.0)
    return first, weights / 6.0, slopes / 2.0
