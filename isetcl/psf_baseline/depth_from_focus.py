"""Depth from focus: where in a stack of pictures local contrast is largest."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

_SECOND_DIFFERENCE = (-1.0, 2.0, -1.0)
_BLUR_POWER = 4.0 / 3.0
_LEAST_REACH = 2.0  # pixels; a narrower blur stays within the window
_LEAK = 1.2
_FLAT = 1e-4
"""Second differences that are less of the mean light are rounding and the last bits of codes."""


@dataclass(frozen=True, eq=False)
class FocusDepth:
    """What a focal stack tells of depth.

    Attributes
    ----------
    vergence_dpt : ndarray, (rows, columns)
        1/m; where nothing is known, that of the nearest pixel that is.
    confidence : ndarray, (rows, columns)
        One less the mean contrast of the stack over its largest: near 0 where focus changes
        nothing, at most 1 - 1/n of n pictures. 0 where there is no texture, or none that is
        stronger than the blur of its neighbours.
    is_known : ndarray of bool, (rows, columns)
        Whether the confidence is as high as was asked for.
    picture : ndarray, (rows, columns) or (rows, columns, 3)
        Linear light, every pixel from the picture that is focused nearest to its depth.
    """

    vergence_dpt: np.ndarray
    confidence: np.ndarray
    is_known: np.ndarray
    picture: np.ndarray

    def __repr__(self) -> str:
        rows, columns = self.is_known.shape
        return f"<FocusDepth of {columns} x {rows} pixels, {self.known_share:.0%} known>"

    @property
    def known_share(self) -> float:
        """Share of the pixels whose depth is known."""
        return float(np.mean(self.is_known))


def depth_from_focus(
    picture: Callable[[int], np.ndarray],
    focus_dpt: np.ndarray,
    resolution_dpt: float,
    window: int,
    least_confidence: float,
) -> FocusDepth:
    """Depth and the picture in focus everywhere.

    Contrast is the modified Laplacian |d2/dx2| + |d2/dy2|, averaged over a window (Nayar and
    Nakagawa 1994, IEEE PAMI 16:824). A disc of radius r leaves |2 J1(x) / x|, x = 2 pi f r, of a
    grating, on average like x^(-3/2); so contrast at the finest details goes like the defocus to
    the power -3/2, and contrast to the power -4/3 is a parabola in dioptres. It is laid through the
    largest contrast and its neighbours. Where the largest is the first or the last, that is the
    answer.

    Parameters
    ----------
    picture
        Linear light of picture k, (rows, columns) or (rows, columns, 3).
    focus_dpt
        In focus, rising or falling, 1/m.
    resolution_dpt
        Change of vergence that widens the blur by a pixel.
    window
        Pixels a side.
    least_confidence
        Below it depth counts as unknown.
    """
    contrast, floor = _contrasts(picture, len(focus_dpt), window)
    best = np.argmax(contrast, axis=0)
    peak = np.take_along_axis(contrast, best[None], axis=0)[0]
    has_texture = peak > floor
    confidence = np.where(
        has_texture, 1.0 - contrast.mean(axis=0) / np.where(has_texture, peak, 1.0), 0.0
    )
    confidence[_drowned(contrast, best, peak, focus_dpt, resolution_dpt, window)] = 0.0
    is_known = has_texture & (confidence >= least_confidence)
    vergence = _filled(_peak_dpt(contrast, best, focus_dpt), is_known)
    nearest = np.abs(vergence[None] - focus_dpt[:, None, None]).argmin(axis=0)
    sharp = picture(0).copy()
    for k in range(1, len(focus_dpt)):
        sharp[nearest == k] = picture(k)[nearest == k]
    return FocusDepth(vergence, confidence, is_known, sharp)


def _contrasts(
    picture: Callable[[int], np.ndarray], count: int, window: int
) -> tuple[np.ndarray, float]:
    """Contrast of every picture, (n, rows, columns), in units of its mean; what is none."""
    from scipy.ndimage import correlate1d, uniform_filter

    contrasts = []
    for k in range(count):
        light = np.asarray(picture(k), np.float64)
        grey = light.mean(axis=2) if light.ndim == 3 else light
        # Exposures that differ a little must not count as contrast.
        grey = grey / grey.mean()
        bent = sum(np.abs(correlate1d(grey, _SECOND_DIFFERENCE, axis)) for axis in (0, 1))
        contrasts.append(uniform_filter(np.asarray(bent), window).astype(np.float32))
    return np.stack(contrasts), _FLAT


def _drowned(
    contrast: np.ndarray,
    best: np.ndarray,
    peak: np.ndarray,
    focus_dpt: np.ndarray,
    resolution_dpt: float,
    window: int,
) -> np.ndarray:
    """Whether the largest contrast may be that of a neighbour whose blur reaches a pixel.

    An even area beside a texture shows contrast where the texture is most out of focus. It counts
    as such if the blurred texture shows as much at its own place, in the same picture.
    """
    from scipy.ndimage import maximum_filter

    drowned = np.zeros(best.shape, dtype=bool)
    for k in np.unique(best):
        here = best == k
        for j in np.unique(best):
            reach = abs(focus_dpt[j] - focus_dpt[k]) / resolution_dpt / 2.0
            # Surfaces that lie between two pictures in depth are at home in both.
            if abs(j - k) < 2 or reach < _LEAST_REACH:
                continue
            size = 2 * math.ceil(reach + window / 2.0) + 1
            size = min(size, 2 * max(best.shape) + 1)
            blurred = np.where(best == j, contrast[k], 0.0)
            drowned |= here & (peak < _LEAK * maximum_filter(blurred, size, mode="nearest"))
    return drowned


def _peak_dpt(contrast: np.ndarray, best: np.ndarray, focus_dpt: np.ndarray) -> np.ndarray:
    """Vergence of the peak through three values, 1/m, (rows, columns)."""
    last = len(focus_dpt) - 1
    middle = np.clip(best, 1, last - 1)
    # So that the largest contrast is the top of a parabola.
    below, at, above = (
        -(np.maximum(contrast_of, _FLAT).astype(np.float64) ** -_BLUR_POWER)
        for contrast_of in (
            np.take_along_axis(contrast, (middle + k)[None], axis=0)[0] for k in (-1, 0, 1)
        )
    )
    before, after = (
        focus_dpt[middle] - focus_dpt[middle - 1],
        focus_dpt[middle + 1] - focus_dpt[middle],
    )
    rise, fall = (at - below) / before, (above - at) / after
    bend = rise - fall
    # Of the parabola through three points: slope at the middle over its change.
    slope = (rise * after + fall * before) / (before + after)
    shift = slope * (before + after) / 2.0 / np.where(bend != 0, bend, np.inf)
    low, high = np.minimum(-before / 2.0, after / 2.0), np.maximum(-before / 2.0, after / 2.0)
    found = focus_dpt[middle] + np.clip(shift, low, high)
    is_end = (best == 0) | (best == last)
    return np.where(is_end, focus_dpt[best], found)


def _filled(vergence_dpt: np.ndarray, is_known: np.ndarray) -> np.ndarray:
    """Unknown values replaced by those of the nearest known pixel."""
    if not is_known.any():
        return vergence_dpt
    from scipy.ndimage import distance_transform_edt

    row, column = distance_transform_edt(~is_known, return_distances=False, return_indices=True)
    return np.asarray(vergence_dpt[row, column])
