"""From the pixels beside an edge to its transfer function, as a linear map with its errors.

The edge spread function is a cubic spline with a knot every quarter of a pixel, fitted to the
pixels at their distances from the edge. Means over bins of a quarter pixel, the customary choice,
lose sinc(f/4) by averaging and sinc(f/2) by the three-point derivative, and are off by up to 0.03
where the pixels' distances repeat (slopes near 1/4 or 1/2), because they then do not fill the bins
evenly. The spline is differentiated as it is and takes every distance for what it is: below the
Nyquist frequency of the pixels it loses less than 1e-6 (the projection on cubic splines of knot
distance h passes sinc^8(f h) / sum_k sinc^8(f h + k)).
"""

from __future__ import annotations

import dataclasses
import math
from dataclasses import dataclass
from typing import Any

import numpy as np

from isetcl.errors import InvalidInputError
from isetcl.validation.transfer import tail
from isetcl.validation.transfer.edge_line import EdgeLine

OVERSAMPLING = (4, 3, 2)
"""Knots per pixel: the first for which every interval between knots holds a pixel."""

_FLAT_SHARE = 0.5
_FINE = 4
_LINE_ROUNDS = 6
_SETTLED_PX = 1e-5
_LEVEL_ROUNDS = 3
_SIDE = (0.55, 0.98)
_CORE = 0.9
_PER_PIXEL = 16
_BAND = 3
_PENALTY = 1e-6


@dataclass(frozen=True, eq=False)
class EdgeFit:
    """A spline through the pixels beside an edge; n pixels, m coefficients.

    Attributes
    ----------
    line
        The line from which distances are taken.
    pixels : tuple of ndarray, (n,)
        Rows and columns of the pixels used, in the turned image.
    distance : ndarray, (n,)
        Their distances, pixels.
    knots_per_pixel
        4, or less where an interval would be empty.
    basis : sparse array, (n, m)
        Cubic B-splines at the distances.
    knots : ndarray
        Knots of the spline, pixels.
    factor : ndarray, (4, m)
        Cholesky factor of B^T B (nearly; see `_factor`), in bands.
    outer_start
        Distance from which on the edge spread function is taken to approach its levels as 1 / x,
        pixels; see `isetcl.validation.transfer.tail`.
    """

    line: EdgeLine
    pixels: tuple[np.ndarray, np.ndarray]
    distance: np.ndarray
    knots_per_pixel: int
    basis: Any
    knots: np.ndarray
    factor: np.ndarray
    outer_start: float

    @property
    def reach(self) -> float:
        """Largest distance, pixels."""
        return float(self.knots[-1 - _BAND])

    def solve(self, right: np.ndarray) -> np.ndarray:
        """(B^T B)^-1 times vectors (m, k)."""
        from scipy.linalg import cho_solve_banded

        return np.asarray(cho_solve_banded((self.factor, False), right))

    def spline(self, values: np.ndarray) -> Any:
        """The edge spread function of pixel values (n,) as a scipy spline of the distance."""
        from scipy.interpolate import BSpline

        return BSpline(self.knots, self.solve(self.basis.T @ values), _BAND)

    def sides(self, spread: Any) -> tuple[float, float]:
        """Brightness of the left and the right side: means of a spline over the outer parts."""
        away = np.linspace(_SIDE[0], _SIDE[1], 64) * self.reach
        return float(np.mean(spread(-away))), float(np.mean(spread(away)))

    def levels(self, spread: Any) -> tuple[float, float]:
        """Brightness that a spline approaches far to the left and far to the right."""
        left, right, _ = self._outer_maps()[0] @ spread.c
        return float(left), float(right)

    def beyond(self, values: np.ndarray, variance: np.ndarray) -> tail.Beyond:
        """Light beyond the region, of pixel values and their variances, (n,) both."""
        from scipy.sparse import diags_array

        whole, inner, outer = self._outer_maps()
        spread = self.spline(values)
        step = float((whole[1] - whole[0]) @ spread.c)
        onto = np.stack([whole[2], inner[2] - outer[2]]) * 2.0 / self.reach / step
        share, change = onto @ spread.c
        covariance = self.basis.T @ diags_array(variance) @ self.basis
        back = self.solve(onto.T)
        errors = np.sqrt(np.sum(back * (covariance @ back), axis=0))
        return tail.Beyond(float(share), float(errors[0]), float(change), float(errors[1]))

    def _outer_maps(self) -> list[np.ndarray]:
        """`tail.outer_map` of the outer part of the region and of its two halves."""
        return [
            tail.outer_map(self.knots, *part)
            for part in tail.outer_parts(self.reach, self.outer_start)
        ]

    def levelled(self, values: np.ndarray) -> np.ndarray:
        """Pixel values (n,) without what changes evenly along the edge on either of its sides.

        A light that falls off along the edge would pass for a turn of its line, and for noise.
        """
        left = values - self.spline(values)(self.distance)
        level = values
        for _ in range(_LEVEL_ROUNDS):
            sides = self.gradients(level)
            level = values - sides @ np.linalg.lstsq(self.beside(sides), left, rcond=None)[0]
        return level

    def gradients(self, values: np.ndarray) -> np.ndarray:
        """How brightness that rises along the edge on the left and on the right looks, (n, 2)."""
        spread = self.spline(values)
        low, high = self.sides(spread)
        rise = (spread(self.distance) - low) / (high - low)
        along = (self.pixels[0] - self.line.middle) / (self.line.rows[1] - self.line.rows[0])
        return np.stack([along * (1.0 - rise), along * rise], axis=1)

    def beside(self, columns: np.ndarray) -> np.ndarray:
        """Pixel values (n, k) without what a function of the distance explains of them."""
        return np.asarray(columns - self.basis @ self.solve(self.basis.T @ columns))

    def transfer_map(self, frequency: np.ndarray) -> np.ndarray:
        """What turns B^T values into the transform of the line spread function, (k, m), complex.

        Under a window that is 1 over the inner half and falls to 0 as a cosine; what that leaves
        out of the tails is put back, see `isetcl.validation.transfer.tail`.
        """
        from scipy.interpolate import BSpline

        steps = round(2.0 * self.reach * self.knots_per_pixel) * _FINE
        place = (np.arange(steps) + 0.5) * 2.0 * self.reach / steps - self.reach
        flat = _FLAT_SHARE * self.reach
        weight = tail.window(place, flat, self.reach) / (steps / 2 / self.reach)
        count = len(self.knots) - _BAND - 1
        # The derivative of the spline of each coefficient, as quadratic splines on the same knots.
        lower = BSpline.design_matrix(place, self.knots[1:-1], _BAND - 1)
        turn = np.exp(-2j * np.pi * np.outer(frequency, place)) * weight
        onto = np.asarray((lower.T @ turn.T).T) * self.knots_per_pixel
        slopes = np.zeros((len(frequency), count), dtype=complex)
        slopes[:, 1:] += onto
        slopes[:, :-1] -= onto
        strength = self._outer_maps()[0][2]
        slopes += np.outer(tail.beyond(frequency, flat, self.reach), strength)
        return np.asarray(self.solve(slopes.T).T)


def fit_edge(image: np.ndarray, line: EdgeLine, is_curved: bool) -> EdgeFit:
    """The spline of a turned image, and the line that fits it best.

    The line is moved until the pixels lie nearest to one function of the distance (Gauss-Newton).

    Raises
    ------
    InvalidInputError
        If the edge is too short for its tilt.
    """
    found = _fit(image, line)
    for _ in range(_LINE_ROUNDS):
        step = _line_step(image, found, is_curved)
        a, b, c = np.add(line.coefficients, step)
        line = dataclasses.replace(line, coefficients=(float(a), float(b), float(c)))
        found = _fit(image, line)
        half = (line.rows[1] - line.rows[0]) / 2.0
        if np.max(np.abs(step * [1.0, half, half**2])) < _SETTLED_PX:
            break
    blur = _blur(found, found.spline(image[found.pixels]))
    return dataclasses.replace(found, outer_start=tail.outer_start(found.reach, blur))


def _blur(found: EdgeFit, spread: Any) -> float:
    """Distance from the edge that 95 % of the light reach, the mean of both sides, pixels."""
    low, high = found.sides(spread)
    away = np.linspace(0.0, _SIDE[1] * found.reach, round(_PER_PIXEL * found.reach))
    rise = (spread(away) - spread(-away)) / (high - low)
    return float(away[np.argmax(rise >= _CORE)]) if np.any(rise >= _CORE) else found.reach


def _fit(image: np.ndarray, line: EdgeLine) -> EdgeFit:
    from scipy.interpolate import BSpline

    distance = line.distance(image.shape)
    reach = math.floor(line.half_width)
    inside = np.abs(distance) < reach
    inside[: line.rows[0]] = False
    inside[line.rows[1] :] = False
    pixels = np.nonzero(inside)
    used = distance[pixels]
    for per_pixel in OVERSAMPLING:
        interval = np.floor((used + reach) * per_pixel).astype(int)
        if np.all(np.bincount(interval, minlength=2 * reach * per_pixel) > 0):
            break
    else:
        raise InvalidInputError(_empty_message(line))
    knots = np.arange(-reach * per_pixel - _BAND, reach * per_pixel + _BAND + 1) / per_pixel
    basis = BSpline.design_matrix(used, knots, _BAND)
    start = tail.outer_start(float(reach), 0.0)
    return EdgeFit(
        line, (pixels[0], pixels[1]), used, per_pixel, basis, knots, _factor(basis), start
    )


def _factor(basis: Any) -> np.ndarray:
    """The Cholesky factor of B^T B + p D^T D in bands, (4, m); D are third differences.

    Where the distances repeat, there may be fewer of them than splines: the penalty keeps what they
    leave open smooth, and takes less than 1e-5 of any frequency of the pixels.
    """
    from scipy.linalg import cholesky_banded
    from scipy.sparse import diags_array

    count = basis.shape[1]
    normal = (basis.T @ basis).todia()
    third = diags_array([-1.0, 3.0, -3.0, 1.0], offsets=[0, 1, 2, 3], shape=(count - _BAND, count))
    weight = _PENALTY * float(np.median(normal.diagonal()))
    whole = normal + weight * (third.T @ third).todia()
    bands = np.stack([np.pad(whole.diagonal(i), (i, 0)) for i in range(_BAND, -1, -1)])
    return np.asarray(cholesky_banded(bands))


def _line_step(image: np.ndarray, found: EdgeFit, is_curved: bool) -> np.ndarray:
    """How a, b, c should change, (3,); a moves with the middle of the line spread."""
    line = found.line
    values = image[found.pixels]
    spread = found.spline(values)
    slope = spread.derivative()(found.distance)
    left = values - spread(found.distance)
    u = found.pixels[0] - line.middle
    terms = np.stack([u, u**2] if is_curved else [u], axis=1)
    # The spline takes what the same shift of all pixels at a distance would explain.
    turns = -slope[:, None] * line.cosine * terms
    design = np.concatenate([turns, found.gradients(values)], axis=1)
    step = np.linalg.lstsq(found.beside(design), left, rcond=None)[0]
    # Where a sharp step would leave the same light on the left: the centroid of the line spread.
    low, high = found.sides(spread)
    end = _SIDE[1] * found.reach
    light = float(spread.integrate(-end, end)) - low * 2.0 * end
    shift = (end - light / (high - low)) / line.cosine
    return np.array([shift, step[0], step[1] if is_curved else 0.0])


def _empty_message(line: EdgeLine) -> str:
    length = line.rows[1] - line.rows[0]
    tilt = line.tilt_deg
    reason = "its pixels repeat the same distances"
    remedy = "choose a tilt between 2 and 40 degrees, such as 5"
    if length * math.tan(math.radians(tilt)) < 1.0:
        reason = "it is too vertical (or too horizontal) for its length"
        needed = "any number of" if tilt < 0.05 else f"{1.0 / math.tan(math.radians(tilt)):.0f}"
        remedy = (
            f"it must cross a whole pixel: {needed} rows at this tilt; tilt it by about 5 degrees "
            "or take a longer edge"
        )
        if tilt < 0.05:
            remedy = "tilt it by about 5 degrees"
    return (
        f"the edge must have pixels at all distances in steps of half a pixel, but {reason}: tilt "
        f"{tilt:.3g} degrees over {length} pixels; {remedy}"
    )
