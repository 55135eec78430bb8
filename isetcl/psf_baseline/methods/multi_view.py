"""M10: sharp views from points of the pupil, moved as each layer is defocused, and averaged."""

from __future__ import annotations

import math

import numpy as np

from isetcl.psf_baseline.methods.blur import Blur
from isetcl.psf_baseline.view import Layer


def aperture_samples(blur: Blur, n_layers: int) -> np.ndarray:
    """M10: the mean of layered views from points of the pupil.

    L(u) = sum_p w_p sum_k m_k f_k(u - o_k(p)) prod_{j nearer} [1 - m_j(u - o_j(p))], o_k(p) where
    the ray through p from an object at layer k lands. Light-field and multi-view depth of field
    (accumulation buffer, Haeberli and Akeley 1990). Exact at small angles as samples grow if the
    layers are complete. Known failure: with few samples a blurred edge is a staircase of copies;
    the PSF is that of rays, whatever PSF the other methods use. An even scene stays even; hidden
    light is lost, as it should be. Memory does not grow with the samples.

    Parameters
    ----------
    blur
        Complete layers, far to near, with pupil shifts. Of several rays in a sample the middle one
        is taken.
    n_layers
        Number of layers.

    Returns
    -------
    ndarray, (basis, rows, columns)
    """
    columns, rows, weights = blur.pupil_shifts()
    columns, rows, weights = columns.mean(axis=-1), rows.mean(axis=-1), weights.sum(axis=-1)
    # Nothing stands before the nearest layer: all its views are added at once.
    nearest = n_layers - 1
    all_views = blur.points_transfer(columns[nearest], rows[nearest], weights)
    image = blur.image(all_views * blur.layer_spectrum(nearest))
    if n_layers == 1:
        return image
    sheets = [
        _Sheet(layer, is_seen=k < nearest, hides=k > 0)
        for k, layer in enumerate(blur.layers[:n_layers])
    ]
    light = np.empty_like(blur.layers[0].coverage)
    for p, weight in enumerate(weights):
        light.fill(weight)
        for k in range(nearest, -1, -1):
            sheets[k].add(image, light, float(columns[k, p]), float(rows[k, p]))
    return image


class _Sheet:
    """The covered part of a layer with room around it, so that moving it is slicing.

    Of the nearest layer only what it hides is wanted, of the farthest only what is seen.
    """

    def __init__(self, layer: Layer, *, is_seen: bool, hides: bool) -> None:
        self._channels = len(layer.colour) if is_seen else 0
        self._hides = hides
        covered_rows = np.flatnonzero(layer.coverage.any(axis=1))
        covered_columns = np.flatnonzero(layer.coverage.any(axis=0))
        if len(covered_rows) == 0:
            self._first = self._last = (0, 0)
            return
        self._first = int(covered_rows[0]), int(covered_columns[0])
        self._last = int(covered_rows[-1]) + 1, int(covered_columns[-1]) + 1
        y, x = (slice(a, b) for a, b in zip(self._first, self._last, strict=True))
        wanted = [layer.colour[:, y, x]] if is_seen else []
        planes = np.concatenate([*wanted, layer.coverage[None, y, x]] if hides else wanted)
        # Empty samples all around, which a shift by a fraction spreads into.
        self._planes = np.pad(planes, ((0, 0), (2, 2), (2, 2)))

    def add(self, image: np.ndarray, light: np.ndarray, column: float, row: float) -> None:
        """Add this sheet, moved, to the image, and take from the light what it hides."""
        if self._first == self._last:
            return
        target, source = [], []
        whole = math.floor(row), math.floor(column)
        for axis in (0, 1):
            # The moved sheet covers first + whole to last + whole + 1, both ends by interpolation.
            start, stop = self._first[axis] + whole[axis], self._last[axis] + whole[axis] + 1
            inside = max(0, start), min(light.shape[axis], stop)
            if inside[0] >= inside[1]:
                return
            target.append(slice(*inside))
            source.append(slice(inside[0] - start, inside[1] - start))
        moved = self._moved(source, row - whole[0], column - whole[1])
        part = light[target[0], target[1]]
        if self._channels > 0:
            image[:, target[0], target[1]] += part * moved[: self._channels]
        if self._hides:
            part *= 1.0 - moved[-1]

    def _moved(self, part: list[slice], row: float, column: float) -> np.ndarray:
        """Between neighbours: sample i of the part is (1 - f) a[i] + f a[i - 1]."""
        y, x = (slice(s.start + 1, s.stop + 2) for s in part)
        block = self._planes[:, y, x]
        block = np.float32(column) * block[..., :-1] + np.float32(1.0 - column) * block[..., 1:]
        return np.float32(row) * block[:, :-1] + np.float32(1.0 - row) * block[:, 1:]
