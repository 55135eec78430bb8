"""The far field of a round hole, in closed form, and its inverse.

v = pi D sin(theta) / lambda, with the diameter D of the hole and lambda in its medium. The share
of the light beyond v is J0^2(v) + J1^2(v). An elliptical hole has the same pattern with v made of
its two diameters: the Fourier transform of a stretched disc is that of the disc, compressed.
"""

from __future__ import annotations

import functools
import math

import numpy as np

from isetcl.errors import InvalidInputError, check_array

FIRST_ZERO = 3.8317059702075125
"""v of the first dark ring: 1.21967 lambda / D."""

TABLE_SIZE = 8192
"""Nodes of `airy_table`."""

_LAST_RINGS_V = 157.0
_HALVINGS = 60


def share_beyond(v: np.ndarray | float) -> np.ndarray:
    """Share of the light that falls beyond v: 1 minus the encircled energy; any shape.

    Source: Rayleigh 1881; Born & Wolf, Principles of Optics, 8.5.2.
    """
    from scipy.special import j0, j1

    x = check_array("v", v)
    return np.asarray(j0(x) ** 2 + j1(x) ** 2)


def circle_otf(share_of_cutoff: np.ndarray | float) -> np.ndarray:
    """OTF of a round hole without aberrations at s = frequency lambda / D; 0 from s = 1 on.

    2/pi (acos s - s sqrt(1 - s^2)).  Source: Goodman, Introduction to Fourier Optics, 6.3.
    """
    s = np.minimum(np.abs(check_array("share_of_cutoff", share_of_cutoff)), 1.0)
    return np.asarray(2.0 / math.pi * (np.arccos(s) - s * np.sqrt(1.0 - s * s)))


def radius_of_share(beyond: np.ndarray | float) -> np.ndarray:
    """The v beyond which a share of the light falls, the inverse of `share_beyond`; any shape.

    Exact within the first 50 rings; farther out the share is 2 / (pi v), the mean over a ring.

    Parameters
    ----------
    beyond
        Shares, 0 < share <= 1.
    """
    t = check_array("beyond", beyond)
    if not np.all((t > 0.0) & (t <= 1.0)):
        raise InvalidInputError("beyond must be shares above 0 and up to 1")
    join = _join()
    low, high = np.zeros(t.shape), np.full(t.shape, join)
    # Halving is slow and cannot go wrong where the pattern is dark and the slope vanishes.
    for _ in range(_HALVINGS):
        middle = 0.5 * (low + high)
        above = share_beyond(middle) > t
        low, high = np.where(above, middle, low), np.where(above, high, middle)
    inner = 0.5 * (low + high)
    return np.asarray(np.where(t < 2.0 / (math.pi * join), 2.0 / (math.pi * t), inner))


@functools.cache
def _join() -> float:
    """A v near the 50th ring where 2 / (pi v) is the share beyond it exactly."""
    from scipy.optimize import brentq

    def excess(v: float) -> float:
        return float(share_beyond(v)) * v - 2.0 / math.pi

    return float(brentq(excess, _LAST_RINGS_V, _LAST_RINGS_V + 1.5, xtol=1e-13))


@functools.cache
def airy_table() -> tuple[float, np.ndarray]:
    """Steps a unit and v at even steps of x = sqrt((1 - t) / t), t the share beyond v.

    In x the pattern's centre (v = 2 x) and its tail (v = 2 / (pi t), about 0.64 x^2) are both
    smooth; the cells are finest where most of the light is. The last node is where the rings end
    and the mean tail begins.

    Returns
    -------
    (float, ndarray (TABLE_SIZE,))
    """
    last = math.sqrt(math.pi * _join() / 2.0 - 1.0)
    x = np.linspace(0.0, last, TABLE_SIZE)
    v = radius_of_share(1.0 / (1.0 + x * x))
    v[0] = 0.0
    v[-1] = _join()
    return (TABLE_SIZE - 1) / last, v
