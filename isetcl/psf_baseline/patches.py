"""Parts of an image that are made one by one: each with the PSFs of its own field position.

A patch belongs to a node of a lattice over the image; patches overlap, and are blended by hats
that are 1 at their own node and 0 at its neighbours. At every pixel the weights sum to 1, so that
an even scene stays even, and PSFs are interpolated linearly between nodes. Tiles do not overlap;
they only bound the memory.
"""

from __future__ import annotations

import itertools
from dataclasses import dataclass

import numpy as np

from isetcl.retina.grid import RetinalGrid


@dataclass(frozen=True, eq=False)
class Patch:
    """A rectangle of pixels.

    Attributes
    ----------
    rows, columns : slice
        Its place in the image.
    weight : ndarray, (rows, columns)
        Its share in the image.
    field_deg
        Field angles (x, y) whose PSFs it has.
    """

    rows: slice
    columns: slice
    weight: np.ndarray
    field_deg: tuple[float, float]

    def grid(self, whole: RetinalGrid) -> RetinalGrid:
        """Its pixels."""
        if (self.columns.stop - self.columns.start, self.rows.stop - self.rows.start) == (
            whole.resolution
        ):
            return whole
        width, height = whole.pitch_deg
        columns, rows = (s.stop - s.start for s in (self.columns, self.rows))
        x = whole.left_deg + (self.columns.start + columns / 2.0) * width
        y = whole.top_deg - (self.rows.start + rows / 2.0) * height
        return RetinalGrid(
            whole.eye,
            (columns * width, rows * height),
            (columns, rows),
            (x, y),
            whole.wavelength_nm,
        )


def field_patches(grid: RetinalGrid, count: int) -> list[Patch]:
    """Patches of `count` nodes across each side of the image, the outer ones on its borders.

    With one node, that is the middle.
    """
    columns, rows = grid.resolution
    x = [(s, w, grid.left_deg + t * grid.fov_deg[0]) for s, w, t in _hats(columns, count)]
    y = [(s, w, grid.top_deg - t * grid.fov_deg[1]) for s, w, t in _hats(rows, count)]
    return [
        Patch(row, column, np.outer(wy, wx), (fx, fy))
        for (row, wy, fy), (column, wx, fx) in itertools.product(y, x)
    ]


def tiles(grid: RetinalGrid, count: int) -> list[Patch]:
    """`count` parts across each side of the image, all with the PSFs of its middle."""
    columns, rows = (np.linspace(0, n, min(count, n) + 1).astype(int) for n in grid.resolution)
    return [
        Patch(
            slice(int(top), int(low)),
            slice(int(left), int(right)),
            np.ones((low - top, right - left)),
            grid.centre_deg,
        )
        for (top, low), (left, right) in itertools.product(
            itertools.pairwise(rows), itertools.pairwise(columns)
        )
    ]


def _hats(pixels: int, count: int) -> list[tuple[slice, np.ndarray, float]]:
    """Pixels, weights and place (0 to 1 across the image) of every node's hat."""
    if count == 1 or pixels == 1:
        return [(slice(0, pixels), np.ones(pixels), 0.5)]
    at = (np.arange(pixels) + 0.5) / pixels * (count - 1)
    result = []
    for node in range(count):
        weight = np.clip(1.0 - np.abs(at - node), 0.0, 1.0)
        used = np.flatnonzero(weight)
        if len(used):
            part = slice(int(used[0]), int(used[-1]) + 1)
            result.append((part, weight[part], node / (count - 1)))
    return result
