"""Point spread functions integrated over the squares of a grid.

Every function returns shares of the flux, (n, n), n odd, with the middle of the pattern in the
middle of the middle square, so that a pattern narrower than a square keeps its energy.
"""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np

from isetcl.errors import InvalidInputError
from isetcl.psf_baseline.psf import MAX_KERNEL_PIXELS, Psf

OUTSIDE = 0.01
"""Share of the light that a kernel may leave out, where its reach allows it."""

_NODES = 32
_NEAR = 16


def disc_cells(half: int, radius: float) -> np.ndarray:
    """Shares of an even disc, exact; `radius` in samples."""
    corner = (np.arange(half + 1) + 0.5) / radius
    corner = np.concatenate([-corner[::-1], corner])
    area = _disc_below(corner[None, :], corner[:, None])
    return np.asarray(np.diff(np.diff(area, axis=0), axis=1) / math.pi).clip(0.0)


def _disc_below(x: np.ndarray, y: np.ndarray) -> np.ndarray:
    """Area of the unit disc to the left of x and below y."""

    def half_moon(u: np.ndarray) -> np.ndarray:
        """Integral of sqrt(1 - u^2) from -1."""
        return (u * np.sqrt(1.0 - u * u) + np.arcsin(u)) / 2.0 + math.pi / 4.0

    x, y = np.clip(x, -1.0, 1.0), np.clip(y, -1.0, 1.0)
    reach = np.sqrt(1.0 - y * y)
    inner = np.clip(x, -reach, reach)
    under_chord = half_moon(inner) - half_moon(-reach)
    area = y * (inner + reach) + under_chord
    return np.asarray(area + np.where(y > 0, 2.0 * (half_moon(x) - under_chord), 0.0))


def gaussian_cells(half: int, sigma: float) -> np.ndarray:
    """Shares of a round Gaussian, exact; the standard deviation in samples."""
    from scipy.special import ndtr

    edges = (np.arange(-half, half + 2) - 0.5) / sigma
    line = np.diff(ndtr(-np.abs(edges)) * -np.sign(edges) + (edges > 0))
    return np.outer(line, line)


def radial_cells(enclosed: Callable[[np.ndarray], np.ndarray], half: int) -> np.ndarray:
    """Shares of a round pattern, from the share `enclosed` within a radius in samples.

    The share in a rectangle from the middle to a corner is an integral over directions of what
    lies within the distance of its border, and squares are differences of those. Far out, where
    such differences are next to nothing, a square has the mean of the ring through it, and all of
    them together what the whole kernel has.
    """
    near = min(half, _NEAR)
    corner = np.concatenate([[0.0], np.arange(near + 1) + 0.5])
    quarter = np.diff(np.diff(_corner_shares(enclosed, corner), axis=0), axis=1)
    quarter[0] *= 2.0
    quarter[:, 0] *= 2.0
    shares = np.zeros((half + 1, half + 1))
    shares[: near + 1, : near + 1] = quarter
    if half > near:
        row, column = np.nonzero(np.maximum.outer(np.arange(half + 1), np.arange(half + 1)) > near)
        r = np.hypot(row, column)
        ring = np.maximum(enclosed(r + 0.5) - enclosed(r - 0.5), 0.0) / (2.0 * math.pi * r)
        # Squares on an axis are in two quarters of the kernel, others in four.
        times = np.where((row == 0) | (column == 0), 2.0, 4.0)
        whole = 4.0 * float(_corner_shares(enclosed, np.array([0.0, half + 0.5]))[1, 1])
        inner = 4.0 * float(_corner_shares(enclosed, np.array([0.0, near + 0.5]))[1, 1])
        total = float(ring @ times)
        shares[row, column] = ring * (max(0.0, whole - inner) / total if total > 0 else 0.0)
    right = np.concatenate([shares[:0:-1], shares])
    return np.concatenate([right[:, :0:-1], right], axis=1).clip(0.0)


def _corner_shares(enclosed: Callable[[np.ndarray], np.ndarray], corner: np.ndarray) -> np.ndarray:
    """Shares in the rectangles from the middle to (corner, corner), the first of which is 0.

    The direction is taken as t with tan = sinh t, in which the distance X cosh t of the border
    x = X is smooth; that of y = Y is the transpose.
    """
    nodes, weights = np.polynomial.legendre.leggauss(_NODES)
    wedge = np.zeros((len(corner), len(corner)))
    for i, y in enumerate(corner[1:], start=1):
        last = np.arcsinh(y / corner[1:])[:, None]
        stretch = np.cosh(last * (nodes + 1.0) / 2.0)
        inside = enclosed(corner[1:, None] * stretch) / stretch
        wedge[i, 1:] = inside @ weights * last[:, 0] / (4.0 * math.pi)
    return wedge + wedge.T


def radial_psf(
    enclosed: Callable[[np.ndarray], np.ndarray], pitch_deg: float, reach_deg: float
) -> Psf:
    """A round PSF as large as 99 % of its light or the reach, from its light within a radius, deg.

    The function must hold to 1.5 times the reach and a square.
    """
    radii = np.linspace(0.0, reach_deg, 4097)
    beyond = np.flatnonzero(enclosed(radii) < 1.0 - OUTSIDE)
    half = checked_half(float(radii[beyond[-1]] if len(beyond) else 0.0) / pitch_deg)
    return psf_of(radial_cells(lambda r: enclosed(r * pitch_deg), half), pitch_deg)


def checked_half(reach: float) -> int:
    """Samples from the middle to the border of a kernel that reaches so many samples.

    Raises
    ------
    InvalidInputError
        If the kernel is more than 4096 samples across.
    """
    half = max(0, math.ceil(reach - 0.5))
    if 2 * half + 1 > MAX_KERNEL_PIXELS:
        raise InvalidInputError(
            f"the blur reaches {2 * half + 1} samples across, more than {MAX_KERNEL_PIXELS}; use "
            "larger pixels, less reach, a smaller stop or objects nearer to focus"
        )
    return half


def psf_of(kernel: np.ndarray, pitch_deg: float) -> Psf:
    """A PSF whose light outside is what the kernel lacks of 1."""
    return Psf(kernel, pitch_deg, max(0.0, 1.0 - float(kernel.sum())))


def cropped(kernel: np.ndarray, reach: float) -> np.ndarray:
    """The smallest middle part that holds 99 % of the light, at most `reach` samples from it."""
    half = kernel.shape[0] // 2
    offset = np.abs(np.arange(-half, half + 1))
    ring = np.maximum(offset[:, None], offset[None, :])
    inside = np.cumsum(np.bincount(ring.ravel(), kernel.ravel(), minlength=half + 1))
    enough = np.flatnonzero(inside >= 1.0 - OUTSIDE)
    keep = min(int(enough[0]) if len(enough) else half, half, checked_half(reach))
    return kernel[half - keep : half + keep + 1, half - keep : half + keep + 1]


def binned(kernel: np.ndarray, factor: int) -> np.ndarray:
    """Sums over squares of `factor` samples (odd), the middle one about the middle."""
    half = kernel.shape[0] // 2
    bins = max(0, math.ceil((half - factor // 2) / factor))
    pad = bins * factor + factor // 2 - half
    padded = np.pad(kernel, pad)
    n = 2 * bins + 1
    return np.asarray(padded.reshape(n, factor, n, factor).sum(axis=(1, 3)))
