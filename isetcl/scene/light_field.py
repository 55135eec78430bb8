"""Light fields: surfaces whose pixels send different light into different directions."""

from __future__ import annotations

import hashlib
import math
from dataclasses import dataclass

import numpy as np

from isetcl.errors import InvalidInputError, check_array, check_between, check_pair, check_type


@dataclass(frozen=True, eq=False)
class LightField:
    """A light-field display: an array of pixels, each with a fan of views.

    A direction is given by its slopes in the frame of the surface: how far a ray that leaves the
    front goes along u (right), and along v (up), for each metre along the normal. The views divide
    the range of slopes evenly, as pixels behind a lenslet do, and each stands for the middle of its
    part; between middles they are interpolated, beyond the outermost ones they are held, and
    outside the full angle the surface is dark. Pixels are boxes.

    Parameters
    ----------
    texels
        Weights >= 0, linear light: (rows, columns, views_y, views_x), or with channels behind. Row
        0 is the top of the surface; view row 0 goes upwards (towards +v), view column 0 towards -u.
    angle_deg
        Full angles over which the views of a pixel spread, horizontal and vertical.
    name
        For messages and provenance.

    Raises
    ------
    InvalidInputError
        If the texels are of another shape, negative or not finite, or an angle breaks its rule.
    """

    texels: np.ndarray
    angle_deg: tuple[float, float]
    name: str = "light field"

    def __post_init__(self) -> None:
        check_type("light field: name", self.name, str)
        texels = check_array(f"light field {self.name!r}", self.texels).astype(np.float32)
        if texels.ndim == 5 and texels.shape[4] == 1:
            texels = texels[..., 0]
        if texels.ndim not in (4, 5) or texels.size == 0:
            raise InvalidInputError(
                f"light field {self.name!r} must have shape (rows, columns, views_y, views_x) or "
                f"(..., channels), got {texels.shape}"
            )
        if not np.all(np.isfinite(texels)) or np.any(texels < 0):
            raise InvalidInputError(
                f"light field {self.name!r} must be finite and >= 0 (linear light)"
            )
        angles = check_pair(f"light field {self.name!r}: angle_deg", self.angle_deg, "deg")
        for angle in angles:
            check_between(f"light field {self.name!r}: angle_deg", angle, 1e-3, 179.0, "deg")
        object.__setattr__(self, "texels", texels)
        object.__setattr__(self, "angle_deg", angles)

    @property
    def channels(self) -> int:
        """1 for grey, 3 for colour."""
        return 1 if self.texels.ndim == 4 else int(self.texels.shape[4])

    @property
    def shape(self) -> tuple[int, int]:
        """Rows and columns of pixels."""
        return int(self.texels.shape[0]), int(self.texels.shape[1])

    @property
    def views(self) -> tuple[int, int]:
        """Views up and across (rows, columns)."""
        return int(self.texels.shape[2]), int(self.texels.shape[3])

    @property
    def slopes(self) -> tuple[float, float]:
        """Slopes of the outermost light: tangents of half the angles (horizontal, vertical)."""
        horizontal, vertical = (math.tan(math.radians(angle) / 2.0) for angle in self.angle_deg)
        return horizontal, vertical

    @property
    def largest(self) -> float:
        """The largest weight."""
        return float(self.texels.max())

    @property
    def mean(self) -> float:
        """The mean weight, for estimates."""
        return float(self.texels.mean())

    def weights(
        self,
        u: np.ndarray,
        v: np.ndarray,
        direction_x: np.ndarray | float = 0.0,
        direction_y: np.ndarray | float = 0.0,
    ) -> np.ndarray:
        """Weights at texture coordinates into directions, shape (..., channels).

        Parameters
        ----------
        u, v
            Texture coordinates; outside 0 to 1 the outermost pixels count.
        direction_x, direction_y
            Slopes along u and v of the light that leaves; straight ahead without any.
        """
        rows, columns = self.shape
        up, across = self.views
        u, v, x, y = np.broadcast_arrays(u, v, direction_x, direction_y)
        column = np.clip(np.floor(u * columns), 0, columns - 1).astype(int)
        row = np.clip(np.floor((1.0 - v) * rows), 0, rows - 1).astype(int)
        limit_x, limit_y = self.slopes
        a = np.clip((x / limit_x + 1.0) / 2.0 * across - 0.5, 0.0, across - 1.0)
        b = np.clip((1.0 - y / limit_y) / 2.0 * up - 0.5, 0.0, up - 1.0)
        left, top = np.floor(a).astype(int), np.floor(b).astype(int)
        right, low = np.minimum(left + 1, across - 1), np.minimum(top + 1, up - 1)
        fx, fy = (a - left)[..., None], (b - top)[..., None]
        t = self.texels.reshape(rows, columns, up, across, self.channels)
        upper = t[row, column, top, left] * (1 - fx) + t[row, column, top, right] * fx
        lower = t[row, column, low, left] * (1 - fx) + t[row, column, low, right] * fx
        seen = (np.abs(x) <= limit_x) & (np.abs(y) <= limit_y)
        return np.where(seen[..., None], upper * (1 - fy) + lower * fy, 0.0)

    def digest(self) -> str:
        """A hash of the texels and angles, for provenance."""
        data = np.ascontiguousarray(self.texels).tobytes()
        place = f"{self.texels.shape} {self.angle_deg}"
        return hashlib.sha256(data + place.encode()).hexdigest()[:16]
