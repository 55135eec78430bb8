"""Photographs in perspective: which pixel of one a field angle falls on."""

from __future__ import annotations

import functools
import math
from dataclasses import dataclass
from typing import TYPE_CHECKING, Literal

import numpy as np

from isetcl.errors import InvalidInputError
from isetcl.eye.field import direction_from_field
from isetcl.psf_baseline.borders import Border, pixel_index

if TYPE_CHECKING:
    from scipy.sparse import csr_array

Projection = Literal["perspective", "angular"]

_BORDER_POINTS = 65
_HALVINGS = 50
_ENTRIES_AT_ONCE = 1 << 22
_LEAST_FORWARD = 1e-6
LARGEST_FOV_DEG = 179.0


@dataclass(frozen=True)
class Camera:
    """A pinhole camera: pixels are equal steps of the tangent of the angle from its axis.

    It stands upright at the eye, its axis through the middle of the picture.

    Parameters
    ----------
    fov_deg
        Angles between the middles of opposite borders of the picture: width and height.
    centre_deg
        Field angles (x, y) that its axis points to.
    shape
        Rows and columns.

    Raises
    ------
    InvalidInputError
        If the field is 180 degrees or the camera points straight up or backwards.
    """

    fov_deg: tuple[float, float]
    centre_deg: tuple[float, float]
    shape: tuple[int, int]

    def __post_init__(self) -> None:
        if max(self.fov_deg) > LARGEST_FOV_DEG:
            raise InvalidInputError(
                f"fov_deg of a picture in perspective must be at most {LARGEST_FOV_DEG:g}, got "
                f'{self.fov_deg}; use projection="angular" for wider ones'
            )
        if math.hypot(*self.centre_deg) >= 90.0:
            raise InvalidInputError(
                f"centre_deg must lie within 90 deg of the axis, got {self.centre_deg}"
            )

    @functools.cached_property
    def axes(self) -> np.ndarray:
        """Unit vectors to the right, up and forward in the frame of the eye, (3, 3)."""
        forward = direction_from_field(*(np.array(angle) for angle in self.centre_deg))
        right = np.cross(forward, [0.0, 1.0, 0.0])
        right /= np.linalg.norm(right)
        return np.stack([right, np.cross(right, forward), forward])

    @property
    def half_tangents(self) -> tuple[float, float]:
        """Tangents of half the width and half the height of the field."""
        width, height = self.fov_deg
        return math.tan(math.radians(width / 2.0)), math.tan(math.radians(height / 2.0))

    def directions(self) -> np.ndarray:
        """Unit vectors towards the scene of the pixels' middles, (rows, columns, 3)."""
        rows, columns = self.shape
        wide, high = self.half_tangents
        x = ((np.arange(columns) + 0.5) / columns * 2.0 - 1.0) * wide
        y = (1.0 - (np.arange(rows) + 0.5) / rows * 2.0) * high
        own = np.stack([*np.meshgrid(x, y), np.ones(self.shape)], axis=-1)
        seen = own @ self.axes
        return seen / np.linalg.norm(seen, axis=-1, keepdims=True)

    def places(self, x_deg: np.ndarray, y_deg: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Columns and rows of field angles, in pixels from the upper left corner."""
        rows, columns = self.shape
        wide, high = self.half_tangents
        right, up, forward = np.moveaxis(direction_from_field(x_deg, y_deg) @ self.axes.T, -1, 0)
        # What lies behind the camera falls far outside the picture.
        forward = np.maximum(forward, _LEAST_FORWARD)
        return (
            (right / forward / wide + 1.0) * columns / 2.0,
            (1.0 - up / forward / high) * rows / 2.0,
        )

    def inner_fov_deg(self) -> tuple[float, float]:
        """Size of the largest image of field angles about the middle that the picture fills.

        As wide for its height as the picture in tangents.
        """
        wide, high = self.half_tangents
        side = np.linspace(-1.0, 1.0, _BORDER_POINTS)
        one = np.ones_like(side)
        x = np.concatenate([side, side, one, -one])
        y = np.concatenate([one, -one, side, side]) * high / wide
        low, most = 0.0, self.fov_deg[0] / 2.0
        for _ in range(_HALVINGS):
            middle = (low + most) / 2.0
            column, row = self.places(
                self.centre_deg[0] + middle * x, self.centre_deg[1] + middle * y
            )
            inside = (column >= 0) & (column <= self.shape[1]) & (row >= 0) & (row <= self.shape[0])
            low, most = (middle, most) if inside.all() else (low, middle)
        return 2.0 * low, 2.0 * low * high / wide

    def farthest_from_even(self) -> float:
        """Largest distance, in pixels, between its pixels and those of even field angles."""
        rows, columns = self.shape
        width, height = self.fov_deg
        side = np.linspace(-0.5, 0.5, _BORDER_POINTS)
        x, y = (axis.ravel() for axis in np.meshgrid(side, side))
        column, row = self.places(self.centre_deg[0] + x * width, self.centre_deg[1] + y * height)
        away = np.hypot(column - (x + 0.5) * columns, row - (0.5 - y) * rows)
        return float(away.max())

    def shares(
        self,
        left_deg: np.ndarray,
        top_deg: np.ndarray,
        pitch_deg: tuple[float, float],
        border: Border,
    ) -> csr_array:
        """Share of each pixel in each sample of even field angles, (samples, pixels), sparse.

        What a sample covers of the picture is taken as an upright box through the middles of its
        four sides. Its slant is left out: at most 4 % of its width at 20 degrees from the middle
        and 9 % at 30, on the diagonals.

        Parameters
        ----------
        left_deg, top_deg
            Field angles where the columns and rows of samples begin.
        pitch_deg
            Width and height of a sample.
        """
        from scipy.sparse import csr_array, vstack

        n_pixels = self.shape[0] * self.shape[1]
        each = (self.shape[1] / len(left_deg) + 2.0) * (self.shape[0] / len(top_deg) + 2.0)
        at_once = max(1, int(_ENTRIES_AT_ONCE / (len(left_deg) * each)))
        parts = []
        for start in range(0, len(top_deg), at_once):
            top = top_deg[start : start + at_once]
            across, down = self._boxes(left_deg, top, pitch_deg)
            share_x, column = _covered(*across, self.shape[1], border)
            share_y, row = _covered(*down, self.shape[0], border)
            share = share_y[:, :, None] * share_x[:, None, :]
            pixel = row[:, :, None] * self.shape[1] + column[:, None, :]
            sample = np.broadcast_to(np.arange(len(share))[:, None, None], share.shape)
            kept = share > 1e-9
            entries = (share[kept], (sample[kept], pixel[kept]))
            parts.append(csr_array(entries, shape=(len(share), n_pixels)))
        return csr_array(vstack(parts, format="csr"))

    def _boxes(
        self, left: np.ndarray, top: np.ndarray, pitch_deg: tuple[float, float]
    ) -> tuple[tuple[np.ndarray, np.ndarray], tuple[np.ndarray, np.ndarray]]:
        """Where what samples cover begins and ends, in columns and in rows, each (samples,)."""
        x, y = left + pitch_deg[0] / 2.0, (top - pitch_deg[1] / 2.0)[:, None]
        begin, end = (self.places(left + k * pitch_deg[0], y)[0].ravel() for k in (0, 1))
        above, below = (self.places(x, top[:, None] - k * pitch_deg[1])[1].ravel() for k in (0, 1))
        return (begin, end), (above, below)


def _covered(
    start: np.ndarray, end: np.ndarray, count: int, border: Border
) -> tuple[np.ndarray, np.ndarray]:
    """Shares of pixels in intervals, and the pixels' numbers, each (intervals, reach)."""
    start, end = np.round(start, 9), np.round(end, 9)
    # Far outside all is one pixel, or none; there what is covered means nothing any more.
    start = np.clip(start, -4.0 * count, 4.0 * count)
    width = np.clip(end - start, 1e-6, 2.0 * count)
    reach = int(np.ceil(width.max())) + 1
    pixel = np.floor(start)[:, None] + np.arange(reach)
    low = np.maximum(start[:, None], pixel)
    high = np.minimum((start + width)[:, None], pixel + 1.0)
    share = np.maximum(high - low, 0.0) / width[:, None]
    index, is_real = pixel_index(pixel + 0.5, count, border)
    return share * is_real, index
