"""Light that an edge spreads beyond the region: how it falls off, and what it adds to the transfer.

The rim of a pupil, of any shape and with any aberrations, bends light so far that the line spread
function falls as A / x^2, and the edge spread function reaches its two levels as A / x. For a round
pupil with cut-off f_c, A = 2 / (pi^3 f_c), from its transfer 1 - 4 f / (pi f_c) + O(f^3). The two
levels and A are fitted to the outer part of the region; what the window and the border of the
region take from A / x^2 is put back. All of it is linear in the pixels, so that noise does not bias
it, and goes into the standard error.
"""

from __future__ import annotations

import math
import warnings
from dataclasses import dataclass

import numpy as np

_OUTER_ROOTS = 2.4
_LEAST_START = 0.4
_LAST_START = 0.75
_CORE_BLURS = 2.5
_END = 0.98
_PER_PIXEL = 16
_CUBIC = 3
_LARGEST_SHARE = 0.035
_LARGEST_CHANGE = 0.005
_SURE = 4.0


def window(place: np.ndarray, flat: float, reach: float) -> np.ndarray:
    """1 up to the distance `flat`, then a fall to 0 at `reach` as a cosine; distances in pixels."""
    outer = np.clip((np.abs(place) - flat) / (reach - flat), 0.0, 1.0)
    return np.asarray(0.5 + 0.5 * np.cos(np.pi * outer))


def outer_start(reach: float, blur: float) -> float:
    """Where the outer part of a region that reaches `reach` pixels from the edge begins, pixels.

    It is 2.4 sqrt(reach) wide, so that A raises the standard error of the transfer of a sharp edge
    by about a tenth whatever the size of the image. It begins no nearer than the core of the blur
    reaches, 2.5 times the distance `blur` at which 95 % of the light are passed (4.1 standard
    deviations of a Gaussian), but a quarter of the region is always taken.
    """
    wide = max(_LEAST_START * reach, reach - _OUTER_ROOTS * math.sqrt(reach))
    return max(wide, min(_CORE_BLURS * blur, _LAST_START * reach))


def outer_parts(reach: float, start: float) -> tuple[tuple[float, float], ...]:
    """Start and end of the outer part of a region, of its inner half and of its outer half."""
    end = _END * reach
    middle = (start + end) / 2.0
    return (start, end), (start, middle), (middle, end)


def outer_map(knots: np.ndarray, start: float, end: float) -> np.ndarray:
    """What turns coefficients of a cubic spline (m,) into left level, right level and A, (3, m).

    By least squares over distances from `start` to `end` on both sides, where the spline is
    level -+ A / |x|.
    """
    from scipy.interpolate import BSpline

    count = max(8, round((end - start) * _PER_PIXEL))
    away = start + (np.arange(count) + 0.5) * (end - start) / count
    one, none = np.ones(count), np.zeros(count)
    left = np.stack([one, none, 1.0 / away], axis=1)
    right = np.stack([none, one, -1.0 / away], axis=1)
    places = np.concatenate([-away, away])
    values = BSpline.design_matrix(places, knots, _CUBIC)
    return np.asarray((values.T @ np.linalg.pinv(np.concatenate([left, right])).T).T)


def beyond(frequency: np.ndarray, flat: float, reach: float) -> np.ndarray:
    """Transform of the part of 1 / x^2 that the window leaves out, up to infinity, (k,).

    Integral of (1 - window) 2 cos(2 pi f x) / x^2 from `flat` to `reach`, and of 2 cos(2 pi f x) /
    x^2 from there on.
    """
    from scipy.special import sici

    steps = math.ceil((reach - flat) * _PER_PIXEL)
    x = flat + (np.arange(steps) + 0.5) * (reach - flat) / steps
    left_out = (1.0 - window(x, flat, reach)) / x**2 * (reach - flat) / steps
    wave = 2.0 * np.pi * np.asarray(frequency)
    # cos(k x) / x^2 integrates to cos(k r) / r - k (pi / 2 - Si(k r)).
    rest = np.cos(wave * reach) / reach - wave * (np.pi / 2.0 - sici(wave * reach)[0])
    return np.asarray(2.0 * (np.cos(np.outer(wave, x)) @ left_out + rest))


@dataclass(frozen=True)
class Beyond:
    """Light beyond the region, relative to the step of the edge.

    Attributes
    ----------
    share, standard_error
        2 A / reach, the light farther from the edge than the region reaches.
    change, change_error
        The same from the inner half of the outer part, less that from its outer half: 0 for light
        that falls as 1 / x^2.
    """

    share: float
    standard_error: float
    change: float
    change_error: float

    def warn(self, width_px: float, name: str, stacklevel: int) -> None:
        """Warn if the transfer may be off by more than 0.005, with the width that is needed."""
        is_much = self.share > max(_LARGEST_SHARE, _SURE * self.standard_error)
        is_other = abs(self.change) > max(_LARGEST_CHANGE, _SURE * self.change_error)
        if not is_much and not is_other:
            return
        needed = max(2.0 if is_other else 1.0, self.share / _LARGEST_SHARE)
        reasons = []
        if is_much:
            reasons.append(f"is as much as {100.0 * self.share:.2g} %")
        if is_other:
            reasons.append(
                "does not fall as 1 / x^2 there (the core of the blur, or uneven light of the "
                "sides, reaches the border)"
            )
        warnings.warn(
            f"light that the edge spreads beyond the {2.0 * width_px:.0f} pixels across it in "
            f"{name} {' and '.join(reasons)}; the transfer may be wrong by more than 0.005: show "
            f"about {math.ceil(2.0 * width_px * needed)} pixels across the edge, evenly lit on "
            "both sides",
            stacklevel=stacklevel,
        )
